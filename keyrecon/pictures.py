"""Frames of a video made small, read ahead of the work on them.

Reading and reducing a picture costs as much as the work on the small one. A thread does it ahead:
decoders and OpenCV let go of Python's lock, so two cores share the load.
"""

from collections.abc import Callable, Iterator
from contextlib import closing
from queue import Full, Queue
from threading import Event, Thread

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from keyrecon.video import Video

AHEAD = 4
"""Pictures that wait for their turn."""
POLL = 0.1
"""How soon the reading thread notices that nobody listens any more, seconds."""


def read_small(
    video: Video, width: int, wanted: set[int] | None = None
) -> Iterator[UInt8[np.ndarray, "h w 3"]]:
    """The frames (or the wanted ones) of a video, reduced to a width, in order."""

    def small() -> Iterator[UInt8[np.ndarray, "h w 3"]]:
        last = len(video) if wanted is None else max(wanted) + 1
        for number, picture in enumerate(video.frames(stop=last)):
            if wanted is None or number in wanted:
                yield reduce_picture(picture, width)

    return _ahead(small)


def reduce_picture(
    picture: UInt8[np.ndarray, "h w 3"], width: int
) -> UInt8[np.ndarray, "y x 3"]:
    """A picture reduced to a width; halved by averaging first, so that nothing aliases."""
    height = max(1, round(picture.shape[0] * width / picture.shape[1]))
    while picture.shape[1] >= 2 * width and picture.shape[0] >= 2 * height:
        half = (picture.shape[1] // 2, picture.shape[0] // 2)
        even = picture[: 2 * half[1], : 2 * half[0]]
        picture = cv2.resize(even, half, interpolation=cv2.INTER_AREA)
    if picture.shape[1] == width and picture.shape[0] == height:
        return picture
    return cv2.resize(picture, (width, height), interpolation=cv2.INTER_LINEAR)


def shrinking(shrink: float) -> Float[np.ndarray, "3 3"]:
    """Full to reduced pixels; a reduced pixel's centre is that of the block it averages."""
    offset = (shrink - 1) / 2
    return np.array([[shrink, 0, offset], [0, shrink, offset], [0, 0, 1]])


Entry = tuple[np.ndarray | None, Exception | None]


def _ahead(make: Callable[[], Iterator[np.ndarray]]) -> Iterator[np.ndarray]:
    """Items of an iterator, made in a thread a few ahead of their use."""
    waiting: Queue[Entry] = Queue(AHEAD)
    unwanted = Event()
    thread = Thread(target=_produce, args=(make, waiting, unwanted), daemon=True)
    thread.start()
    try:
        while True:
            item, fault = waiting.get()
            if fault is not None:
                raise fault
            if item is None:
                return
            yield item
    finally:
        unwanted.set()
        thread.join()


def _produce(
    make: Callable[[], Iterator[np.ndarray]], waiting: Queue[Entry], unwanted: Event
) -> None:
    """Put items into the queue until they end, fail or are no longer wanted."""
    try:
        with closing(make()) as items:
            for item in items:
                if not _put(waiting, (item, None), unwanted):
                    return
    except Exception as fault:  # noqa: BLE001 - raised again where the items are used
        _put(waiting, (None, fault), unwanted)
    else:
        _put(waiting, (None, None), unwanted)


def _put(waiting: Queue[Entry], entry: Entry, unwanted: Event) -> bool:
    """Wait for room in the queue; False if nobody listens any more."""
    while not unwanted.is_set():
        try:
            waiting.put(entry, timeout=POLL)
        except Full:
            continue
        return True
    return False
