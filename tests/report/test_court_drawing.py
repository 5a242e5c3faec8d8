"""The way on the ground: within a shot a line, from one shot to the next none."""

from dataclasses import replace

import numpy as np
import pytest
from court_walker import court_camera
from painted_court import camera_at
from small_motion import make_motion

from keyrecon.report.court_drawing import PER_METRE, WORDS, draw_ground, draw_way
from keyrecon.world.court import HALF_LENGTH
from keyrecon.world.records import WorldMotion

FRAMES, CUT, SIZE = 40, 20, (360, 640)
LEFT, RIGHT = np.array([-3.0, -9.0, 1.0]), np.array([3.0, -9.0, 1.0])


@pytest.fixture(scope="module")
def camera():
    return court_camera(camera_at((1, -25, 8), (0, -9, 0), size=SIZE[::-1]), FRAMES)


def standing_left_then_right(cuts):
    """Who stands on the left of the court up to `CUT` and on the right of it from there on."""
    root = np.where(np.arange(FRAMES)[:, None] < CUT, LEFT, RIGHT)
    motion = replace(make_motion(FRAMES), cuts=cuts)
    points = np.repeat(root[:, None], 14, axis=1)
    return WorldMotion(points, root, np.zeros((FRAMES, 2), dtype=bool), 1.0), motion


@pytest.mark.parametrize(("cuts", "joined"), [(None, True), (np.array([CUT]), False)])
def test_in_the_video_the_way_does_not_jump_from_shot_to_shot(camera, cuts, joined):
    world, motion = standing_left_then_right(cuts)
    black = np.zeros((*SIZE, 3), np.uint8)
    drawn, bare = (
        draw_ground(black, (placed, camera), motion, FRAMES - 1).astype(int)
        for placed in (world, replace(world, root=np.full_like(world.root, np.nan)))
    )
    for x, y in (
        camera.project(0, np.linspace(LEFT, RIGHT, 9)[1:-1] * [1, 1, 0]).round().astype(int)
    ):
        near = slice(y - 2, y + 3), slice(x - 2, x + 3)
        assert (np.abs(drawn[near] - bare[near]).max() > 40) == joined


@pytest.mark.parametrize(("cuts", "joined"), [(None, True), (np.array([CUT]), False)])
def test_from_above_the_way_does_not_jump_from_shot_to_shot(cuts, joined):
    world, motion = standing_left_then_right(cuts)
    speed = np.where(np.arange(FRAMES) < CUT, 0.0, 4.0)
    drawn = draw_way(world, motion, speed, "")
    nowhere = replace(world, root=np.full_like(world.root, np.nan))
    bare = draw_way(nowhere, motion, speed, "")
    assert (drawn != bare).any(axis=2)[60:].sum() > 0
    columns = np.flatnonzero((drawn != bare).any(axis=2)[60:].any(axis=0))
    assert (np.diff(columns).max() == 1) == joined


@pytest.mark.parametrize("behind", [3.0, 9.0])
def test_from_above_the_way_of_who_stands_far_behind_the_far_baseline_is_whole_and_below_the_words(
    behind,
):
    world, motion = standing_left_then_right(None)
    root = np.linspace(LEFT, RIGHT, FRAMES)
    root[:, 1] = HALF_LENGTH + behind
    speed = np.linspace(0, 4.0, FRAMES)
    one, other = (
        draw_way(replace(world, root=root), motion, s, "way") for s in (speed, speed[::-1])
    )
    rows, columns = np.nonzero((one != other).any(axis=2))
    assert rows.min() > WORDS
    assert np.ptp(columns) > 0.95 * (RIGHT - LEFT)[0] * PER_METRE
