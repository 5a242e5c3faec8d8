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
from keyrecon.matching.fit import FAR_TO_NEAR, Figures, Step, fit_figures, keep_shape
from keyrecon.matching.judge import PARTS, find_unexplained, judge_figures, judge_limb
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
    far: Float[np.ndarray, "T S 3 F"]
    """How far each of the frame's elements is from each part of the figure (`judge.py`)."""
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
    return _fit_all(puppets, index, Figures(frames, which, start), FAR_TO_NEAR, most)


def _fit_all(puppets, index, start, schedule, most):
    """Fit in blocks; `most` figures per frame."""
    joints, misfit, far = [], [], []
    for at in range(0, len(start.frames), BLOCK):
        part = slice(at, at + BLOCK)
        figures = Figures(start.frames[part], start.which[part], start.joints[part])
        found = fit_figures(puppets, index, figures, schedule)
        joints.append(found.joints)
        misfit.append(judge_figures(puppets, index, found))
        far.append(find_unexplained(puppets, index, found))
    ranked = start.which.reshape(-1, most)
    shape = ranked.shape
    return Candidates(
        np.concatenate(joints).reshape(*shape, -1),
        np.concatenate(misfit).reshape(*shape, -1),
        np.concatenate(far).reshape(*shape, *far[0].shape[1:]),
        ranked,
        np.zeros(shape),
    )


REFIT = (Step(0.08, 0.02, 0.05), Step(0.06, 0.02, 0.08), Step(0.05, 0.02, 0.08))
DIFFERENT = 0.06
BORROWED = 3


def borrow_limbs(puppets, index, candidates):
    """Limbs of all annotated figures on the best trunk of each frame: the ones that fit best."""
    half, poses = puppets.half, puppets.poses
    T, S, J = candidates.joints.shape
    best = candidates.misfit.mean(axis=2).argmin(axis=1)
    base = candidates.joints[np.arange(T), best]
    one, other = (np.array(side) for side in half.sides)
    top = half.depth[one].argmin()
    library = np.concatenate([poses.joints[:, s] - poses.joints[:, s[top]][:, None] for s in (one, other)])
    L = len(library)
    starts = np.repeat(base[:, None], BORROWED, axis=1)
    for side in (one, other):
        bones = np.isin(half.bones[:, 1], side) & (half.bones[:, 0] != half.mirror[half.bones[:, 1]])
        bones &= np.isin(half.bones[:, 0], side)
        misfit = np.empty((T, L))
        arms = base[:, side[top]][:, None, None] + library[None]
        for at in range(0, T, 16):
            n = min(16, T - at)
            joints = np.repeat(base[at : at + n], L, axis=0)
            joints[:, side] = arms[at : at + n].reshape(n * L, -1)
            fig = Figures(np.repeat(np.arange(at, at + n), L), np.full(n * L, puppets.average), joints)
            misfit[at : at + n] = judge_limb(puppets, index, fig, np.flatnonzero(bones)).reshape(n, L)
        for r in range(BORROWED):
            pick = misfit.argmin(axis=1)
            arm = arms[np.arange(T), pick]
            starts[:, r, side] = arm
            same = (np.abs(arms - arm[:, None]) < DIFFERENT).all(axis=2)
            misfit[same] = 2.0
    which = np.repeat(candidates.which[np.arange(T), best][:, None], BORROWED, axis=1)
    figures = Figures(np.repeat(np.arange(T), BORROWED), np.full(T * BORROWED, puppets.average), starts.reshape(T * BORROWED, J))
    found = _fit_all(puppets, index, figures, REFIT, BORROWED)
    return Candidates(found.joints, found.misfit, found.far, which, found.age)


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
    far = np.zeros((count, PARTS, puppets.listed.shape[1]), np.float32)
    age = np.full(count, np.inf)
    joints[poses.frames], age[poses.frames] = poses.joints, 0
    last, speed = poses.frames, None
    while True:
        ahead = last + step
        going = (ahead >= 0) & (ahead < count)
        going[going] = np.isinf(age[ahead[going]])
        last, ahead = last[going], ahead[going]
        if not len(last):
            fields_ = (joints, misfit, far, similar, age)
            return Candidates(*(values[:, None] for values in fields_))
        there = predict_joints(limbs, puppets, last, joints[last], step > 0)
        if speed is not None:
            there += MOMENTUM * (joints[last] + speed[going] - there)
        figures = Figures(ahead, np.full(len(ahead), puppets.average), there)
        alike = keep_shape(puppets, there, poses.joints[similar[ahead]], LIKENESS)
        figures = fit_figures(puppets, index, figures, HOLD, alike)
        joints[ahead], age[ahead] = figures.joints, age[last] + 1
        misfit[ahead] = judge_figures(puppets, index, figures)
        far[ahead] = find_unexplained(puppets, index, figures)
        last, speed = ahead, joints[ahead] - joints[last]
