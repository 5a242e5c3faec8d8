import numpy as np
import pytest

from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.mocap import Capture
from keyrecon.synthetic.clips import JoinOptions, bone_lengths, join_with_toes
from keyrecon.synthetic.figure import ANKLE_HEIGHT, STATURE, estimate_stature, point_figure
from keyrecon.synthetic.motion import MotionOptions, play_tennis

ANKLES = [LSP14.index("right_ankle"), LSP14.index("left_ankle")]
FPS = 50.0


@pytest.fixture(scope="module")
def tennis():
    return play_tennis(MotionOptions(seconds=20.0, seed=3))


def lengths(points):
    bones = LSP14.bones
    return np.linalg.norm(points[:, bones[:, 0]] - points[:, bones[:, 1]], axis=-1)


def speeds(points):
    return np.linalg.norm(np.diff(points, axis=0), axis=-1) * FPS


def test_bones_of_the_built_in_player_keep_their_lengths(tennis):
    assert np.ptp(lengths(tennis), axis=0).max() < 1e-6


def test_bones_of_the_built_in_player_have_human_proportions(tennis):
    np.testing.assert_allclose(lengths(tennis)[0] / 1.78, LSP14.lengths, atol=0.002)


def test_feet_never_sink_into_the_floor(tennis):
    assert tennis[:, ANKLES, 1].min() > ANKLE_HEIGHT * 1.78 / STATURE - 1e-9


def test_a_foot_on_the_floor_does_not_slide(tennis):
    ankles = tennis[:, ANKLES]
    down = ankles[..., 1] < ANKLE_HEIGHT * 1.78 / STATURE + 1e-9
    still = down[1:] & down[:-1]
    assert still.mean() > 0.4
    assert np.linalg.norm(np.diff(ankles, axis=0), axis=-1)[still].max() < 1e-6


def test_the_player_moves_as_fast_as_people_do(tennis):
    assert 6 < speeds(tennis)[:, LSP14.index("right_wrist")].max() < 16
    assert speeds(tennis)[:, LSP14.index("neck")].max() < 5
    assert (np.linalg.norm(np.diff(tennis, 2, axis=0), axis=-1) * FPS**2).max() < 400


def test_knees_bend_forward(tennis):
    for side in ("right", "left"):
        hip, knee, ankle = (tennis[:, LSP14.index(f"{side}_{n}")] for n in ("hip", "knee", "ankle"))
        toes = point_figure(tennis, FPS).toes[:, 0 if side == "right" else 1]
        ahead = (knee - (hip + ankle) / 2) * [1, 0, 1]
        assert ((ahead * toes).sum(axis=1) > -0.05).mean() > 0.97


def test_a_left_handed_player_is_the_mirror_image(tennis):
    left = play_tennis(MotionOptions(seconds=20.0, seed=3, left_handed=True))
    np.testing.assert_array_equal(left, tennis[:, LSP14.mirror] * [-1, 1, 1])


def test_strokes_are_repeated_but_never_the_same(tennis):
    wrist = tennis[:, LSP14.index("right_wrist")]
    fast = np.flatnonzero(speeds(tennis)[:, LSP14.index("right_wrist")] > 5)
    strokes = np.split(fast, np.flatnonzero(np.diff(fast) > 25) + 1)
    assert len(strokes) >= 4
    tops = [wrist[s, 1].max() for s in strokes]
    assert len(set(np.round(tops, 4))) == len(tops)


def test_a_camera_with_few_frames_a_second_sees_the_player_too():
    points = play_tennis(MotionOptions(seconds=12.0, fps=6.0))
    assert points.shape == (72, 14, 3) and np.isfinite(points).all()


def test_the_same_seed_plays_the_same_points(tennis):
    np.testing.assert_array_equal(tennis, play_tennis(MotionOptions(seconds=20.0, seed=3)))
    assert not np.allclose(tennis, play_tennis(MotionOptions(seconds=20.0, seed=4)))


def test_stature_is_found_from_the_bones(tennis):
    assert estimate_stature(tennis) == pytest.approx(1.78, rel=0.002)


@pytest.fixture(scope="module")
def captures(tennis):
    """Two clips of different people at other rates, off the floor and turned."""
    short = play_tennis(MotionOptions(seconds=9.0, seed=5, fps=120.0, stature=1.62))
    turned = np.stack([short[..., 2], short[..., 1] + 0.3, -short[..., 0]], axis=-1)
    return [Capture(tennis[:450] + np.array([3.0, 0, 1]), FPS), Capture(turned, 120.0)]


def test_joined_clips_never_jump(captures):
    joined = join_with_toes(captures, JoinOptions(seconds=30.0))[:, :14]
    assert joined.shape == (1500, 14, 3)
    assert speeds(joined).max() < 16


def test_joined_clips_are_one_person_on_the_floor(captures):
    joined = join_with_toes(captures, JoinOptions(seconds=30.0))[:, :14]
    np.testing.assert_allclose(lengths(joined) / bone_lengths(captures[0].joints), 1, atol=0.03)
    assert abs(joined[:, ANKLES, 1].min() - ANKLE_HEIGHT) < 0.04


def test_captured_toes_go_with_their_ankles_and_change_nothing_else(captures):
    toes = [c.joints[:, ANKLES] + [0, -0.05, 0.17] for c in captures]
    footed = [Capture(c.joints, c.fps, t) for c, t in zip(captures, toes, strict=True)]
    joined = join_with_toes(footed, JoinOptions(seconds=30.0))
    without = join_with_toes(captures, JoinOptions(seconds=30.0))
    np.testing.assert_array_equal(joined[:, :14], without[:, :14])
    foot = np.linalg.norm(joined[:, 14:] - joined[:, ANKLES], axis=2)
    np.testing.assert_allclose(foot, np.hypot(0.05, 0.17), rtol=1e-6)
    assert np.isnan(without[:, 14:]).all()


def test_joined_clips_face_the_net(captures):
    joined = join_with_toes(captures, JoinOptions(seconds=12.0))[:, :14]
    front = point_figure(joined, FPS).front.mean(axis=0)
    assert -front[2] > 3 * abs(front[0])


def test_one_short_clip_is_repeated_as_often_as_needed(captures):
    short = Capture(captures[0].joints[:100], FPS)
    joined = join_with_toes([short], JoinOptions(seconds=14.0))[:, :14]
    assert joined.shape == (700, 14, 3)
    assert speeds(joined).max() < 20


def test_a_clip_too_short_to_join_is_refused():
    with pytest.raises(KeyreconError, match="needs"):
        join_with_toes([Capture(np.zeros((10, 14, 3)), 100.0)])
