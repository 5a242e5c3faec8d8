"""What the report of a swing tells of a body that turns by known angles."""

from dataclasses import replace

import numpy as np
from golf_truth import observe
from scipy.spatial.transform import Rotation

from keyrecon.body import LSP14
from keyrecon.golf.fit.residuals import build_capsules
from keyrecon.golf.prior.skeleton import size_body
from keyrecon.golf.records import Camera, FittedSwing, RootPose, SwingState
from keyrecon.records import Motion
from keyrecon.report.golf_measures import measure_swing

FRAMES = 31


def turning(shoulders, hips, aside=0.0):
    """A player whose lines of shoulders and hips turn about the vertical; a camera `aside`."""
    points = np.zeros((FRAMES, 14, 3))
    for part, angles, y in (("shoulder", shoulders, -0.5), ("hip", hips, 0.0)):
        across = 0.2 * np.stack([np.cos(angles), 0 * angles, np.sin(angles)], axis=1)
        middle = np.array([0.0, y, 4.0])
        points[:, LSP14.index(f"left_{part}")] = middle + across
        points[:, LSP14.index(f"right_{part}")] = middle - across
    points = points @ Rotation.from_euler("y", aside, degrees=True).as_matrix().T
    body = size_body(1.8)
    upright = np.tile(np.diag([1.0, -1, -1]), (FRAMES, 1, 1))
    return FittedSwing(
        motion=motion_of(points),
        state=SwingState(np.zeros(4), np.zeros(FRAMES), upright, np.zeros((FRAMES, 3))),
        body=body,
        pose=RootPose(np.zeros((FRAMES, 16, 3)), np.tile(np.eye(3), (FRAMES, 16, 1, 1))),
        capsules=build_capsules(body),
        club=np.zeros((FRAMES, 2, 3)),
        club2d=np.zeros((FRAMES, 2, 2)),
        keys=np.array([0.0, 18.0, 24.0, 30.0]),
    )


def motion_of(points):
    flat = points[..., :2]
    return Motion(
        LSP14, points, flat, flat, np.ones((FRAMES, 14)), np.ones((FRAMES, 14), int),
        np.ones(FRAMES), 30.0, np.arange(FRAMES) / 30, "m", np.array([0]),
    )  # fmt: skip


def seen(left_handed=False):
    camera = Camera(800.0, np.array([320.0, 240.0]))
    one = observe(np.ones((FRAMES, 14, 3)), np.ones((FRAMES, 2, 3)), camera, 0.0)
    club = one.club.copy()
    club[::3] = np.nan
    return replace(one, club=club, left_handed=left_handed)


def test_tempo_is_upswing_to_downswing():
    measures = measure_swing(turning(np.zeros(FRAMES), np.zeros(FRAMES)), seen())
    assert abs(measures.tempo - 3.0) < 1e-9
    assert abs(measures.downswing - 0.2) < 1e-9


def test_shoulders_that_turn_farther_than_hips_make_the_x_factor():
    ramp = np.linspace(0, 1, FRAMES)
    measures = measure_swing(turning(np.radians(90) * ramp, np.radians(40) * ramp), seen())
    np.testing.assert_allclose(np.abs(measures.shoulders), 90 * ramp, atol=1e-6)
    np.testing.assert_allclose(np.abs(measures.x_factor), 50 * ramp, atol=1e-6)


def test_a_left_hander_turns_away_from_the_target_too():
    ramp = np.radians(90) * np.linspace(0, 1, FRAMES)
    right = measure_swing(turning(ramp, ramp), seen())
    left = measure_swing(turning(-ramp, -ramp), seen(left_handed=True))
    np.testing.assert_allclose(left.shoulders, right.shoulders, atol=1e-6)


def test_turns_do_not_depend_on_where_the_camera_stands():
    angles = np.linspace(0, 1.5, FRAMES), np.linspace(0, 0.7, FRAMES)
    before, beside = (measure_swing(turning(*angles, aside), seen()) for aside in (0, 70))
    np.testing.assert_allclose(beside.shoulders, before.shoulders, atol=1e-6)


def test_frames_without_a_club_lower_the_share_found():
    measures = measure_swing(turning(np.zeros(FRAMES), np.zeros(FRAMES)), seen())
    assert abs(measures.club_found - 20 / 31) < 1e-9
