"""Which keyframe stands for which frame (Section 4.4).

Every frame is assigned to its nearest keyframe by D, so that joints can be propagated to it; only
those nearer than beta count as represented (W), and short gaps between these can be bridged by
interpolation (J).
"""

import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.keyframes.coverage import Neighborhoods, join_neighborhoods
from keyrecon.records import PoseDistances

GROUP_SIZE = 1 << 25
"""Candidates times frames that are looked at together; changes nothing but memory."""


def find_neighborhoods(
    smoothed: Float[np.ndarray, "M M"],
    comparison: PoseDistances,
    exemplar_distance: Float[np.ndarray, "T"],
    beta: float,
) -> Neighborhoods:
    """w(k): frames whose pose lies within beta of each candidate, itself among them.

    A frame that an exemplar stands for counts with it if the exemplar is within beta of both.
    """
    near = smoothed < beta
    np.fill_diagonal(near, True)
    served = exemplar_distance < beta
    step = max(1, GROUP_SIZE // max(1, len(served)))
    return join_neighborhoods(
        [
            Neighborhoods.of_members(near[first : first + step, comparison.row] & served)
            for first in range(0, max(1, len(near)), step)
        ]
    )


def assign_frames(
    smoothed: Float[np.ndarray, "M M"],
    comparison: PoseDistances,
    exemplar_distance: Float[np.ndarray, "T"],
    keyframes: Int[np.ndarray, "K"],
) -> tuple[Int[np.ndarray, "T"], Float[np.ndarray, "T"]]:
    """(nearest keyframe, distance D to it) for every frame.

    Frames that an exemplar stands for, keyframes among them, are as far from others as the
    exemplar, or as far as they are from it. Frames with the same exemplar as several keyframes go
    to the nearest in time, and a keyframe stands for itself.
    """
    rows = comparison.row[keyframes]
    apart = np.maximum(smoothed[rows], exemplar_distance[keyframes][:, None])
    nearest = keyframes[apart.argmin(axis=0)][comparison.row]
    distance = np.maximum(apart.min(axis=0)[comparison.row], exemplar_distance)
    for row in np.flatnonzero(np.bincount(rows) > 1):
        near, members = keyframes[rows == row], np.flatnonzero(comparison.row == row)
        closest = near[np.abs(members[:, None] - near).argmin(axis=1)]
        nearest[members] = np.where(np.isin(nearest[members], near), closest, nearest[members])
    nearest[keyframes], distance[keyframes] = keyframes, 0
    return nearest, distance


def represent_frames(
    hoods: Neighborhoods,
    comparison: PoseDistances,
    near: Bool[np.ndarray, "K"],
    keyframes: Int[np.ndarray, "K"],
) -> Bool[np.ndarray, "T"]:
    """W: what keyframes represent; one that is not `near` its exemplar only itself."""
    represented = hoods.union(np.unique(comparison.row[keyframes[near]]).tolist())
    represented[keyframes] = True
    return represented
