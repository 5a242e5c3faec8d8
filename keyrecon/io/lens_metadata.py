"""The lens that a phone has written into its video: the focal length as 35 mm film has it.

Apple's phones write `com.apple.quicktime.camera.focal_length.35mm_equivalent` into the metadata of
the video track (AVFoundation, "track-level metadata"), as text ("26.00mm") or as a number. FFmpeg,
and so PyAV, reads the metadata of a whole movie alone, so the boxes are walked here: moov, trak,
meta, keys and ilst (QuickTime File Format, "Metadata"; ISO/IEC 14496-12 puts four bytes more in
front). Other phones, and files that went through an editor or a web site, tell nothing.
"""

import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

KEY = b"com.apple.quicktime.camera.focal_length.35mm_equivalent"
FILM_DIAGONAL = 43.27
"""mm of 36 by 24 mm: equivalence is by the diagonal (CIPA DCG-001)."""
PLAUSIBLE = (6.0, 1000.0)
"""mm that such a focal length can be."""
MOST_BYTES = 1 << 20
"""Of a box of metadata; a larger one holds something else."""
NUMBERS = {21: ">i", 22: ">I", 23: ">f", 24: ">d", 66: ">h", 67: ">i", 76: ">H", 77: ">I"}
"""Well-known types of values, of four bytes and others, as struct reads them."""


def lens_focal(path: Path, size: tuple[int, int]) -> float | None:
    """Focal length in px of a picture of this size, as the file tells it; None where it does not.

    Stabilised and slow-motion video shows less than the lens does, which the file does not say.
    """
    try:
        with path.open("rb") as file:
            film = _equivalent(file, path.stat().st_size)
    except (struct.error, OSError):
        return None
    if film is None or not PLAUSIBLE[0] <= film <= PLAUSIBLE[1]:
        return None
    return film / FILM_DIAGONAL * float(size[0] ** 2 + size[1] ** 2) ** 0.5


def _equivalent(file: BinaryIO, end: int) -> float | None:
    """mm; that of a track before that of the whole movie."""
    for kind, first, last in _boxes(file, 0, end):
        if kind != b"moov":
            continue
        tracks = [box for box in _boxes(file, first, last) if box[0] == b"trak"]
        for _, start, stop in (*tracks, (b"moov", first, last)):
            for inner, a, b in _boxes(file, start, stop):
                if inner == b"meta" and (found := _value(file, a, b)) is not None:
                    return found
    return None


def _boxes(file: BinaryIO, start: int, end: int) -> Iterator[tuple[bytes, int, int]]:
    """Kind, first byte and end of what is in each box between two places of a file."""
    at = start
    while at + 8 <= end:
        file.seek(at)
        length, kind = struct.unpack(">I4s", file.read(8))
        head = 8
        if length == 1:
            (length,) = struct.unpack(">Q", file.read(8))
            head = 16
        elif length == 0:
            length = end - at
        if length < head or at + length > end:
            return
        yield kind, at + head, at + length
        at += length


def _value(file: BinaryIO, start: int, end: int) -> float | None:
    """What a box of metadata says of `KEY`."""
    if end - start > MOST_BYTES:
        return None
    for skipped in (0, 4):
        boxes = {kind: (a, b) for kind, a, b in _boxes(file, start + skipped, end)}
        if {b"keys", b"ilst"} <= set(boxes):
            break
    else:
        return None
    number = _key_number(file, *boxes[b"keys"])
    for kind, a, b in _boxes(file, *boxes[b"ilst"]):
        if number is not None and kind == struct.pack(">I", number):
            for inner, first, last in _boxes(file, a, b):
                if inner == b"data":
                    file.seek(first)
                    return _number(file.read(last - first))
    return None


def _key_number(file: BinaryIO, start: int, end: int) -> int | None:
    """Which of the keys is ours, from 1."""
    file.seek(start)
    (count,) = struct.unpack(">4xI", file.read(8))
    at = start + 8
    for number in range(1, min(count, 10_000) + 1):
        if at + 8 > end:
            return None
        file.seek(at)
        length, _ = struct.unpack(">I4s", file.read(8))
        if length < 8:
            return None
        if file.read(length - 8) == KEY:
            return number
        at += length
    return None


def _number(data: bytes) -> float | None:
    """A value as text or as a number: type, language, and the value itself."""
    (kind,) = struct.unpack(">I", data[:4])
    value = data[8:]
    if kind in NUMBERS:
        return float(struct.unpack(NUMBERS[kind], value)[0])
    found = re.search(rb"\d+(?:\.\d+)?", value)
    return float(found.group()) if found else None
