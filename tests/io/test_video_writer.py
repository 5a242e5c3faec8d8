"""Files of pictures."""

import numpy as np
from scipy.ndimage import gaussian_filter

from keyrecon.io.video_writer import write_video


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
