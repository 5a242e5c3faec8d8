"""Exact frames as JPEG: made once, kept in a folder, and ready before they are requested.

A frame deep inside a group of pictures costs the decoding of all before it, so that single
requests would be slow. One thread therefore decodes a run of neighbours for each frame that is
requested, the frame itself first; the last request is answered first. When there is none, it
makes the pictures of the keyframes, so that going from one to the next only reads a file.

The folder is a cache: nothing waits until a picture has reached the disk. Each file ends in the
CRC-32 of its picture, so one that a loss of power tore counts as not made.
"""

import hashlib
import zlib
from collections.abc import Iterable
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from threading import Condition, Thread

import cv2
import numpy as np
from jaxtyping import UInt8

from keyrecon.errors import KeyreconError
from keyrecon.io.durable import make_folder, write_quickly
from keyrecon.io.frame_reader import reduce_picture
from keyrecon.io.video import Video

WIDTHS = (320, 640, 960, 1280)
"""Widths that pictures are kept in, beside the full one, px."""
RUN_LENGTH = 24
"""Frames decoded together: seeking costs as much as some hundred frames."""
JPEG_QUALITY = 90
"""Contours stay where they are."""
MAX_CACHE_BYTES = 2_000_000_000
"""Pictures kept on the disk; at the start the oldest of more go."""


@dataclass(frozen=True, eq=False)
class FrameRequest:
    """A frame to make, the width to keep it in, and whoever waits for it."""

    frame: int
    width: int
    waiting: Future[bytes] | None = None


class FrameCache:
    """Pictures of a video by frame number."""

    def __init__(self, video: Video, folder: Path) -> None:
        """Keep pictures of `video` in a folder of their own under `folder`."""
        self.video = video
        identity = video.fingerprint.encode() + video.stamps.tobytes()
        self.identity = hashlib.sha256(identity).hexdigest()[:16]
        """Tells this video and trim from others."""
        self.folder = folder / self.identity
        make_folder(self.folder)
        _forget_oldest(folder)
        self._changed = Condition()
        self._requested: list[FrameRequest] = []
        self._upcoming: list[FrameRequest] = []
        self._closed = False
        self._thread = Thread(target=self._work, name="frames", daemon=True)
        self._thread.start()

    def jpeg(self, frame: int, width: int | None = None) -> Future[bytes]:
        """The JPEG of one frame, at least `width` wide (the full size without it)."""
        if not 0 <= frame < len(self.video):
            raise KeyreconError(
                f"There is no frame {frame}: the video has frames 0 to {len(self.video) - 1}."
            )
        waiting: Future[bytes] = Future()
        kept = self._kept_width(width)
        if data := _read(self._path(frame, kept)):
            waiting.set_result(data)
        else:
            with self._changed:
                self._requested.append(FrameRequest(frame, kept, waiting))
                self._changed.notify()
        return waiting

    def prepare(self, frames: Iterable[int], width: int | None = None) -> None:
        """Make these pictures when there is nothing else to do, in this order."""
        kept = self._kept_width(width)
        upcoming = [FrameRequest(frame, kept) for frame in frames]
        with self._changed:
            self._upcoming = upcoming[::-1]
            self._changed.notify()

    def close(self) -> None:
        """Stop the thread."""
        with self._changed:
            self._closed = True
            self._changed.notify()
        self._thread.join()

    def _path(self, frame: int, width: int) -> Path:
        return self.folder / f"{frame:07d}-{width}.jpg"

    def _kept_width(self, width: int | None) -> int:
        fitting = [w for w in WIDTHS if width and width <= w < self.video.width]
        return fitting[0] if fitting else self.video.width

    def _work(self) -> None:
        while request := self._next():
            try:
                if _read(self._path(request.frame, request.width)) is None:
                    self._make(request)
                self._answer_waiting()
                self._give_up(request, KeyreconError(f"Frame {request.frame} cannot be kept."))
            except Exception as fault:  # noqa: BLE001 - raised again where the frame was requested
                self._give_up(request, fault)

    def _next(self) -> FrameRequest | None:
        """What to do next; waits for it, None at the end. A request stays listed till answered."""
        with self._changed:
            while not (self._requested or self._upcoming or self._closed):
                self._changed.wait()
            if self._closed:
                return None
            return self._requested[-1] if self._requested else self._upcoming.pop()

    def _make(self, request: FrameRequest) -> None:
        """Decode a run of frames; keep the requested one first, then what else is requested of it.

        A frame that nobody waits for is made alone.
        """
        frame, width, alone = request.frame, request.width, request.waiting is None
        first = frame if alone else frame - frame % RUN_LENGTH
        span = range(first, frame + 1 if alone else min(first + RUN_LENGTH, len(self.video)))
        run = {}
        for number, picture in enumerate(self.video.frames(first, span.stop), first):
            run[number] = reduce_picture(picture, width)
            if number == frame:
                self._keep(frame, run[frame])
                self._answer_waiting()
        requested, _ = self._waited_for(span, width)
        for number in sorted(run, key=lambda n: (n not in requested, abs(n - frame))):
            if number not in requested and self._waited_for(span, width)[1]:
                return
            if _read(self._path(number, width)) is None:
                self._keep(number, run[number])
                self._answer_waiting()

    def _waited_for(self, span: range, width: int) -> tuple[set[int], bool]:
        """Frames of a run that someone waits for, and whether someone waits for any other."""
        with self._changed:
            here = {r.frame for r in self._requested if r.frame in span and r.width == width}
            other = any(r.frame not in span or r.width != width for r in self._requested)
        return here, other

    def _keep(self, frame: int, picture: UInt8[np.ndarray, "h w 3"]) -> None:
        data = encode_jpeg(picture)
        write_quickly(self._path(frame, picture.shape[1]), data + _checksum(data))

    def _answer_waiting(self) -> None:
        """Answer all whose frame has been made meanwhile."""
        with self._changed:
            read = [(one, _read(self._path(one.frame, one.width))) for one in self._requested]
            self._requested = [one for one, data in read if data is None]
        for one, data in read:
            if data and one.waiting and one.waiting.set_running_or_notify_cancel():
                one.waiting.set_result(data)  # else nobody waits

    def _give_up(self, request: FrameRequest, fault: Exception) -> None:
        """Raise `fault` for whoever still waits for a request."""
        with self._changed:
            listed = request in self._requested
            self._requested = [other for other in self._requested if other is not request]
        waiting = request.waiting
        if listed and waiting and waiting.set_running_or_notify_cancel():
            waiting.set_exception(fault)


def encode_jpeg(picture: UInt8[np.ndarray, "h w 3"]) -> bytes:
    """An RGB picture as JPEG."""
    turned = cv2.cvtColor(picture, cv2.COLOR_RGB2BGR)
    return cv2.imencode(".jpg", turned, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1].tobytes()


def encode_png(picture: UInt8[np.ndarray, "h w 4"]) -> bytes:
    """An RGBA picture as PNG."""
    return cv2.imencode(".png", cv2.cvtColor(picture, cv2.COLOR_RGBA2BGRA))[1].tobytes()


def _checksum(data: bytes) -> bytes:
    return zlib.crc32(data).to_bytes(4, "big")


def _read(path: Path) -> bytes | None:
    """A picture that was kept; None if there is none, or if it is not whole."""
    try:
        kept = path.read_bytes()
    except FileNotFoundError:
        return None
    return kept[:-4] if len(kept) > 4 and kept[-4:] == _checksum(kept[:-4]) else None


def _forget_oldest(folder: Path) -> None:
    """Delete the oldest pictures beyond what may be kept."""
    files = sorted(folder.rglob("*.jpg"), key=lambda path: -path.stat().st_mtime)
    kept = 0
    for path in files:
        kept += path.stat().st_size
        if kept > MAX_CACHE_BYTES:
            path.unlink()
