import cv2
import numpy as np
import pytest
from drawn_player import HEIGHT, draw_player, scene

from keyrecon.io.video import open_video
from keyrecon.io.video_writer import write_video
from keyrecon.records import CameraPath, Track
from keyrecon.segmentation.background_model import build_background, median_background
from keyrecon.segmentation.color_model import to_lab


def scene_with_limb(shift, rng):
    """A floor with a line across, and a limb in front of its middle."""
    picture = np.full((60, 80, 3), (150, 90, 60), np.uint8)
    picture[40:43] = 230
    bare = picture.copy()
    cv2.line(picture, (30 + 2 * shift, 10), (45 + 2 * shift, 55), (190, 130, 100 + 2 * shift), 6)
    noise = rng.normal(0, 1.0, picture.shape)
    return (picture + noise).round().astype(np.uint8), bare


def test_what_shows_between_moving_limbs_completes_the_background():
    rng = np.random.default_rng(0)
    views = [scene_with_limb(int(s), rng) for s in rng.integers(-8, 9, 40)]
    free = np.ones((60, 80), bool)
    free[5:58, 15:65] = False  # the player never leaves
    paths = np.tile(np.eye(3), (40, 1, 1))
    observations = [to_lab(v) for v, _ in views]
    background = median_background(observations, [free] * 40, paths, 1.0, inpaint=True)
    off = np.abs(background.color.astype(int) - to_lab(views[0][1]).astype(int)).max(axis=2)
    assert background.known[~free].mean() > 0.9
    assert np.percentile(off[background.known], 99) <= 6


def test_what_the_player_always_covers_stays_unknown():
    rng = np.random.default_rng(0)
    picture = rng.integers(0, 255, (40, 40, 40, 3), np.uint8)
    picture[:, :, :10] = 120
    free = np.zeros((40, 40), bool)
    free[:, :10] = True
    paths = np.tile(np.eye(3), (40, 1, 1))
    observations = [to_lab(p) for p in picture]
    background = median_background(observations, [free] * 40, paths, 1.0, inpaint=True)
    assert background.known[:, :10].all()
    assert not background.known[:, 12:].any()


def test_a_leg_that_the_track_lacks_does_not_become_background(tmp_path):
    count, stride = 40, 0.25 * HEIGHT
    head = np.tile([120.0, 60.0], (count, 1))
    head[28:, 0] = 260.0

    def frames():
        for x, y in head:
            picture = scene()
            draw_player(picture, x, y, stride)
            yield picture[:180, :360]

    write_video(tmp_path / "stands.mp4", frames(), 30.0, crf=18)
    right = head + np.array([stride, HEIGHT])
    tall = np.full(count, HEIGHT)
    track = Track(head, np.stack([right, right], 1), tall, np.zeros((count, 4)), np.ones(count))
    still = CameraPath(np.tile(np.eye(3), (count, 1, 1)), np.ones(count))
    background = build_background(open_video(tmp_path / "stands.mp4"), still, track)
    left = tuple((head[0] + np.array([-stride, HEIGHT])).round().astype(int)[::-1])
    off = background.color[left].astype(int) - to_lab(scene())[left]
    assert not background.known[left] or np.abs(off).max() < 12


def test_the_spread_is_the_distance_from_the_lower_quartile_to_the_median_as_a_deviation():
    lightness = [90, 92, 94, 96, 100, 100, 110, 120, 130]  # lower quartile 94
    pictures = [np.full((4, 4, 3), value, np.uint8) for value in lightness]
    free, paths = [np.ones((4, 4), bool)] * 9, np.tile(np.eye(3), (9, 1, 1))
    background = median_background(pictures, free, paths, 1.0)
    assert (background.color == 100).all()
    assert background.spread == pytest.approx(6 / 0.6745)


def test_the_spread_of_normal_noise_is_its_deviation():
    noise = np.random.default_rng(0).normal(120, 6, (400, 20, 20, 1)).repeat(3, axis=3)
    pictures = list(noise.round().astype(np.uint8))
    free, paths = [np.ones((20, 20), bool)] * 400, np.tile(np.eye(3), (400, 1, 1))
    spread = median_background(pictures, free, paths, 1.0).spread
    assert np.median(spread) == pytest.approx(6, rel=0.05)
