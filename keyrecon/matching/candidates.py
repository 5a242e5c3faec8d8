"""Several proposals for every frame: similar annotated figures, and neighbours carried along.

From the annotated figures that look most like a frame, each brought onto its edges; from the best
of these with limbs of other annotated figures (`borrow.py`); and from the annotated frames before
and after it in time, carried step by step at the speed they have and set right by the edges at
each step. The first kinds never drift but may take one leg for the other; the last knows which leg
is which for as long as it holds on.
"""

from dataclasses import dataclass, fields, replace

import numpy as np
from jaxtyping import Complex, Float, Int

from keyrecon.matching.blocks import in_blocks
from keyrecon.matching.correspondence import ElementIndex
from keyrecon.matching.fit import FAR_TO_NEAR, Figures, Step, fit_figures, keep_shape
from keyrecon.matching.judge import find_unexplained, judge_figures
from keyrecon.matching.puppet import Puppets

HOLD = (Step(0.05, 0.006, 0.02), Step(0.03, 0.006, 0.02))
"""Corrections of a figure that was carried from the neighbouring frame."""
LIKENESS = Step(0.0, 0.04, 1.0)
"""How firmly its bones keep the lengths of the most similar annotated figure."""
UNLIKE, UNLIKE_MOST = 0.5, 4.0
"""Doubt per usual distance to the nearest keyframe, which counts up to so many times."""
AGE, AGE_MOST = 0.02, 150.0
"""Doubt per frame that a figure was carried, and the frames that count."""
MOMENTUM = 0.9
"""Share of its last step that a joint is expected to repeat: at 50 frames/s the joints of a tennis
stroke change their step by a tenth of it or so."""


@dataclass(frozen=True, eq=False)
class Candidates:
    """S proposals for each frame."""

    joints: Complex[np.ndarray, "T S J"]
    misfit: Float[np.ndarray, "T S B"]
    far: Float[np.ndarray, "T S 3 F"]
    """How far each of the frame's elements is from each part of the figure (`judge.py`)."""
    which: Int[np.ndarray, "T S"]
    """Annotated figure that it comes from, or that is most similar."""
    doubt: Float[np.ndarray, "T S"]
    """Cost of taking it before its edges are looked at; infinite where there is none."""


def join_candidates(*parts: Candidates) -> Candidates:
    """All proposals side by side."""
    names = [field.name for field in fields(Candidates)]
    return Candidates(*(np.concatenate([getattr(p, n) for p in parts], axis=1) for n in names))


def fit_similar(
    puppets: Puppets,
    index: ElementIndex,
    distance: Float[np.ndarray, "T K"],
    shift: Complex[np.ndarray, "T K"],
    most: int,
) -> Candidates:
    """Fit the `most` similar figures to every frame; `shift` aligns figure and frame at first."""
    ranked = np.argsort(distance, axis=1, kind="stable")[:, :most]
    frames, which = np.repeat(np.arange(len(ranked)), ranked.shape[1]), ranked.ravel()
    start = puppets.poses.joints[which] + shift[frames, which][:, None]
    fitted = fit_candidates(puppets, index, Figures(frames, which, start), FAR_TO_NEAR)
    usual = max(float(np.median(distance.min(axis=1))), 1e-9)
    unlike = np.take_along_axis(distance, ranked, axis=1) / usual
    return replace(fitted, doubt=UNLIKE * np.minimum(unlike, UNLIKE_MOST))


def fit_candidates(
    puppets: Puppets, index: ElementIndex, start: Figures, schedule: tuple[Step, ...]
) -> Candidates:
    """Fit figures, the same number for each frame, one frame after the other."""

    def fit(part: slice) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        found = fit_figures(puppets, index, start.take(part), schedule)
        misfit = judge_figures(puppets, index, found)
        return found.joints, misfit, find_unexplained(puppets, index, found)

    joints, misfit, far = in_blocks(fit, len(start.frames))
    shape = (start.frames[-1] + 1, -1)
    return Candidates(
        joints.reshape(shape[0], -1, joints.shape[1]),
        misfit.reshape(shape[0], -1, misfit.shape[1]),
        far.reshape(shape[0], -1, *far.shape[1:]),
        start.which.reshape(shape),
        np.zeros((shape[0], len(joints) // shape[0])),
    )


def carry_figures(
    puppets: Puppets, index: ElementIndex, similar: Int[np.ndarray, "T"]
) -> Candidates:
    """Carry every annotated figure forwards and back up to the next annotated one.

    Two proposals per frame: from the annotated frame before it, and from the one after it.
    """
    poses, count = puppets.poses, len(similar)
    joints = np.zeros((2, count, poses.joints.shape[1]), complex)
    age = np.full((2, count), np.inf)
    joints[:, poses.frames], age[:, poses.frames] = poses.joints, 0
    way, last = np.repeat([0, 1], len(poses.frames)), np.tile(poses.frames, 2)
    speed = np.zeros((len(last), joints.shape[2]), complex)
    while len(last):
        ahead = last + np.where(way == 0, 1, -1)
        going = (ahead >= 0) & (ahead < count)
        going[going] = np.isinf(age[way[going], ahead[going]])
        way, last, ahead, speed = way[going], last[going], ahead[going], speed[going]
        there = joints[way, last] + MOMENTUM * speed
        alike = keep_shape(puppets, there, poses.joints[similar[ahead]], LIKENESS)
        figures = Figures(ahead, np.full(len(ahead), puppets.average), there)
        joints[way, ahead] = fit_figures(puppets, index, figures, HOLD, alike).joints
        age[way, ahead] = age[way, last] + 1
        last, speed = ahead, joints[way, ahead] - joints[way, last]
    frames = np.repeat(np.arange(count), 2)
    paired = np.swapaxes(joints, 0, 1).reshape(2 * count, -1)
    carried = Figures(frames, np.full(2 * count, puppets.average), paired)
    judged = fit_candidates(puppets, index, carried, ())
    doubt = np.where(np.isfinite(age), AGE * np.minimum(age, AGE_MOST), np.inf)
    return replace(judged, which=np.repeat(similar[:, None], 2, axis=1), doubt=doubt.T)
