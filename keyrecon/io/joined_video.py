"""Several files of one player as one video: the frames of one after those of the other.

Frames are numbered on through all files, and time goes on from file to file by a frame, since when
the next was filmed is not known. Where a file begins the picture cuts (`Video.file_starts`).
"""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Int

from keyrecon.errors import KeyreconError
from keyrecon.io.video import Video

if TYPE_CHECKING:
    import av

SAME_RATE = 0.02
"""Share by which frame rates may differ: 29.97 and 30 are one, 25 and 30 are not."""


@dataclass(frozen=True, eq=False)
class JoinedVideo(Video):
    """Files one after the other; `stamps` go on from file to file."""

    files: tuple[Video, ...]
    begins: Int[np.ndarray, "n"]
    """Where the stamps of each file begin."""

    @property
    def name(self) -> str:
        """What people call it."""
        return " + ".join(file.name for file in self.files)

    @cached_property
    def fingerprint(self) -> str:
        """Tells these files from others."""
        fingerprints = "".join(file.fingerprint for file in self.files)
        return hashlib.sha256(fingerprints.encode()).hexdigest()[:32]

    @property
    def file_starts(self) -> tuple[int, ...]:
        """Frames with which another file begins."""
        starts = set(np.searchsorted(self.stamps, self.begins[1:]).tolist())
        return tuple(sorted(starts - {0, len(self)}))

    def part(self, frames: slice | Int[np.ndarray, "n"]) -> Video:
        """A video of some frames; its times stay those of the whole."""
        return replace(self, **self._of_frames(frames))

    def _decoded(self, start: int, stop: int | None) -> "Iterator[av.VideoFrame]":
        stop = len(self) if stop is None else min(stop, len(self))
        inner = [frame for frame in self.file_starts if start < frame < stop]
        for first, last in pairwise([start, *inner, stop]) if start < stop else ():
            number = int(np.searchsorted(self.begins, self.stamps[first], side="right")) - 1
            file = self.files[number]
            stamps = self.stamps[first:last] - self.begins[number] + file.stamps[0]
            piece = replace(file, stamps=stamps, time=self.time[first:last], exposure=None)
            yield from piece._decoded(0, None)


def join_videos(files: Sequence[Video]) -> Video:
    """One video of several files; of one, that itself.

    Raises KeyreconError for pictures of another size, or that stand otherwise, and for another
    frame rate than the first file's.
    """
    first = files[0]
    if len(files) == 1:
        return first
    for file in files[1:]:
        _check_alike(first, file)
    lengths = np.array([file.stamps[-1] - file.stamps[0] + 1 for file in files])
    begins = np.cumsum(lengths) - lengths
    stamps = [
        file.stamps - file.stamps[0] + begin for file, begin in zip(files, begins, strict=True)
    ]
    seconds = np.array([file.time[-1] + 1 / file.fps for file in files])
    starts = np.cumsum(seconds) - seconds
    times = [file.time + start for file, start in zip(files, starts, strict=True)]
    inherited = {field.name: getattr(first, field.name) for field in fields(Video)}
    inherited |= {"stamps": np.concatenate(stamps), "time": np.concatenate(times)}
    return JoinedVideo(**inherited, files=tuple(files), begins=begins)


def _check_alike(first: Video, other: Video) -> None:
    """Raise KeyreconError where the two cannot be one video."""
    remedy = f"re-encode it like {first.path.name}, or start a project of its own for it."
    if (other.width, other.height) != (first.width, first.height):
        raise KeyreconError(
            f"{other.path} has pictures of {other.width}x{other.height}, {first.path.name} of "
            f"{first.width}x{first.height}; {remedy}"
        )
    if (other.turns, other.mirrored) != (first.turns, first.mirrored):
        raise KeyreconError(
            f"The pictures of {other.path} are stored turned otherwise than those of "
            f"{first.path.name}; {remedy}"
        )
    if abs(other.fps / first.fps - 1) > SAME_RATE:
        raise KeyreconError(
            f"{other.path} has {other.fps:.4g} frames per second of real time, {first.path.name} "
            f"{first.fps:.4g}; {remedy}"
        )
