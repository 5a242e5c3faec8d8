"""The only file that opens a video: exact frames by presentation order, RGB, true times.

A frame is its index in presentation order, never time x rate. The index is built once from the
packets (no decoding): the presentation times of all packets that are shown, sorted. A frame is
fetched by seeking to a key packet at or before it and decoding up to its exact time. The quarter
turn and the mirroring that a file asks for (phones hold their sensor sideways) are applied here, as
players do: every other part of the program sees upright pictures and their coordinates.
Slow-motion footage tells its factor, so that times are those of the world.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator
from dataclasses import dataclass, fields
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float, Int, UInt8

from keyrecon.errors import KeyreconError, counted
from keyrecon.io.decoding_times import (
    lacks_presentation_times,
    stamped_as_decoded,
    stamps_as_decoded,
)
from keyrecon.io.evening import LUMA_FIRST, black_of, even_exposure
from keyrecon.io.fingerprint import fingerprint_file
from keyrecon.io.frame_times import even_out
from keyrecon.io.pixel_aspect import check_pixels
from keyrecon.reading import reading

if TYPE_CHECKING:
    import av

VARIABLE_RATE = 0.25
"""Frame spacing that differs by more than this share from its median counts as variable."""
MAX_PIXELS = 1 << 26
"""Of a picture: twice those of 8K video."""
MIN_FPS, MAX_FPS = 0.05, 100_000.0
"""Frames per second of a video, from time lapse to high-speed cameras."""
SOUGHT_SECONDS, SOUGHT_FRAMES = 4.0, 100
"""A gap between frames of a video of parts that is longer is jumped over, not decoded."""
MIN_DISTINCT = 0.9
"""Share of pictures that must have a time of their own; of others with the same, one is shown."""
PICTURES = ("image2", "_pipe")
"""Ends of the names of FFmpeg's formats that are pictures and no videos."""
LEAST_SLOW_MOTION, MOST_SLOW_MOTION = 0.01, 1000.0
"""Factors that a video can have: time lapse of a hundredth, and high-speed cameras."""


@dataclass(frozen=True, eq=False)
class Video:
    """A trimmed video file; frame 0 is the first frame after the trim."""

    path: Path
    width: int
    height: int
    """Size after rotation, px."""
    stamps: Int[np.ndarray, "T"]
    """Presentation times of the frames, in ticks of the stream."""
    time: Float[np.ndarray, "T"]
    """Seconds in the world since frame 0; of an even rate without the rounding of its container."""
    fps: float
    """Frames per second of the world (median spacing)."""
    turns: int
    """Quarter turns counter-clockwise that stand the stored picture upright."""
    mirrored: bool
    """Whether left and right of the stored picture are exchanged before it is turned."""
    exposure: Float[np.ndarray, "T"] | None
    """Brightness of the frames as factors on what is usual; they are read as if all were alike.
    None reads them as they were filmed."""

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.stamps)

    @property
    def name(self) -> str:
        """What people call it."""
        return self.path.name

    @property
    def file_starts(self) -> tuple[int, ...]:
        """Frames with which another file begins; of one file none."""
        return ()

    def part(self, frames: slice | Int[np.ndarray, "n"]) -> Video:
        """A video of some frames; its times stay those of the whole."""
        inherited = {field.name: getattr(self, field.name) for field in fields(Video)}
        return Video(**(inherited | self._of_frames(frames)))

    def _of_frames(self, frames: slice | Int[np.ndarray, "n"]) -> dict[str, Any]:
        """What is known of each frame, of some of them."""
        exposure = None if self.exposure is None else self.exposure[frames]
        return {"stamps": self.stamps[frames], "time": self.time[frames], "exposure": exposure}

    @property
    def variable_rate(self) -> bool:
        """Whether frames are unevenly spaced in time."""
        steps = np.diff(self.time)
        return bool(len(steps) and np.abs(steps * self.fps - 1).max() > VARIABLE_RATE)

    @cached_property
    def fingerprint(self) -> str:
        """Tells this file from others."""
        return fingerprint_file(self.path)

    def frames(
        self, start: int = 0, stop: int | None = None, width: int | None = None
    ) -> Iterator[UInt8[np.ndarray, "h w 3"]]:
        """Frames start..stop-1 in order, one in memory at a time; reduced to `width` if given."""
        convert = self._converter(width)
        for number, frame in enumerate(self._decoded(start, stop), start):
            yield even_exposure(convert(frame), self._exposure(number))

    def chosen_frames(self, numbers: Container[int], last: int) -> Iterator[np.ndarray]:
        """The frames with these numbers up to `last`; the others are decoded but not converted."""
        convert = self._converter(None)
        for number, frame in enumerate(self._decoded(0, last + 1)):
            if number in numbers:
                yield even_exposure(convert(frame), self._exposure(number))

    def grey_frames(
        self, wanted: Container[int] | None = None
    ) -> Iterator[UInt8[np.ndarray, "h w"]]:
        """The brightness of all frames, or of the wanted ones, in order.

        They are in the range that the file stores, or in full range where its format has to be
        converted: `black` tells.
        """
        grey: UInt8[np.ndarray, "h w"]
        for number, frame in enumerate(self._decoded(0, None)):
            if wanted is not None and number not in wanted:
                continue
            if frame.format.name in LUMA_FIRST:
                plane = frame.planes[0]
                pixels = np.frombuffer(memoryview(plane), np.uint8)
                grey = pixels.reshape(plane.height, plane.line_size)[:, : plane.width]
            else:
                grey = frame.to_ndarray(format="gray")
            evened = even_exposure(grey, self._exposure(number), black_of(frame))
            yield self._upright(evened)

    @cached_property
    def black(self) -> int:
        """How black is stored in the brightness that `grey_frames` gives."""
        return black_of(next(self._decoded(0, 1)))

    def _exposure(self, number: int) -> float:
        """Brightness of a frame as a factor on what is usual."""
        return 1.0 if self.exposure is None else float(self.exposure[number])

    def _decoded(self, start: int, stop: int | None) -> Iterator[av.VideoFrame]:
        """Frames start..stop-1 as they are stored, not turned."""
        stop = len(self) if stop is None else min(stop, len(self))
        if start >= stop:
            return
        apart = np.diff(self.time[start:stop])
        gaps = np.flatnonzero(apart > max(SOUGHT_SECONDS, SOUGHT_FRAMES / self.fps)) + 1
        for first, last in pairwise([start, *(start + gaps).tolist(), stop]):
            yield from self._decoded_run(first, last)

    def _decoded_run(self, start: int, stop: int) -> Iterator[av.VideoFrame]:
        """Frames that are decoded one after the other, those between them too."""
        wanted = self.stamps[start:stop]
        position = 0
        with _open(self.path) as container:
            for frame in _decode_from(container, int(wanted[0])):
                if frame.pts is None or frame.pts < wanted[position]:
                    continue
                if frame.pts != wanted[position]:
                    break
                if {frame.width, frame.height} != {self.width, self.height}:
                    raise KeyreconError(
                        f"{self.path}: from frame {start + position} on the pictures are "
                        f"{frame.width}x{frame.height}; use a part of one size by --start and "
                        "--end, or re-encode the video."
                    )
                yield frame
                position += 1
                if position == len(wanted):
                    return
        raise KeyreconError(
            f"{self.path}: frame {start + position} of {len(self)} cannot be decoded; the file is "
            "damaged there. Trim the project before it with --end, or repair the file."
        )

    def frame(self, index: int, width: int | None = None) -> UInt8[np.ndarray, "h w 3"]:
        """One frame by its number."""
        if not 0 <= index < len(self):
            raise KeyreconError(f"Frame {index} is outside the video of {len(self)} frames.")
        return next(self.frames(index, index + 1, width))

    def _converter(
        self, width: int | None
    ) -> Callable[[av.VideoFrame], UInt8[np.ndarray, "h w 3"]]:
        """Makes RGB pictures of frames, one after the other, reduced to `width` if given.

        One scaler does for all: it keeps its tables, which each frame would make and hold anew.
        """
        from av.video.reformatter import VideoReformatter

        wanted: dict[str, Any] = {"format": "rgb24"}
        if width and width != self.width:
            height = max(1, round(self.height * width / self.width))
            stored = (height, width) if self.turns % 2 else (width, height)
            wanted |= {"width": stored[0], "height": stored[1], "interpolation": "AREA"}
        scaler = VideoReformatter()
        return lambda frame: self._upright(scaler.reformat(frame, **wanted).to_ndarray())

    def _upright(self, stored: UInt8[np.ndarray, "h w *c"]) -> UInt8[np.ndarray, "y x *c"]:
        """A stored picture as players show it."""
        if not self.turns and not self.mirrored:
            return stored
        flipped = stored[:, ::-1] if self.mirrored else stored
        return np.ascontiguousarray(np.rot90(flipped, self.turns))


def open_video(
    path: str | Path,
    start: int = 0,
    end: int | None = None,
    slow_motion: float = 1.0,
    square_only: bool = True,
) -> Video:
    """Index a video file; frames start..end-1, filmed `slow_motion` times faster than shown.

    Pixels are taken as square, which one scale for both directions of the picture needs. Raises
    KeyreconError for a file that is missing, empty, without pictures or damaged, and for one whose
    pixels are not square; without `square_only` that is a warning.
    """
    path = Path(path)
    if not path.is_file():
        if path.is_dir():
            raise KeyreconError(f"{path} is a folder; name the video file itself.")
        raise KeyreconError(f"There is no video at {path}; check the path and the file's name.")
    if path.stat().st_size == 0:
        raise KeyreconError(f"{path} is empty (0 bytes).")
    if not LEAST_SLOW_MOTION <= slow_motion <= MOST_SLOW_MOTION:  # which NaN is not either
        raise KeyreconError(
            f"The slow-motion factor is {slow_motion:g}; it must lie between {LEAST_SLOW_MOTION:g} "
            f"and {MOST_SLOW_MOTION:g}: 240 frames a second shown at 30 are 8."
        )
    with reading(path, "a video that can be read", "repair or re-encode it"):
        video, aspect = _index(path, start, end, slow_motion)
    check_pixels(path, aspect, square_only)
    return video


def _index(
    path: Path, start: int, end: int | None, slow_motion: float
) -> tuple[Video, Fraction | None]:
    """Find the times of the frames and how the pictures stand; how wide to high a pixel is."""
    with _open(path) as container:
        stream = container.streams.video[0]
        if stream.width * stream.height > MAX_PIXELS:
            raise ValueError(f"pictures of {stream.width}x{stream.height} are too large")
        stamps = _distinct(np.array(sorted(_shown_stamps(container, path)), dtype=np.int64))
        cut_off = _pictures_beyond(stream, path.stat().st_size)
        first = next(_decode_from(container, int(stamps[0])), None)
        if first is None:
            raise KeyreconError(f"{path}: no picture can be decoded; the file is damaged.")
        if first.pts is not None:  # where a file was cut, pictures before lack what they refer to
            stamps = stamps[stamps >= first.pts]
        seconds_per_tick = _seconds_per_tick(stream)
        turns, mirrored = _find_orientation(first, stream)
        aspect = stream.sample_aspect_ratio
    width, height = (first.width, first.height)[:: -1 if turns % 2 else 1]
    if not 0 <= start < (len(stamps) if end is None else end) <= len(stamps):
        raise KeyreconError(
            f"{path} has {len(stamps)} frames, counted from 0; it cannot be used from frame "
            f"{start} {'on' if end is None else f'up to before frame {end}'}."
        )
    if end is None and cut_off:
        raise KeyreconError(
            f"{path} ends in the middle: {len(stamps)} frames are there, "
            f"{counted(cut_off, 'frame')} missing. Copy it again, or use what is there with "
            f"--end {len(stamps)}."
        )
    stamps = stamps[start:end]
    time = even_out(stamps) * seconds_per_tick / slow_motion
    fps = 1 / float(np.median(np.diff(time))) if len(time) > 1 else 25.0
    if not MIN_FPS <= fps <= MAX_FPS or not time[-1] < len(time) / MIN_FPS:
        raise ValueError(f"{len(time)} frames in {time[-1]:g} s")
    return Video(path, width, height, stamps, time, fps, turns, mirrored, None), aspect


def _distinct(stamps: Int[np.ndarray, "N"]) -> Int[np.ndarray, "T"]:
    """Each time once; ValueError where many pictures have none of their own."""
    distinct = np.unique(stamps)
    if len(distinct) < MIN_DISTINCT * len(stamps):
        raise ValueError(f"only {len(distinct)} of {len(stamps)} pictures have a time of their own")
    return distinct


def _find_orientation(frame: av.VideoFrame, stream: av.VideoStream) -> tuple[int, bool]:
    """Quarter turns counter-clockwise, and whether the picture is mirrored before.

    The display matrix (ISO/IEC 14496-12, 8.3.2.3) shows (x, y) at (a x + c y, b x + d y). Files of
    older programs tell clockwise degrees in a tag instead.
    """
    from av.sidedata.sidedata import Type

    side_data: Any = frame.side_data  # PyAV's stubs know motion vectors alone
    matrix = side_data.get(Type.DISPLAYMATRIX)
    if matrix is None:
        tag = {name.lower(): value for name, value in stream.metadata.items()}.get("rotate", "0")
        return (-round(int(tag) / 90) % 4 if tag.lstrip("-").isdigit() else 0), False
    a, b, _, c, d = np.frombuffer(bytes(matrix)[:20], np.int32).astype(float)
    mirrored = bool(a * d - b * c < 0)
    clockwise = np.degrees(np.arctan2(-b, -a) if mirrored else np.arctan2(b, a))
    return -round(clockwise / 90) % 4, mirrored


def _open(path: Path) -> av.container.InputContainer:
    """Open a file that has pictures, or say what it is."""
    import av

    try:
        # Older programs wrote titles in other codes than UTF-8; they are of no use here.
        container = av.open(
            f"file:{path}", options={"protocol_whitelist": "file"}, metadata_errors="replace"
        )
    except (av.FFmpegError, ValueError) as fault:
        raise KeyreconError(
            f"{path} cannot be read as a video ({getattr(fault, 'strerror', fault)}); it may be "
            "cut off, or of another kind: mp4, mov, mkv and avi work."
        ) from fault
    if not container.streams.video:
        container.close()
        raise KeyreconError(f"{path} holds no pictures, only sound; a video is needed.")
    if container.format.name.endswith(PICTURES):
        container.close()
        raise KeyreconError(f"{path} is a single picture; a video is needed.")
    container.streams.video[0].thread_type = "AUTO"
    return container


def _pictures_beyond(stream: av.VideoStream, size: int) -> int:
    """Pictures that lie beyond the end of a file of `size` bytes by its own index."""
    index: Any = getattr(stream, "index_entries", ())  # older versions of PyAV do not show it
    return sum(entry.pos + entry.size > size for entry in index)


def _shown_stamps(container: av.container.InputContainer, path: Path) -> list[int]:
    """Presentation times of all packets that a player would show."""
    import av

    stamps: list[int] = []
    try:
        if lacks_presentation_times(container):
            stamps += stamps_as_decoded(container)
        else:
            for packet in container.demux(video=0):
                if packet.pts is not None and packet.size and not packet.is_discard:
                    stamps.append(packet.pts)
    except av.FFmpegError as fault:
        raise KeyreconError(
            f"{path} breaks off after {len(stamps)} frames ({fault}); repair or re-encode it."
        ) from fault
    if not stamps:
        raise KeyreconError(f"{path} holds no frames; it may have been cut off while copied.")
    return stamps


def _seconds_per_tick(stream: av.VideoStream) -> float:
    """Unit of a stream's presentation times."""
    if stream.time_base is None:
        raise KeyreconError("The video has no clock: it does not say when its pictures are shown.")
    return float(stream.time_base)


def _decode_from(container: av.container.InputContainer, stamp: int) -> Iterator[av.VideoFrame]:
    """Decode in presentation order from a key frame at or before a presentation time."""
    import av

    stream = container.streams.video[0]
    before = stamp
    for back in (0.0, 2.0, 10.0, None):
        try:
            if back is None:
                container.seek(0)
            else:
                before = stamp - int(back / _seconds_per_tick(stream))
                container.seek(before, stream=stream, backward=True, any_frame=False)
        except av.FFmpegError:  # where the index is damaged, some places cannot be sought
            continue
        frames = container.decode(stream)
        if lacks_presentation_times(container):
            frames = stamped_as_decoded(frames)
        try:
            first = next(frames, None)
            if back is not None and (first is None or first.pts is None or first.pts > stamp):
                continue
            while first is not None:
                yield first
                first = next(frames, None)
        except av.FFmpegError:
            return
        return
