"""Files of pictures."""

import numpy as np
from scipy.ndimage import gaussian_filter

from keyrecon.io.video_writer import comment_of, write_video


def test_the_same_pictures_make_the_same_file(tmp_path):
    rng = np.random.default_rng(0)
    scene = gaussian_filter(rng.normal(110, 400, (270, 580, 3)), (3, 3, 0))
    pictures = [
        np.clip(scene[:, t : t + 480] + rng.normal(0, 3, (270, 480, 3)), 0, 255).astype(np.uint8)
        for t in range(60)
    ]
    files = set()
    for turn in range(6):
        write_video(tmp_path / f"{turn}.mp4", pictures, 30.0)
        files.add((tmp_path / f"{turn}.mp4").read_bytes())
    assert len(files) == 1


def test_a_comment_is_read_as_it_was_written(tmp_path):
    picture = np.full((48, 64, 3), 90, np.uint8)
    write_video(tmp_path / "told.mp4", [picture], 25.0, comment="of a test")
    write_video(tmp_path / "bare.mp4", [picture], 25.0)
    (tmp_path / "text.mp4").write_text("no video")
    names = ("told.mp4", "bare.mp4", "text.mp4")
    assert [comment_of(tmp_path / name) for name in names] == ["of a test", "", ""]
