"""Times of pictures in files that do not tell when to show them.

AVI knows the order in which packets are decoded and nothing else. With B pictures that is another
one than that of presentation. FFmpeg makes presentation times up, and errs where DivX has put a
packet beside the first picture that holds no picture itself, or two pictures into one packet. But
pictures of MPEG-4 leave the decoder in the order of presentation, each when a packet goes in: that
packet's time is theirs. Which packets bring one out only decoding tells.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import av


def lacks_presentation_times(container: av.container.InputContainer) -> bool:
    """Whether it is MPEG-4 with B pictures in AVI."""
    coding = container.streams.video[0].codec_context
    return container.format.name == "avi" and coding.name == "mpeg4" and bool(coding.has_b_frames)


def stamps_as_decoded(container: av.container.InputContainer) -> Iterator[int]:
    """Times of all pictures; they are decoded for it."""
    for frame in stamped_as_decoded(container.decode(video=0)):
        if frame.pts is not None:
            yield frame.pts


def stamped_as_decoded(frames: Iterator[av.VideoFrame]) -> Iterator[av.VideoFrame]:
    """The frames with the times of the packets that brought them out, wherever decoding begins; the
    last comes out when there are no more, a tick later."""
    latest = None
    for frame in frames:
        latest = frame.dts if frame.dts is not None or latest is None else latest + 1
        frame.pts = latest
        yield frame
