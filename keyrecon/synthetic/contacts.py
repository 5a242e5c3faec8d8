"""Which foot stands, of a motion whose ankles and toes are known.

A foot stands as long as a part of it rests on the floor: flat, on its heel, or on its toes with the
heel up. So an ankle that rises about toes that stay is a standing foot.
"""

import numpy as np
from jaxtyping import Bool, Float

RISE = 0.03
"""Metres above its height at rest within which a part of the foot is on the floor."""
MOVING = 0.3
"""Metres per second from which on it does not rest."""
RESTING = 0.15
"""Metres per second below which toes are taken to lie on the floor, to see how high the captured
point is then: 4 to 10 cm, as the model of each player has it, 1 to 2 cm to both sides of that."""


def find_contacts(
    ankles: Float[np.ndarray, "T 2 3"], toes: Float[np.ndarray, "T 2 3"], fps: float
) -> Bool[np.ndarray, "T 2"]:
    """Whether the right and the left foot stand; metres, y up."""
    on_heel = ankles[..., 1] < np.percentile(ankles[..., 1], 5) + RISE
    pace = _speed(toes, fps)
    height = np.where(pace < RESTING, toes[..., 1], np.nan)
    rests = np.isfinite(height).any(axis=0)
    rest = np.percentile(toes[..., 1], 5, axis=0)
    rest[rests] = np.nanmedian(height[:, rests], axis=0)
    on_toes = toes[..., 1] < rest + RISE
    return (on_heel & (_speed(ankles, fps) < MOVING)) | (on_toes & (pace < MOVING))


def _speed(points: Float[np.ndarray, "T 2 3"], fps: float) -> Float[np.ndarray, "T 2"]:
    return np.linalg.norm(np.gradient(points, axis=0), axis=2) * fps
