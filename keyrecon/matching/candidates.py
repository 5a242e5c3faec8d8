"""Several proposals for every frame: similar annotated figures, and neighbours carried along.

From the annotated figures that look most like a frame, each brought onto its edges; and from
the annotated frames before and after it in time, carried step by step at their speed and by the
flow, and set right by the edges at each step. The first kind never drifts but may take one leg for
the other; the second knows which leg is which for as long as it holds on.
"""

from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Complex, Float, Int

from keyrecon.matching.correspondence import ElementIndex
from keyrecon.matching.fit import Figures, Step, fit_figures, judge_figures, keep_shape
from keyrecon.matching.limbs import LimbFlow, predict_joints
from keyrecon.matching.puppet import Puppets

BLOCK = 256
"""Figures fitted at a time, to bound memory."""
HOLD = (Step(0.05, 0.006, 0.02), Step(0.03, 0.006, 0.02))
"""Corrections of a figure that was carried from the neighbouring frame."""
LIKENESS = Step(0.0, 0.04, 1.0)
"""How firmly its bones keep the lengths of the most similar annotated figure."""
MOMENTUM = 0.7
"""Share of the last step against the flow in what is expected of the next. Joints of a tennis
stroke at 50 frames/s change their step by a tenth of it or less; the flow loses thin fast arms."""


@dataclass(frozen=True, eq=False)
class Candidates:
    """S proposals for each frame; NaN where there is none."""

    joints: Complex[np.ndarray, "T S J"]
    misfit: Float[np.ndarray, "T S B"]
    which: Int[np.ndarray, "T S"]
    """Most similar puppet."""
    age: Float[np.ndarray, "T S"]
    """Frames since the annotated frame it was carried from; 0 for a fitted figure."""


def join_candidates(*parts: Candidates) -> Candidates:
    """All proposals side by side."""
    names = [field.name for field in fields(Candidates)]
    return Candidates(*(np.concatenate([getattr(p, n) for p in parts], axis=1) for n in names))


def fit_similar(
    puppets: Puppets,
    index: ElementIndex,
    ranked: Int[np.ndarray, "T M"],
    shift: Complex[np.ndarray, "T K"],
) -> Candidates:
    """Fit the ranked puppets to every frame; `shift` aligns puppet and frame to begin with."""
    count, most = ranked.shape
    frames, which = np.repeat(np.arange(count), most), ranked.ravel()
    start = puppets.poses.joints[which] + shift[frames, which][:, None]
    joints, misfit = [], []
    for at in range(0, len(frames), BLOCK):
        part = slice(at, at + BLOCK)
        found = fit_figures(puppets, index, Figures(frames[part], which[part], start[part]))
        joints.append(found.joints)
        misfit.append(judge_figures(puppets, index, found))
    return Candidates(
        np.concatenate(joints).reshape(count, most, -1),
        np.concatenate(misfit).reshape(count, most, -1),
        ranked,
        np.zeros(ranked.shape),
    )


def carry_figures(
    puppets: Puppets,
    index: ElementIndex,
    limbs: LimbFlow,
    similar: Int[np.ndarray, "T"],
    step: int,
) -> Candidates:
    """Carry every annotated figure forwards (step 1) or back (-1) up to the next annotated one."""
    count, poses = len(similar), puppets.poses
    joints = np.full((count, poses.joints.shape[1]), np.nan + 0j)
    misfit = np.ones((count, len(puppets.half.bones)))
    age = np.full(count, np.inf)
    joints[poses.frames], age[poses.frames] = poses.joints, 0
    last, speed = poses.frames, None
    while True:
        ahead = last + step
        going = (ahead >= 0) & (ahead < count)
        going[going] = np.isinf(age[ahead[going]])
        last, ahead = last[going], ahead[going]
        if not len(last):
            return Candidates(joints[:, None], misfit[:, None], similar[:, None], age[:, None])
        there = predict_joints(limbs, puppets, last, joints[last], step > 0)
        if speed is not None:
            there += MOMENTUM * (joints[last] + speed[going] - there)
        figures = Figures(ahead, np.full(len(ahead), puppets.average), there)
        alike = keep_shape(puppets, there, poses.joints[similar[ahead]], LIKENESS)
        figures = fit_figures(puppets, index, figures, HOLD, alike)
        joints[ahead], age[ahead] = figures.joints, age[last] + 1
        misfit[ahead] = judge_figures(puppets, index, figures)
        last, speed = ahead, joints[ahead] - joints[last]
