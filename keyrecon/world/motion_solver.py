"""Levenberg-Marquardt on a motion in the world, banded in time.

Unknowns of frame t: the place of the skeleton's root (3, metres) and a small turn of every bone in
the plane tangent to its direction (2 each), so bones keep their lengths; a few more for all frames
are logarithms of the body's size and of bones' lengths beside it, left and right alike. Directions
are kept in axes about the line of sight to the player, where the third one is the depth that a
picture hardly tells. Terms are sums of squares of functions of the joints in up to three frames in
a row; the normal matrix is banded but for the columns of the sizes, which are eliminated (Schur
complement).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from keyrecon.body import Skeleton
from keyrecon.numerics.banded_least_squares import (
    add_second_differences,
    apply_bands,
    band_from_blocks,
    solve_banded,
)
from keyrecon.numerics.geometry import tangents, unit_vectors
from keyrecon.numerics.levenberg_marquardt import Damping, minimise

DAMPING = Damping(start=1e-3, increase=10.0, decrease=5.0, largest=1e3)
"""As in the lifting."""
TOLERANCE = 1e-3
"""Relative gain below which the solver stops."""


@dataclass(frozen=True, eq=False)
class Figure:
    """What does not change: the body's shape and the axes of its directions."""

    skeleton: Skeleton
    reach: Float[np.ndarray, "J B"]
    """Length of each bone on the way from the root to each joint, metres at size 1; else 0."""
    axes: Float[np.ndarray, "T 3 3"]
    """Columns: the axes of directions in the world; the third is the line of sight."""

    @property
    def growth(self) -> Float[np.ndarray, "B P"]:
        """What the logarithm of each bone's length gains by each of `WorldState.log_sizes`."""
        group = self.skeleton.length_group
        return np.column_stack([np.ones(len(group)), np.eye(group.max() + 1)[group]])

    def grown(self, log_sizes: Float[np.ndarray, "P"]) -> "Figure":
        """The figure of a body of these sizes."""
        return replace(self, reach=self.reach * np.exp(self.growth @ log_sizes))


@dataclass(frozen=True, eq=False)
class WorldState:
    """A motion in the world."""

    root: Float[np.ndarray, "T 3"]
    """Place of the skeleton's root, metres."""
    directions: Float[np.ndarray, "T B 3"]
    """Unit vectors of bones in the figure's axes."""
    log_sizes: Float[np.ndarray, "P"]
    """Of the body, and of each length beside it (`Skeleton.length_group`)."""

    @property
    def log_size(self) -> float:
        """Of the body."""
        return float(self.log_sizes[0])

    def reach(self, figure: Figure) -> Float[np.ndarray, "J B"]:
        """Lengths of the bones on the way to each joint, metres."""
        return figure.grown(self.log_sizes).reach

    def points(self, figure: Figure) -> Float[np.ndarray, "T J 3"]:
        """Joints in the world, metres."""
        pose = np.einsum("jb,tbk->tjk", self.reach(figure), self.directions)
        return self.root[:, None] + np.einsum("tik,tjk->tji", figure.axes, pose)


@dataclass(frozen=True, eq=False)
class JointRows:
    """Weighted residuals of every frame and their slopes by the joints there and nearby."""

    residual: Float[np.ndarray, "T m"]
    slope: Mapping[int, Float[np.ndarray, "T m J 3"]]
    """By how many frames later; frames beyond the ends have slopes of 0."""
    by_size: Float[np.ndarray, "T m"] | None = None
    """Slope by the logarithm of the size itself, beside that of the joints."""


Term = Callable[[Float[np.ndarray, "T J 3"], float], JointRows]
"""Joints and the logarithm of the size to residuals."""


@dataclass(frozen=True, eq=False)
class DirectionPrior:
    """Directions as they were before, but for errors that change slowly.

    Cost: half of spread^-2 (c^2 + memory^4 (D^2 c)^2) for each bone, axis and frame, c the
    correction and D^2 its second difference.
    """

    before: Float[np.ndarray, "T B 3"]
    weight: Float[np.ndarray, "B 3"]
    """spread^-2"""
    memory: float
    """Frames."""


@dataclass(frozen=True, eq=False)
class _Evaluation:
    rows: Sequence[JointRows]
    cost: float


def solve(
    start: WorldState,
    figure: Figure,
    terms: Sequence[Term],
    prior: DirectionPrior,
    size_spread: Float[np.ndarray, "P"],
    rounds: int,
) -> WorldState:
    """Lower the sum of all terms; `size_spread`: standard deviations of `log_sizes`."""

    def evaluate(state: WorldState) -> _Evaluation:
        points = state.points(figure)
        rows = [term(points, state.log_size) for term in terms]
        cost = sum(0.5 * float((r.residual**2).sum()) for r in rows)
        cost += 0.5 * float(((state.log_sizes / size_spread) ** 2).sum())
        cost += _prior_cost(state, prior)
        return _Evaluation(rows, cost)

    def step(state: WorldState, here: _Evaluation, damping: float) -> WorldState:
        return _moved(state, *_step(state, figure, here.rows, prior, size_spread, damping))

    return minimise(
        start,
        evaluate,
        step,
        lambda before, after: after < before,
        lambda before, after: (before - after) / max(before, 1e-12) < TOLERANCE,
        DAMPING,
        rounds,
    )


def _prior_cost(state: WorldState, prior: DirectionPrior) -> float:
    off = state.directions - prior.before
    bend = np.diff(off, 2, axis=0)
    stiff = prior.memory**4
    return 0.5 * float((prior.weight * off**2).sum() + stiff * (prior.weight * bend**2).sum())


def _moved(
    state: WorldState, step: Float[np.ndarray, "T D"], growth: Float[np.ndarray, "P"]
) -> WorldState:
    turn = step[:, 3:].reshape(len(step), -1, 2)
    moved = state.directions + np.einsum("tbik,tbk->tbi", tangents(state.directions), turn)
    return replace(
        state,
        root=state.root + step[:, :3],
        directions=unit_vectors(moved),
        log_sizes=state.log_sizes + growth,
    )


def _joint_slopes(
    state: WorldState, figure: Figure, basis: Float[np.ndarray, "T B 3 2"]
) -> Float[np.ndarray, "T n D"]:
    """How the joints' coordinates, J x 3 in a row, change with the unknowns of their frame."""
    frames, bones = basis.shape[:2]
    joints = len(figure.reach)
    turned = np.einsum("tik,tbkd->tbid", figure.axes, basis)
    slope = np.zeros((frames, joints, 3, 3 + 2 * bones))
    slope[..., :3] = np.eye(3)
    by_bone = state.reach(figure)[:, :, None, None] * turned[:, None]  # (T, J, B, 3, 2)
    slope[..., 3:] = by_bone.swapaxes(2, 3).reshape(frames, joints, 3, 2 * bones)
    return slope.reshape(frames, joints * 3, -1)


def _size_slopes(state: WorldState, figure: Figure) -> Float[np.ndarray, "T n P"]:
    """How the joints' coordinates, J x 3 in a row, change with the sizes."""
    turned = np.einsum("tik,tbk->tbi", figure.axes, state.directions)
    slope = np.einsum("jb,bp,tbi->tjip", state.reach(figure), figure.growth, turned, optimize=True)
    return slope.reshape(len(slope), -1, slope.shape[-1])


def _step(
    state: WorldState,
    figure: Figure,
    rows: Sequence[JointRows],
    prior: DirectionPrior,
    size_spread: Float[np.ndarray, "P"],
    damping: float,
) -> tuple[Float[np.ndarray, "T D"], Float[np.ndarray, "P"]]:
    basis, grown = tangents(state.directions), _size_slopes(state, figure)
    by_unknowns = _joint_slopes(state, figure, basis)
    frames, _, size = by_unknowns.shape
    blocks = [np.zeros((frames, size, size)) for _ in range(3)]
    gradient, border = np.zeros((frames, size)), np.zeros((frames, size, len(size_spread)))
    corner = np.diag(1 / size_spread**2)
    slant = state.log_sizes / size_spread**2
    for part in rows:
        slopes = {}
        by_size = np.zeros((*part.residual.shape, len(size_spread)))
        if part.by_size is not None:
            by_size[..., 0] = part.by_size
        for later, by_joint in part.slope.items():
            flat = by_joint.reshape(*by_joint.shape[:2], -1)
            there = np.clip(np.arange(frames) + later, 0, frames - 1)
            slopes[later] = flat @ by_unknowns[there]
            by_size += flat @ grown[there]
        corner += np.einsum("tmp,tmq->pq", by_size, by_size, optimize=True)
        slant += np.einsum("tmp,tm->p", by_size, part.residual)
        for one, first in slopes.items():
            across = first.swapaxes(1, 2)
            _add_shifted(gradient, (across @ part.residual[..., None])[..., 0], one)
            _add_shifted(border, across @ by_size, one)
            for other, second in slopes.items():
                if other >= one:
                    _add_shifted(blocks[other - one], across @ second, one)
    _add_prior(blocks, gradient, state, prior, basis)
    blocks[0] += np.eye(size) * (damping * blocks[0] + 1e-9)
    edge = border.reshape(frames * size, -1)
    right = np.column_stack([gradient.ravel(), edge])
    solved = solve_banded(band_from_blocks(blocks, 3 * size), right)
    rest = corner + damping * np.diag(np.diag(corner)) - edge.T @ solved[:, 1:]
    growth = -np.linalg.solve(rest, slant - edge.T @ solved[:, 0])
    return -(solved[:, 0] + solved[:, 1:] @ growth).reshape(frames, size), growth


def _add_shifted(into: np.ndarray, values: np.ndarray, later: int) -> None:
    """Add the values of frame t to frame t + `later`; beyond the ends there are none."""
    count = len(into)
    if later >= 0:
        into[later:] += values[: count - later]
    else:
        into[:later] += values[-later:]


def _add_prior(
    blocks: Sequence[Float[np.ndarray, "T D D"]],
    gradient: Float[np.ndarray, "T D"],
    state: WorldState,
    prior: DirectionPrior,
    basis: Float[np.ndarray, "T B 3 2"],
) -> None:
    """The prior's part of the normal equations, in place."""
    frames, bones = basis.shape[:2]
    stiffness = np.zeros((3, frames, bones, 3))
    add_second_differences(list(stiffness), prior.memory**4 * prior.weight)
    stiffness[0] += prior.weight
    pull = apply_bands(stiffness, state.directions - prior.before)
    gradient[:, 3:] += (basis * pull[..., None]).sum(axis=2).reshape(frames, -1)
    place = 3 + 2 * np.arange(bones)
    for later in range(3):
        until = frames - later
        if until <= 0:
            continue
        weighted = stiffness[later, :until, ..., None] * basis[:until]
        product = np.einsum("tbik,tbil->tbkl", weighted, basis[later:])
        for here in range(2):
            for there in range(2):
                blocks[later][:until, place + here, place + there] += product[..., here, there]
