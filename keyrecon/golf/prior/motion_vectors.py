"""Swings as motion vectors: warped to the same key times, N samples each (CVPR 2005, Section 3).

Time is warped piecewise linearly so that every swing reaches its key postures at the same
normalised times, and turns are resampled by quaternion slerp. A motion vector holds rotation
vectors about one centre per segment, the mean of its turns over all swings: a sound coordinate as
long as no segment turns half a circle away from it, which is checked.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation, Slerp

from keyrecon.golf.prior.skeleton import NAMES, SEGMENTS, turns_from_swing
from keyrecon.golf.records import Swing

SAMPLES = 200
"""N of the paper."""
FARTHEST_TURN = np.radians(165)
"""Turn from the centre beyond which rotation vectors are about to wrap around."""


def mean_keys(swings: Sequence[Swing]) -> Float[np.ndarray, "4"]:
    """Normalised times of the key postures: the mean over swings, so that the warp is least."""
    shares = [(s.keys - s.keys[0]) / (s.keys[3] - s.keys[0]) for s in swings]
    return np.mean(shares, axis=0)


def sample_swing(
    swing: Swing, keys: Float[np.ndarray, "4"], samples: int = SAMPLES
) -> tuple[Float[np.ndarray, "N P 3 3"], Float[np.ndarray, "N 3"]]:
    """Turns and place of the pelvis (statures) at evenly spaced normalised times."""
    turns, place = turns_from_swing(swing)
    time = np.interp(np.linspace(0, 1, samples), keys, swing.keys)
    frames = np.arange(len(turns))
    sampled = [
        Slerp(frames, Rotation.from_matrix(t))(time).as_matrix() for t in turns.swapaxes(0, 1)
    ]
    moved = np.stack([np.interp(time, frames, c) for c in place.T], axis=1)
    return np.stack(sampled, axis=1), moved


def find_centre(turns: Float[np.ndarray, "M N P 3 3"]) -> Float[np.ndarray, "P 3 3"]:
    """Mean turn of every segment over all swings and times."""
    columns = turns.transpose(2, 0, 1, 3, 4).reshape(len(SEGMENTS), -1, 3, 3)
    return np.stack([Rotation.from_matrix(c).mean().as_matrix() for c in columns])


def motion_vector(
    turns: Float[np.ndarray, "N P 3 3"],
    place: Float[np.ndarray, "N 3"],
    centre: Float[np.ndarray, "P 3 3"],
) -> Float[np.ndarray, "N D"]:
    """Rotation vectors of all segments and the place of the pelvis, as one row per sample."""
    local = np.swapaxes(centre, 1, 2) @ turns
    vectors = Rotation.from_matrix(local.reshape(-1, 3, 3)).as_rotvec()
    return np.concatenate([vectors.reshape(len(turns), -1), place], axis=1)


def farthest_turn(vector: Float[np.ndarray, "N D"]) -> tuple[str, float]:
    """The segment that turns farthest from its centre, and its angle."""
    angles = np.linalg.norm(vector[:, :-3].reshape(len(vector), -1, 3), axis=2).max(axis=0)
    return NAMES[int(angles.argmax())], float(angles.max())
