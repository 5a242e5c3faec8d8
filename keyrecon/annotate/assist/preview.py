"""What the picked colours find, before the whole video is worked on.

A strip of pictures spread over the video is decoded once and kept small. To the stages it looks
like a short video of few frames per second: the player is tracked on it as on the real one, which
takes a second, and again after every click.
"""

from collections.abc import Container, Iterator
from dataclasses import dataclass, fields

import cv2
import numpy as np
from jaxtyping import Float, Int, UInt8

from keyrecon.errors import KeyreconError
from keyrecon.io.evening import even_exposure
from keyrecon.io.frame_reader import reduce_picture
from keyrecon.io.video import Video
from keyrecon.records import CameraPath, Colors, Track, TrackAnchors
from keyrecon.segmentation.background_model import sample_frames
from keyrecon.segmentation.color_model import color_bins, posterior_tables, to_lab
from keyrecon.tracking import detection as find

SAMPLE_COUNT = 24
"""Pictures beside those asked for: enough for the scene behind the player to show everywhere."""
MAX_WIDTH = 960
"""Pictures are kept at most this wide, px."""
TINT_COLOR = (255, 0, 200)
"""Laid over pixels that look like a part: no skin, cloth, grass or clay has this colour."""
MAX_ALPHA = 200
"""Alpha where a pixel is surely of the part, of 255."""


@dataclass(frozen=True, eq=False)
class Strip(Video):
    """Some frames of a video as a video of their own, reduced and in memory."""

    numbers: tuple[int, ...]
    """Frame numbers in the whole video."""
    pictures: tuple[UInt8[np.ndarray, "h w 3"], ...]

    def frames(
        self, start: int = 0, stop: int | None = None, width: int | None = None
    ) -> Iterator[UInt8[np.ndarray, "h w 3"]]:
        """Pictures start..stop-1."""
        for place, picture in enumerate(self.pictures[start:stop], start):
            shown = even_exposure(picture, self._exposure(place))
            yield shown if width is None else reduce_picture(shown, width)

    def chosen_frames(self, numbers: Container[int], last: int) -> Iterator[np.ndarray]:
        """The pictures with these places up to `last`."""
        for place, picture in enumerate(self.pictures[: last + 1]):
            if place in numbers:
                yield even_exposure(picture, self._exposure(place))

    def grey_frames(
        self, wanted: Container[int] | None = None
    ) -> Iterator[UInt8[np.ndarray, "h w"]]:
        """The brightness of all pictures, or of those with the wanted places, in full range."""
        for place, picture in enumerate(self.frames()):
            if wanted is None or place in wanted:
                yield cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)

    @property
    def black(self) -> int:
        """That of RGB."""
        return 0


def cut_strip(video: Video, frames: tuple[int, ...]) -> Strip:
    """The frames asked for and others spread evenly; the whole video is decoded once."""
    if outside := [frame for frame in frames if not 0 <= frame < len(video)]:
        raise KeyreconError(f"Frame {outside[0]} is outside the video of {len(video)} frames.")
    numbers = np.union1d(np.array(frames, dtype=np.int64), sample_frames(len(video), SAMPLE_COUNT))
    chosen = video.chosen_frames(set(numbers.tolist()), int(numbers[-1]))
    width = min(video.width, MAX_WIDTH)
    pictures = tuple(reduce_picture(picture, width) for picture in chosen)
    whole = {field.name: getattr(video, field.name) for field in fields(Video)}
    time = video.time[numbers]
    rate = 1 / float(np.median(np.diff(time))) if len(time) > 1 else video.fps
    part = {"stamps": video.stamps[numbers], "time": time - time[0], "fps": rate}
    part["exposure"] = None  # the pictures are evened as the video was
    return Strip(**{**whole, **part}, numbers=tuple(numbers.tolist()), pictures=pictures)


@dataclass(frozen=True, eq=False)
class PreviewedParts:
    """The player on the frames of a strip that were asked for."""

    frames: Int[np.ndarray, "N"]
    head: Float[np.ndarray, "N 2"]
    """px; NaN where it was not found, as with the feet."""
    feet: Float[np.ndarray, "N 2 2"]
    box: Float[np.ndarray, "N 4"]
    confidence: float
    """Share of all pictures of the strip on which head and feet were found, 0-1."""


def find_player_in_strip(
    strip: Strip, colors: Colors, camera: CameraPath, frames: tuple[int, ...]
) -> PreviewedParts:
    """Head, feet and box on `frames`; KeyreconError where the head is hardly ever found."""
    track: Track = find.find_player(strip, colors, camera, TrackAnchors.none())
    rows = np.searchsorted(strip.numbers, np.unique(frames))
    tracked = track.confidence > 0
    missing = ~tracked[rows]
    return PreviewedParts(
        frames=np.unique(frames),
        head=np.where(missing[:, None], np.nan, track.head[rows]),
        feet=np.where(missing[:, None, None], np.nan, track.feet[rows]),
        box=track.box[rows],
        confidence=float(tracked.mean()),
    )


def tint_part(
    picture: UInt8[np.ndarray, "h w 3"], colors: Colors, part: str
) -> UInt8[np.ndarray, "h w 4"]:
    """How much each pixel looks like a part rather than its surroundings, as a layer of tint."""
    if part not in colors.names:
        raise KeyreconError(f"Nothing was picked as {part}; there are {', '.join(colors.names)}.")
    share = posterior_tables(colors)[colors.names.index(part)][color_bins(to_lab(picture))]
    layer = np.empty((*share.shape, 4), np.uint8)
    layer[..., :3] = TINT_COLOR
    layer[..., 3] = np.rint(MAX_ALPHA * share)
    return layer
