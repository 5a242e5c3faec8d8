"""Paths of feet from what filters saw, with one foot hidden for a while."""

import numpy as np
import pytest

from keyrecon.records import CameraPath, Track, TrackAnchors
from keyrecon.segmentation.player_crops import Cropping
from keyrecon.tracking.correlation_filters import clear_frames, sound_frames
from keyrecon.tracking.linking import Detections, FootMotionModel, link_feet
from keyrecon.tracking.smoothing import fill_gaps
from keyrecon.tracking.tracker import _through_anchors, detect_in_crop

COUNT, TALL = 60, 56.0
HEAD, LEFT, RIGHT = (np.array(spot) for spot in ((200.0, 100.0), (195.0, 150.0), (205.0, 158.0)))
GONE = slice(20, 40)


def track(feet=(LEFT, RIGHT)):
    """A player of 56 px who stands still."""
    head, both = np.tile(HEAD, (COUNT, 1)), np.tile(np.array(feet), (COUNT, 1, 1))
    return Track(head, both, np.full(COUNT, TALL), np.zeros((COUNT, 4)), np.ones(COUNT))


def link(covered):
    """Both feet are detected but for the left one while it is gone; all or nothing is covered."""
    cropping, detections = Cropping.below_heads(track(), TALL), []
    gone = np.isin(np.arange(COUNT), np.arange(COUNT)[GONE])
    for t in range(COUNT):
        spots = np.stack([RIGHT] if gone[t] else [LEFT, RIGHT])
        places = cropping.from_picture(spots, t)
        strength = np.ones(len(places))
        mask = np.full([n // 2 for n in cropping.size], covered)
        detections.append(Detections(np.zeros((0, 2)), np.zeros(0), places, strength, mask))
    camera = CameraPath(np.tile(np.eye(3), (COUNT, 1, 1)), np.ones(COUNT))
    standing, motion = track(), FootMotionModel(0.04 * TALL, 25, 50, 1.0, 1.0)
    unmarked = np.full((len(detections), 2, 2), np.nan)
    return link_feet(detections, camera, cropping, standing.head, standing.height, unmarked, motion)


def test_a_foot_behind_the_other_leg_stays_where_it_stood():
    feet, confidence = link(covered=True)
    off = np.linalg.norm(feet[:, :, None] - np.array([LEFT, RIGHT]), axis=3).min(axis=1)
    assert off.max() < 0.02 * TALL
    assert confidence[GONE].max() < confidence[:20].min()


def test_a_foot_is_not_remembered_where_the_scene_shows_but_is_behind_the_other_leg():
    feet, _ = link(covered=False)
    nearest, farthest = feet[30][np.argsort(-feet[30, :, 1])]
    assert nearest == pytest.approx(RIGHT, abs=0.02 * TALL)
    assert farthest[0] == pytest.approx(RIGHT[0], abs=0.02 * TALL)
    assert 0 < (RIGHT - farthest)[1] < 0.1 * TALL


def test_feet_that_stand_while_the_camera_turns_stand_in_between_too():
    shift = np.linspace(0, 90, 10) ** 1.2
    to_picture = np.tile(np.eye(3), (10, 1, 1))
    to_picture[:, 0, 2] = shift
    stable = np.tile(np.array([LEFT, RIGHT]), (2, 1, 1))
    placed = fill_gaps(stable, np.array([0, 9]), to_picture)
    assert placed[:, 0, 0] == pytest.approx(LEFT[0] + shift)


def test_frames_with_a_racket_or_one_shoe_for_both_feet_are_not_trained_on():
    rough = track()
    rough.feet[10:20, 1] = (220, 136)
    rough.feet[30:40, 0] = (206, 158)
    assert set(clear_frames(rough)) == set(range(COUNT)) - set(range(10, 20)) - set(range(30, 40))


@pytest.mark.parametrize("choose", [clear_frames, sound_frames])
def test_frames_in_which_the_player_was_not_seen_are_not_trained_on(choose):
    rough = track()
    rough.confidence[GONE] = 0
    seen = set(range(COUNT)) - set(range(COUNT)[GONE])
    assert set(choose(rough)) == seen
    rough.feet[:, 1] = rough.feet[:, 0]  # none is clear: all that was seen counts
    assert set(choose(rough)) == seen
    rough.confidence[:] = 0
    assert set(choose(rough)) == set(range(COUNT))


def test_a_marked_head_does_not_make_the_track_sure_of_feet_that_were_not_seen():
    unsure = track()
    unsure.confidence[:] = 0
    head = np.array([HEAD, HEAD + 1, (np.nan, np.nan)])
    feet = np.array([(LEFT, RIGHT), np.full((2, 2), np.nan), (LEFT, RIGHT)])
    every, unknown, nowhere = np.ones(3, bool), np.full(3, np.nan), np.full((3, 2), np.nan)
    anchors = TrackAnchors(
        np.array([5, 10, 15]), head, feet, every, unknown, ~every, nowhere, unknown
    )
    marked = _through_anchors(unsure, anchors)
    assert np.flatnonzero(marked.confidence).tolist() == [5]
    assert marked.head[10].tolist() == (HEAD + 1).tolist()


def test_a_place_with_the_leg_beneath_it_is_less_a_foot_than_one_with_the_floor():
    response = np.zeros((2, 88, 96), np.float32)
    response[1, 60, 40] = response[1, 72, 60] = 1.0
    player = np.zeros((88, 96), np.float32)
    player[40:74, 36:45] = player[40:73, 56:65] = 1.0
    detections = detect_in_crop(response, (255 * player).astype(np.uint8), player, TALL)
    strength = {
        round(x): s for (x, _), s in zip(detections.feet, detections.foot_strength, strict=True)
    }
    assert strength[60] == pytest.approx(1.0)
    assert strength[40] == pytest.approx(0.5)
