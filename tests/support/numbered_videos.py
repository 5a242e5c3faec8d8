"""Video files of every kind that misleads players, with pictures that say their number."""

import struct
from fractions import Fraction

import av
import numpy as np
from numbered_pictures import numbered_picture

EVEN = list(range(0, 60 * 12, 12))
UNEVEN = np.cumsum([0, *np.random.default_rng(3).choice([10, 12, 30], 59)]).tolist()
OPEN_GOP = {"x264-params": "open-gop=1:bframes=8:b-pyramid=normal:keyint=20:min-keyint=20"}
KINDS = {
    "constant rate": (EVEN, {}),
    "variable rate": (UNEVEN, {}),
    "B-frames": (EVEN, {"bf": "3", "g": "20"}),
    "open GOP": (EVEN, {"x264-params": "open-gop=1:bframes=3:keyint=15:min-keyint=15"}),
    "late start": ([t + 6000 for t in EVEN], {"bf": "2"}),
}


def copy_packets(source, target, skip_until=0, earlier=0):
    """The same packets from some key picture on, and earlier by some ticks of 1/600 s."""
    with av.open(str(source)) as old, av.open(str(target), "w") as new:
        stream = old.streams.video[0]
        copied = new.add_stream_from_template(stream)
        keys = 0
        for packet in old.demux(stream):
            keys += packet.is_keyframe
            if packet.dts is not None and keys > skip_until:
                shift = round(Fraction(earlier, 600) / packet.time_base)
                packet.pts, packet.dts = packet.pts - shift, packet.dts - shift
                packet.stream = copied
                new.mux(packet)
    return target


def write_divx(path, count):
    """MPEG-4 with B pictures in AVI as DivX wrote it: its name, a packet without picture."""
    with av.open(str(path), "w") as container:
        options = {"bf": "1", "g": "12", "b_strategy": "0"}
        stream = container.add_stream("mpeg4", rate=30, options=options)
        stream.width, stream.height, stream.pix_fmt = 128, 64, "yuv420p"
        packets = []
        for number in range(count):
            packets += stream.encode(av.VideoFrame.from_ndarray(numbered_picture(number), "rgb24"))
        first, *others = [*packets, *stream.encode()]
        header, picture, rest = bytes(first).partition(b"\0\0\1\xb6")
        named = av.Packet(header + b"\0\0\1\xb2DivX503b1393p" + picture + rest)
        named.is_keyframe = True
        for time, packet in enumerate([named, av.Packet(b"\x7f"), *others]):
            packet.stream, packet.time_base = stream, Fraction(1, 30)
            packet.dts = packet.pts = time
            container.mux(packet)
    return path


def trim_with_edit_list(source, target, first, count):
    """The same file whose edit list shows only some of its frames, as phones trim."""
    data = bytearray(source.read_bytes())
    box, track, movie = data.index(b"elst"), data.index(b"mdhd"), data.index(b"mvhd")
    (ticks,), (units,) = (struct.unpack_from(">I", data, b + 16) for b in (track, movie))
    (start,) = struct.unpack_from(">i", data, box + 16)
    struct.pack_into(">ii", data, box + 12, count * units // 50, start + first * ticks // 50)
    target.write_bytes(data)
    return target


def turn(source, target, degrees, mirrored=False):
    """The same file that says that it is to be shown turned clockwise, mirrored before."""
    data = bytearray(source.read_bytes())
    sine, cosine = {0: (0, 1), 90: (1, 0), 180: (0, -1), 270: (-1, 0)}[degrees]
    flip = -1 if mirrored else 1
    matrix = [flip * cosine, flip * sine, 0, -sine, cosine, 0, 0, 0, 1]
    fixed = [value << (30 if n % 3 == 2 else 16) for n, value in enumerate(matrix)]
    struct.pack_into(">9i", data, data.index(b"tkhd") + 44, *fixed)
    target.write_bytes(data)
    return target
