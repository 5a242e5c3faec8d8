"""Pictures of the report: crops that follow the player, as JPEG and PNG data in the page.

The video is read once. Every frame is cropped to a window that follows the player smoothly and
keeps the player's size; crops with the pose on them become a small video that plays beside the
3D figure, and some of them stills: an even strip through the video, and all keyframes.
"""

import base64
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8
from scipy.ndimage import gaussian_filter1d

from keyrecon.io.frame_reader import read_small, reduce_picture, side_by_side
from keyrecon.io.video import Video, open_video
from keyrecon.io.video_writer import write_video
from keyrecon.progress import Progress, silent
from keyrecon.records import Annotations, Motion, Shots, Track
from keyrecon.report.drawing import draw_pose
from keyrecon.report.markup import thinning

SIDE, LEAST_SIDE = 420, 120
"""Side of the square stills, and of the small video: of a video of hours it is smaller, px."""
CLIP_BYTES = 12e6
"""What the small video may take, as long as its side is not the least."""
FRAME_BYTES, SIDE_POWER = 1230.0, 1.2
"""What a frame of it takes at the whole side, bytes, and the power of the side that this grows
with: 1230, 586, 419 and 263 at 420, 240, 168 and 120 px (a rendered rally of 25 frames a second).
"""
NOTHING = 16
"""Grey value of the small video where there is no motion: such frames take 15 bytes."""
JPEG_QUALITY = 80
CLIP_QUALITY = 27
"""x264's crf; 27 keeps a minute of the small video under about 2 MB."""
HALVED_BY, COARSEST = 6.0, 42
"""By how much crf grows where a video is to take half of its bytes (x264's rule), and at most."""
ROOM = 1.65
"""Side of the window in player heights: a raised arm with a racket fits."""
CALM = 0.2
"""Seconds over which the window's motion is smoothed, so that the player moves, not the picture."""


Watch = Callable[[int, UInt8[np.ndarray, "h w 3"]], None]
"""Somebody else who wants to see pictures that are read: called with the frame and its picture."""


def ignore(frame: int, picture: UInt8[np.ndarray, "h w 3"]) -> None:
    """Nobody else."""


@dataclass(frozen=True, eq=False)
class Windows:
    """The square around the player in every frame, px."""

    center: Float[np.ndarray, "T 2"]
    side: Float[np.ndarray, "T"]

    def to_crop(
        self, frame: int, points: Float[np.ndarray, "*n 2"], size: int
    ) -> Float[np.ndarray, "*n 2"]:
        """Points of the picture as points of the crop, which has `size` px to a side."""
        corner, side = self._square(frame)
        return (points - corner + 0.5) * (size / side) - 0.5

    def cut(
        self, frame: int, picture: UInt8[np.ndarray, "h w 3"], size: int
    ) -> UInt8[np.ndarray, "size size 3"]:
        """The window of one frame; its edge pixels go on where it leaves the picture."""
        corner, side = self._square(frame)
        height, width = picture.shape[:2]
        columns = np.clip(corner[0] + np.arange(side), 0, width - 1)
        rows = np.clip(corner[1] + np.arange(side), 0, height - 1)
        x0, x1, y0, y1 = columns[0], columns[-1] + 1, rows[0], rows[-1] + 1
        border = (y0 - corner[1], corner[1] + side - y1, x0 - corner[0], corner[0] + side - x1)
        top, bottom, left, right = np.maximum(border, 0).tolist()
        inner = picture[y0:y1, x0:x1]
        if top or bottom or left or right:
            inner = cv2.copyMakeBorder(inner, top, bottom, left, right, cv2.BORDER_REPLICATE)
        return reduce_picture(inner[:side, :side], size)

    def _square(self, frame: int) -> tuple[Int[np.ndarray, "2"], int]:
        side = max(2, round(float(self.side[frame])))
        return np.round(self.center[frame] - side / 2).astype(np.int64), side


@dataclass(frozen=True, eq=False)
class Pictures:
    """What was cut from the video; pictures as data URIs."""

    strip: dict[int, str]
    """Frame number to still with the refined pose, evenly through the video."""
    instants: dict[int, str]
    """The same at the frames that were asked for."""
    keyframes: dict[int, str]
    """Frame number to still with the marks of a person."""
    clip: str
    """The small video, one frame per frame of the motion."""


def follow_player(track: Track, motion: Motion) -> Windows:
    """A window around the player for every frame that moves as calmly as the player allows, and
    jumps where another shot begins."""
    sigma = max(1.0, CALM * motion.fps)
    middle = track.box.reshape(-1, 2, 2).mean(axis=1)
    middle = np.where(np.isfinite(middle), middle, (track.head + track.mid_feet) / 2)
    center, size = _bridge(middle), _bridge(track.height[:, None])[:, 0]
    cuts = () if motion.cuts is None else tuple(motion.cuts.tolist())
    for part in Shots.between(cuts, len(size)).parts:
        center[part] = gaussian_filter1d(center[part], sigma, axis=0, mode="nearest")
        size[part] = gaussian_filter1d(size[part], 2 * sigma, mode="nearest")
    return Windows(center, ROOM * size)


def cut_pictures(
    video: Video,
    track: Track,
    annotations: Annotations,
    motion: Motion,
    strip: int = 24,
    progress: Progress = silent,
    instants: Sequence[int] = (),
    watch: Watch = ignore,
) -> Pictures:
    """Read the video once and cut everything that the report shows of it; `watch` sees all marked
    frames too."""
    windows = follow_player(track, motion)
    shown_motion = motion.known
    known = np.flatnonzero(shown_motion)
    even = known[np.linspace(0, len(known) - 1, min(strip, len(known))).round().astype(int)]
    every = thinning(len(shown_motion))
    side = clip_side(len(known) // every)
    nothing = np.full((side, side, 3), NOTHING, np.uint8)
    stills, marked = dict[int, str](), dict[int, str]()

    def cut(entry: tuple[int, UInt8[np.ndarray, "h w 3"]]) -> UInt8[np.ndarray, "side side 3"]:
        frame, picture = entry
        if frame in annotations.frames:
            watch(frame, picture)
            marked[frame] = jpeg_uri(_marked_still(windows, picture, annotations, frame))
        if frame in even or frame in instants:
            stills[frame] = jpeg_uri(_posed_crop(windows, frame, picture, motion, SIDE))
        if not shown_motion[frame] or frame % every:
            return nothing
        return _posed_crop(windows, frame, picture, motion, side)

    def crops() -> Iterator[UInt8[np.ndarray, "h w 3"]]:
        chosen = known[known % every == 0], even, annotations.frames
        wanted = sorted({*instants, *np.concatenate(chosen).tolist()})
        pictures = read_small(video, video.width, {*wanted})
        shown = progress(pictures, "Cutting pictures for the report", len(wanted))
        cropped = zip(wanted, side_by_side(cut, zip(wanted, shown, strict=True)), strict=True)
        of_clip = ((t, crop) for t, crop in cropped if t % every == 0)
        yield from _with_gaps(of_clip, range(0, len(shown_motion), every), nothing)

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "clip.mp4"
        write_video(path, crops(), motion.fps / every, CLIP_QUALITY)
        clip = video_uri(_small_enough(path, motion.fps / every).read_bytes())
    shown = [{t: stills[t] for t in sorted(chosen)} for chosen in (even.tolist(), instants)]
    return Pictures(shown[0], shown[1], dict(sorted(marked.items())), clip)


def _small_enough(clip: Path, fps: float) -> Path:
    """The small video, encoded once more, coarser, where it came out larger than was expected: one
    picture in several differs more from the one before, and so do shots cut to shots."""
    excess = clip.stat().st_size / CLIP_BYTES
    if excess <= 1:
        return clip
    coarser = CLIP_QUALITY + int(np.ceil(HALVED_BY * np.log2(excess)))
    smaller = clip.with_name("smaller.mp4")
    write_video(smaller, open_video(clip).frames(), fps, min(coarser, COARSEST))
    return smaller


def _with_gaps(
    pictures: Iterable[tuple[int, UInt8[np.ndarray, "h w 3"]]],
    frames: range,
    nothing: UInt8[np.ndarray, "h w 3"],
) -> Iterator[UInt8[np.ndarray, "h w 3"]]:
    """A picture for every frame, `nothing` for those that have none."""
    numbered = iter(pictures)
    frame, picture = next(numbered, (-1, nothing))
    for number in frames:
        if number == frame:
            yield picture
            frame, picture = next(numbered, (-1, nothing))
        else:
            yield nothing


def clip_side(frames: int) -> int:
    """Side of a small video of so many frames with a motion, px."""
    room = CLIP_BYTES / max(1.0, FRAME_BYTES * frames)
    side = SIDE * min(1.0, room) ** (1 / SIDE_POWER)
    return max(LEAST_SIDE, 2 * round(side / 2))


def video_uri(content: bytes) -> str:
    """An mp4 file as a data URI."""
    return _data_uri("video/mp4", content)


def png_uri(picture: UInt8[np.ndarray, "h w"]) -> str:
    """A grey picture as a PNG data URI."""
    return _data_uri("image/png", cv2.imencode(".png", picture)[1].tobytes())


def _posed_crop(
    windows: Windows, frame: int, picture: UInt8[np.ndarray, "h w 3"], motion: Motion, size: int
) -> UInt8[np.ndarray, "size size 3"]:
    return draw_pose(
        windows.cut(frame, picture, size),
        windows.to_crop(frame, motion.points2d[frame], size),
        motion.skeleton,
        motion.points3d[frame, :, 2],
        motion.source[frame],
        size / ROOM,
    )


def _marked_still(
    windows: Windows, picture: UInt8[np.ndarray, "h w 3"], annotations: Annotations, frame: int
) -> UInt8[np.ndarray, "side side 3"]:
    """Marks as a person made them; joints placed though hidden are rings."""
    row = int(np.searchsorted(annotations.frames, frame))
    return draw_pose(
        windows.cut(frame, picture, SIDE),
        windows.to_crop(frame, annotations.joints[row], SIDE),
        annotations.skeleton,
        source=np.where(annotations.visible[row], 0, 2),
        height=SIDE / ROOM,
    )


def _bridge(values: Float[np.ndarray, "T n"]) -> Float[np.ndarray, "T n"]:
    """Values with gaps filled linearly, so that a window exists in every frame."""
    bridged, at = values.copy(), np.arange(len(values))
    for column in bridged.T:
        known: Bool[np.ndarray, "T"] = np.isfinite(column)
        if known.any():
            column[~known] = np.interp(at[~known], at[known], column[known])
        else:
            column[:] = 1.0
    return bridged


def jpeg_uri(picture: UInt8[np.ndarray, "h w 3"]) -> str:
    """A picture as a JPEG data URI."""
    quality = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
    data = cv2.imencode(".jpg", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR), quality)[1]
    return _data_uri("image/jpeg", data.tobytes())


def _data_uri(kind: str, data: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"
