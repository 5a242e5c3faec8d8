"""Limbs of all annotated figures on the trunk that fits a frame best.

Few annotated figures cannot show every combination of arms and legs, but each of their limbs can be
had on its own: turned about the shoulder or hip of the frame, the one that finds the most edges is
a good place to start from. Of limbs that end at the same place only the best is kept.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Complex, Float, Int

from keyrecon.matching.blocks import in_blocks
from keyrecon.matching.candidates import Candidates, fit_candidates
from keyrecon.matching.correspondence import ElementIndex
from keyrecon.matching.fit import Figures, Step
from keyrecon.matching.judge import judge_limb
from keyrecon.matching.puppet import Puppets

SCHEDULE = (
    Step(0.08, 0.02, 0.05, every=2),
    Step(0.06, 0.02, 0.08, every=2),
    Step(0.05, 0.02, 0.08),
)
"""A borrowed limb starts nearer to its place than a whole figure."""
DIFFERENT = 0.06
"""Joints of limbs that count as different are this far apart, player heights."""
STRANGE = 1.0
"""Doubt in a borrowed limb: without edges that speak for it, the figure keeps its own."""
LIBRARY = 24
"""Limbs tried; of more, those that differ most."""


def borrow_limbs(
    puppets: Puppets, index: ElementIndex, candidates: Candidates, count: int
) -> Candidates:
    """`count` proposals per frame: the best trunk, and on both sides the best limbs in order."""
    every = np.arange(len(candidates.which))
    best = candidates.misfit.mean(axis=2).argmin(axis=1)
    trunk, which = candidates.joints[every, best], candidates.which[every, best]
    library = _collect_limbs(puppets)
    joints = np.repeat(trunk[:, None], count, axis=1)
    for side in map(np.array, puppets.half.sides):
        limbs = trunk[:, side[:1], None] + library.T[None]
        limbs = np.moveaxis(limbs, 1, 2)
        misfit = _try_limbs(puppets, index, trunk, limbs, side)
        for rank in range(count):
            found = limbs[every, misfit.argmin(axis=1)]
            joints[:, rank, side] = found
            same = (np.abs(limbs - found[:, None]) < DIFFERENT).all(axis=2)
            misfit[same] += 1
    frames = np.repeat(every, count)
    average = np.full(len(frames), puppets.average)
    start = Figures(frames, average, joints.reshape(len(frames), -1))
    fitted = fit_candidates(puppets, index, start, SCHEDULE)
    doubt = candidates.doubt[every, best] + STRANGE
    rows = np.ones((1, count), int)
    return replace(fitted, which=which[:, None] * rows, doubt=doubt[:, None] * rows)


def _collect_limbs(puppets: Puppets) -> Complex[np.ndarray, "L j"]:
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


def _try_limbs(
    puppets: Puppets,
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
        return (judge_limb(puppets, index, Figures(frames, which, joints), bones),)

    return in_blocks(judge, len(trunk) * count)[0].reshape(len(trunk), count)
