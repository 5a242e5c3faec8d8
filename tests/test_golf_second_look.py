"""A club that turns before a scene, and what is expected of it."""

import cv2
import numpy as np
import pytest

from keyrecon.golf.second_look import look_again, median_picture
from keyrecon.video import open_video
from keyrecon.video_writer import write_video

FRAMES, HEIGHT, LENGTH = 40, 200.0, 100.0
HANDS = np.array([160.0, 150.0])
ANGLES = np.linspace(-40.0, 220.0, FRAMES)
NOWHERE = np.full((FRAMES, 2, 2), np.nan)


def clubs(angles, hands=HANDS):
    way = np.radians(angles)
    heads = hands + LENGTH * np.stack([np.cos(way), np.sin(way)], axis=1)
    return np.stack([np.broadcast_to(hands, heads.shape), heads], axis=1)


def off(found, true):
    ways = [ends[:, 1] - ends[:, 0] for ends in (found, true)]
    turn = ways[0][:, 0] * ways[1][:, 1] - ways[0][:, 1] * ways[1][:, 0]
    return np.degrees(np.abs(np.arctan2(turn, (ways[0] * ways[1]).sum(axis=1))))


def draw(picture, ends, shade=200):
    a, b = (tuple(np.round(16 * p).astype(int).tolist()) for p in ends)
    cv2.line(picture, a, b, (shade,) * 3, 2, cv2.LINE_AA, 4)


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    """A bright club before a rope and the broad arm of the player, gone in frames 18 to 21."""
    path = tmp_path_factory.mktemp("film") / "club.mp4"
    ground = np.random.default_rng(0).normal(100, 3, (300, 320, 3)).astype(np.uint8)
    draw(ground, clubs(np.array([75.0]))[0])

    def pictures():
        for t, ends in enumerate(clubs(ANGLES)):
            picture = ground.copy()
            cv2.line(picture, (160, 150), (130, 60), (60, 70, 90), 14)
            if not 18 <= t < 22:
                draw(picture, ends)
            yield picture

    write_video(path, pictures(), 30.0, 18)
    return open_video(path)


def test_a_club_is_found_where_it_is_expected_only_roughly(film):
    expected = clubs(ANGLES + 12, HANDS + np.array([3.0, -4.0]))
    found = look_again(film, median_picture(film), NOWHERE, expected, HEIGHT)
    known = np.isfinite(found[:, 0, 0])
    assert known[:18].mean() > 0.8 and known[22:].mean() > 0.8
    assert (off(found, clubs(ANGLES))[known] < 3).mean() > 0.9


def test_a_rope_in_the_scene_is_not_taken_for_it(film):
    expected = clubs(np.full(FRAMES, 70.0))
    found = look_again(film, median_picture(film), NOWHERE, expected, HEIGHT)
    far = np.abs(ANGLES - 70) > 45
    assert np.isfinite(found[far, 0, 0]).mean() < 0.1


def test_what_was_seen_at_first_stays_where_the_expectation_is_all_wrong(film):
    true = clubs(ANGLES)
    found = look_again(film, median_picture(film), true, clubs(ANGLES + 100), HEIGHT)
    clear = np.abs(np.arange(FRAMES) - 20) > 4
    assert (np.nan_to_num(off(found, true), nan=99.0)[clear] < 1).mean() > 0.8


def test_nothing_is_found_where_the_club_points_at_the_camera(film):
    expected = clubs(ANGLES)
    expected[:, 1] = expected[:, 0] + 0.1 * (expected[:, 1] - expected[:, 0])
    assert np.isnan(look_again(film, median_picture(film), NOWHERE, expected, HEIGHT)).all()
