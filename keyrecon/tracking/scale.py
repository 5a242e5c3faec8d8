"""How large the player is: the unit of length of all later stages.

Players crouch, lunge and jump, so the standing height from head to mid-feet is an upper envelope
over time of the distance between them. A zooming camera changes it faster than any player can; its
magnification is taken out first. Where the player was not seen, head and feet lie anywhere, and far
from each other more often than not: those frames tell nothing.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import gaussian_filter1d, percentile_filter

from keyrecon.io.video import Video
from keyrecon.records import CameraPath, Track
from keyrecon.segmentation.color_model import STANDING


def zoom(camera: CameraPath, video: Video) -> Float[np.ndarray, "T"]:
    """Magnification of each frame against the first.

    Accumulated from frame to frame at the centre of the picture, where turning the camera does
    not magnify.
    """
    center = np.array([video.width / 2, video.height / 2])
    step = np.linalg.inv(camera.to_reference[1:]) @ camera.to_reference[:-1]
    weight = step[:, 2, :2] @ center + step[:, 2, 2]
    area = np.linalg.det(step) / weight**3
    return np.concatenate([[1.0], np.exp(np.cumsum(0.5 * np.log(np.maximum(area, 1e-6))))])


def standing_height(
    head: Float[np.ndarray, "T 2"],
    mid_feet: Float[np.ndarray, "T 2"],
    magnification: Float[np.ndarray, "T"],
    frames: int,
    seen: Bool[np.ndarray, "T"],
) -> Float[np.ndarray, "T"]:
    """Upper envelope of the distance from head to mid-feet over about `frames` frames, px, told by
    those in which the player was `seen`; by all where there are none.

    The zoom is undone before and done again after. A crouch longer than that passes for a change
    of distance.
    """
    known = np.flatnonzero(seen if seen.any() else ~seen)
    length = np.linalg.norm(mid_feet - head, axis=1)[known] / magnification[known]
    window = min(len(length), max(3, frames) | 1)
    envelope = percentile_filter(length, 100 * STANDING, size=window, mode="nearest")
    smooth = gaussian_filter1d(envelope, window / 4, mode="nearest")
    return np.interp(np.arange(len(head)), known, smooth) * magnification


def measured(
    track: Track,
    magnification: Float[np.ndarray, "T"],
    frames: int,
    seen: Bool[np.ndarray, "T"],
) -> Track:
    """The track with standing height and box by the frames in which the player was `seen`."""
    height = standing_height(track.head, track.mid_feet, magnification, frames, seen)
    return replace(track, height=height, box=player_boxes(track.head, track.feet, height))


def player_boxes(
    head: Float[np.ndarray, "T 2"],
    feet: Float[np.ndarray, "T 2 2"],
    height: Float[np.ndarray, "T"],
) -> Float[np.ndarray, "T 4"]:
    """x0, y0, x1, y1 around head and feet, with room for a raised racket arm."""
    spots = np.concatenate([head[:, None], feet], axis=1)
    low, high = spots.min(axis=1), spots.max(axis=1)
    room = height[:, None]
    return np.concatenate([low - room * (0.5, 0.35), high + room * (0.5, 0.08)], axis=1)
