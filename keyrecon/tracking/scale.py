"""How large the player is: the unit of length of all later stages.

Players crouch, lunge and jump, so the standing height from head to mid-feet is an upper envelope
over time of the distance between them. A zooming camera changes it faster than any player can; its
magnification is taken out first. Where the player was not seen, head and feet lie anywhere, and far
from each other more often than not: those frames tell nothing.

Nor do frames whose lower edge cuts the feet off: what is taken for feet there is whatever lies
lowest in the picture, and a player who comes near would shrink while he grows. Where a body was
marked without feet, the bones of marked bodies tell how tall they would stand, against those whose
feet are seen, and the feet are put there, out of the picture. Without such a mark a head that is
low is a crouch, or was taken for one by mistake.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import gaussian_filter1d, percentile_filter

from keyrecon.io.video import Video
from keyrecon.records import CameraPath, Track, TrackAnchors

SURELY_CUT = 0.85
"""Feet that would be farther below the head than this, of the standing height that marks tell, are
out of the picture: a crouch takes less away, and what marks tell is off by as much."""


@dataclass(frozen=True, eq=False)
class SizeEvidence:
    """Evidence of the player's size other than head and feet, in every frame."""

    magnification: Float[np.ndarray, "T"]
    """By the camera's zoom."""
    marked_height: Float[np.ndarray, "T"]
    """Standing height by the bones of marked bodies, interpolated between these by the zoom, px;
    NaN without marks."""
    footless: Bool[np.ndarray, "T"]
    """Next to a marked body without feet, up to the next one that has them."""
    rows: int
    """Of the picture."""

    @classmethod
    def of(cls, camera: CameraPath, video: Video, anchors: TrackAnchors) -> "SizeEvidence":
        """By the camera and by marked bodies."""
        magnification, frames = zoom(camera, video), np.arange(len(video))
        marked_height, known = np.full(len(video), np.nan), np.isfinite(anchors.height)
        footless = np.zeros(len(video), dtype=bool)
        if known.any():
            at, height = anchors.frames[known], anchors.height[known]
            unzoomed = np.log(height / magnification[at])
            marked_height = np.exp(np.interp(frames, at, unzoomed)) * magnification
            below = (anchors.feet[known, :, 1] > video.height).all(axis=1)
            lacking = anchors.footless[known] | below
            after = np.searchsorted(at, frames).clip(max=len(at) - 1)
            before = (np.searchsorted(at, frames, side="right") - 1).clip(min=0)
            footless = lacking[before] | lacking[after]
            footless[at] = lacking
        return cls(magnification, marked_height, footless, video.height)

    def every(self, step: int) -> "SizeEvidence":
        """That of each `step`-th frame."""
        return SizeEvidence(
            self.magnification[::step], self.marked_height[::step], self.footless[::step], self.rows
        )

    def cut(
        self, head: Float[np.ndarray, "T 2"], share: float = SURELY_CUT
    ) -> Bool[np.ndarray, "T"]:
        """Frames whose lower edge cuts off the feet of a player who stands under these heads and is
        `share` times the marked height tall."""
        # comparisons with NaN are false: without marks feet are taken to be seen
        return (head[:, 1] + share * self.marked_height > self.rows) & self.footless


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
    envelope = percentile_filter(length, 80, size=window, mode="nearest")
    smooth = gaussian_filter1d(envelope, window / 4, mode="nearest")
    return np.interp(np.arange(len(head)), known, smooth) * magnification


def with_standing_height(
    track: Track, evidence: SizeEvidence, frames: int, seen: Bool[np.ndarray, "T"]
) -> Track:
    """The track with standing height and box by the frames in which the player was `seen`, and
    with feet out of the picture where its edge cuts them off."""
    cut, head = evidence.cut(track.head), track.head
    whole = seen & ~cut
    height = standing_height(head, track.mid_feet, evidence.magnification, frames, whole)
    if not cut.any():
        return replace(track, height=height, box=player_boxes(head, track.feet, height))
    height = _with_marked_heights(height, evidence, whole, seen & ~evidence.cut(head, 1.0))
    below = head[:, None] + height[:, None, None] * [0, 1]
    feet = np.where(cut[:, None, None], below, track.feet)
    return replace(track, feet=feet, height=height, box=player_boxes(head, feet, height))


def _with_marked_heights(
    height: Float[np.ndarray, "T"],
    evidence: SizeEvidence,
    whole: Bool[np.ndarray, "T"],
    surely: Bool[np.ndarray, "T"],
) -> Float[np.ndarray, "T"]:
    """The standing height by marked bodies where the player may not be `surely` whole.

    It is scaled by the ratio of both heights in whole frames, interpolated between them.
    """
    surely = surely if surely.any() else whole
    if not surely.any():
        return evidence.marked_height
    at = np.flatnonzero(surely)
    share = np.interp(np.arange(len(height)), at, height[at] / evidence.marked_height[at])
    return np.where(surely, height, share * evidence.marked_height)


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
