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

from keyrecon.errors import KeyreconError
from keyrecon.golf.records import Swing
from keyrecon.golf.skeleton import NAMES, SEGMENTS, turns_from_swing

SAMPLES = 200
"""N of the paper."""
FARTHEST = np.radians(175)
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


def motion_vectors(
    turns: Float[np.ndarray, "M N P 3 3"],
    place: Float[np.ndarray, "M N 3"],
    centre: Float[np.ndarray, "P 3 3"],
) -> Float[np.ndarray, "M N D"]:
    """Motion vectors; raises KeyreconError where a segment turns too far from its centre."""
    local = np.swapaxes(centre, 1, 2) @ turns
    vectors = Rotation.from_matrix(local.reshape(-1, 3, 3)).as_rotvec()
    vectors = vectors.reshape(*turns.shape[:3], 3)
    angle = np.linalg.norm(vectors, axis=3).max(axis=(0, 1))
    if (worst := int(angle.argmax())) and angle[worst] > FARTHEST:
        raise KeyreconError(
            f"The {NAMES[worst].replace('_', ' ')} turns {np.degrees(angle[worst]):.0f} degrees "
            "away from its mean in these swings; leave out swings that are not alike."
        )
    return np.concatenate([vectors.reshape(*turns.shape[:2], -1), place], axis=2)
