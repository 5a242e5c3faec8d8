import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from keyrecon.errors import KeyreconError
from keyrecon.golf.observe.club import Club
from keyrecon.golf.observe.swing_timing import (
    find_key_frames,
    interpolate_times,
    keep_order,
    refine_key_frames,
)

HEIGHT, FPS = 200.0, 60.0
TRUE = np.array([30, 78, 96, 130])


def filmed(keys=TRUE, frames=160):
    """A club that rests, goes up, turns round, comes down faster, and goes up to a finish."""
    pace = np.array([1 / 48, 1 / 30, 1 / 25, 1 / 34])
    passed = CubicHermiteSpline(keys, [0, 1, 2, 3], pace)(
        np.clip(np.arange(frames), keys[0], keys[3])
    )
    up = 0.5 - 0.5 * np.cos(np.pi * passed)
    turn = np.radians(90) + np.radians(np.interp(passed, [0, 1, 2, 3], [0, 190, 0, -220]))
    hands = np.stack([300 - 60 * np.sin(np.pi * passed / 2), 300 - 80 * up], axis=1)
    head = hands + 110 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    detected = np.ones(frames, bool)
    return Club(np.stack([hands, head], axis=1), detected, detected)


def test_key_postures_are_found_within_two_frames():
    keys = find_key_frames(filmed(), HEIGHT, FPS)
    assert np.abs(keys[:3] - TRUE[:3]).max() <= 2
    assert abs(keys[3] - TRUE[3]) <= 5


def test_slow_motion_changes_no_key_posture():
    slowly = find_key_frames(filmed(), HEIGHT, FPS / 1.5)
    assert np.abs(slowly[:3] - TRUE[:3]).max() <= 3


def test_a_rest_with_the_hands_up_is_no_address():
    club = filmed(np.array([30, 78, 110, 144]), 180)
    ends = club.ends.copy()
    ends[60:78] = ends[78]
    keys = find_key_frames(Club(ends, club.detected, club.tip), HEIGHT, FPS)
    assert abs(keys[0] - 30) <= 4


def test_a_club_that_was_hardly_detected_moves_no_key_posture():
    club, supposed = filmed(), TRUE + np.array([-6.0, 3, -3, 5])
    rarely = club.detected & (np.arange(160) % 5 == 0)
    refined = refine_key_frames(club, supposed, HEIGHT, FPS)
    assert np.abs(refined[:3] - TRUE[:3]).max() <= 2
    kept = refine_key_frames(Club(club.ends, rarely, club.tip), supposed, HEIGHT, FPS)
    assert (kept == supposed).all()


def test_someone_who_stands_still_makes_no_swing():
    club = filmed()
    still = Club(club.ends[:1].repeat(100, axis=0), club.detected[:100], club.tip[:100])
    with pytest.raises(KeyreconError, match="no swing in this video"):
        find_key_frames(still, HEIGHT, FPS)


def test_after_the_finish_normalised_time_may_only_fall():
    phase = keep_order(np.array([-0.1, 0.2, 0.1, 0.5, 1.2, 0.9, 0.95, 0.8]))
    np.testing.assert_allclose(phase, [0, 0.2, 0.2, 0.5, 1, 0.9, 0.9, 0.8])


def test_normalised_time_rises_through_the_key_postures_and_rests_outside():
    times = np.array([0.0, 0.6, 0.75, 1.0])
    phase = interpolate_times(TRUE.astype(float), times, 160)
    np.testing.assert_allclose(phase[TRUE], times, atol=1e-9)
    assert (np.diff(phase) >= 0).all()
    assert phase[0] == 0 and phase[-1] == 1


def test_key_postures_out_of_order_are_put_around_the_top():
    times = interpolate_times(np.array([52.0, 50.0, 50.0, 49.0]), np.array([0, 0.4, 0.7, 1.0]), 90)
    assert (np.diff(times) >= 0).all() and times[0] == 0 and times[-1] == 1
