"""What a good motion costs, one small term each: every function returns a `solver.Term`."""

import numpy as np
from jaxtyping import Float

from keyrecon.body import Skeleton
from keyrecon.lifting.preprocessing import PreparedTracks
from keyrecon.lifting.solver import LinearizedTerm, MotionState, Term


def reprojection(
    observed: PreparedTracks,
    lengths: Float[np.ndarray, "B"],
    skeleton: Skeleton,
) -> Term:
    """Joints should project onto the observed ones; Huber beyond `huber_delta` spreads.

    In units of length (px over scale); NaN or an infinite spread where nothing is known. The
    squared loss of Eq. 6, made robust where a joint may be an outlier.
    """
    spread, delta = observed.spread, observed.huber_delta
    reach = skeleton.ancestry * lengths
    inverse = np.where(np.isnan(observed.joints[..., 0]) | np.isinf(spread), 0.0, 1.0 / spread)
    target = np.nan_to_num(observed.joints)
    slope = np.zeros((len(skeleton.names), 2, len(lengths), 3))
    for axis in range(2):
        slope[:, axis, :, axis] = reach

    def term(state: MotionState) -> LinearizedTerm:
        frames = len(target)
        residual = inverse[..., None] * (state.points(lengths, skeleton)[..., :2] - target)
        size = np.linalg.norm(residual, axis=-1)
        near = np.minimum(size, delta)
        shrink = np.sqrt(np.where(size > delta, near / np.maximum(size, 1e-12), 1.0))
        cost = (near * (size - 0.5 * near)).sum()
        weight = inverse * shrink
        by_direction = (weight[:, :, None, None, None] * slope).reshape(frames, -1, len(lengths), 3)
        by_root = (weight[..., None, None] * np.eye(2)).reshape(frames, -1, 2)
        return LinearizedTerm(
            (shrink[..., None] * residual).reshape(frames, -1), by_direction, by_root, float(cost)
        )

    return term


def breadth(
    left: int,
    right: int,
    length: float,
    spread: float,
    lengths: Float[np.ndarray, "B"],
    skeleton: Skeleton,
) -> Term:
    """The distance of two joints of the trunk stays `length`, within `spread`."""
    ways = skeleton.ancestry * lengths
    difference = ways[left] - ways[right]

    def term(state: MotionState) -> LinearizedTerm:
        across = np.einsum("b,tbi->ti", difference, state.directions)
        size = np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-9)
        toward = across / size / spread
        return LinearizedTerm(
            (size - length) / spread, (toward[:, None, None, :] * difference[:, None])
        )

    return term


def alignment(share: Float[np.ndarray, "B"], spread: float) -> Term:
    """A weighted sum of bone directions stays near zero: parts of the trunk move together."""
    slope = np.zeros((3, len(share), 3))
    slope[np.arange(3), :, np.arange(3)] = share / spread

    def term(state: MotionState) -> LinearizedTerm:
        residual = np.einsum("b,tbi->ti", share, state.directions) / spread
        return LinearizedTerm(residual, np.broadcast_to(slope, (len(residual), *slope.shape)))

    return term


def balance(share: Float[np.ndarray, "B"], tilt: float, spread: float) -> Term:
    """A weighted sum of bones stands upright: its depth is `tilt` times its way down."""
    slope = np.zeros((1, len(share), 3))
    slope[0, :, 2] = share / spread
    slope[0, :, 1] = -tilt * share / spread

    def term(state: MotionState) -> LinearizedTerm:
        residual = np.einsum("mbi,tbi->tm", slope, state.directions)
        return LinearizedTerm(residual, np.broadcast_to(slope, (len(residual), *slope.shape)))

    return term


def key_pose_prior(directions: Float[np.ndarray, "T B 3"], spread: float, weight: float) -> Term:
    """Bone directions stay near those of the slerped key poses; `weight` is that of one frame.

    Quadratic within `spread`, linear beyond (pseudo-Huber), so a pose that does not fit lets go.
    """
    bones = directions.shape[1]
    identity = np.zeros((bones, 3, bones, 3))
    for bone in range(bones):
        identity[bone, :, bone] = np.eye(3) / spread

    def term(state: MotionState) -> LinearizedTerm:
        frames = len(directions)
        off = (state.directions - directions) / spread
        size = np.sqrt(1 + (off**2).sum(axis=-1, keepdims=True))
        root = np.sqrt(weight / size)
        by_direction = (root[..., None, None] * identity).reshape(frames, -1, bones, 3)
        cost = weight * float((size - 1).sum())
        return LinearizedTerm((root * off).reshape(frames, -1), by_direction, None, cost)

    return term


def depth_prior(
    shares: Float[np.ndarray, "T B"], spread: Float[np.ndarray, "B"], weight: float
) -> Term:
    """Depths of bones, as shares of their lengths, are those expected; NaN expects nothing.

    Quadratic within `spread`, linear beyond (pseudo-Huber): some poses are not what was learnt.
    """
    known, bones = np.isfinite(shares), np.arange(len(spread))
    wanted = np.nan_to_num(shares)

    def term(state: MotionState) -> LinearizedTerm:
        off = np.where(known, (state.directions[..., 2] - wanted) / spread, 0.0)
        size = np.sqrt(1 + off**2)
        root = np.sqrt(weight / size)
        slope = np.zeros((len(off), len(bones), len(bones), 3))
        slope[:, bones, bones, 2] = np.where(known, root / spread, 0.0)
        return LinearizedTerm(root * off, slope, None, weight * float((size - 1).sum()))

    return term


def hinge(
    bones: tuple[int, int],
    axis: Float[np.ndarray, "T 3"],
    spread: Float[np.ndarray, "T"],
    weight: float,
) -> Term:
    """Two bones bend about an axis: along it their unit directions differ by `spread` at most."""
    first, second = bones
    inverse = (np.sqrt(weight) / spread)[:, None]

    def term(state: MotionState) -> LinearizedTerm:
        bend = state.directions[:, second] - state.directions[:, first]
        slope = np.zeros((len(bend), 1, state.directions.shape[1], 3))
        slope[:, 0, second], slope[:, 0, first] = inverse * axis, -inverse * axis
        return LinearizedTerm(inverse * (bend * axis).sum(axis=-1, keepdims=True), slope)

    return term


def unseen_bend(
    bones: tuple[int, int],
    start: Float[np.ndarray, "T B 3"],
    noise: float,
    weight: float,
) -> Term:
    """The part of a bend that the picture does not show is of the size of the part that it shows.

    The difference w of two bones' unit directions tells their bend. Seen from anywhere alike, the
    depth w_z given the picture's part a = |w_xy| has the density a / (a^2 + w_z^2) times that of
    the bend's size: a Cauchy density of scale a. A limb that looks straight is straight, but for
    `noise`: each bone by itself would be given the depth that its foreshortening may hide, and two
    such depths of opposite signs bend the limb. a is taken from the directions of `start`.
    """
    first, second = bones
    pictured = np.linalg.norm((start[:, second] - start[:, first])[:, :2], axis=-1)
    scale = np.hypot(pictured, noise)[:, None]

    def term(state: MotionState) -> LinearizedTerm:
        depth = (state.directions[:, second, 2] - state.directions[:, first, 2])[:, None]
        residual = depth / scale
        root = np.sqrt(2 * weight / (1 + residual**2))
        slope = np.zeros((len(depth), 1, state.directions.shape[1], 3))
        slope[:, 0, second, 2], slope[:, 0, first, 2] = (root / scale)[:, 0], -(root / scale)[:, 0]
        cost = weight * float(np.log1p(residual**2).sum())
        return LinearizedTerm(root * residual, slope, None, cost)

    return term
