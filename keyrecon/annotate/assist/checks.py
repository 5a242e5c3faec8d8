"""Marks that look wrong, the most suspicious first: annotated frames checked by one another.

Where the annotated poses most similar to a frame put its joints (see `neighbours`) and what its
joints look like on other frames (`mark_appearance`) is what the other marks say about this one.

crossed  left and right of a limb look exchanged (see `side_checks`)
far      a joint lies where none of the similar poses puts it
unlike   a place beside the mark looks more like the joint than the marked place does
long     a bone shows more of its length than it has, and than other frames show of it: impossible
         under scaled orthography
off      head or feet are not where the program follows the player
missing  joints of a half that was begun

The three residuals of a joint, far, unlike and long, are added; it is told for what is largest. A
bone that is too long is told once, for the end that is the more suspicious otherwise. What is said
about the same joints otherwise is put together as if independent, 1 - (1 - a)(1 - b), and reported
once.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from keyrecon.annotate.assist.mark_appearance import MarkAppearance
from keyrecon.annotate.assist.neighbours import Neighbours
from keyrecon.annotate.assist.side_checks import find_exchanges
from keyrecon.annotate.assist.suspicion import (
    LEAST_EVIDENCE,
    MIN_SUSPICION,
    Check,
    suspicion,
)
from keyrecon.body import Skeleton, plain_name
from keyrecon.lifting.limb_lengths import BodySize, LengthOptions
from keyrecon.propagation.marked_poses import LEAST_MARKED
from keyrecon.records import Annotations, Track
from keyrecon.segmentation.marked_bodies import anchors_from_bodies

EVEN_DISTANCE = 0.115
"""Distance from all similar poses at which a mark is as likely wrong as not, player heights: one
joint in fifty of careful marks lies farther than half of that."""
DISTANCE_PER_USUAL = 4.6
"""How much farther that is, per distance that the pose's other joints have."""
DISTANCE_PER_JOINT = 2.3
"""The same per distance that this joint has in the median of the other frames."""
DISTANCE_PER_LIMB = 2.3
"""The same per distance of the other end of forearm or shank: an arm raised on one mark only has
elbow and wrist elsewhere. On three real clips with 192 planted mistakes 72 % of the warnings are
true, 66 % without; 70 and 69 % are found, and 4 and 5 are about true marks."""
EVEN_UNLIKE = 2.9
"""How much more a place beside a mark looks like the joint when the mark is as likely wrong as not:
times what one mark in ten of this video exceeds (`USUAL_QUANTILE`).

Chosen with all `EVEN_` constants, by one common factor, on nine real clips with 744 planted
mistakes (benchmarks/checks.py): 73 % found, 79 % of the warnings true, 11 warnings about the true
marks of all nine. All four percent smaller 74, 76 % and 14, larger 71, 83 % and 11. Before marks
were compared by looks: 67, 66 % and 13. Single ones changed by a fifth to a third: 70 to 74 % found
and 76 to 82 % true with 13 warnings about true marks. A constant in place of the tenth: 74 and
68 % with 13."""
USUAL_QUANTILE = 0.9
EVEN_OFF = 0.48
"""Distance of head and feet from the track at which they are as likely wrong as not, player
heights."""
EVEN_FRAME_UNLIKE = 1.25
"""The same as `EVEN_UNLIKE` for the mean of all joints of a frame."""
LEAST_UNLIKE = 0.1
"""What one mark in ten exceeds at least: what two eyes make of the same frames."""
LEAST_JOINTS = 5
"""Joints that must be seen for their mean to say anything."""
SURE_TRACK = 0.4
"""Confidence from which a track may doubt a mark."""
EVEN_EXCESS = 6.9
"""Clicks' deviations by which a bone is too long when it is as likely wrong as not."""
LEAST_SEEN = 4
"""Bones of other frames from which something is known of how long a bone is seen."""
MISSING_SUSPICION, BEGUN_SUSPICION = 0.95, 0.5
"""Of joints left out of a half that is marked, and of one that is only begun."""


def find_checks(
    annotations: Annotations,
    size: BodySize,
    neighbours: tuple[Neighbours, ...],
    track: Track | None = None,
    appearance: MarkAppearance | None = None,
    motion: Float[np.ndarray, "K 2"] | None = None,
) -> list[Check]:
    """All marks that look wrong, evidence about the same joints put together.

    `motion` is what it says for exchanged sides (`JointTracks.exchange_evidence`), where there is
    one of these marks.
    """
    residuals = measure_residuals(annotations, size, neighbours, appearance)
    evidence = [
        *find_exchanges(annotations, size, neighbours, appearance, motion),
        *_displaced(annotations, residuals),
        *_other_frame(annotations, track, appearance),
        *_left_out(annotations),
    ]
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


def completed_halves(annotations: Annotations) -> Annotations:
    """Halves of the body of which every joint is marked or said to be absent.

    A frame in the middle of being marked is not compared with others yet.
    """
    skeleton, joints = annotations.skeleton, annotations.joints.copy()
    open_, absent = np.isnan(joints[:, :, 0]), {*annotations.absent}
    for row, joint in np.argwhere(open_):
        open_[row, joint] = (annotations.frames[row], skeleton.names[joint]) not in absent
    for half in (skeleton.is_lower, ~skeleton.is_lower):
        joints[np.ix_(open_[:, half].any(axis=1), half)] = np.nan
    return replace(annotations, joints=joints)


def _about_the_same(one: Check, other: Check) -> bool:
    return one.frame == other.frame and bool(set(one.joints) & set(other.joints))


@dataclass(frozen=True, eq=False)
class MarkResiduals:
    """What speaks against the marks of K frames, in units at which they are as likely wrong as not;
    0 where nothing is known."""

    far: Float[np.ndarray, "K J"]
    distance: Float[np.ndarray, "K J"]
    """From where similar poses have the joint, player heights."""
    unlike: Float[np.ndarray, "K J"]
    long: Float[np.ndarray, "K B"]
    stretch: Float[np.ndarray, "K B"]
    """Length in the picture over the possible one."""


def measure_residuals(
    annotations: Annotations,
    size: BodySize,
    neighbours: tuple[Neighbours, ...],
    appearance: MarkAppearance | None,
) -> MarkResiduals:
    """Of all marks, each predicted from the others."""
    stretch = _stretch_bones(annotations, size)
    excess = np.maximum(np.nan_to_num(measure_excess(stretch, size.lengths)), 0)
    far, distance = np.zeros((2, *annotations.joints.shape[:2]))
    other_end = _other_ends(annotations.skeleton)
    for half in neighbours:
        cells = np.ix_(np.searchsorted(annotations.frames, half.frames), half.members)
        far[cells], distance[cells] = _measure_distance(half, other_end)
    unlike = np.zeros_like(far)
    if appearance is not None:
        unlike = appearance.excess / (EVEN_UNLIKE * _usual_excess(annotations, appearance))
    return MarkResiduals(far, distance, unlike, excess / EVEN_EXCESS, stretch)


def _usual_excess(annotations: Annotations, appearance: MarkAppearance) -> float:
    """What one seen mark in ten exceeds."""
    seen = np.isfinite(annotations.joints[:, :, 0]) & annotations.visible
    excess = appearance.excess[seen]
    return max(float(np.quantile(excess, USUAL_QUANTILE)), LEAST_UNLIKE) if len(excess) else 1.0


def _other_ends(skeleton: Skeleton) -> dict[int, int]:
    """Elbow by wrist and wrist by elbow, knee by ankle and ankle by knee: both ends of the bones
    that are turned by a joint of the same side."""
    paired = skeleton.mirror != np.arange(len(skeleton.names))
    outer = [
        (a, b) for a, b in skeleton.bones.tolist() if paired[[a, b, skeleton.parents[a]]].all()
    ]
    return {one: other for pair in outer for one, other in (pair, pair[::-1])}


def _measure_distance(
    half: Neighbours, other_end: Mapping[int, int]
) -> tuple[Float[np.ndarray, "K J"], Float[np.ndarray, "K J"]]:
    """Of marks from where the nearest of the similar poses has them: in units of what is usual, and
    in player heights."""
    distance = np.diagonal(half.distance, axis1=2, axis2=3).min(axis=1)
    # a pose that is far off as a whole says nothing about one joint: the frame is like no other;
    # neither does one about a joint that is far off in most frames
    usual = np.nanmedian(distance, axis=1, keepdims=True)
    usual_of_joint = np.nanmedian(distance, axis=0, keepdims=True)
    even = EVEN_DISTANCE + DISTANCE_PER_USUAL * usual + DISTANCE_PER_JOINT * usual_of_joint
    # nor does one that has the limb elsewhere: a slip moves one joint, a limb both
    place = {int(joint): column for column, joint in enumerate(half.members)}
    for joint, column in place.items():
        if other_end.get(joint) in place:
            of_limb = distance[:, place[other_end[joint]]]
            even[:, column] += DISTANCE_PER_LIMB * np.nan_to_num(of_limb)
    return np.nan_to_num(distance / even), np.nan_to_num(distance)


def measure_excess(
    stretch: Float[np.ndarray, "*n B"], lengths: Float[np.ndarray, "B"]
) -> Float[np.ndarray, "*n B"]:
    """By how many deviations of clicks bones are too long; negative where they are not.

    `stretch` is the length in the picture over the possible one, `lengths` are in body heights.
    """
    return (stretch - 1) * lengths / (np.sqrt(2) * LengthOptions.click_noise)


def _stretch_bones(annotations: Annotations, size: BodySize) -> Float[np.ndarray, "K B"]:
    """Lengths in the picture over the possible ones, and over what other bones are seen to have."""
    skeleton = annotations.skeleton
    ends = annotations.joints[:, skeleton.bones]
    length = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
    stretch = length / size.scale[annotations.frames][:, None] / size.lengths
    stretch /= np.maximum(1.0, _longest_elsewhere(stretch, skeleton))
    stretch /= np.maximum(1.0, _longest_beside(stretch, skeleton))
    return stretch


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


def _displaced(annotations: Annotations, residuals: MarkResiduals) -> Iterator[Check]:
    """Joints by the sum of their residuals; a long bone counts for one of its ends alone."""
    skeleton = annotations.skeleton
    at_joint = (skeleton.bones[:, :, None] == np.arange(len(skeleton.names))).any(axis=1)
    for row, frame in enumerate(annotations.frames.tolist()):
        own, long = residuals.far[row] + residuals.unlike[row], residuals.long[row].copy()
        while True:
            longest = np.where(at_joint, long[:, None], 0).max(axis=0)
            joint = int((own + longest).argmax())
            doubt = suspicion(float(own[joint] + longest[joint]))
            if doubt < LEAST_EVIDENCE:
                break
            bone = int(np.where(at_joint[:, joint], long, -1).argmax())
            yield _describe(skeleton, frame, joint, bone, doubt, residuals, row, longest[joint])
            own[joint] = 0
            long[at_joint[:, joint]] = 0


def _describe(
    skeleton: Skeleton,
    frame: int,
    joint: int,
    bone: int,
    doubt: float,
    residuals: MarkResiduals,
    row: int,
    longest: float,
) -> Check:
    """The largest residual in a sentence."""
    name = skeleton.names[joint]
    far, unlike = residuals.far[row, joint], residuals.unlike[row, joint]
    if longest > max(far, unlike):
        parent, child = (skeleton.names[j] for j in skeleton.bones[bone])
        text = (
            f"From {plain_name(parent)} to {plain_name(child)} is "
            f"{residuals.stretch[row, bone]:.1f} times as long as it can be; check both ends."
        )
        return Check(frame, name, "long", doubt, text, (child, parent))
    if unlike > far:
        text = f"A place beside it looks more like the {plain_name(name)} of other frames."
        return Check(frame, name, "unlike", doubt, text, (name,))
    text = (
        f"The {plain_name(name)} is {residuals.distance[row, joint]:.0%} of the player's height "
        "from where similar frames have it."
    )
    return Check(frame, name, "far", doubt, text, (name,))


def _other_frame(
    annotations: Annotations, track: Track | None, appearance: MarkAppearance | None
) -> Iterator[Check]:
    """Frames whose marks look like those of another frame: most joints look unlike themselves, or
    head and feet are both elsewhere than the player is followed."""
    off, unlike = np.zeros((2, len(annotations.frames)))
    if track is not None:
        off = _measure_off_track(annotations, track)
    if appearance is not None:
        seen = np.isfinite(annotations.joints[:, :, 0]) & annotations.visible
        count = seen.sum(axis=1)
        known = count >= LEAST_JOINTS
        total = np.where(seen, appearance.excess, 0).sum(axis=1)
        unlike = np.where(known, total / np.maximum(count, 1), 0)
        unlike /= _usual_excess(annotations, appearance)
    names = annotations.skeleton.names
    for row, frame in enumerate(annotations.frames.tolist()):
        text = "Most joints look unlike those of other frames"
        if off[row] / EVEN_OFF > unlike[row] / EVEN_FRAME_UNLIKE:
            text = (
                f"Head and feet are {off[row]:.0%} of the player's height from where the program "
                "follows the player"
            )
        yield Check(
            frame=frame,
            joint="head_top",
            kind="off",
            suspicion=suspicion(float(off[row] / EVEN_OFF + unlike[row] / EVEN_FRAME_UNLIKE)),
            text=text + "; do these marks belong to another frame?",
            joints=names,
        )


def _measure_off_track(annotations: Annotations, track: Track) -> Float[np.ndarray, "K"]:
    """How far both head and feet are from the track, player heights; 0 where it is not sure. One of
    them alone is more often a fault of the track."""
    anchors = anchors_from_bodies(annotations)
    frames, height = anchors.frames, track.height[anchors.frames]
    head = np.linalg.norm(track.head[frames] - anchors.head, axis=1)
    tracked = track.feet[frames]
    straight, crossed = (
        np.linalg.norm(feet - anchors.feet, axis=2).max(axis=1)
        for feet in (tracked, tracked[:, ::-1])
    )
    both = np.minimum(head, np.minimum(straight, crossed)) / height
    known = (track.confidence[frames] > SURE_TRACK) & np.isfinite(both)
    off = np.zeros(len(annotations.frames))
    off[np.searchsorted(annotations.frames, frames[known])] = both[known]
    return off


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
                listed = ", ".join(plain_name(name) for name in names)
                text = f"Not marked: {listed}; place them, or say that they are not seen."
                yield Check(
                    frame,
                    names[0],
                    "missing",
                    MISSING_SUSPICION if done else BEGUN_SUSPICION,
                    text,
                    names,
                )
