"""A club that turns before a scene, and what is expected of it."""

import cv2
import numpy as np
import pytest

from keyrecon.golf.observe.club_lines import ClubLines
from keyrecon.golf.observe.guided_club_detection import (
    ExpectedClubs,
    GuidedDetectionOptions,
    _choose,
    detect_clubs,
)
from keyrecon.io.video import open_video
from keyrecon.io.video_writer import write_video

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


def detect(film, first, expected, resting=None):
    resting = np.zeros(FRAMES, bool) if resting is None else resting
    return detect_clubs(film, ExpectedClubs(first, expected, resting, HEIGHT))


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
    found = detect(film, NOWHERE, expected)
    known = np.isfinite(found[:, 0, 0])
    assert known[:18].mean() > 0.8 and known[22:].mean() > 0.8
    assert (off(found, clubs(ANGLES))[known] < 3).mean() > 0.9


def test_a_rope_in_the_scene_is_not_taken_for_it(film):
    expected = clubs(np.full(FRAMES, 70.0))
    found = detect(film, NOWHERE, expected)
    far = np.abs(ANGLES - 70) > 45
    assert np.isfinite(found[far, 0, 0]).mean() < 0.1


def test_what_was_detected_at_first_stays_where_the_expectation_is_all_wrong(film):
    true = clubs(ANGLES)
    found = detect(film, true, clubs(ANGLES + 100))
    clear = np.abs(np.arange(FRAMES) - 20) > 4
    assert (np.nan_to_num(off(found, true), nan=99.0)[clear] < 1).mean() > 0.8


@pytest.mark.parametrize("gap", [28, 60])
def test_a_club_that_is_unseen_for_long_is_found_before_and_after(gap):
    one = ClubLines(np.zeros((1, 2, 2)), np.zeros((1, 2)), np.array([18.0]))
    none = ClubLines(np.zeros((0, 2, 2)), np.zeros((0, 2)), np.zeros(0))
    taken = _choose([one] * 60 + [none] * gap + [one] * 50, 60.0, GuidedDetectionOptions())
    assert (taken >= 0).tolist() == [True] * 60 + [False] * gap + [True] * 50


def test_nothing_is_found_where_the_club_points_at_the_camera(film):
    expected = clubs(ANGLES)
    expected[:, 1] = expected[:, 0] + 0.1 * (expected[:, 1] - expected[:, 0])
    assert np.isnan(detect(film, NOWHERE, expected)).all()


def test_a_line_detected_askew_is_moved_on_to_the_shaft(film):
    askew = clubs(ANGLES + 3, HANDS + np.array([0.0, 1.5]))
    found = detect(film, askew, clubs(ANGLES + 100))
    clear = np.abs(np.arange(FRAMES) - 20) > 4
    assert (np.nan_to_num(off(found, clubs(ANGLES)), nan=99.0)[clear] < 1.5).mean() > 0.8


@pytest.fixture(scope="module")
def still_film(tmp_path_factory):
    """A club that rests all the time: it is in the median picture too."""
    path = tmp_path_factory.mktemp("still") / "club.mp4"
    picture = np.random.default_rng(0).normal(100, 3, (300, 320, 3)).astype(np.uint8)
    draw(picture, clubs(np.array([75.0]))[0])
    write_video(path, (picture for _ in range(FRAMES)), 30.0, 18)
    return open_video(path)


def test_a_club_that_rests_is_told_by_the_picture_alone(still_film):
    expected = clubs(np.full(FRAMES, 70.0))
    found = detect(still_film, NOWHERE, expected, np.ones(FRAMES, bool))
    assert (off(found, clubs(np.full(FRAMES, 75.0))) < 1.5).all()
    assert np.isnan(detect(still_film, NOWHERE, expected)).all()


def written(path, ends, ground):
    """A film of a bright club before what `ground` gives for every frame."""

    def pictures():
        for t, club in enumerate(ends):
            picture = ground(t)
            draw(picture, club)
            yield picture

    write_video(path, pictures(), 30.0, 12)
    return open_video(path)


def smooth_ground(_):
    return np.random.default_rng(0).normal(100, 3, (300, 320, 3)).astype(np.uint8)


def test_a_fast_club_is_found_by_a_fit_that_is_half_a_frame_early(tmp_path):
    angles = np.cumsum(np.r_[np.full(18, 2.0), 70.0, np.full(21, 2.0)]) - 200
    early = np.interp(np.arange(FRAMES) + 0.5, np.arange(FRAMES), angles)
    film = written(tmp_path / "fast.mp4", clubs(angles), smooth_ground)
    found = detect(film, NOWHERE, clubs(early))
    assert (off(found, clubs(angles)) < 3).all()


def test_leaves_that_stand_out_everywhere_are_not_taken_for_a_club(tmp_path):
    random = np.random.default_rng(1)

    def leaves(_):
        spots = cv2.GaussianBlur(random.normal(0, 1, (300, 320)), (0, 0), 1.0)
        grey = np.clip(90 + 45 * spots / spots.std(), 0, 255)
        return grey[..., None].repeat(3, axis=2).astype(np.uint8)

    film = written(tmp_path / "leaves.mp4", clubs(ANGLES), leaves)
    wrong = np.where(np.isin(np.arange(FRAMES), [10, 20, 30]), 22.0, 0.0)
    found = detect(film, NOWHERE, clubs(ANGLES + wrong))
    assert (off(found, clubs(ANGLES)) < 3).all()
