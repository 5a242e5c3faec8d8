"""Posture at any normalised time: mean motion plus weighted components (CVPR 2005, Eq. 2).

A motion vector holds N postures. Between them postures are interpolated by Catmull-Rom's cubic,
so that the slope by normalised time is continuous and Gauss-Newton sees no kinks. A posture is
linear in the coefficients as long as it is a rotation vector about the segment's `centre`; the
derivative of the exponential map (its left Jacobian) turns rates of the vector into a rotation
velocity.
"""

from dataclasses import fields, replace

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from keyrecon.golf.prior.skeleton import SEGMENTS
from keyrecon.golf.records import MotionModel, Posture

_CUBIC = 0.5 * np.array(
    [[0.0, 2.0, 0.0, 0.0], [-1.0, 0.0, 1.0, 0.0], [2.0, -5.0, 4.0, -1.0], [-1.0, 3.0, -3.0, 1.0]]
)
"""Catmull-Rom: powers of the fraction to weights of the four samples around it."""


def posture_at(
    model: MotionModel, phase: Float[np.ndarray, "T"], coefficients: Float[np.ndarray, "m"]
) -> Posture:
    """Postures at normalised times with their rates by coefficients and phase.

    Before 0 and after 1 the player stands still. Fewer coefficients than components may be given.
    """
    samples = len(model.mean)
    first, weights, slopes = _interpolate(phase, samples)
    components = model.components[: len(coefficients)]
    motion = model.mean + np.tensordot(coefficients, components, axes=1)
    around = np.clip(first[:, None] + np.arange(-1, 3), 0, samples - 1)
    vector = np.einsum("tk,tkd->td", weights, motion[around])
    by_phase = np.einsum("tk,tkd->td", slopes, motion[around])
    by_coefficients = np.einsum("tk,ctkd->tdc", weights, components[:, around])
    rates = np.concatenate([by_coefficients, by_phase[..., None]], axis=2)
    turned = 3 * len(SEGMENTS)
    vectors = vector[:, :turned].reshape(len(phase), -1, 3)
    turns = model.centre @ _rotations(vectors)
    velocity = model.centre @ left_jacobian(vectors)
    turn_rates = velocity @ rates[:, :turned].reshape(len(phase), len(SEGMENTS), 3, -1)
    return Posture(turns, vector[:, turned:], turn_rates, rates[:, turned:])


def posture_by_frame(
    model: MotionModel, phase: Float[np.ndarray, "T"], coefficients: Float[np.ndarray, "T m"]
) -> Posture:
    """The same where every frame has other coefficients."""
    each = [posture_at(model, phase[t : t + 1], c) for t, c in enumerate(coefficients)]
    return Posture(*(np.concatenate([getattr(p, f.name) for p in each]) for f in fields(Posture)))


def turn_posture(posture: Posture, turns: Float[np.ndarray, "T P 3"]) -> Posture:
    """Postures whose segments turn further, by rotation vectors in their parents' axes."""
    more = _rotations(turns)
    return replace(posture, turns=more @ posture.turns, turn_rates=more @ posture.turn_rates)


def _interpolate(
    phase: Float[np.ndarray, "T"], samples: int
) -> tuple[np.ndarray, Float[np.ndarray, "T 4"], Float[np.ndarray, "T 4"]]:
    """Sample before each time, weights of the four samples around it, and their slopes."""
    inside = np.clip(phase, 0, 1)
    place = inside * (samples - 1)
    first = np.minimum(place.astype(int), samples - 2)
    u = place - first
    weights = np.stack([u**0, u, u**2, u**3], axis=1) @ _CUBIC
    slopes = np.stack([0 * u, u**0, 2 * u, 3 * u**2], axis=1) @ _CUBIC * (samples - 1)
    slopes[inside != phase] = 0
    return first, weights, slopes


def _rotations(vectors: Float[np.ndarray, "T P 3"]) -> Float[np.ndarray, "T P 3 3"]:
    return Rotation.from_rotvec(vectors.reshape(-1, 3)).as_matrix().reshape(*vectors.shape, 3)


def left_jacobian(vectors: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3 3"]:
    """Rotation velocity of exp(v) by the rate of v: J_l = I + (1 - cos) [v]x + (a - sin) [v]x^2.

    With a = |v| the terms are divided by a^2 and a^3; near 0 by their series.
    """
    angle = np.linalg.norm(vectors, axis=-1)[..., None, None]
    small = angle < 1e-4
    safe = np.where(small, 1.0, angle)
    first = np.where(small, 0.5 - angle**2 / 24, (1 - np.cos(safe)) / safe**2)
    second = np.where(small, 1 / 6 - angle**2 / 120, (safe - np.sin(safe)) / safe**3)
    cross = cross_matrix(vectors)
    return np.eye(3) + first * cross + second * cross @ cross


def cross_matrix(vectors: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3 3"]:
    """[v]x: the matrix that multiplies as v x."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    rows = [zero, -z, y, z, zero, -x, -y, x, zero]
    return np.stack(rows, axis=-1).reshape(*vectors.shape[:-1], 3, 3)
