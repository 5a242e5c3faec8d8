"""Facts about perspective in a lift: who is filmed from near has near limbs that look long."""

import numpy as np
import pytest
from swinging_figure import swinging_motion

from keyrecon.body import LSP14
from keyrecon.lifting.lifting import LiftPriors, LiftResult, lift_motion
from keyrecon.lifting.perspective import relative_distance, without_perspective
from keyrecon.metrics import pa_mpjpe
from keyrecon.numerics.bone_directions import pose_from_directions
from keyrecon.records import Annotations, HalfKeyframes, JointTracks, Keyframes

DISTANCE, FOCAL = 2.2, 900.0
"""Body heights, px."""


def tilted_motion(frames: int) -> np.ndarray:
    """A swinging figure seen from 25 degrees above, its middle `DISTANCE` before the camera."""
    truth = pose_from_directions(swinging_motion(frames, 3), LSP14.lengths, LSP14)
    sine, cosine = np.sin(np.radians(25)), np.cos(np.radians(25))
    truth = truth @ np.array([[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]]).T
    truth -= truth.mean(axis=1, keepdims=True)
    return truth + np.array([0, 0, DISTANCE])


def filmed(truth: np.ndarray) -> tuple[JointTracks, Annotations, Keyframes]:
    """Tracks and marks of the motion in perspective, with all depth signs."""
    picture = FOCAL * truth[..., :2] / truth[..., 2:] + [640.0, 360.0]
    frames = len(truth)
    at = np.arange(6, frames, 12)
    bones = LSP14.bones
    depth = (truth[:, bones[:, 1]] - truth[:, bones[:, 0]])[..., 2]
    nearer = -np.sign(depth[at]).astype(np.int64)
    marks = Annotations(LSP14, at, picture[at], np.ones((len(at), 14), bool), nearer)
    nearest = at[np.abs(np.arange(frames)[:, None] - at).argmin(axis=1)]
    apart = np.abs(np.arange(frames) - nearest).astype(float)
    half = HalfKeyframes(at, nearest, apart < 4, 1.0, 4.0, apart, len(at))
    tracks = JointTracks(picture, np.ones((frames, 14)))
    return tracks, marks, Keyframes(half, half, 10, 0.95)


def test_what_is_drawn_together_from_afar_lies_where_it_was_seen_when_put_back():
    truth = tilted_motion(20)
    picture = FOCAL * truth[..., :2] / truth[..., 2:]
    scale = np.full(20, FOCAL / DISTANCE)
    distance = relative_distance(truth, scale, FOCAL)
    middle = np.zeros((20, 2))
    flat = without_perspective(picture, middle, distance)
    assert np.allclose(flat, truth[..., :2] * scale[:, None, None])
    assert np.allclose(without_perspective(flat, middle, 1 / distance), picture)


@pytest.fixture(scope="module")
def lifted() -> tuple[np.ndarray, JointTracks, dict[float | None, LiftResult]]:
    """Truth, tracks, and lifts that are told no focal length, the true one and twice as much."""
    truth = tilted_motion(180)
    tracks, marks, keyframes = filmed(truth)
    height = np.full(len(truth), 0.88 * FOCAL / DISTANCE)
    told = {
        focal: lift_motion(tracks, marks, keyframes, height, 50.0, LiftPriors(focal=focal))
        for focal in (None, FOCAL, 2 * FOCAL)
    }
    return truth, tracks, told


def test_heads_are_not_too_long_for_their_shanks_once_the_lens_is_known(lifted):
    _, _, told = lifted
    child = LSP14.bones[:, 1].tolist()
    head, shank = (child.index(LSP14.index(name)) for name in ("head_top", "left_ankle"))
    shares = {focal: result.lengths / LSP14.lengths for focal, result in told.items()}
    off = {focal: share[head] / share[shank] - 1 for focal, share in shares.items()}
    assert off[None] > 0.15
    assert abs(off[FOCAL]) < 0.5 * off[None]


def test_the_pose_of_a_near_player_is_better_once_the_lens_is_roughly_known(lifted):
    truth, _, told = lifted
    error = {focal: pa_mpjpe(result.points3d, truth) for focal, result in told.items()}
    assert error[FOCAL] < 0.85 * error[None]
    assert error[2 * FOCAL] < 0.9 * error[None]


def test_joints_lie_where_they_were_seen_with_perspective_taken_out(lifted):
    _, tracks, told = lifted
    apart = np.linalg.norm(told[FOCAL].points2d - tracks.joints, axis=-1)
    assert np.median(apart) < 0.01 * FOCAL / DISTANCE


def test_joints_that_would_be_behind_the_camera_are_only_moved_so_far():
    points = np.zeros((1, 14, 3))
    points[0, 0, 2] = -5.0
    distance = relative_distance(points, np.array([500.0]), 100.0)
    assert distance.min() == 0.5
