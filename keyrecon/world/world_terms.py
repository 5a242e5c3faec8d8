"""What a good motion in the world costs, one small term each: functions return a `Term`.

All are sums of squares; robust terms weigh their residuals anew at every step, and their cost is
that of the weights at hand (iteratively reweighted least squares), see `refinement`.
"""

import numpy as np
from jaxtyping import Float, Int

from keyrecon.world.motion_solver import JointRows, Term
from keyrecon.world.records import WorldCamera


def reprojection(
    camera: WorldCamera, pixels: Float[np.ndarray, "T J 2"], spread: Float[np.ndarray, "T J"]
) -> Term:
    """Joints are seen where they were seen, within so many pixels; an infinite spread is blind."""
    rotation, shift = camera.R, camera.t
    focal, principal = camera.focal, camera.K[:, :2, 2]
    inverse = np.where(np.isfinite(spread), 1 / spread, 0.0)
    target = (np.nan_to_num(pixels) - principal[:, None]) / focal[:, None, None]
    weight = inverse * focal[:, None]

    def term(points: Float[np.ndarray, "T J 3"], _: float) -> JointRows:
        frames, joints = points.shape[:2]
        local = np.einsum("tik,tjk->tji", rotation, points) + shift[:, None]
        depth = np.maximum(local[..., 2:], NEAREST)
        flat = local[..., :2] / depth
        slope = np.zeros((frames, joints, 2, joints, 3))
        index = np.arange(joints)
        toward = rotation[:, None, :2] - flat[..., None] * rotation[:, None, 2:]
        slope[:, index, :, index] = (weight[..., None, None] * toward / depth[..., None]).swapaxes(
            0, 1
        )
        residual = weight[..., None] * (flat - target)
        return JointRows(
            residual.reshape(frames, -1), {0: slope.reshape(frames, 2 * joints, joints, 3)}
        )

    return term


NEAREST = 0.5
"""Metres before the camera that no player comes nearer than."""


def breadth(left: int, right: int, length: float, spread: float, joints: int) -> Term:
    """Two joints of the trunk keep their distance, `length` at size 1, within `spread` metres."""

    def term(points: Float[np.ndarray, "T J 3"], log_size: float) -> JointRows:
        across = points[:, left] - points[:, right]
        apart = np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
        wanted = np.exp(log_size) * length
        slope = np.zeros((len(points), 1, joints, 3))
        slope[:, 0, left], slope[:, 0, right] = across / apart / spread, -across / apart / spread
        by_size = np.full_like(apart, -wanted / spread)
        return JointRows((apart - wanted) / spread, {0: slope}, by_size)

    return term


def linear(slope: dict[int, Float[np.ndarray, "T m J 3"]], right: Float[np.ndarray, "T m"]) -> Term:
    """A weighted sum of joints' coordinates is what it should be."""

    def term(points: Float[np.ndarray, "T J 3"], _: float) -> JointRows:
        frames = len(points)
        flat = points.reshape(frames, -1)
        residual = -right
        for later, part in slope.items():
            there = np.clip(np.arange(frames) + later, 0, frames - 1)
            by_joint = part.reshape(frames, part.shape[1], -1)
            residual = residual + (by_joint @ flat[there][..., None])[..., 0]
        return JointRows(residual, slope)

    return term


def slip(feet: list[int], weight: Float[np.ndarray, "T 2 3"], joints: int) -> Term:
    """Feet are where they will be in the next frame; `weight` per axis, 0 where they move.

    The last frame has none.
    """
    frames = len(weight)
    slope = np.zeros((frames, 6, joints, 3))
    for foot, joint in enumerate(feet):
        for axis in range(3):
            slope[:-1, 3 * foot + axis, joint, axis] = weight[:-1, foot, axis]
    return linear({0: -slope, 1: slope}, np.zeros((frames, 6)))


def foot_height(
    feet: list[int],
    height: float,
    weight: Float[np.ndarray, "T 2"],
    joints: int,
) -> Term:
    """Ankles are so many metres above the ground."""
    slope = np.zeros((len(weight), 2, joints, 3))
    for foot, joint in enumerate(feet):
        slope[:, foot, joint, 2] = weight[:, foot]
    return linear({0: slope}, weight * height)


def body_acceleration(
    masses: Float[np.ndarray, "J"],
    expected: Float[np.ndarray, "T 3"],
    weight: Float[np.ndarray, "T 3"],
    fps: float,
) -> Term:
    """The centre of mass accelerates as expected, m/s^2; ends have weight 0."""
    axes = np.einsum("ta,j,ak->tajk", weight * fps**2, masses, np.eye(3))
    axes[0], axes[-1] = 0, 0
    right = weight * expected
    right[0], right[-1] = 0, 0
    return linear({-1: axes, 0: -2 * axes, 1: axes}, right)


def balance(
    masses: Float[np.ndarray, "J"],
    support: Float[np.ndarray, "T J"],
    along: Float[np.ndarray, "T 2"],
    ahead: Float[np.ndarray, "T"],
    weight: Float[np.ndarray, "T"],
) -> Term:
    """The centre of mass is `ahead` metres from above a mean of joints, along the ground."""
    slope = np.zeros((len(weight), 1, len(masses), 3))
    slope[:, 0, :, :2] = (weight[:, None] * (masses - support))[..., None] * along[:, None]
    return linear({0: slope}, (weight * ahead)[:, None])


SEGMENTS = {
    "head": (0.0694, "neck", "head_top", 0.5),
    "trunk": (0.4346, "neck", "hip", 0.55),
    "upper_arm": (0.0271, "shoulder", "elbow", 0.577),
    "forearm": (0.0162, "elbow", "wrist", 0.457),
    "hand": (0.0061, "wrist", "wrist", 0.0),
    "thigh": (0.1416, "hip", "knee", 0.41),
    "shank": (0.0433, "knee", "ankle", 0.446),
    "foot": (0.0137, "ankle", "ankle", 0.0),
}
"""Share of the body's mass, ends, and where its centre is between them: de Leva (J. Biomechanics
29, 1996), men; the trunk's centre, which has other ends there, from the neck to the hips."""


def joint_masses(names: tuple[str, ...]) -> Float[np.ndarray, "J"]:
    """Weights of joints of which the centre of mass is the mean."""
    masses = np.zeros(len(names))

    def put(name: str, mass: float) -> None:
        bearers: Int[np.ndarray, "n"] = np.array(
            [j for j, known in enumerate(names) if known in (name, f"right_{name}", f"left_{name}")]
        )
        if len(bearers):
            masses[bearers] += mass / len(bearers)

    for name, (mass, near, far, where) in SEGMENTS.items():
        both = mass if name in ("head", "trunk") else 2 * mass
        put(near, both * (1 - where))
        put(far, both * where)
    return masses / masses.sum()
