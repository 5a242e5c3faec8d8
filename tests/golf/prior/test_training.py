"""From captured swings to a motion model, on swings drawn from the built-in one."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from keyrecon.app.golf_demo import draw_swing
from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.golf.prior.captured_swing import MIRROR, make_swing, retarget_swing
from keyrecon.golf.prior.key_postures import find_key_postures
from keyrecon.golf.prior.motion_vectors import motion_vector, sample_swing
from keyrecon.golf.prior.skeleton import size_body
from keyrecon.golf.prior.training import (
    TrainOptions,
    collect_swings,
    cross_validate,
    learn_motion,
    without,
)
from keyrecon.golf.prior.variation import VariationOptions, vary_swing
from keyrecon.io.formats.model_file import read_motion_model

NO_VARIATION = TrainOptions(variation=VariationOptions(count=0))


@pytest.fixture(scope="module")
def swings():
    model = read_motion_model()
    return tuple(draw_swing(model, seed) for seed in range(3))


def with_rest(points, frames=40):
    """Held at both ends, as a player rests before and after."""
    return np.concatenate([points[:1].repeat(frames, 0), points, points[-1:].repeat(frames, 0)])


def test_key_postures_of_a_drawn_swing_are_found(swings):
    for swing in swings:
        keys = find_key_postures(with_rest(swing.joints), with_rest(swing.club), swing.fps)
        assert np.abs(keys - 40 - swing.keys)[[1, 2]].max() <= 5
        assert np.abs(keys - 40 - swing.keys)[[0, 3]].max() <= 20


def test_a_player_who_only_stands_has_no_swing(swings):
    still = swings[0].joints[:1].repeat(200, 0)
    with pytest.raises(KeyreconError, match="no swing"):
        find_key_postures(still, None, 120.0)


def test_where_and_which_way_a_capture_stands_makes_no_difference(swings):
    swing = swings[0]
    parts = [with_rest(p) for p in (swing.joints, swing.toes, swing.club)]
    plain = make_swing(*parts, swing.fps, "plain")
    turn = Rotation.from_euler("y", 2.1).as_matrix()
    moved = make_swing(*(p @ turn.T + [3.0, 0.4, -2.0] for p in parts), swing.fps, "moved")
    np.testing.assert_allclose(plain.joints, moved.joints, atol=1e-9)
    np.testing.assert_allclose(plain.club, moved.club, atol=1e-9)


def test_a_left_hander_gives_the_swing_of_his_mirror_image(swings):
    swing = swings[1]
    joints, toes, club = (with_rest(p) for p in (swing.joints, swing.toes, swing.club))
    right = make_swing(joints, toes, club, swing.fps, "right")
    left = make_swing(
        joints[:, LSP14.mirror] * MIRROR, toes[:, ::-1] * MIRROR, club * MIRROR, swing.fps, "left"
    )
    np.testing.assert_allclose(left.joints, right.joints, atol=1e-9)


def test_another_body_keeps_feet_in_place_and_hands_together(swings):
    swing = swings[0]
    retargeted = retarget_swing(swing, size_body(1.6))
    ankles = [LSP14.index("right_ankle"), LSP14.index("left_ankle")]
    slid = retargeted.joints[:, ankles] - 1.6 / swing.stature * swing.joints[:, ankles]
    assert np.abs(slid).max() < 0.02
    wrists = [LSP14.index("right_wrist"), LSP14.index("left_wrist")]
    before, after = (
        np.linalg.norm(s.joints[:, wrists[0]] - s.joints[:, wrists[1]], axis=1)
        for s in (swing, retargeted)
    )
    assert np.median(np.abs(after - 1.6 / swing.stature * before)) < 0.01


def test_without_variation_all_swings_lie_in_the_span_of_their_components(swings):
    database = collect_swings(swings, NO_VARIATION)
    model = learn_motion(database, "drawn", NO_VARIATION)
    assert len(model.components) == len(swings) - 1
    axes = model.components.reshape(len(model.components), -1)
    for vector in database.vectors:
        coefficients, *_ = np.linalg.lstsq(axes.T, (vector - model.mean).ravel(), rcond=None)
        assert np.allclose(model.mean.ravel() + coefficients @ axes, vector.ravel(), atol=1e-6)
    assert model.explained[-1] == pytest.approx(1.0)


def test_alphas_of_the_database_have_unit_variance(swings):
    database = collect_swings(swings, NO_VARIATION)
    model = learn_motion(database, "drawn", NO_VARIATION)
    axes = model.components.reshape(len(model.components), -1)
    coefficients = [
        np.linalg.lstsq(axes.T, (v - model.mean).ravel(), rcond=None)[0] for v in database.vectors
    ]
    np.testing.assert_allclose(np.var(coefficients, axis=0, ddof=1), 1.0, rtol=1e-6)


def test_a_swing_is_left_out_with_its_variations(swings):
    options = TrainOptions(components=4, variation=VariationOptions(count=2))
    database = collect_swings(swings, options)
    assert len(database.vectors) == 9
    kept = without(database, 1)
    assert len(kept.vectors) == 6
    assert np.array_equal(kept.vectors[1], database.vectors[2])
    rows = cross_validate(database, options)
    assert [row.components for row in rows] == [0, 1, 2, 3, 4]
    assert 0 < rows[-1].pa_mpjpe < 150


def test_variations_keep_the_feet_on_the_floor_and_differ(swings):
    body = size_body(1.75)
    rng = np.random.default_rng(3)
    one, other = (vary_swing(swings[0], body, VariationOptions(), rng) for _ in range(2))
    ankles = [LSP14.index("right_ankle"), LSP14.index("left_ankle")]
    for varied in (one, other):
        lifted = varied.joints[:, ankles, 1] - 1.75 / 1.8 * swings[0].joints[:, ankles, 1]
        assert np.abs(lifted).max() < 0.06
    assert np.abs(one.joints - other.joints).max() > 0.02


def test_one_swing_alone_has_no_variance(swings):
    with pytest.raises(KeyreconError, match="no variance"):
        collect_swings(swings[:1], NO_VARIATION)


def test_samples_of_a_swing_pass_its_key_postures(swings):
    swing = swings[0]
    keys = np.array([0.0, 0.4, 0.7, 1.0])
    turns, place = sample_swing(swing, keys, samples=101)
    vectors = motion_vector(turns, place, np.tile(np.eye(3), (turns.shape[1], 1, 1)))
    whole = replace(swing, keys=np.array([0, swing.keys[1], swing.keys[2], swing.keys[3]]))
    exact = motion_vector(
        *sample_swing(whole, keys, samples=101), np.tile(np.eye(3), (turns.shape[1], 1, 1))
    )
    np.testing.assert_allclose(vectors, exact, atol=1e-9)
    np.testing.assert_allclose(place[40], sample_swing(swing, keys, samples=11)[1][4], atol=1e-9)
