"""Joints of frames that nobody annotated yet, from the few that somebody did.

What `matching.propagate` does for a whole video is done for a single frame here: the annotated
figures that look most like it are brought onto its edges, limbs of others are tried, the
combination that leaves the least of the edges unexplained is taken and fitted once more. There is
no path through time to lean on, so it takes a fraction of a second; each annotated frame makes the
next ghost better.
"""

from dataclasses import dataclass, fields, replace

import numpy as np
from jaxtyping import Complex, Float, Int

from keyrecon.assist.figures import (
    OPTIONS,
    Fitting,
    look_at,
    marked_figures,
    prepare_fitting,
    stand_in,
    take_rows,
)
from keyrecon.matching.borrow import borrow_limbs
from keyrecon.matching.candidates import Candidates, fit_similar, join_candidates
from keyrecon.matching.choose import choose_limbs
from keyrecon.matching.fit import Figures, Step, fit_figures
from keyrecon.matching.follow import BORROWED, judge_joints
from keyrecon.matching.halves import split_body
from keyrecon.matching.propagate import distances_to
from keyrecon.matching.puppet import Poses, Puppets
from keyrecon.matching.rows import observe_joints
from keyrecon.matching.settle import FOLLOW, HELD, LOOSE, REACHES, Proposal
from keyrecon.records import Annotations, Survey

SETTLING = tuple(Step(reach, LOOSE.length, LOOSE.swing) for reach in REACHES)
"""Last fit of the chosen figure, as `settle` does it for all frames at once."""
MOST = 10
"""Annotated figures looked at for each half; with more a ghost gets slower and no better."""
_PULL = 1 / FOLLOW**2
"""Weight of the chosen proposal in the last fit."""
_PER_FIGURE = [field for field in fields(Poses) if field.name != "half"]


@dataclass(frozen=True, eq=False)
class Ghost:
    """Foreseen joints of one frame."""

    joints: Float[np.ndarray, "J 2"]
    """px; NaN where that half of the body has no annotated frame yet."""
    confidence: Float[np.ndarray, "J"]
    """0-1"""
    source: Int[np.ndarray, "J"]
    """Annotated frame that each joint comes from, -1 for none."""


def choose_sources(survey: Survey, annotations: Annotations, frame: int) -> Annotations:
    """The other annotated frames that look most like `frame`: all that its ghost depends on."""
    others = take_rows(annotations, annotations.frames != frame)
    near = []
    for half in split_body(annotations.skeleton):
        figures = marked_figures(others, half)
        distance = distances_to(survey.comparison, half.name, figures)[frame]
        near.append(figures[np.argsort(distance, kind="stable")[:MOST]])
    return take_rows(others, np.isin(others.frames, np.concatenate(near)))


def foresee_joints(
    survey: Survey,
    sources: Annotations,
    frame: int,
    held: Float[np.ndarray, "J 2"] | None = None,
) -> Ghost:
    """Joints of `frame` from annotated frames; what is marked there already is `held`, px."""
    skeleton = sources.skeleton
    scene = look_at(survey, sources)
    lower, upper = split_body(skeleton)
    joints = np.full((len(survey.track.head), len(skeleton.names)), np.nan + 0j)
    joints[sources.frames] = scene.from_pixels(sources.joints, sources.frames)
    if held is not None:
        joints[frame] = scene.window.from_pixels(held, frame)
    confidence, source = np.zeros(joints.shape[1]), np.full(joints.shape[1], -1)
    beyond = np.setdiff1d(marked_figures(sources, upper), marked_figures(sources, lower))
    for half, frames in ((lower, np.array([frame, *beyond])), (upper, np.array([frame]))):
        own = half.joints[half.own]
        if len(marked_figures(sources, half)):
            fitting = prepare_fitting(scene, half, joints, frames)
            found, sure, come_from = _foresee_half(fitting, joints[frames][:, half.joints])
            joints[frames[:, None], own] = found
            confidence[own], source[own] = sure[0], come_from[0]
        if half is lower:
            stand_in(scene, joints, upper)
    pixels = scene.window.to_pixels(joints[frame], frame)
    return Ghost(np.where(source[:, None] < 0, np.nan, pixels), confidence, source)


def _foresee_half(
    fitting: Fitting, known: Complex[np.ndarray, "N J"]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(own joints, confidence, source frame) of one half; `known` joints stay."""
    puppets, index = fitting.puppets, fitting.index
    fitted = fit_similar(puppets, index, fitting.distance, fitting.shift, OPTIONS.similar)
    candidates = join_candidates(fitted, borrow_limbs(puppets, index, fitted, BORROWED))
    chosen, which = _choose(puppets, candidates)
    chosen = np.where(np.isfinite(known), known, chosen)
    weight = np.where(np.isfinite(known), HELD, _PULL)
    similar = fitted.which[:, 0]
    start = Figures(np.arange(len(known)), similar, chosen)
    settled = fit_figures(puppets, index, start, SETTLING, observe_joints(chosen, weight)).joints
    confidence = judge_joints(puppets, index, Proposal(chosen, similar), settled)
    own = puppets.half.own
    return settled[:, own], confidence[:, own], fitting.sources[which[:, own]]


def _choose(
    puppets: Puppets, candidates: Candidates
) -> tuple[Complex[np.ndarray, "N J"], Int[np.ndarray, "N J"]]:
    """The best proposals, each frame by itself: (joints, figure that they come from)."""
    nobody = replace(
        puppets.poses, **{f.name: getattr(puppets.poses, f.name)[:0] for f in _PER_FIGURE}
    )
    found = []
    for n in range(len(candidates.which)):
        one = Candidates(*(getattr(candidates, f.name)[n : n + 1] for f in fields(Candidates)))
        feet = puppets.feet and replace(puppets.feet, points=puppets.feet.points[n : n + 1])
        alone = replace(puppets, poses=nobody, listed=puppets.listed[n : n + 1], feet=feet)
        found.append(choose_limbs(alone, one))
    return tuple(np.concatenate(part) for part in zip(*found, strict=True))
