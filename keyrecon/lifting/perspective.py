"""Perspective taken out of joints in the picture, by the depths of a first lift.

The lift is scaled orthography: a limb is as long in the picture wherever it is. Who is filmed from
two or three body heights is not seen like that: a head half a metre nearer than the hips looks a
sixth larger, so arms and shoulders come out too long, legs too short, and a body seen from above
too upright. The depths of a first lift tell most of it: each joint is moved to where it would be
seen from afar, away from the player's middle or towards it by (D + z) / D, z its depth behind the
middle and D the player's distance, and lifted again. The picture's plane is that of the line of
sight to the player; how it is inclined to the sensor is left out (.9 mm of PA-MPJPE where the
player is 12 degrees beside the axis).
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from keyrecon.records import Annotations, JointTracks

NEAREST = 0.5
"""No joint looks more than twice as large as the player's middle: where a focal length says so it
is wrong, and depths of a lift that is wrong too must not turn joints over."""


def relative_distance(
    points: Float[np.ndarray, "T J 3"],
    scale: Float[np.ndarray, "T"],
    focal: Float[np.ndarray, "T"] | float,
) -> Float[np.ndarray, "T J"]:
    """How far joints are from the camera, in distances of the player's middle.

    `scale` in px per unit of `points`, `focal` in px.
    """
    behind = points[..., 2] - points[..., 2].mean(axis=1, keepdims=True)
    return np.maximum(1 + behind * (scale / focal)[:, None], NEAREST)


def without_perspective(
    joints: Float[np.ndarray, "T J 2"],
    middle: Float[np.ndarray, "T 2"],
    distance: Float[np.ndarray, "T J"],
) -> Float[np.ndarray, "T J 2"]:
    """Joints where they would be seen from afar; `distance` as `relative_distance` gives it."""
    return middle[:, None] + (joints - middle[:, None]) * distance[..., None]


def tracks_without_perspective(
    tracks: JointTracks,
    annotations: Annotations,
    middle: Float[np.ndarray, "T 2"],
    distance: Float[np.ndarray, "T J"],
) -> tuple[JointTracks, Annotations]:
    """Tracks and marks without perspective."""
    marked = annotations.frames
    joints = without_perspective(annotations.joints, middle[marked], distance[marked])
    return (
        replace(tracks, joints=without_perspective(tracks.joints, middle, distance)),
        replace(annotations, joints=joints),
    )
