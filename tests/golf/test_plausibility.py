"""What speaks against a fitted swing."""

from dataclasses import replace

import numpy as np
import pytest
from golf_truth import camera_before, even_times, observe

from keyrecon.body import LSP14
from keyrecon.golf.fit.residuals import SILHOUETTE_STEP
from keyrecon.golf.fit.result import describe_fit
from keyrecon.golf.observe.film import Film
from keyrecon.golf.observe.motion_timing import TimeShift
from keyrecon.golf.plausibility import find_doubts, shown_keys
from keyrecon.golf.prior.kinematics import find_club, find_joints, place_body
from keyrecon.golf.prior.motion_model import posture_at
from keyrecon.golf.prior.skeleton import size_body
from keyrecon.golf.records import Camera, InitialJoints, SwingFit, SwingMarks, SwingState
from keyrecon.io.formats.model_file import read_motion_model

CAMERA = Camera(1000.0, np.array([640.0, 360.0]))
FRAMES = 50
TIME = np.arange(FRAMES) / 30
"""Its swings take 1.33 s, a fifth of it downwards."""


@pytest.fixture(scope="module")
def played():
    """A swing as it is, seen without noise by a camera in front: (fitted, observations)."""
    model, body = read_motion_model(), size_body(1.8)
    rotation, position = camera_before(180.0)
    state = SwingState(
        np.zeros(len(model.components)),
        even_times(FRAMES, 5),
        np.tile(rotation, (FRAMES, 1, 1)),
        np.tile(position, (FRAMES, 1)),
    )
    pose = place_body(body, posture_at(model, state.phase, state.coefficients), state)
    observations = observe(find_joints(body, pose), find_club(body, pose), CAMERA, noise=0.1)
    fitted = describe_fit(SwingFit(model, body, state), observations, TIME)
    return fitted, observations


def texts(fitted, observations):
    return " ".join(doubt.text for doubt in find_doubts(fitted, observations))


def test_nothing_speaks_against_a_swing_that_is_where_it_was_seen(played):
    assert find_doubts(*played) == []


def test_key_postures_out_of_order_or_at_the_films_end_are_told(played):
    fitted, observations = played
    assert "not in order" in texts(replace(fitted, keys=np.array([-1.0, 0, 0, 30])), observations)
    ended = replace(fitted, keys=np.array([5.0, 42.0, 48.5, 49.0]))
    assert "the hit lies at the film's end" in texts(ended, observations)


def test_a_pace_that_nobody_swings_at_is_told(played):
    fitted, observations = played
    slow = replace(fitted, motion=replace(fitted.motion, time=TIME * 6))
    assert "slow motion?" in texts(slow, observations)
    _, top, hit, finish = fitted.keys
    hasty = replace(fitted, keys=np.array([top - 0.5 * (hit - top), top, hit, finish]))
    assert "the tempo is 0.5 to 1" in texts(hasty, observations)


def test_a_downswing_off_from_what_moves_in_the_pictures_is_told(played):
    fitted, observations = played
    middle = round(float(fitted.keys[1:3].mean()))

    def told(*shift):
        (doubt,) = find_doubts(fitted, observations, TimeShift(*shift))
        assert abs(doubt.frame - middle) <= 1
        return doubt.text

    assert "come down 0.10 s later" in told(3.0, 0.35, 0.2, 0.5)
    assert "come down 0.10 s earlier" in told(-3.0, -0.35, 0.2, 0.5)
    assert "nothing moves where" in told(-3.0, -0.35, -0.1, 0.05)
    assert find_doubts(fitted, observations, TimeShift(0.5, 0.06, 0.4, 0.45)) == []


def test_a_club_elsewhere_or_nowhere_is_told(played):
    fitted, observations = played
    turned = observations.club[:, ::-1]
    assert "agrees with the detected one in 0%" in texts(fitted, replace(observations, club=turned))
    none = replace(observations, club=np.full_like(turned, np.nan))
    assert "detected in 0%" in texts(fitted, none)


def on_trunk_and_beside(fitted, observations, beside):
    """Samples of a mask: on the spine, and a share of them at the player's side."""
    spine = fitted.motion.points2d[:, [LSP14.index("neck")]]
    hips = fitted.motion.points2d[:, [LSP14.index("right_hip"), LSP14.index("left_hip")]]
    way = hips.mean(axis=1, keepdims=True) - spine
    on = spine + np.linspace(0.3, 0.9, 100)[None, :, None] * way
    on[:, : round(100 * beside), 0] += 1.2 * observations.height
    return replace(observations, foreground=tuple(on))


def test_a_body_beside_the_figure_is_told_with_a_frame(played):
    fitted, observations = played
    observations = on_trunk_and_beside(fitted, observations, 0.0)
    shape = (FRAMES, 720 // SILHOUETTE_STEP, 1280 // SILHOUETTE_STEP)
    on = replace(observations, silhouette_distance=np.zeros(shape))
    assert find_doubts(fitted, on) == []
    off = replace(observations, silhouette_distance=np.full(shape, 50.0))
    (doubt,) = find_doubts(fitted, off)
    assert "only 0% of the joints" in doubt.text
    assert 0 <= doubt.frame < FRAMES


def test_frames_without_a_mask_do_not_speak_for_a_swing(played):
    fitted, observations = played
    observations = on_trunk_and_beside(fitted, observations, 0.0)
    masked = np.arange(FRAMES) % 4 == 0
    samples = [s if m else s[:0] for s, m in zip(observations.foreground, masked, strict=True)]
    shape = (720 // SILHOUETTE_STEP, 1280 // SILHOUETTE_STEP)
    away = np.where(masked[:, None, None], np.full(shape, 50.0), 0.0)
    seen = replace(observations, foreground=tuple(samples), silhouette_distance=away)
    assert "only 0% of the joints lie on the player" in texts(fitted, seen)
    nowhere = replace(seen, foreground=tuple(s[:0] for s in samples))
    assert "figure is whole in no frame" in texts(fitted, nowhere)


@pytest.mark.parametrize(("beside", "told"), [(0.0, False), (0.15, True)])
def test_a_figure_that_is_more_than_the_body_is_told(played, beside, told):
    fitted, observations = played
    seen = on_trunk_and_beside(fitted, observations, beside)
    assert ("15% of the player's figure lies beside" in texts(fitted, seen)) == told


def test_joints_tracked_elsewhere_are_told_unless_the_track_is_unsure(played):
    fitted, observations = played
    joints, spread = observations.joints.copy(), observations.spread.copy()
    knee = LSP14.index("left_knee")
    joints[:, knee, 0] += 0.1 * observations.height
    assert "left_knee most" in texts(fitted, replace(observations, joints=joints))
    spread[:, knee] = 0.2 * observations.height
    assert texts(fitted, replace(observations, joints=joints, spread=spread)) == ""


@pytest.mark.parametrize(("frames", "told"), [(2, False), (6, True)])
def test_hands_that_leave_the_figure_are_told_unless_for_a_moment_only(played, frames, told):
    fitted, observations = played
    observations = on_trunk_and_beside(fitted, observations, 0.0)
    distance = np.zeros((FRAMES, 720 // SILHOUETTE_STEP, 1280 // SILHOUETTE_STEP))
    first = round(float(fitted.keys[1]))
    wrists = [LSP14.index("right_wrist"), LSP14.index("left_wrist")]
    for t in range(first, first + frames):
        for x, y in (fitted.motion.points2d[t, wrists] / SILHOUETTE_STEP).astype(int):
            distance[t, max(0, y - 8) : y + 8, max(0, x - 8) : x + 8] = 50.0
    doubts = find_doubts(fitted, replace(observations, silhouette_distance=distance))
    assert [doubt.frame for doubt in doubts] == ([first + frames // 2] if told else [])
    assert all("both hands" in doubt.text for doubt in doubts)


def test_clicks_that_the_fit_is_not_near_are_told(played):
    fitted, observations = played
    names = ("head_top", "root", "right_knee", "left_knee", "right_ankle", "left_ankle")
    points = fitted.motion.points2d[0]
    hips = (points[LSP14.index("right_hip")] + points[LSP14.index("left_hip")]) / 2
    places = np.array([hips if n == "root" else points[LSP14.index(n)] for n in names])
    clicked = replace(observations, initial=InitialJoints(0, names, places))
    assert find_doubts(fitted, clicked) == []
    aside = replace(observations, initial=InitialJoints(0, names, places + np.array([60.0, 0.0])))
    assert "clicked joints are 20% of the body height away" in texts(fitted, aside)


def film_of(frames):
    """A film of frames of a file, the first and last of which it shows."""
    numbers, everywhere = np.arange(frames), np.tile(np.eye(3), (frames, 1, 1))
    whole, size = (0, frames - 1), (720, 500)
    return Film(
        numbers, numbers / 30.0, numbers * 1.0, everywhere, size, np.zeros(2), True, whole, 0.0,
        whole,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("keys", "frames", "shown"),
    [
        ((19.0, 36.8, 44.2, 57.0), 80, (True, True)),
        ((0.0, 17.0, 25.7, 40.0), 45, (False, True)),  # begins within the upswing
        ((3.5, 25.5, 34.9, 36.0), 41, (True, False)),  # ends right after the hit
        ((3.5, 26.0, 34.8, 41.0), 46, (True, False)),  # ends in the follow-through
        ((19.0, 36.8, 44.2, 78.5), 80, (True, False)),
    ],
)
def test_a_film_that_begins_late_or_ends_early_does_not_show_the_whole_swing(keys, frames, shown):
    assert shown_keys(np.array(keys), film_of(frames)) == (shown[0], True, True, shown[1])


def test_a_finish_that_is_held_in_pictures_that_repeat_is_shown():
    whole = film_of(60)
    index = np.minimum(whole.film_index, 50.0)
    held = replace(
        whole, file_frames=whole.file_frames[:51], time=whole.time[:51], film_index=index
    )
    in_file = held.keys_in_file(np.array([10.0, 30.0, 38.0, 50.0]))
    assert shown_keys(in_file, held) == (True, True, True, True)


def test_a_shaft_that_was_marked_far_from_the_fitted_club_is_told(played):
    """The club is shown where it was marked in any case: only this tells of a mark beside it."""
    fitted, observations = played
    at = np.array([10, 30])
    shafts = fitted.club2d[at].copy()
    nothing = np.full((2, 14, 2), np.nan), np.full(4, np.nan)
    right = replace(observations, marks=SwingMarks(at, nothing[0], shafts, nothing[1]))
    assert find_doubts(fitted, right) == []
    turned = shafts.copy()
    turned[1, 1] = shafts[1, 0] + (shafts[1, 1] - shafts[1, 0])[::-1] * [1, -1]
    wrong = replace(right, marks=replace(right.marks, shafts=turned))
    (doubt,) = find_doubts(fitted, wrong)
    assert "the club was marked 90 degrees" in doubt.text and doubt.frame == 30
