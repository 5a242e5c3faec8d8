"""Marks that look wrong, the most suspicious first: annotated frames checked by one another.

Where the annotated poses most similar to a frame put its joints (see `neighbours`) is what the
other marks say about this frame.

long     a bone shows more of its length than it has, and than other frames show of it: impossible
         under scaled orthography
crossed  left and right of a limb agree better with the other annotated frames when swapped, or
         shoulders and hips face opposite ways
far      a joint lies where none of the similar poses puts it
off      head or feet are not where the program follows the player
missing  joints of a half that was begun

Silhouettes do not show left from right, so frames only say of one another whether they agree. Which
of them is wrong is decided by the majority: the frame whose swap ends most disagreement is taken
to be swapped, and again, until none is left worth it. Evidence on the same joints is put
together as if independent, 1 - (1 - a)(1 - b), and reported once.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Float

from keyrecon.annotate.assist.neighbours import Neighbours
from keyrecon.body import Skeleton
from keyrecon.lifting.limb_lengths import BodySize, LengthOptions
from keyrecon.propagation.marked_poses import LEAST_MARKED
from keyrecon.records import Annotations, Track
from keyrecon.segmentation.marked_bodies import anchors_from_bodies

MAX_JOINT_DISTANCE = 0.15
"""Distance at which a joint counts as elsewhere, player heights: half a thigh."""
EVEN_DISAGREEMENT = 1.5
"""Frames that speak for a swap, less those against it, at which it is as likely as not."""
EVEN_DISTANCE = 0.10
"""Distance from all similar poses at which a mark is as likely wrong as not, player heights: one
joint in fifty of careful marks lies farther than half of that."""
DISTANCE_PER_USUAL = 4.0
"""How much farther that is, per distance that the pose's other joints have."""
DISTANCE_PER_JOINT = 2.0
"""The same per distance that this joint has in the median of the other frames."""
SEEN_BREADTH = 0.08
"""Length in the picture from which shoulders or hips tell which way they face, body heights."""
EVEN_OPPOSITE = 0.75
"""How opposite shoulders and hips are when they are as likely wrong as not, 0-1."""
EVEN_OFF = 0.15
"""Distance of head and feet from the track at which they are as likely wrong as not, player
heights."""
SURE_TRACK = 0.4
"""Confidence from which a track may doubt a mark."""
EVEN_EXCESS = 6.0
"""Clicks' deviations by which a bone is too long when it is as likely wrong as not. With
`EVEN_OPPOSITE` and `EVEN_OFF` chosen on nine real clips (benchmarks/checks.py): at 6, .75 and .15
12 warnings about true marks, 59 % of planted mistakes found, 72 % of the warnings true; at 4.5, .65
and .12 15, 62 and 68 %; at 4, .5 and .1 18, 68 and 66 %."""
POOR_FIT_DISTANCE = 0.06
"""Mean distance of a fitted pose's joints, left and right as they agree better, at which it says
half as much about left and right, player heights."""
LEAST_SEEN = 4
"""Bones of other frames from which something is known of how long a bone is seen."""
MISSING_SUSPICION, BEGUN_SUSPICION = 0.95, 0.5
"""Of joints left out of a half that is marked, and of one that is only begun."""
MIN_SUSPICION = 0.2
"""Suspicion below which nothing is reported."""


@dataclass(frozen=True)
class Check:
    """A mark that may be wrong."""

    frame: int
    joint: str
    kind: Literal["long", "crossed", "far", "off", "missing"]
    suspicion: float
    """0-1"""
    text: str
    joints: tuple[str, ...]
    """All joints that it is about."""


def find_checks(
    annotations: Annotations,
    size: BodySize,
    neighbours: tuple[Neighbours, ...],
    track: Track | None = None,
) -> list[Check]:
    """All marks that look wrong, evidence about the same joints put together."""
    skeleton = annotations.skeleton
    facing = _facing(annotations, size)
    evidence = [
        *_too_long(annotations, size),
        *_left_out(annotations),
        *_opposite(annotations, facing),
    ]
    if track is not None:
        evidence += _off_track(annotations, track)
    for half in neighbours:
        evidence += [*_swapped(half, skeleton, facing), *_elsewhere(half, skeleton)]
    checks: list[Check] = []
    for check in sorted(evidence, key=lambda c: (c.kind != "crossed", -c.suspicion)):
        same = [n for n, c in enumerate(checks) if _about_the_same(c, check)]
        if same:
            first = checks[same[0]]
            both = 1 - (1 - first.suspicion) * (1 - check.suspicion)
            checks[same[0]] = replace(first, suspicion=both)
        else:
            checks.append(check)
    checks = [check for check in checks if check.suspicion >= MIN_SUSPICION]
    return sorted(checks, key=lambda check: (-check.suspicion, check.frame))


def _about_the_same(one: Check, other: Check) -> bool:
    return one.frame == other.frame and bool(set(one.joints) & set(other.joints))


def _suspicion(value: float, even: float) -> float:
    """0 at 0, one half at `even`, 1 far beyond."""
    return value**4 / (value**4 + even**4)


def _label(name: str) -> str:
    return name.replace("_", " ")


def measure_excess(
    stretch: Float[np.ndarray, "*n B"], lengths: Float[np.ndarray, "B"]
) -> Float[np.ndarray, "*n B"]:
    """By how many deviations of clicks bones are too long; negative where they are not.

    `stretch` is the length in the picture over the possible one, `lengths` are in body heights.
    """
    return (stretch - 1) * lengths / (np.sqrt(2) * LengthOptions.click_noise)


def _too_long(annotations: Annotations, size: BodySize) -> Iterator[Check]:
    skeleton = annotations.skeleton
    ends = annotations.joints[:, skeleton.bones]
    length = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
    stretch = length / size.scale[annotations.frames][:, None] / size.lengths
    stretch /= np.maximum(1.0, _longest_elsewhere(stretch, skeleton))
    stretch /= np.maximum(1.0, _longest_beside(stretch, skeleton))
    excess = np.nan_to_num(measure_excess(stretch, size.lengths))
    for row, bone in np.argwhere(excess > 0):
        parent, child = (skeleton.names[j] for j in skeleton.bones[bone])
        yield Check(
            frame=int(annotations.frames[row]),
            joint=child,
            kind="long",
            suspicion=_suspicion(float(excess[row, bone]), EVEN_EXCESS),
            text=f"From {_label(parent)} to {_label(child)} is {stretch[row, bone]:.1f} times as "
            "long as it can be; check both ends.",
            joints=(child, parent),
        )


def _longest_elsewhere(
    stretch: Float[np.ndarray, "K B"], skeleton: Skeleton
) -> Float[np.ndarray, "K B"]:
    """How long other frames have each bone or its twin at most, one of them left out; 0 where
    there are too few.

    A bone that is too long in many frames is longer than the table has it, or nearer the camera:
    that tells of the player, not of a mark. The longest of all others may be a mistake itself.
    """
    bones = skeleton.bones.tolist()
    twin = [bones.index([int(skeleton.mirror[j]) for j in bone]) for bone in bones]
    longest = np.zeros_like(stretch)
    for row in range(len(stretch)):
        others = np.delete(stretch, row, axis=0)
        for bone in range(len(bones)):
            seen = others[:, sorted({bone, twin[bone]})].ravel()
            seen = np.sort(seen[np.isfinite(seen)])
            if len(seen) >= LEAST_SEEN:
                longest[row, bone] = seen[-2]
    return longest


def _longest_beside(
    stretch: Float[np.ndarray, "K B"], skeleton: Skeleton
) -> Float[np.ndarray, "K B"]:
    """How long the frame has the bones at most that share no end with each one: where these are
    too long as well, the player is nearer than was thought."""
    bones = skeleton.bones
    apart = ~(bones[:, None, :, None] == bones[None, :, None, :]).any(axis=(2, 3))
    known = np.where(np.isfinite(stretch), stretch, 0.0)
    return np.where(apart, known[:, None, :], 0.0).max(axis=2)


def _facing(annotations: Annotations, size: BodySize) -> dict[int, float]:
    """Whether shoulders and hips of each frame point the same way from right to left, -1 to 1.

    A trunk twists by less than a right angle. Near 0 where they are seen end on, or not marked.
    """
    names = annotations.skeleton.names
    corners = [f"{side}_{part}" for part in ("shoulder", "hip") for side in ("right", "left")]
    if not {*corners} <= {*names}:
        return {}
    right_shoulder, left_shoulder, right_hip, left_hip = (
        annotations.joints[:, names.index(corner)] for corner in corners
    )
    across = np.stack([left_shoulder - right_shoulder, left_hip - right_hip])
    across /= size.scale[annotations.frames][:, None]
    length = np.linalg.norm(across, axis=2)
    alike = (across[0] * across[1]).sum(axis=1) / np.maximum(length[0] * length[1], 1e-9)
    seen = np.minimum(length.min(axis=0) / SEEN_BREADTH, 1.0)
    return {
        int(frame): float(value)
        for frame, value in zip(annotations.frames, alike * seen, strict=True)
        if np.isfinite(value)
    }


def _opposite(annotations: Annotations, facing: dict[int, float]) -> Iterator[Check]:
    """Frames whose shoulders and hips point opposite ways."""
    names = annotations.skeleton.names
    joints = tuple(n for n in names if n.startswith(("left_", "right_")))
    for frame, value in facing.items():
        if value < 0:
            text = (
                "Shoulders and hips face opposite ways; left and right of arms or legs are swapped."
            )
            yield Check(
                frame, "left_hip", "crossed", _suspicion(-value, EVEN_OPPOSITE), text, joints
            )


def _off_track(annotations: Annotations, track: Track) -> Iterator[Check]:
    """Frames whose head and feet are both elsewhere than the player is followed: the marks of
    another frame. One of them alone is more often a fault of the track."""
    anchors = anchors_from_bodies(annotations)
    frames, height = anchors.frames, track.height[anchors.frames]
    head = np.linalg.norm(track.head[frames] - anchors.head, axis=1)
    tracked = track.feet[frames]
    straight, crossed = (
        np.linalg.norm(feet - anchors.feet, axis=2).max(axis=1)
        for feet in (tracked, tracked[:, ::-1])
    )
    both = np.minimum(head, np.minimum(straight, crossed)) / height
    sure = track.confidence[frames] > SURE_TRACK
    names = annotations.skeleton.names
    for row in np.flatnonzero(sure & np.isfinite(both)):
        yield Check(
            frame=int(frames[row]),
            joint="head_top",
            kind="off",
            suspicion=_suspicion(float(both[row]), EVEN_OFF),
            text=f"Head and feet are {both[row]:.0%} of the player's height from where the program "
            "follows the player; do these marks belong to another frame?",
            joints=names,
        )


def _left_out(annotations: Annotations) -> Iterator[Check]:
    """Halves of the body that were begun and lack joints."""
    skeleton, absent = annotations.skeleton, {*annotations.absent}
    marked = np.isfinite(annotations.joints[:, :, 0])
    for half in (~skeleton.is_lower, skeleton.is_lower):
        for row in np.flatnonzero(marked[:, half].any(axis=1)):
            frame = int(annotations.frames[row])
            open_ = [skeleton.names[j] for j in np.flatnonzero(half & ~marked[row])]
            names = tuple(name for name in open_ if (frame, name) not in absent)
            done = marked[row, half].mean() >= LEAST_MARKED
            if names:
                listed = ", ".join(_label(name) for name in names)
                text = f"Not marked: {listed}; place them, or say that they are not seen."
                yield Check(
                    frame,
                    names[0],
                    "missing",
                    MISSING_SUSPICION if done else BEGUN_SUSPICION,
                    text,
                    names,
                )


def _elsewhere(half: Neighbours, skeleton: Skeleton) -> Iterator[Check]:
    distance = np.diagonal(half.distance, axis1=2, axis2=3).min(axis=1)
    # a pose that is far off as a whole says nothing about one joint: the frame is like no other;
    # neither does one about a joint that is far off in most frames
    usual = np.nanmedian(distance, axis=1)
    usual_of_joint = np.nanmedian(distance, axis=0)
    for row, place in np.argwhere(np.nan_to_num(distance) > 0):
        name, off = skeleton.names[half.members[place]], float(distance[row, place])
        yield Check(
            frame=int(half.frames[row]),
            joint=name,
            kind="far",
            suspicion=_suspicion(
                off,
                EVEN_DISTANCE
                + DISTANCE_PER_USUAL * usual[row]
                + DISTANCE_PER_JOINT * usual_of_joint[place],
            ),
            text=f"The {_label(name)} is {off:.0%} of the player's height from where similar "
            "frames have it.",
            joints=(name,),
        )


def _swapped(half: Neighbours, skeleton: Skeleton, facing: dict[int, float]) -> Iterator[Check]:
    gain = _swap_gain(half, skeleton)
    agreeing = np.array([max(0.0, facing.get(int(frame), 0.0)) for frame in half.frames])
    swapped = np.zeros(len(half.frames), dtype=bool)
    while True:
        evidence = np.where(swapped[:, None] == swapped[half.sources], gain, -gain)
        total = evidence.sum(axis=1)
        np.add.at(total, half.sources, evidence)
        total *= 1 - agreeing
        row = int(np.where(swapped, -np.inf, total).argmax())
        suspicion = _suspicion(max(float(total[row]), 0.0), EVEN_DISAGREEMENT)
        if swapped[row] or suspicion < MIN_SUSPICION:
            return
        swapped[row] = True
        yield _swap_check(half, skeleton, row, suspicion)


def _swap_gain(half: Neighbours, skeleton: Skeleton) -> Float[np.ndarray, "K S"]:
    """How much nearer the joints of a limb are to those of the other side, -1 to 1."""
    paired = np.flatnonzero(skeleton.mirror[half.members] != half.members)
    twin = np.array([list(half.members).index(skeleton.mirror[j]) for j in half.members[paired]])
    straight = np.minimum(half.distance[:, :, paired, paired], MAX_JOINT_DISTANCE)
    crossed = np.minimum(half.distance[:, :, paired, twin], MAX_JOINT_DISTANCE)
    known = np.isfinite(straight) & np.isfinite(crossed)
    count = np.maximum(known.sum(axis=2), 1)
    straight, crossed = (np.where(known, a, 0).sum(axis=2) / count for a in (straight, crossed))
    return (
        (straight - crossed)
        / MAX_JOINT_DISTANCE
        / (1 + (np.minimum(straight, crossed) / POOR_FIT_DISTANCE) ** 2)
    )


def _swap_check(half: Neighbours, skeleton: Skeleton, row: int, suspicion: float) -> Check:
    """Joints that lie nearer to the other side's, in a sentence."""
    paired = [int(j) for j in half.members if skeleton.mirror[j] != j]
    limb = "legs" if skeleton.is_lower[paired].all() else "arms"
    others = np.unique(half.frames[half.sources[row]])[:3]
    named = ", ".join(str(frame) for frame in others)
    names = tuple(skeleton.names[j] for j in paired)
    text = f"Left and right of the {limb} look swapped beside frames {named}."
    return Check(int(half.frames[row]), names[-1], "crossed", suspicion, text, names)
