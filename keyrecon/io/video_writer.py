"""Write pictures as an H.264 video that any player opens."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from keyrecon.errors import KeyreconError
from keyrecon.io.durable import replacing, write_durably

THREADS = 4
"""Of the encoder on any machine: another number of threads would write other bits."""


def write_video(
    path: Path,
    frames: Iterable[UInt8[np.ndarray, "h w 3"]],
    fps: float,
    crf: int = 23,
    seek_every: int | None = None,
    comment: str = "",
) -> int:
    """Encode RGB pictures of one size as they come (8 bit 4:2:0); returns how many there were.

    `crf` is x264's constant quality, 18 very good to 28 coarse. An odd last row or column is left
    out, because 4:2:0 needs even sizes. `seek_every` so many frames there is one that players can
    jump to at once; by default one in 250. A `comment` stands in the file (`comment_of`). The file
    appears when it is whole. Raises KeyreconError when there are no frames, or where the file
    cannot be written.
    """
    import av

    count = 0
    stream = None
    with replacing(path) as file, av.open(file, "w", format="mp4") as container:
        if comment:
            container.metadata["comment"] = comment
        for count, picture in enumerate(frames, start=1):  # noqa: B007
            height, width = (n - n % 2 for n in picture.shape[:2])
            if stream is None:
                stream = container.add_stream("libx264", rate=Fraction(fps).limit_denominator(1001))
                stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
                # x264's macroblock tree depends on where its memory lies: other bits in each run
                parameters = "mbtree=0"
                stream.options = {"crf": str(crf), "preset": "veryfast", "x264-params": parameters}
                if seek_every:
                    stream.options |= {"g": str(seek_every), "bf": "0"}
                stream.thread_type = "AUTO"
                stream.codec_context.thread_count = THREADS
            frame = av.VideoFrame.from_ndarray(
                np.ascontiguousarray(picture[:height, :width]), format="rgb24"
            )
            container.mux(stream.encode(frame))
        if stream is None:
            raise KeyreconError(f"No frames came to be written to {path}; give at least one.")
        container.mux(stream.encode())
    return count


def comment_of(path: Path) -> str:
    """The comment that a video was written with; empty for one without, and for what is none."""
    import av

    try:
        with av.open(str(path)) as container:
            return container.metadata.get("comment", "")
    except av.FFmpegError:
        return ""


def write_picture(path: Path, picture: UInt8[np.ndarray, "h w 3"]) -> None:
    """Write one RGB picture as PNG."""
    import cv2

    turned = cv2.cvtColor(picture, cv2.COLOR_RGB2BGR)
    write_durably(path, cv2.imencode(".png", turned)[1].tobytes())
