"""Exact frames as JPEG: made once, kept in a folder, and ready before they are asked for.

A frame deep inside a group of pictures costs the decoding of all before it, so that single
requests would be slow. One thread therefore decodes a run of neighbours for each frame that is
asked for, the frame itself first; what was asked last is answered first. When nobody asks, it
makes the pictures of the keyframes, so that going from one to the next only reads a file.

The folder is a cache: nothing waits until a picture has reached the disk. Each file ends in the
CRC-32 of its picture, so one that a loss of power tore counts as not made.
"""

import hashlib
import zlib
from collections.abc import Iterable
from concurrent.futures import Future
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
"""Widths that stills are kept in, beside the full one, px."""
RUN = 24
"""Neighbours decoded together: seeking costs as much as some hundred frames."""
QUALITY = 90
"""JPEG quality: contours stay where they are."""
MOST_BYTES = 2_000_000_000
"""Stills kept on the disk; at the start the oldest of more go."""

Order = tuple[int, int, Future[bytes] | None]
"""A frame, the width to keep it in, and whoever waits for it."""


class FrameCache:
    """Pictures of a video by frame number."""

    def __init__(self, video: Video, folder: Path) -> None:
        """Keep stills of `video` in a folder of their own under `folder`."""
        self.video = video
        told = video.fingerprint.encode() + video.stamps.tobytes()
        self.identity = hashlib.sha256(told).hexdigest()[:16]
        """Tells this video and trim from others."""
        self.folder = folder / self.identity
        make_folder(self.folder)
        _forget_oldest(folder)
        self._changed = Condition()
        self._asked: list[Order] = []
        self._coming: list[Order] = []
        self._closed = False
        self._thread = Thread(target=self._work, name="stills", daemon=True)
        self._thread.start()

    def still(self, frame: int, width: int | None = None) -> Future[bytes]:
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
                self._asked.append((frame, kept, waiting))
                self._changed.notify()
        return waiting

    def prepare(self, frames: Iterable[int], width: int | None = None) -> None:
        """Make these stills when there is nothing else to do, in this order."""
        kept = self._kept_width(width)
        orders: list[Order] = [(frame, kept, None) for frame in frames]
        with self._changed:
            self._coming = orders[::-1]
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
        while order := self._next():
            frame, width, waiting = order
            try:
                if _read(self._path(frame, width)) is None:
                    self._make(frame, width, alone=waiting is None)
                self._answer_waiting()
                self._give_up(order, KeyreconError(f"Frame {frame} cannot be kept."))
            except Exception as fault:  # noqa: BLE001 - raised again where the still was asked for
                self._give_up(order, fault)

    def _next(self) -> Order | None:
        """What to do next; waits for it, None at the end. Who asked stays listed till answered."""
        with self._changed:
            while not (self._asked or self._coming or self._closed):
                self._changed.wait()
            if self._closed:
                return None
            return self._asked[-1] if self._asked else self._coming.pop()

    def _make(self, frame: int, width: int, alone: bool) -> None:
        """Decode a run of frames; keep the one asked for first, then what else is asked of it."""
        first = frame if alone else frame - frame % RUN
        span = range(first, frame + 1 if alone else min(first + RUN, len(self.video)))
        run = {}
        for number, picture in enumerate(self.video.frames(first, span.stop), first):
            run[number] = reduce_picture(picture, width)
            if number == frame:
                self._keep(frame, run[frame])
                self._answer_waiting()
        asked, _ = self._waited_for(span, width)
        for number in sorted(run, key=lambda n: (n not in asked, abs(n - frame))):
            if number not in asked and self._waited_for(span, width)[1]:
                return
            if _read(self._path(number, width)) is None:
                self._keep(number, run[number])
                self._answer_waiting()

    def _waited_for(self, span: range, width: int) -> tuple[set[int], bool]:
        """Frames of a run that someone waits for, and whether someone waits for any other."""
        with self._changed:
            here = {f for f, kept, _ in self._asked if f in span and kept == width}
            other = any(f not in span or kept != width for f, kept, _ in self._asked)
        return here, other

    def _keep(self, frame: int, picture: UInt8[np.ndarray, "h w 3"]) -> None:
        data = encode_jpeg(picture)
        write_quickly(self._path(frame, picture.shape[1]), data + _checksum(data))

    def _answer_waiting(self) -> None:
        """Answer all whose still has been made meanwhile."""
        with self._changed:
            found = [(order, _read(self._path(order[0], order[1]))) for order in self._asked]
            self._asked = [order for order, data in found if data is None]
        for (_, _, waiting), data in found:
            if data and waiting and waiting.set_running_or_notify_cancel():  # else nobody waits
                waiting.set_result(data)

    def _give_up(self, order: Order, fault: Exception) -> None:
        """Tell whoever still waits for an order that nothing came of it."""
        with self._changed:
            left = [other for other in self._asked if other is order]
            self._asked = [other for other in self._asked if other is not order]
        for _, _, waiting in left:
            if waiting and waiting.set_running_or_notify_cancel():
                waiting.set_exception(fault)


def encode_jpeg(picture: UInt8[np.ndarray, "h w 3"]) -> bytes:
    """An RGB picture as JPEG."""
    turned = cv2.cvtColor(picture, cv2.COLOR_RGB2BGR)
    return cv2.imencode(".jpg", turned, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1].tobytes()


def encode_png(picture: UInt8[np.ndarray, "h w 4"]) -> bytes:
    """An RGBA picture as PNG."""
    return cv2.imencode(".png", cv2.cvtColor(picture, cv2.COLOR_RGBA2BGRA))[1].tobytes()


def _checksum(data: bytes) -> bytes:
    return zlib.crc32(data).to_bytes(4, "big")


def _read(path: Path) -> bytes | None:
    """A still that was kept; None if there is none, or if it is not whole."""
    try:
        kept = path.read_bytes()
    except FileNotFoundError:
        return None
    return kept[:-4] if len(kept) > 4 and kept[-4:] == _checksum(kept[:-4]) else None


def _forget_oldest(folder: Path) -> None:
    """Delete the oldest stills beyond what may be kept."""
    found = sorted(folder.rglob("*.jpg"), key=lambda path: -path.stat().st_mtime)
    kept = 0
    for path in found:
        kept += path.stat().st_size
        if kept > MOST_BYTES:
            path.unlink()
