"""A video that is decoded once, however often it is read.

Decoding costs more than most work on a picture; a golf fit reads its few hundred frames a dozen
times, and the stages that follow a player read those of a shot four times. Frames are held as the
codec stores them, at half of the size of RGB, so that whoever reads them gets the same pixels as
from the file. What does not fit into memory lies in a temporary file; its rows are padded
otherwise, which the scaler of FFmpeg may round otherwise (`width` of `frames`).
"""

import tempfile
import weakref
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from functools import cached_property
from threading import Lock
from typing import IO, TYPE_CHECKING

import numpy as np
from jaxtyping import Float, Int

from keyrecon.io.video import Video

if TYPE_CHECKING:
    import av

MOST_IN_MEMORY = 1.5e9
"""Bytes of decoded frames that are held in memory: ten seconds of 1920 x 1080 at 48 frames per
second; a computer on which one looks at such videos has several times as much."""

LEAST_BYTES_PER_PIXEL = 1.5
"""Of a decoded frame: brightness in full, two colours of a quarter of the size."""


@dataclass(frozen=True, eq=False)
class HeldVideo(Video):
    """A video whose frames are held once they have been decoded."""

    source: Video
    most_in_memory: float = MOST_IN_MEMORY
    """Bytes; what is beyond lies in a temporary file."""

    @property
    def name(self) -> str:
        """That of the source."""
        return self.source.name

    @property
    def file_starts(self) -> tuple[int, ...]:
        """Those of the source."""
        return self.source.file_starts

    @cached_property
    def fingerprint(self) -> str:
        """That of the source."""
        return self.source.fingerprint

    def part(self, frames: slice | Int[np.ndarray, "n"]) -> Video:
        """That of the source, which decodes nothing again that was decoded for the whole."""
        shown = replace(
            self.source, turns=self.turns, mirrored=self.mirrored, exposure=self.exposure
        ).part(frames)
        if not self._held.is_filled:
            return shown
        part = hold_frames(shown, self.most_in_memory)
        vars(part)["_held"] = self._held.part(frames)
        return part

    @cached_property
    def _held(self) -> "_HeldFrames":
        return _HeldFrames(self.source, self.most_in_memory)

    def _decoded(self, start: int, stop: int | None) -> "Iterator[av.VideoFrame]":
        yield from self._held.read(start, len(self) if stop is None else min(stop, len(self)))


def hold_frames(video: Video, most_in_memory: float = MOST_IN_MEMORY) -> HeldVideo:
    """The same video, decoded only once."""
    inherited = {field.name: getattr(video, field.name) for field in fields(Video)}
    return HeldVideo(**inherited, source=video, most_in_memory=most_in_memory)


def hold_if_small(video: Video, most_in_memory: float = MOST_IN_MEMORY) -> Video:
    """The same video, decoded only once where all of its frames can be held in memory."""
    if isinstance(video, HeldVideo):
        return video
    size = LEAST_BYTES_PER_PIXEL * video.width * video.height * len(video)
    return hold_frames(video, most_in_memory) if size < most_in_memory else video


def shows_same(video: Video, other: Video) -> bool:
    """Whether both have the same frames of the same files, whatever is done to these."""
    return video.fingerprint == other.fingerprint and np.array_equal(video.stamps, other.stamps)


def share_decoded(video: HeldVideo, other: HeldVideo) -> HeldVideo:
    """A video with what another one, which shows the same, has decoded of it or will have."""
    vars(video)["_held"] = other._held
    return video


def mirror_video(video: Video) -> Video:
    """The same video with left and right exchanged; what one has decoded the other has too."""
    other = replace(video, mirrored=not video.mirrored, turns=-video.turns % 4)
    return _with_decoded(other, video)


def with_exposure(video: Video, exposure: Float[np.ndarray, "T"] | None) -> Video:
    """The same video, its frames read as if all had been exposed alike; None: as filmed.

    What one has decoded the other has too.
    """
    if exposure is video.exposure:
        return video
    return _with_decoded(replace(video, exposure=exposure), video)


def _with_decoded(other: Video, video: Video) -> Video:
    if isinstance(video, HeldVideo):
        vars(other)["_held"] = video._held
    return other


@dataclass(frozen=True)
class _StoredFrame:
    """How a frame lies in the file."""

    place: int
    """Of its first byte."""
    format: str
    width: int
    height: int
    colorspace: int
    color_range: int
    planes: tuple[tuple[int, int], ...]
    """Rows of every plane and bytes in each of them."""


class _HeldFrames:
    """Decoded frames, the first ones in memory, the others in an unnamed file."""

    def __init__(self, source: Video, most_in_memory: float) -> None:
        """Hold all frames of a video once any is read."""
        self._source = source
        self._most_in_memory = most_in_memory
        self._memory: list[av.VideoFrame] = []
        self._stored: list[_StoredFrame] = []
        self._file: IO[bytes] | None = None
        self._lock = Lock()

    @property
    def is_filled(self) -> bool:
        """Whether the frames have been decoded."""
        return len(self._memory) + len(self._stored) == len(self._source)

    def read(self, start: int, stop: int) -> "Iterator[av.VideoFrame]":
        """Frames start..stop-1."""
        with self._lock:
            if not self.is_filled:
                self._fill()
        for number in range(start, stop):
            yield self._frame(number)

    def part(self, frames: slice | Int[np.ndarray, "n"]) -> "_HeldPart":
        """Some of the frames, which are held once."""
        return _HeldPart(self, np.arange(len(self._source))[frames])

    def _fill(self) -> None:
        """Decode all frames."""
        self._memory.clear()
        self._stored.clear()
        held = 0
        for frame in self._source._decoded(0, None):
            held += sum(plane.buffer_size for plane in frame.planes)
            if held <= self._most_in_memory:
                self._memory.append(frame)
            else:
                self._store(frame)

    def _frame(self, number: int) -> "av.VideoFrame":
        if number < len(self._memory):
            return self._memory[number]
        return self._restore(self._stored[number - len(self._memory)])

    def _store(self, frame: "av.VideoFrame") -> None:
        if self._file is None:
            self._file = tempfile.TemporaryFile()  # noqa: SIM115 - lives as long as the frames
            weakref.finalize(self, self._file.close)
        planes = tuple((plane.height, plane.line_size) for plane in frame.planes)
        self._stored.append(
            _StoredFrame(
                self._file.tell(), frame.format.name, frame.width, frame.height,
                int(frame.colorspace), int(frame.color_range), planes,
            )
        )  # fmt: skip
        for plane, (rows, size) in zip(frame.planes, planes, strict=True):
            self._file.write(memoryview(plane)[: rows * size])

    def _restore(self, stored: _StoredFrame) -> "av.VideoFrame":
        import av

        frame = av.VideoFrame(stored.width, stored.height, stored.format)
        frame.colorspace, frame.color_range = stored.colorspace, stored.color_range
        with self._lock:
            if self._file is None:
                raise ValueError("no frame was stored")
            self._file.seek(stored.place)
            planes = [self._file.read(rows * size) for rows, size in stored.planes]
        for plane, pixels, (rows, size) in zip(frame.planes, planes, stored.planes, strict=True):
            target = np.frombuffer(memoryview(plane), np.uint8)
            target = target[: rows * plane.line_size].reshape(rows, -1)
            source = np.frombuffer(pixels, np.uint8).reshape(rows, size)
            width = min(size, plane.line_size)  # both have all pixels and some padding
            target[:, :width] = source[:, :width]
        return frame


@dataclass(frozen=True)
class _HeldPart:
    """Some of the frames that are held for a video."""

    whole: _HeldFrames
    numbers: Int[np.ndarray, "n"]
    is_filled = True

    def read(self, start: int, stop: int) -> "Iterator[av.VideoFrame]":
        """Frames start..stop-1 of the part."""
        for number in self.numbers[start:stop].tolist():
            yield from self.whole.read(number, number + 1)

    def part(self, frames: slice | Int[np.ndarray, "n"]) -> "_HeldPart":
        """Some of them."""
        return _HeldPart(self.whole, self.numbers[frames])
