"""A phone's lens is read where the phone wrote it."""

import struct

import av
import numpy as np
import pytest

from keyrecon.io.lens_metadata import FILM_DIAGONAL, KEY, lens_focal

SIZE = (1920, 1080)
DIAGONAL = np.hypot(*SIZE)


def box(kind, content):
    return struct.pack(">I4s", len(content) + 8, kind) + content


def metadata(value, kind=1, key=KEY, full=b""):
    """A box as phones write it, after a key that is not ours."""
    names = [b"com.apple.quicktime.camera.lens_model", key]
    keys = b"".join(box(b"mdta", name) for name in names)
    item = box(b"data", struct.pack(">II", kind, 0) + value)
    model = box(b"data", struct.pack(">II", 1, 0) + b"back camera 6.765mm f/1.78")
    values = box(struct.pack(">I", 1), model) + box(struct.pack(">I", 2), item)
    head = box(b"hdlr", bytes(8) + b"mdta" + bytes(12))
    table = box(b"keys", struct.pack(">4xI", len(names)) + keys)
    return box(b"meta", full + head + table + box(b"ilst", values))


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """A film without such metadata, its index behind the pictures."""
    path = tmp_path_factory.mktemp("lens") / "plain.mov"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=25)
        stream.width, stream.height, stream.pix_fmt = 64, 32, "yuv420p"
        for _ in range(3):
            picture = np.zeros((32, 64, 3), np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        container.mux(stream.encode())
    return path


def written(plain, addition, where, path):
    """The film with a box more in its track, or in the whole movie."""
    data, made, at = plain.read_bytes(), b"", 0
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at : at + 8])
        content = data[at + 8 : at + length]
        if kind == b"moov":
            parts, inner = b"", 0
            while inner < len(content):
                size, name = struct.unpack(">I4s", content[inner : inner + 8])
                part = content[inner + 8 : inner + size]
                parts += box(name, part + addition if name == where else part)
                inner += size
            content = parts + (addition if where == b"moov" else b"")
        made += box(kind, content)
        at += length
    path.write_bytes(made)
    return path


@pytest.mark.parametrize("where", [b"trak", b"moov"])
@pytest.mark.parametrize(
    ("value", "kind"),
    [(b"26.00mm", 1), (struct.pack(">f", 26.0), 23), (struct.pack(">i", 26), 21), (b"26", 1)],
)
def test_the_focal_length_is_that_of_the_lens(plain, tmp_path, where, value, kind):
    film = written(plain, metadata(value, kind), where, tmp_path / "v.mov")
    assert lens_focal(film, SIZE) == pytest.approx(26 / FILM_DIAGONAL * DIAGONAL)
    with av.open(str(film)) as container:  # the film is still one
        assert len(list(container.decode(video=0))) == 3


def test_the_newer_form_of_the_box_is_read_too(plain, tmp_path):
    film = written(plain, metadata(b"52mm", full=bytes(4)), b"trak", tmp_path / "v.mp4")
    assert lens_focal(film, SIZE) == pytest.approx(52 / FILM_DIAGONAL * DIAGONAL)


def test_a_film_that_tells_nothing_tells_nothing(plain, tmp_path):
    assert lens_focal(plain, SIZE) is None
    other = metadata(b"26mm", key=b"com.apple.quicktime.model")
    assert lens_focal(written(plain, other, b"trak", tmp_path / "a.mov"), SIZE) is None
    nothing = metadata(b"0.0mm")
    assert lens_focal(written(plain, nothing, b"trak", tmp_path / "b.mov"), SIZE) is None


def test_a_film_that_is_cut_off_anywhere_tells_nothing_or_the_truth(plain, tmp_path):
    film = written(plain, metadata(b"26mm"), b"trak", tmp_path / "v.mov")
    data, short = film.read_bytes(), tmp_path / "short.mov"
    for length in range(len(data) - 400, len(data), 7):
        short.write_bytes(data[:length])
        assert lens_focal(short, SIZE) in (None, lens_focal(film, SIZE))
    rng = np.random.default_rng(0)
    for _ in range(60):
        broken = bytearray(data)
        for place in rng.integers(len(data) - 500, len(data), 6):
            broken[place] = rng.integers(256)
        short.write_bytes(bytes(broken))
        lens_focal(short, SIZE)  # no other error than none
