"""Which shots show the player: by colours that lie as a person showed, by repeats, and by word."""

import numpy as np
import pytest

from keyrecon.errors import KeyreconError
from keyrecon.records import PERHAPS, PLAYER, Shots, Track
from keyrecon.tracking.shot_sorting import CELLS, PlayerDetection, ShotOptions, sort_shots

FPS = 50.0


def seen(layout, repeated=0.0, plain=False, found=True):
    nowhere = np.zeros((4, 2))
    track = Track(nowhere, np.zeros((4, 2, 2)), np.ones(4), np.zeros((4, 4)), np.ones(4))
    rng = np.random.default_rng(0)
    maps = layout + 0.1 * rng.random((8, *layout.shape))
    return PlayerDetection(
        track if found else None, "", maps if found else maps[:0], plain, repeated
    )


@pytest.fixture
def player():
    return np.random.default_rng(1).random((3, *CELLS))


@pytest.fixture
def somebody():
    return np.random.default_rng(2).random((3, *CELLS))


def sort(detections, length=100, told=(0,), **options):
    count = len(detections)
    shots = Shots.between(tuple(length * n for n in range(1, count)), length * count)
    marked = np.isin(np.arange(count), told)
    return sort_shots(shots, detections, marked, FPS, ShotOptions(**options)).shows


def test_a_shot_like_the_marked_one_shows_the_player_and_another_somebody_else(player, somebody):
    assert sort([seen(player), seen(somebody), seen(player)]) == (PLAYER, "somebody else", PLAYER)


def test_of_a_shot_that_is_a_little_like_the_marked_one_a_person_must_tell(player, somebody):
    mixed = seen(0.5 * player + 0.5 * somebody)
    assert sort([seen(player), mixed]) == (PLAYER, PERHAPS)
    assert sort([seen(player), mixed], use="2") == (PLAYER, PLAYER)
    assert sort([seen(player), mixed], alike=0.4) == (PLAYER, PLAYER)


def test_black_slow_motion_and_an_empty_scene_are_told_apart(player):
    shown = sort(
        [
            seen(player),
            seen(player, plain=True, found=False),
            seen(player, 0.6),
            seen(player, found=False),
        ]
    )
    assert shown == (PLAYER, "black", "slow motion", "nobody found")


def test_pictures_repeated_in_every_shot_are_a_conversion_of_the_rate(player):
    assert sort([seen(player, 0.5), seen(player, 0.5)]) == (PLAYER, PLAYER)


def test_a_shot_of_a_moment_is_left_out_unless_it_was_marked(player):
    assert sort([seen(player), seen(player)], length=20) == (PLAYER, "too short")


def test_what_a_person_says_of_a_shot_stands(player, somebody):
    shown = sort([seen(player), seen(somebody), seen(player)], use="2", skip="3")
    assert shown == (PLAYER, PLAYER, "left out by --shots.skip")


def test_a_shot_that_is_none_is_named(player):
    with pytest.raises(KeyreconError, match="1 to 2"):
        sort([seen(player), seen(player)], use="3")


def test_a_video_without_the_player_is_refused(player):
    with pytest.raises(KeyreconError, match="No shot"):
        sort([seen(player, found=False), seen(player, found=False)])


def test_whoever_is_found_is_not_the_player_where_the_marked_shot_does_not_tell(player, somebody):
    lost = seen(player, found=False)
    with pytest.raises(KeyreconError, match="No shot"):
        sort([lost, seen(somebody)])
    assert sort([lost, seen(somebody), seen(player)], use="3") == ("nobody found", PERHAPS, PLAYER)


def test_a_dissolve_is_no_shot_of_the_player(player):
    shots = Shots.between((100, 140), 300)
    detections = [seen(player), seen(player), seen(player)]
    told = np.array([True, False, False])
    shown = sort_shots(shots, detections, told, FPS, dissolves=(100,)).shows
    assert shown == (PLAYER, "a dissolve", PLAYER)
