"""Frames of a video made small, read ahead of the work on them, and worked on side by side.

Reading and reducing a picture costs as much as the work on the small one. A thread does it ahead,
and others work on several frames at a time: decoders, OpenCV and NumPy let go of Python's lock, so
the cores share the load.
"""

from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from queue import Full, Queue
from threading import Event, Thread
from typing import Any, TypeVar

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from keyrecon.io.video import Video
from keyrecon.numerics.threads import core_count

Item = TypeVar("Item")
Result = TypeVar("Result")

MOST_THREADS = 4
"""Frames worked on at a time: beyond it the reading thread is what all wait for."""
AHEAD = 4
"""Pictures that wait for their turn."""
POLL = 0.1
"""How soon the reading thread notices that nobody listens any more, seconds."""


def read_small(
    video: Video, width: int, wanted: set[int] | None = None
) -> Iterator[UInt8[np.ndarray, "h w 3"]]:
    """The frames (or the wanted ones) of a video, reduced to a width, in order."""

    def small() -> Generator[UInt8[np.ndarray, "h w 3"], None, None]:
        pictures = video.frames() if wanted is None else video.chosen_frames(wanted, max(wanted))
        for picture in pictures:
            yield reduce_picture(picture, width)

    return _ahead(small)


def read_grey(video: Video, width: int) -> Iterator[UInt8[np.ndarray, "h w"]]:
    """The brightness of all frames of a video, reduced to a width, in order."""

    def small() -> Generator[UInt8[np.ndarray, "h w"], None, None]:
        for picture in video.grey_frames():
            yield np.ascontiguousarray(reduce_picture(picture, width))

    return _ahead(small)


def side_by_side(
    work: Callable[[Item], Result], items: Iterable[Item], threads: int | None = None
) -> Iterator[Result]:
    """`work` done on every item, in order, a few at a time; by default one thread per core."""
    threads = threads or min(MOST_THREADS, core_count())
    pending: deque[Future[Result]] = deque()
    with ThreadPoolExecutor(threads) as pool:
        try:
            for item in items:
                pending.append(pool.submit(work, item))
                if len(pending) > threads:
                    yield pending.popleft().result()
            while pending:
                yield pending.popleft().result()
        finally:
            for future in pending:
                future.cancel()


def in_threads(work: Callable[..., Result], inputs: Iterable[tuple[Any, ...]]) -> Iterator[Result]:
    """Pieces of a stage's work (`parallel_map.ParallelMap`) that are done here, side by side."""
    return side_by_side(lambda arguments: work(*arguments), inputs)


def reduce_picture(picture: UInt8[np.ndarray, "h w *c"], width: int) -> UInt8[np.ndarray, "y x *c"]:
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


def _ahead(make: Callable[[], Generator[np.ndarray, None, None]]) -> Iterator[np.ndarray]:
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
    make: Callable[[], Generator[np.ndarray, None, None]], waiting: Queue[Entry], unwanted: Event
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
