"""Annotated frames seen through one another.

Every annotated frame is fitted with the annotated figures that look most like it, itself left out:
where they put the joints is what the other marks say about this frame. All frames are fitted at
once, which takes a second or two.

Marks that look wrong, the most suspicious first.

long     a bone shows more of its length than it has: impossible under scaled orthography
crossed  left and right of a limb agree better with the other annotated frames when swapped
far      a joint lies where none of the annotated figures that look alike puts it
missing  joints of a half that was begun

Silhouettes do not tell left from right, so frames only say of one another whether they agree. Which
of them is wrong is settled by the majority: the frame whose swap settles most disagreement is
taken to be swapped, and again, until none is left worth it. Evidence on the same joints is put
together as if independent, 1 - (1 - a)(1 - b), and told once.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Float, Int

from keyrecon.annotate.assist.pose_suggestion import (
    marked_figures,
    prepare_fitting,
    scene_of,
    stand_in,
)
from keyrecon.body import Skeleton
from keyrecon.lifting.limb_lengths import BodySize, LengthOptions
from keyrecon.propagation.half_body import split_body
from keyrecon.propagation.hypotheses import fit_similar
from keyrecon.propagation.propagation import LEAST_MARKED
from keyrecon.records import Annotations, Preparation

MOST = 5
"""Other figures that each frame is fitted with."""


@dataclass(frozen=True, eq=False)
class Neighbours:
    """One half of the body on K annotated frames, as S other annotated frames have it."""

    members: Int[np.ndarray, "J"]
    """Joints of the skeleton that this half has of its own."""
    frames: Int[np.ndarray, "K"]
    sources: Int[np.ndarray, "K S"]
    """Row in `frames` that each figure comes from."""
    away: Float[np.ndarray, "K S J J"]
    """From each mark (first J) to where a figure has each joint (second J), player heights; NaN
    where nothing is marked."""
    misfit: Float[np.ndarray, "K S"]
    """Share of the figure that finds no edges, 0-1; NaN where there is no such figure."""


def find_neighbours(preparation: Preparation, annotations: Annotations) -> tuple[Neighbours, ...]:
    """Both halves of the body, as far as two frames of a half are marked."""
    scene = scene_of(preparation, annotations)
    lower, upper = split_body(annotations.skeleton)
    joints = np.full((len(preparation.track.head), len(annotations.skeleton.names)), np.nan + 0j)
    marks = scene.from_pixels(annotations.joints, annotations.frames)
    joints[annotations.frames] = marks
    found = []
    for half in (lower, upper):
        frames = marked_figures(annotations, half)
        own = half.joints[half.free]
        if len(frames) > 1:
            beyond = np.setdiff1d(marked_figures(annotations, upper), frames)
            asked = np.concatenate([frames, beyond]) if half is lower else frames
            fitting = prepare_fitting(scene, half, joints, asked)
            fitting.distance[np.arange(len(frames)), np.arange(len(frames))] = np.inf
            most = min(MOST, len(frames) - 1)
            fitted = fit_similar(
                fitting.templates, fitting.index, fitting.distance, fitting.shift, most
            )
            places = fitted.joints[:, :, half.free]
            misfit = fitted.residual.mean(axis=2)
            best = misfit.argmin(axis=1)[len(frames) :]
            joints[beyond[:, None], own] = places[np.arange(len(frames), len(asked)), best]
            known = joints[frames][:, own]
            away = np.abs(known[:, None, :, None] - places[: len(frames), :, None])
            found.append(
                Neighbours(own, frames, fitted.template[: len(frames)], away, misfit[: len(frames)])
            )
        if half is lower:
            stand_in(scene, joints, upper)
    return tuple(found)


CAP = 0.15
"""Distance at which a joint counts as elsewhere, player heights: half a thigh."""
EVEN_DISAGREEMENT = 1.5
"""Frames that speak for a swap, less those against it, at which it is as likely as not."""
EVEN_DISTANCE = 0.10
"""Distance from all look-alikes at which a mark is as likely wrong as not, player heights: one
joint in fifty of careful marks lies farther than half of that."""
UNLIKE = 4.0
"""How much farther that is, per distance that the figure's other joints have."""
EVEN_EXCESS = 4.0
"""Clicks' deviations by which a bone is too long when it is as likely wrong as not."""
POOR_FIT = 0.06
"""Mean distance of a figure's joints, left and right as they agree better, at which it says half as
much about left and right, player heights."""
MISSING, BEGUN = 0.95, 0.5
"""Suspicion of joints left out of a half that is marked, and of one that is only begun."""
WORTH_TELLING = 0.2
"""Suspicion below which nothing is said."""


@dataclass(frozen=True)
class Check:
    """Something to look at."""

    frame: int
    joint: str
    kind: Literal["long", "crossed", "far", "missing"]
    suspicion: float
    """0-1"""
    text: str
    joints: tuple[str, ...]
    """All joints that it is about."""


def find_checks(
    annotations: Annotations, size: BodySize, looks: tuple[Neighbours, ...]
) -> list[Check]:
    """All that is worth telling."""
    found = [*_too_long(annotations, size), *_left_out(annotations)]
    for look in looks:
        found += [*_swapped(look, annotations.skeleton), *_elsewhere(look, annotations.skeleton)]
    told: list[Check] = []
    for check in sorted(found, key=lambda c: (c.kind != "crossed", -c.suspicion)):
        same = [n for n, c in enumerate(told) if _about_the_same(c, check)]
        if same:
            first = told[same[0]]
            both = 1 - (1 - first.suspicion) * (1 - check.suspicion)
            told[same[0]] = replace(first, suspicion=both)
        else:
            told.append(check)
    told = [check for check in told if check.suspicion >= WORTH_TELLING]
    return sorted(told, key=lambda check: (-check.suspicion, check.frame))


def _about_the_same(one: Check, other: Check) -> bool:
    return one.frame == other.frame and bool(set(one.joints) & set(other.joints))


def _likely(value: float, even: float) -> float:
    """0 at 0, one half at `even`, 1 far beyond."""
    return value**4 / (value**4 + even**4)


def _spoken(name: str) -> str:
    return name.replace("_", " ")


def measure_excess(
    stretch: Float[np.ndarray, "*n B"], lengths: Float[np.ndarray, "B"]
) -> Float[np.ndarray, "*n B"]:
    """By how many deviations of clicks bones are too long; negative where they are not.

    `stretch` is the shown length over the possible one, `lengths` are in body heights.
    """
    return (stretch - 1) * lengths / (np.sqrt(2) * LengthOptions.click_noise)


def _too_long(annotations: Annotations, size: BodySize) -> Iterator[Check]:
    skeleton = annotations.skeleton
    ends = annotations.joints[:, skeleton.bones]
    shown = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
    stretch = shown / size.scale[annotations.frames][:, None] / size.lengths
    excess = np.nan_to_num(measure_excess(stretch, size.lengths))
    for row, bone in np.argwhere(excess > 0):
        parent, child = (skeleton.names[j] for j in skeleton.bones[bone])
        yield Check(
            frame=int(annotations.frames[row]),
            joint=child,
            kind="long",
            suspicion=_likely(float(excess[row, bone]), EVEN_EXCESS),
            text=f"From {_spoken(parent)} to {_spoken(child)} is {stretch[row, bone]:.1f} times as "
            "long as it can be; check both ends.",
            joints=(child, parent),
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
                listed = ", ".join(_spoken(name) for name in names)
                text = f"Not marked: {listed}; place them, or say that they are not seen."
                yield Check(frame, names[0], "missing", MISSING if done else BEGUN, text, names)


def _elsewhere(look: Neighbours, skeleton: Skeleton) -> Iterator[Check]:
    away = np.diagonal(look.away, axis1=2, axis2=3).min(axis=1)
    # a figure that is far off as a whole tells nothing about one joint: the frame is like no other
    usual = np.nanmedian(away, axis=1)
    for row, place in np.argwhere(np.nan_to_num(away) > 0):
        name, off = skeleton.names[look.members[place]], float(away[row, place])
        yield Check(
            frame=int(look.frames[row]),
            joint=name,
            kind="far",
            suspicion=_likely(off, EVEN_DISTANCE + UNLIKE * usual[row]),
            text=f"The {_spoken(name)} is {off:.0%} of the player's height from where similar "
            "frames have it.",
            joints=(name,),
        )


def _swapped(look: Neighbours, skeleton: Skeleton) -> Iterator[Check]:
    gain = _swap_gain(look, skeleton)
    swapped = np.zeros(len(look.frames), dtype=bool)
    while True:
        evidence = np.where(swapped[:, None] == swapped[look.sources], gain, -gain)
        total = evidence.sum(axis=1)
        np.add.at(total, look.sources, evidence)
        row = int(np.where(swapped, -np.inf, total).argmax())
        suspicion = _likely(max(float(total[row]), 0.0), EVEN_DISAGREEMENT)
        if swapped[row] or suspicion < WORTH_TELLING:
            return
        swapped[row] = True
        yield _tell_swap(look, skeleton, row, suspicion)


def _swap_gain(look: Neighbours, skeleton: Skeleton) -> Float[np.ndarray, "K S"]:
    """How much nearer the joints of a limb are to those of the other side, -1 to 1."""
    paired = np.flatnonzero(skeleton.mirror[look.members] != look.members)
    twin = np.array([list(look.members).index(skeleton.mirror[j]) for j in look.members[paired]])
    straight = np.minimum(look.away[:, :, paired, paired], CAP)
    crossed = np.minimum(look.away[:, :, paired, twin], CAP)
    known = np.isfinite(straight) & np.isfinite(crossed)
    count = np.maximum(known.sum(axis=2), 1)
    straight, crossed = (np.where(known, a, 0).sum(axis=2) / count for a in (straight, crossed))
    return (straight - crossed) / CAP / (1 + (np.minimum(straight, crossed) / POOR_FIT) ** 2)


def _tell_swap(look: Neighbours, skeleton: Skeleton, row: int, suspicion: float) -> Check:
    """Joints that lie nearer to the other side's, in a sentence."""
    paired = [int(j) for j in look.members if skeleton.mirror[j] != j]
    limb = "legs" if skeleton.is_lower[paired].all() else "arms"
    others = np.unique(look.frames[look.sources[row]])[:3]
    named = ", ".join(str(frame) for frame in others)
    names = tuple(skeleton.names[j] for j in paired)
    text = f"Left and right of the {limb} look swapped beside frames {named}."
    return Check(int(look.frames[row]), names[-1], "crossed", suspicion, text, names)
