"""Several proposals for every frame: similar annotated figures, and neighbours carried along.

From the annotated figures that look most like a frame, each brought onto its edges; from the best
of these with limbs of other annotated figures (`borrow.py`); and from the annotated frames before
and after it in time, carried step by step at the speed they have and set right by the edges at
each step. The first kinds never drift but may take one leg for the other; the last knows which leg
is which for as long as it holds on.

Limbs of all annotated figures on the trunk that fits a frame best.

Few annotated figures cannot show every combination of arms and legs, but each of their limbs can be
had on its own: turned about the shoulder or hip of the frame, the one that finds the most edges is
a good place to start from. Of limbs that end at the same place only the best is kept.
"""

from dataclasses import dataclass, fields, replace

import numpy as np
from jaxtyping import Complex, Float, Int

from keyrecon.numerics.blocks import in_blocks
from keyrecon.propagation.correspondence import ElementIndex
from keyrecon.propagation.edge_template import EdgeTemplates
from keyrecon.propagation.registration import (
    FAR_TO_NEAR,
    FittedFigures,
    RegistrationStep,
    keep_shape,
    register_templates,
)
from keyrecon.propagation.scoring import find_unexplained_edges, score_limb, score_templates

HOLD = (RegistrationStep(0.05, 0.006, 0.02), RegistrationStep(0.03, 0.006, 0.02))
"""Corrections of a figure that was carried from the neighbouring frame."""
LIKENESS = RegistrationStep(0.0, 0.04, 1.0)
"""How firmly its bones keep the lengths of the most similar annotated figure."""
UNLIKE, UNLIKE_MOST = 0.5, 4.0
"""Doubt per usual distance to the nearest keyframe, which counts up to so many times."""
AGE, AGE_MOST = 0.02, 150.0
"""Doubt per frame that a figure was carried, and the frames that count."""
MOMENTUM = 0.9
"""Share of its last step that a joint is expected to repeat: at 50 frames/s the joints of a tennis
stroke change their step by a tenth of it or so."""


@dataclass(frozen=True, eq=False)
class PoseHypotheses:
    """S proposals for each frame."""

    joints: Complex[np.ndarray, "T S J"]
    misfit: Float[np.ndarray, "T S B"]
    far: Float[np.ndarray, "T S 3 F"]
    """How far each of the frame's elements is from each part of the figure (`judge.py`)."""
    which: Int[np.ndarray, "T S"]
    """Annotated figure that it comes from, or that is most similar."""
    doubt: Float[np.ndarray, "T S"]
    """Cost of taking it before its edges are looked at; infinite where there is none."""


def join_hypotheses(*parts: PoseHypotheses) -> PoseHypotheses:
    """All proposals side by side."""
    names = [field.name for field in fields(PoseHypotheses)]
    return PoseHypotheses(*(np.concatenate([getattr(p, n) for p in parts], axis=1) for n in names))


def fit_similar(
    puppets: EdgeTemplates,
    index: ElementIndex,
    distance: Float[np.ndarray, "T K"],
    shift: Complex[np.ndarray, "T K"],
    most: int,
) -> PoseHypotheses:
    """Fit the `most` similar figures to every frame; `shift` aligns figure and frame at first."""
    ranked = np.argsort(distance, axis=1, kind="stable")[:, :most]
    frames, which = np.repeat(np.arange(len(ranked)), ranked.shape[1]), ranked.ravel()
    start = puppets.poses.joints[which] + shift[frames, which][:, None]
    fitted = fit_hypotheses(puppets, index, FittedFigures(frames, which, start), FAR_TO_NEAR)
    usual = max(float(np.median(distance.min(axis=1))), 1e-9)
    unlike = np.take_along_axis(distance, ranked, axis=1) / usual
    return replace(fitted, doubt=UNLIKE * np.minimum(unlike, UNLIKE_MOST))


def fit_hypotheses(
    puppets: EdgeTemplates,
    index: ElementIndex,
    start: FittedFigures,
    schedule: tuple[RegistrationStep, ...],
) -> PoseHypotheses:
    """Fit figures, the same number for each frame, one frame after the other."""

    def fit(part: slice) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        found = register_templates(puppets, index, start.take(part), schedule)
        misfit = score_templates(puppets, index, found)
        return found.joints, misfit, find_unexplained_edges(puppets, index, found)

    joints, misfit, far = in_blocks(fit, len(start.frames))
    shape = (start.frames[-1] + 1, -1)
    return PoseHypotheses(
        joints.reshape(shape[0], -1, joints.shape[1]),
        misfit.reshape(shape[0], -1, misfit.shape[1]),
        far.reshape(shape[0], -1, *far.shape[1:]),
        start.which.reshape(shape),
        np.zeros((shape[0], len(joints) // shape[0])),
    )


def track_from_keyframes(
    puppets: EdgeTemplates, index: ElementIndex, similar: Int[np.ndarray, "T"]
) -> PoseHypotheses:
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
        figures = FittedFigures(ahead, np.full(len(ahead), puppets.average), there)
        joints[way, ahead] = register_templates(puppets, index, figures, HOLD, alike).joints
        age[way, ahead] = age[way, last] + 1
        last, speed = ahead, joints[way, ahead] - joints[way, last]
    frames = np.repeat(np.arange(count), 2)
    paired = np.swapaxes(joints, 0, 1).reshape(2 * count, -1)
    carried = FittedFigures(frames, np.full(2 * count, puppets.average), paired)
    judged = fit_hypotheses(puppets, index, carried, ())
    doubt = np.where(np.isfinite(age), AGE * np.minimum(age, AGE_MOST), np.inf)
    return replace(judged, which=np.repeat(similar[:, None], 2, axis=1), doubt=doubt.T)


SCHEDULE = (
    RegistrationStep(0.08, 0.02, 0.05, every=2),
    RegistrationStep(0.06, 0.02, 0.08, every=2),
    RegistrationStep(0.05, 0.02, 0.08),
)
"""A borrowed limb starts nearer to its place than a whole figure."""
DIFFERENT = 0.06
"""Joints of limbs that count as different are this far apart, player heights."""
STRANGE = 1.0
"""Doubt in a borrowed limb: without edges that speak for it, the figure keeps its own."""
LIBRARY = 24
"""Limbs tried; of more, those that differ most."""


def propose_limbs(
    puppets: EdgeTemplates, index: ElementIndex, candidates: PoseHypotheses, count: int
) -> PoseHypotheses:
    """`count` proposals per frame: the best trunk, and on both sides the best limbs in order."""
    every = np.arange(len(candidates.which))
    best = candidates.misfit.mean(axis=2).argmin(axis=1)
    trunk, which = candidates.joints[every, best], candidates.which[every, best]
    library = _collect_limbs(puppets)
    joints = np.repeat(trunk[:, None], count, axis=1)
    for side in map(np.array, puppets.half.sides):
        limbs = trunk[:, side[:1], None] + library.T[None]
        limbs = np.moveaxis(limbs, 1, 2)
        misfit = _register_limbs(puppets, index, trunk, limbs, side)
        for rank in range(count):
            found = limbs[every, misfit.argmin(axis=1)]
            joints[:, rank, side] = found
            same = (np.abs(limbs - found[:, None]) < DIFFERENT).all(axis=2)
            misfit[same] += 1
    frames = np.repeat(every, count)
    average = np.full(len(frames), puppets.average)
    start = FittedFigures(frames, average, joints.reshape(len(frames), -1))
    fitted = fit_hypotheses(puppets, index, start, SCHEDULE)
    doubt = candidates.doubt[every, best] + STRANGE
    rows = np.ones((1, count), int)
    return replace(fitted, which=which[:, None] * rows, doubt=doubt[:, None] * rows)


def _collect_limbs(puppets: EdgeTemplates) -> Complex[np.ndarray, "L j"]:
    """Limbs of both sides, from their first joint; the first one, then whichever differs most."""
    poses = puppets.poses.joints
    limbs = np.concatenate(
        [poses[:, side] - poses[:, side[:1]] for side in map(list, puppets.half.sides)]
    )
    chosen = [0]
    apart = np.full(len(limbs), np.inf)
    while len(chosen) < min(LIBRARY, len(limbs)):
        apart = np.minimum(apart, np.abs(limbs - limbs[chosen[-1]]).max(axis=1))
        chosen.append(int(apart.argmax()))
    return limbs[chosen]


def _register_limbs(
    puppets: EdgeTemplates,
    index: ElementIndex,
    trunk: Complex[np.ndarray, "T J"],
    limbs: Complex[np.ndarray, "T L j"],
    side: Int[np.ndarray, "j"],
) -> Float[np.ndarray, "T L"]:
    """Misfit of every limb in every frame."""
    bones = np.flatnonzero(np.isin(puppets.half.bones, side).all(axis=1))
    count = limbs.shape[1]

    def judge(part: slice) -> tuple[np.ndarray]:
        frames = np.arange(part.start, min(part.stop, len(trunk) * count)) // count
        joints = trunk[frames]
        joints[:, side] = limbs.reshape(-1, len(side))[part]
        which = np.full(len(frames), puppets.average)
        return (score_limb(puppets, index, FittedFigures(frames, which, joints), bones),)

    return in_blocks(judge, len(trunk) * count)[0].reshape(len(trunk), count)
