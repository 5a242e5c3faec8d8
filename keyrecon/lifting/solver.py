"""Levenberg-Marquardt on unit bone directions, banded in time.

Unknowns of frame t: the root (2, in units of length) and a small turn of every bone in the
plane tangent to its direction (2 each), so bone lengths are exact by construction. Terms depend
on one frame each and add a block to the diagonal; smoothness ties a bone to itself in the next
two frames. The normal matrix is banded, one banded Cholesky solves it, and the cost grows
linearly with the length of the motion.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from keyrecon.body import Skeleton
from keyrecon.numerics.banded_least_squares import (
    STENCIL,
    add_second_differences,
    apply_bands,
    band_from_blocks,
    second_difference_bands,
    solve_banded,
)
from keyrecon.numerics.bone_directions import pose_from_directions
from keyrecon.numerics.geometry import tangents, unit_vectors
from keyrecon.numerics.levenberg_marquardt import Damping, minimise


@dataclass(frozen=True, eq=False)
class MotionState:
    """A motion: root in the image and bone directions in space."""

    root: Float[np.ndarray, "T 2"]
    """Units of length: px over scale."""
    directions: Float[np.ndarray, "T B 3"]

    def points(
        self, lengths: Float[np.ndarray, "B"], skeleton: Skeleton
    ) -> Float[np.ndarray, "T J 3"]:
        """Joints where they appear in the image; the root has depth 0."""
        points = pose_from_directions(self.directions, lengths, skeleton)
        points[..., :2] += self.root[:, None]
        return points


@dataclass(frozen=True, eq=False)
class LinearizedTerm:
    """Weighted residuals of a term and their slopes."""

    residual: Float[np.ndarray, "T m"]
    by_direction: Float[np.ndarray, "T m B 3"]
    by_root: Float[np.ndarray, "T m 2"] | None = None
    cost: float | None = None
    """Value of the term where it is not half the sum of squared residuals (robust terms)."""


Term = Callable[[MotionState], LinearizedTerm]


@dataclass(frozen=True, eq=False)
class Smoothness:
    """Penalty on second differences in time that leave the expected ones; S is T - 2."""

    root: float
    bones: Float[np.ndarray, "S B 3"]
    """Weights of each bone's direction."""
    expected: Float[np.ndarray, "S B 3"]
    """Second differences of bone directions that cost nothing."""

    @classmethod
    def even(cls, frames: int, root: float, bones: Float[np.ndarray, "B"]) -> "Smoothness":
        """The same at all times, and nothing but constant velocity is free."""
        weights = np.broadcast_to(bones[:, None], (max(frames - 2, 0), len(bones), 3))
        return cls(root, weights, np.zeros_like(weights))


@dataclass(frozen=True, eq=False)
class Evaluation:
    """All terms at a motion, and their sum with the smoothness."""

    linearized: Sequence[LinearizedTerm]
    cost: float


DAMPING = Damping(start=1e-3, increase=10.0, decrease=5.0, largest=1e3)
"""Marquardt's factor 10 (1963) for a step taken back; the others chosen on rendered sequences, see
benchmarks/sensitivity.py."""


def solve(
    start: MotionState, terms: Sequence[Term], smoothness: Smoothness, rounds: int, tolerance: float
) -> MotionState:
    """Lower the sum of all terms until a step gains less than the share `tolerance`."""

    def evaluate(state: MotionState) -> Evaluation:
        linearized = [term(state) for term in terms]
        return Evaluation(linearized, _cost(state, linearized, smoothness))

    def step(state: MotionState, here: Evaluation, damping: float) -> MotionState:
        return _move(state, _step(state, here.linearized, smoothness, damping))

    def accepts(before: float, after: float) -> bool:
        return after < before

    def converged(before: float, after: float) -> bool:
        return (before - after) / max(before, 1e-12) < tolerance

    return minimise(start, evaluate, step, accepts, converged, DAMPING, rounds)


def _move(state: MotionState, step: Float[np.ndarray, "T D"]) -> MotionState:
    turn = step[:, 2:].reshape(len(step), -1, 2)
    moved = state.directions + np.einsum("tbik,tbk->tbi", tangents(state.directions), turn)
    return MotionState(state.root + step[:, :2], unit_vectors(moved))


def _cost(
    state: MotionState, linearized: Sequence[LinearizedTerm], smoothness: Smoothness
) -> float:
    total = sum(
        0.5 * float((term.residual**2).sum()) if term.cost is None else term.cost
        for term in linearized
    )
    bend = np.diff(state.directions, 2, axis=0) - smoothness.expected
    leap = np.diff(state.root, 2, axis=0)
    return total + 0.5 * float(
        (smoothness.bones * bend**2).sum() + smoothness.root * (leap**2).sum()
    )


def _step(
    state: MotionState, linearized: Sequence[LinearizedTerm], smoothness: Smoothness, damping: float
) -> Float[np.ndarray, "T D"]:
    basis = tangents(state.directions)
    hessian, gradient = _gather(linearized, basis)
    frames, size = gradient.shape
    bands = second_difference_bands(frames)
    gradient[:, :2] += smoothness.root * apply_bands(bands, state.root)
    stiffness = np.zeros((3, *state.directions.shape))
    add_second_differences(list(stiffness), smoothness.bones)
    expected = np.zeros_like(state.directions)
    for place, factor in enumerate(STENCIL):
        part = expected[place : place + len(smoothness.bones)]
        part += factor * smoothness.bones * smoothness.expected
    pull = apply_bands(stiffness, state.directions) - expected
    gradient[:, 2:] += (basis * pull[..., None]).sum(axis=2).reshape(frames, -1)
    diagonal = np.arange(size)
    hessian[:, diagonal, diagonal] *= 1 + damping
    hessian[:, diagonal, diagonal] += 1e-9
    hessian[:, diagonal[:2], diagonal[:2]] += smoothness.root * bands[0][:, None]
    banded = _banded(hessian, basis, smoothness.root * bands, stiffness)
    return -solve_banded(banded, gradient.ravel()).reshape(frames, size)


def _gather(
    linearized: Sequence[LinearizedTerm], basis: Float[np.ndarray, "T B 3 2"]
) -> tuple[Float[np.ndarray, "T D D"], Float[np.ndarray, "T D"]]:
    """Sum of J'J and J'r of all terms in tangent coordinates."""
    frames, bones = basis.shape[:2]
    hessian = np.zeros((frames, 2 + 2 * bones, 2 + 2 * bones))
    gradient = np.zeros((frames, 2 + 2 * bones))
    for term in linearized:
        count = term.residual.shape[1]
        slope = np.zeros((frames, count, 2 + 2 * bones))
        turned = np.matmul(term.by_direction.swapaxes(1, 2), basis)  # (T, B, m, 2)
        slope[..., 2:] = turned.swapaxes(1, 2).reshape(frames, count, -1)
        if term.by_root is not None:
            slope[..., :2] = term.by_root
        across = slope.swapaxes(1, 2)
        hessian += across @ slope
        gradient += (across @ term.residual[..., None])[..., 0]
    return hessian, gradient


def _banded(
    hessian: Float[np.ndarray, "T D D"],
    basis: Float[np.ndarray, "T B 3 2"],
    root: Float[np.ndarray, "3 T"],
    bones: Float[np.ndarray, "3 T B 3"],
) -> Float[np.ndarray, "w n"]:
    """The normal matrix in scipy's lower banded form; unknowns ordered frame by frame.

    `root` and `bones`: diagonals of the smoothness.
    """
    frames, size, _ = hessian.shape
    # a bone is coupled with itself alone: nothing lies farther off than two frames and one
    banded = band_from_blocks([hessian.swapaxes(1, 2)], 2 * size + 2).reshape(-1, frames, size)
    for offset in (0, 1, 2):
        until = frames - offset
        if offset:
            banded[offset * size, :until, :2] += root[offset, :until, None]
        weighted = bones[offset, :until, ..., None] * basis[:until]
        for here in range(2):
            for there in range(2):
                row = offset * size + there - here
                if row >= 0:
                    product = (weighted[..., here] * basis[offset:, ..., there]).sum(axis=-1)
                    banded[row, :until, 2 + here :: 2] += product
    return banded.reshape(2 * size + 2, frames * size)
