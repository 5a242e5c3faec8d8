"""Hands that rest, swing and rest again before a still scene."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from golf_truth import camera_before, even_times, observe

from keyrecon.golf.fit.result import describe_fit
from keyrecon.golf.observe.swing_events import detect_swing_events
from keyrecon.golf.prior.kinematics import find_club, find_joints, fitted_pose
from keyrecon.golf.prior.skeleton import size_body
from keyrecon.golf.records import Camera, SwingFit, SwingState
from keyrecon.io.formats.model_file import read_motion_model
from keyrecon.io.video import open_video
from keyrecon.io.video_writer import write_video

FRAMES, FPS, HEIGHT, STATURE = 110, 60.0, 300.0, 1.8
LEAVES, TURNS, STOPS = 30.0, 62.0, 90.0


def hands():
    """Way of the hands in player heights: away, faster back and beyond, and at rest."""
    time = np.arange(FRAMES)
    away, back = (np.clip((time - a) / (b - a), 0, 1) for a, b in ((LEAVES, TURNS), (TURNS, STOPS)))
    ease = [10 * s**3 - 15 * s**4 + 6 * s**5 for s in (away, back)]
    return 0.4 * ease[0] - 0.6 * ease[1]


def rests():
    """Last frame before and first one after the swing in which the hands hardly move."""
    speed = np.abs(np.gradient(hands()))
    slow = np.flatnonzero(speed < 0.05 * speed.max())
    return slow[slow < 45][-1], slow[slow > 80][0]


def filmed(folder, share):
    """The hands, a patch of skin, of whose way the picture shows a share."""
    rng = np.random.default_rng(0)
    ground = rng.normal(100, 25, (300, 320, 3)).clip(0, 255).astype(np.uint8)
    skin = cv2.GaussianBlur(rng.normal(170, 60, (40, 40, 3)), (0, 0), 2).clip(0, 255)
    places = np.stack([160 + HEIGHT * share * hands(), np.full(FRAMES, 150.0)], axis=1)

    def pictures():
        for place in places:
            shift = np.array([[1, 0, place[0] - 20], [0, 1, place[1] - 20]])
            moved = cv2.warpAffine(skin, shift, (320, 300))
            there = cv2.warpAffine(np.ones((40, 40, 1)), shift, (320, 300))[..., None]
            yield (ground * (1 - there) + moved * there).astype(np.uint8)

    write_video(folder / "hands.mp4", pictures(), FPS, 12)
    return open_video(folder / "hands.mp4"), places


def fitted_swing(places, off):
    """A fitted swing whose hands are those of the film, in space as far as they go."""
    model, body = read_motion_model(), size_body(STATURE)
    rotation, position = camera_before(180.0)
    state = SwingState(
        np.zeros(1), even_times(FRAMES), np.tile(rotation, (FRAMES, 1, 1)),
        np.tile(position, (FRAMES, 1)),
    )  # fmt: skip
    fit = SwingFit(model, body, state)
    pose = fitted_pose(fit)
    joints, club = find_joints(body, pose), find_club(body, pose)
    observations = observe(joints, club, Camera(1000.0, np.array([160.0, 150.0])), 0.0)
    swing = describe_fit(fit, observations, np.arange(FRAMES) / FPS)
    club = np.zeros((FRAMES, 2, 3))
    club[:, 0, 0] = STATURE * hands()
    ends = np.repeat(places[:, None], 2, axis=1)
    keys = np.array([LEAVES, TURNS, 76.0, STOPS]) + off
    swing = replace(swing, club=club, club2d=ends, keys=keys)
    return swing, replace(observations, height=HEIGHT)


@pytest.mark.parametrize("share", [1.0, 0.4])
@pytest.mark.parametrize("off", [-4.0, 4.0])
def test_hands_tell_when_a_swing_begins_turns_and_ends_however_much_of_their_way_is_seen(
    tmp_path, share, off
):
    video, places = filmed(tmp_path, share)
    grid = np.stack(np.meshgrid(np.arange(-15, 16, 6), np.arange(-15, 16, 6)), axis=2)
    player = tuple(place + grid.reshape(-1, 2) for place in places)
    swing, observations = fitted_swing(places, np.array([off, -off, 0, -off]))
    keys = detect_swing_events(video, replace(observations, foreground=player), swing)
    assert np.abs(keys[[0, 3]] - rests()).max() <= 1
    assert abs(keys[1] - TURNS) <= FPS / 30, "the top is where the hands turn round"
    assert keys[2] == swing.keys[2]
