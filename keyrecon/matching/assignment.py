"""Which keyframe stands for which frame (Section 4.4).

Every frame is assigned to its nearest keyframe by D, so that joints can be carried to it; only
those nearer than beta count as represented (W), and short gaps between these can be bridged by
interpolation (J).
"""

import numpy as np
from jaxtyping import Float, Int

from keyrecon.matching.cells import ranges
from keyrecon.matching.coverage import Neighborhoods
from keyrecon.records import Comparison


def find_neighborhoods(
    smoothed: Float[np.ndarray, "M M"],
    comparison: Comparison,
    detour: Float[np.ndarray, "T"],
    beta: float,
) -> Neighborhoods:
    """w(k): frames whose pose lies within beta of each candidate, itself among them.

    A frame that an exemplar stands for counts with it if the exemplar is within beta of both.
    """
    near = smoothed < beta
    np.fill_diagonal(near, True)
    n_frames = len(comparison.row)
    served = np.flatnonzero(detour < beta).astype(np.int32)
    members = np.bincount(comparison.row[served], minlength=len(near))
    first_member = np.cumsum(members) - members
    candidate, row = np.nonzero(near)
    count = members[row]
    frame = served[ranges(first_member[row], count)]
    size = np.bincount(candidate, count, minlength=len(near)).astype(np.int64)
    return Neighborhoods(np.concatenate([[0], np.cumsum(size)]), frame, n_frames)


def assign_frames(
    smoothed: Float[np.ndarray, "M M"],
    comparison: Comparison,
    detour: Float[np.ndarray, "T"],
    chosen: list[int],
) -> tuple[Int[np.ndarray, "T"], Float[np.ndarray, "T"]]:
    """(row of the nearest of the `chosen` rows, distance D to it) for every frame.

    A frame that an exemplar stands for is as far as the exemplar, or as far from it.
    """
    rows = np.sort(chosen)
    to_keyframes = smoothed[rows]
    nearest, distance = rows[to_keyframes.argmin(axis=0)], to_keyframes.min(axis=0)
    return nearest[comparison.row], np.maximum(distance[comparison.row], detour)
