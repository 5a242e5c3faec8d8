"""Which frames of a video are fitted: no repeats, one shot, one place."""

from itertools import pairwise

import cv2
import numpy as np
import pytest

from keyrecon.golf.observe.film import choose_frames
from keyrecon.io.video import open_video
from keyrecon.io.video_writer import write_video
from keyrecon.records import CameraPath
from keyrecon.segmentation.repeated_frames import find_repeats

SIZE = (160, 120)
RNG = np.random.default_rng(0)
SCENE = cv2.GaussianBlur(RNG.integers(0, 255, (160, 220, 3), np.uint8), (0, 0), 2)


def picture(step, shift=0.0):
    """A block that moves over a scene, seen by a camera that has moved aside."""
    scene = SCENE.copy()
    x = round(40 + 2 * step)
    scene[60:100, x : x + 20] = (250, 20, 20)
    moved = cv2.warpAffine(scene, np.array([[1, 0, -shift - 20.0], [0, 1, -20.0]]), SIZE)
    return np.ascontiguousarray(moved)


def still(count):
    return CameraPath(np.tile(np.eye(3), (count, 1, 1)), np.ones(count))


def film_of(folder, pictures, camera=None, clicked=0, fps=30.0):
    write_video(folder / "v.mp4", iter(pictures), fps, 12)
    video = open_video(folder / "v.mp4")
    return video, choose_frames(video, camera or still(len(video)), clicked)


def test_a_video_without_repeats_from_one_place_is_fitted_as_it_is(tmp_path):
    video, film = film_of(tmp_path, [picture(t) for t in range(40)])
    assert film.is_whole(video) and film.open(video) is video
    assert film.film_index.tolist() == list(range(40))


def test_pictures_shown_four_times_are_fitted_once_and_lie_evenly_in_time(tmp_path):
    video, film = film_of(tmp_path, [picture(t // 4) for t in range(80)])
    assert len(film.file_frames) == 20
    assert film.film_index[:9].tolist() == [0, 0, 0, 0, 1, 1, 1, 1, 2]
    assert np.diff(film.time) == pytest.approx(4 / 30, abs=0.003)
    assert film.keys_in_file(np.array([2.0])) == pytest.approx([9.5])
    shown = list(film.open(video).frames())
    assert all(np.abs(a.astype(int) - b).max() > 50 for a, b in pairwise(shown))


def test_a_pause_is_no_repeated_frame():
    change = 20 - 17 * np.exp(-((np.arange(40) - 20.0) ** 2) / 20)
    assert not find_repeats(change).any()
    change[10] = 1.0
    assert np.flatnonzero(find_repeats(change)).tolist() == [10]


def test_only_the_shot_that_was_clicked_is_fitted(tmp_path):
    other = [picture(t) // 4 for t in range(15)]
    _, film = film_of(tmp_path, [picture(t) for t in range(30)] + other)
    assert film.shot == (0, 29)
    assert film.file_frames[-1] == 29 and film.film_index[-1] == 29


def test_frames_of_a_camera_that_moves_show_the_scene_in_one_place(tmp_path):
    shifts = 8 * np.sin(np.arange(30) / 5)
    homographies = np.tile(np.eye(3), (30, 1, 1))
    homographies[:, 0, 2] = shifts
    camera = CameraPath(homographies, np.ones(30))
    moving = [picture(t, shift) for t, shift in enumerate(shifts)]
    video, film = film_of(tmp_path, moving, camera)
    assert film.size[0] > SIZE[0]
    frames = [f.astype(int) for f in film.open(video).frames()]
    low = slice(film.size[1] - 15, film.size[1] - 2)  # below the block
    assert max(np.abs(f[low] - frames[0][low]).mean() for f in frames) < 4
    greys = list(film.open(video).grey_frames())
    assert greys[0].shape == film.size[::-1] and len(greys) == 30


def test_twice_as_many_frames_as_a_swing_needs_are_halved(tmp_path):
    _, film = film_of(tmp_path, [picture(t / 2) for t in range(100)], fps=240.0)
    assert film.fps == pytest.approx(80.0, rel=0.01)
    assert film.film_index[3] == pytest.approx(1.0)


def test_a_part_of_a_film_knows_which_frames_of_the_file_it_shows(tmp_path):
    """Each picture is shown twice; the pictures 5 to 14 are frames 10 to 29."""
    _, film = film_of(tmp_path, [picture(t // 2) for t in range(60)])
    part = film.take(np.arange(5, 15))
    assert part.file_range == (10, 29)
    assert np.flatnonzero(part.shows).tolist() == list(range(10, 30))
    assert part.keys_in_file(np.array([0.0, 3.0, 9.0])) == pytest.approx([10.5, 16.5, 28.5])
    assert film.file_range == (0, 59) and film.shows.all()
