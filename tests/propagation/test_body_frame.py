"""Player coordinates: an origin that follows the player through the whole video."""

import numpy as np
import pytest

from keyrecon.propagation.body_frame import ground_path, stabilise_player, stabilise_shots
from keyrecon.records import CameraPath, Shots, Track


def track_of(middle):
    """A player of 180 px whose midpoint of head and feet is given."""
    count = len(middle)
    head, feet = middle - [0, 90], np.repeat(middle[:, None] + [0, 90], 2, axis=1)
    return Track(head, feet, np.full(count, 180.0), np.zeros((count, 4)), np.ones(count))


def camera_at(shift):
    """A camera whose picture is displaced by `shift` px against the reference frame."""
    to_reference = np.tile(np.eye(3), (len(shift), 1, 1))
    to_reference[:, :2, 2] = shift
    return CameraPath(to_reference, np.ones(len(shift)))


@pytest.mark.parametrize("pan", [0.0, 12.0])
@pytest.mark.parametrize("count", [40, 9])
def test_a_player_at_constant_speed_is_at_the_origin_from_first_to_last_frame(count, pan):
    frames = np.arange(count)[:, None]
    on_the_ground = [300.0, 200.0] + frames * [6.0, -1.5]
    shift = frames * [pan, 0.0]
    body_frame = stabilise_player(track_of(on_the_ground - shift), camera_at(shift), 50.0)
    origin = np.stack([body_frame.origin.real, body_frame.origin.imag], axis=1)
    np.testing.assert_allclose(origin, on_the_ground - shift, atol=1e-6)


def test_a_video_of_one_frame_has_its_player_at_the_origin():
    body_frame = stabilise_player(track_of(np.array([[5.0, 7.0]])), camera_at([[0.0, 0.0]]), 50.0)
    assert body_frame.origin[0] == pytest.approx(5 + 7j)


def test_jitter_of_the_tracker_is_smoothed_away():
    rng = np.random.default_rng(0)
    middle = np.array([300.0, 200.0]) + rng.normal(0, 2, (200, 2))
    body_frame = stabilise_player(track_of(middle), camera_at(np.zeros((200, 2))), 50.0)
    assert body_frame.origin.real.std() < 0.5 * middle[:, 0].std()


def test_what_stands_on_the_ground_keeps_its_place_while_player_and_camera_move():
    frames = np.arange(60)[:, None]
    cut = frames >= 35
    shift = np.where(cut, [400.0, 90.0] + frames * [-3.0, 1.0], frames * [9.0, -2.0])
    player = [300.0, 200.0] + 40 * np.sin(frames / 9) * [1.0, 0.2] - shift
    track, camera, shots = track_of(player), camera_at(shift), Shots.between((35,), 60)
    body_frame = stabilise_shots(track, camera, shots, 50.0)
    print_of_a_foot = body_frame.from_pixels(([330.0, 290.0] - shift)[:, None], frames)[:, 0]
    place = print_of_a_foot + ground_path(body_frame, camera, shots)
    for shot in shots.parts:
        np.testing.assert_allclose(place[shot], place[shot.start], atol=1e-9)
