"""The player's proportions from the joints that a person placed."""

from dataclasses import replace

import numpy as np
import pytest
from golf_truth import camera_before, even_times, observe

from keyrecon.body import LSP14
from keyrecon.golf.clicks import NEEDED
from keyrecon.golf.fit import proportions
from keyrecon.golf.fit.fitting import FitOptions
from keyrecon.golf.fit.proportions import (
    PARTS,
    ProportionOptions,
    clicked_joints,
    fit_proportions,
    refit_proportions,
    scale_body,
)
from keyrecon.golf.fit.residuals import project
from keyrecon.golf.prior.kinematics import find_club, find_joints, place_body
from keyrecon.golf.prior.motion_model import posture_at
from keyrecon.golf.prior.skeleton import size_body
from keyrecon.golf.records import Camera, InitialJoints, SwingFit, SwingMarks, SwingState
from keyrecon.io.formats.model_file import read_motion_model

CAMERA = Camera(1000.0, np.array([640.0, 360.0]))
FACTORS = np.array([1.04, 0.96, 1.0, 0.95, 1.08, 1.02, 1.06, 0.98])
FRAMES = np.array([0, 14, 25, 39])


@pytest.fixture(scope="module")
def posed():
    """The average body in the mean swing, and the marks of a player of other proportions."""
    model, body = read_motion_model(), size_body(1.8)
    rotation, position = camera_before(180.0)
    state = SwingState(
        np.zeros(0), even_times(40, 5), np.tile(rotation, (40, 1, 1)), np.tile(position, (40, 1))
    )
    posture = posture_at(model, state.phase, state.coefficients)
    joints = find_joints(theirs := scale_body(body, FACTORS), place_body(theirs, posture, state))
    pixels = project(joints[FRAMES].reshape(-1, 3), CAMERA)[0].reshape(4, 14, 2)
    return body, place_body(body, posture, state), SwingMarks.of_joints(FRAMES, pixels)


def lengths(body):
    return np.linalg.norm(body.joint_place, axis=1)


def test_marks_of_four_postures_tell_how_long_the_limbs_are(posed):
    body, pose, marks = posed
    fitted = fit_proportions(body, pose, marks, CAMERA, spread=1.0)
    share = lengths(fitted) / lengths(scale_body(body, FACTORS))
    assert np.ptp(share) < 0.02  # how large all of the player is, one camera cannot tell


def test_without_marks_the_player_is_average(posed):
    body, pose, marks = posed
    nothing = replace(marks, joints=np.full_like(marks.joints, np.nan))
    fitted = fit_proportions(body, pose, nothing, CAMERA)
    np.testing.assert_allclose(fitted.offsets, body.offsets, atol=1e-9)


def test_a_longer_part_moves_what_hangs_on_it():
    body = size_body(1.8)
    longer = scale_body(body, 1 + 0.1 * np.eye(len(PARTS))[PARTS.index("thigh")])
    state = SwingState(np.zeros(0), np.zeros(1), np.eye(3)[None], np.zeros((1, 3)))
    posture = posture_at(read_motion_model(), state.phase, state.coefficients)
    legs = [find_joints(b, place_body(b, posture, state))[0, :6] for b in (body, longer)]
    thighs = [np.linalg.norm(leg[2] - leg[1]) for leg in legs]
    shanks = [np.linalg.norm(leg[1] - leg[0]) for leg in legs]
    assert thighs[1] == pytest.approx(1.1 * thighs[0]) and shanks[1] == pytest.approx(shanks[0])


def test_six_clicks_tell_how_trunk_and_legs_share_the_height(posed):
    body, pose, marks = posed
    first = marks.joints[0]
    hips = [LSP14.index("right_hip"), LSP14.index("left_hip")]
    places = [first[hips].mean(axis=0) if n == "root" else first[LSP14.index(n)] for n in NEEDED]
    clicks = clicked_joints(body, pose, InitialJoints(0, NEEDED, np.array(places)), CAMERA)
    share = lengths(fit_proportions(body, pose, clicks, CAMERA)) / lengths(body)
    trunk, thigh = (share[LSP14.index(name)] for name in ("neck", "right_knee"))
    assert 1.02 < thigh / trunk < 1.06 / 0.96


@pytest.fixture
def proportions_with(posed, monkeypatch):
    """Finds bone lengths by six clicks and further marks, without fitting anew."""
    body, pose, marks = posed
    model, (rotation, position) = read_motion_model(), camera_before(180.0)
    state = SwingState(
        np.zeros(0), even_times(40, 5), np.tile(rotation, (40, 1, 1)), np.tile(position, (40, 1))
    )
    fit = SwingFit(model, body, state)
    monkeypatch.setattr(
        proportions, "refit_swing",
        lambda seen, initial, state, *_: SwingFit(model, initial.body, state),
    )  # fmt: skip
    first, hips = marks.joints[0], [LSP14.index("right_hip"), LSP14.index("left_hip")]
    places = [first[hips].mean(axis=0) if n == "root" else first[LSP14.index(n)] for n in NEEDED]
    seen = replace(
        observe(find_joints(body, pose), find_club(body, pose), CAMERA, 0.0),
        initial=InitialJoints(0, NEEDED, np.array(places)),
    )

    def find(marks=None):
        observed = seen if marks is None else replace(seen, marks=marks)
        options = FitOptions(), ProportionOptions()
        return lengths(refit_proportions(fit, observed, fit, 25.0, *options).body)

    return find


def test_a_corrected_joint_leaves_the_proportions_that_clicks_told(posed, proportions_with):
    body, _, marks = posed
    wrist = replace(marks, joints=np.full_like(marks.joints, np.nan))
    wrist.joints[2, LSP14.index("left_wrist")] = marks.joints[2, LSP14.index("left_wrist")]
    by_clicks, with_wrist = proportions_with(), proportions_with(wrist)
    assert np.abs(by_clicks / lengths(body) - 1).max() > 0.015
    legs = [LSP14.index(f"{side}_{joint}") for side in SIDES for joint in ("knee", "ankle")]
    np.testing.assert_allclose(with_wrist[legs], by_clicks[legs], rtol=0.005)


def test_a_marked_shaft_tells_nothing_of_the_proportions(posed, proportions_with):
    marks = posed[2]
    shaft = replace(
        marks, joints=np.full_like(marks.joints, np.nan), shafts=np.full_like(marks.shafts, 400.0)
    )
    np.testing.assert_array_equal(proportions_with(shaft), proportions_with())


SIDES = ("right", "left")
