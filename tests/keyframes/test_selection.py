import json
from dataclasses import replace

import numpy as np
import pytest
from sporting_poses import comparison_of, sporting_poses

from keyrecon.annotation_budget import least_labels, usual_budget
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.keyframes import keyframes_from_json, keyframes_to_json, read_keyframes
from keyrecon.keyframes.assignment import find_neighborhoods
from keyrecon.keyframes.selection import (
    KeyframeOptions,
    choose_keyframes,
    count_labels,
    half_distances,
)
from keyrecon.keyframes.swaps import CoverageGoal, swap_for_coverage

SPARSE = KeyframeOptions(budget=0.015)


@pytest.fixture(scope="module")
def comparison():
    return comparison_of(sporting_poses(seed=1), sporting_poses(seed=2))


def test_the_whole_budget_is_spent(comparison):
    for budget, upper, lower in ((0.02, 8, 8), (0.0163, 7, 6), (0.0025, 1, 1)):
        chosen = choose_keyframes(comparison, 50.0, KeyframeOptions(budget=budget))
        assert (len(chosen.upper.frames), len(chosen.lower.frames)) == (upper, lower)


@pytest.mark.parametrize("method", ["coverage", "paper"])
def test_the_budget_is_kept_and_the_coverage_reached(comparison, method):
    chosen = choose_keyframes(comparison, 50.0, KeyframeOptions(budget=0.02, method=method))
    labels = len(chosen.upper.frames) + len(chosen.lower.frames)
    assert labels / 2 / 400 <= 0.02
    for half in (chosen.upper, chosen.lower):
        assert half.coverage >= 0.95
        assert np.isin(half.nearest, half.frames).all()
        assert np.array_equal(half.nearest[half.frames], half.frames)
        assert (half.distance[half.frames] == 0).all()
        assert np.array_equal(half.represented, half.distance < half.beta)
        assert np.array_equal(half.frames, np.unique(half.frames))


def test_every_frame_is_assigned_to_its_nearest_keyframe(comparison):
    half = choose_keyframes(comparison, 50.0, KeyframeOptions(budget=0.02, smoothing=0.0)).upper
    to_keyframes = comparison.upper[half.frames]
    assert np.allclose(half.distance, to_keyframes.min(axis=0), atol=1e-3)


def test_a_still_clip_needs_one_keyframe():
    still = comparison_of(1e-4 * np.random.default_rng(0).normal(size=(200, 2)))
    chosen = choose_keyframes(still, 50.0, KeyframeOptions(beta_upper=0.01, beta_lower=0.01))
    assert len(chosen.upper.frames) == len(chosen.lower.frames) == 1
    assert chosen.upper.coverage == 1


def test_frames_that_are_all_the_same_need_no_particular_keyframe():
    chosen = choose_keyframes(comparison_of(np.zeros((100, 2))), 50.0)
    assert chosen.upper.coverage == 1
    assert (chosen.upper.distance == 0).all()


def test_choosing_for_coverage_beats_the_choice_as_printed_at_equal_beta(comparison):
    for beta in (0.01, 0.02):
        # both count frames: to cover strokes in pose change too takes more keyframes
        options = KeyframeOptions(beta_upper=beta, beta_lower=beta, pose_time=0.0)
        chosen = choose_keyframes(comparison, 50.0, options)
        assert len(chosen.upper.frames) < chosen.upper.printed_count
        assert len(chosen.lower.frames) <= chosen.lower.printed_count


def test_a_smaller_beta_takes_more_keyframes(comparison):
    counts = [
        len(
            choose_keyframes(
                comparison, 50.0, KeyframeOptions(beta_upper=beta, beta_lower=0.05)
            ).upper.frames
        )
        for beta in (0.005, 0.01, 0.03)
    ]
    assert counts[0] > counts[1] > counts[2]


def test_a_larger_budget_brings_frames_nearer_to_their_keyframes(comparison):
    small, large = (
        choose_keyframes(comparison, 50.0, KeyframeOptions(budget=b)) for b in (0.01, 0.04)
    )
    assert large.upper.beta < small.upper.beta
    assert large.upper.distance.mean() < small.upper.distance.mean()


def test_a_budget_below_one_keyframe_for_each_half_is_refused():
    short = comparison_of(sporting_poses(60))
    with pytest.raises(KeyreconError, match=r"60 frames is 1 half of the body.*0\.017 or more"):
        choose_keyframes(short, 50.0, KeyframeOptions(budget=0.015))
    chosen = choose_keyframes(short, 50.0, KeyframeOptions(budget=0.017))
    assert len(chosen.upper.frames) == len(chosen.lower.frames) == 1


def test_the_longest_gap_is_a_time_not_a_number_of_frames(comparison):
    assert choose_keyframes(comparison, 50.0).reach == 10
    assert choose_keyframes(comparison, 25.0).reach == 5
    assert choose_keyframes(comparison, 120.0).reach == 24


def test_unclear_frames_are_left_to_clear_ones_as_good():
    poses = sporting_poses(300, seed=3)
    visibility_score = np.ones(300)
    visibility_score[::2] = 0.2
    chosen = choose_keyframes(comparison_of(poses, visibility_score=visibility_score), 50.0, SPARSE)
    assert (visibility_score[chosen.frames] == 1).mean() > 0.7


def test_exchanging_keyframes_never_covers_less(comparison):
    hoods = find_neighborhoods(comparison.upper, comparison, comparison.exemplar_distance[0], 0.01)
    goal = CoverageGoal(hoods, 10, 0, np.ones(400))
    start = [0, 100, 200, 300]
    better = swap_for_coverage(goal, start)
    assert len(better) == len(start)
    assert goal.uncovered_frames(hoods.union(better)) < goal.uncovered_frames(hoods.union(start))


def test_exemplars_choose_as_their_frames_would():
    poses = sporting_poses(200, seed=4)
    twice = np.repeat(poses, 2, axis=0)
    direct = choose_keyframes(comparison_of(twice), 100.0, SPARSE)
    by_exemplars = choose_keyframes(
        comparison_of(poses, row=np.repeat(np.arange(200), 2)), 100.0, SPARSE
    )
    assert by_exemplars.upper.beta == pytest.approx(direct.upper.beta, rel=0.1)
    assert len(by_exemplars.upper.nearest) == 400
    assert (by_exemplars.upper.frames % 2 == 0).all()
    assert by_exemplars.upper.coverage >= 0.95


@pytest.mark.parametrize("method", ["coverage", "paper"])
def test_keyframes_json_gives_back_what_was_written(comparison, method):
    chosen = choose_keyframes(comparison, 50.0, KeyframeOptions(budget=0.015, method=method))
    text = keyframes_to_json(chosen)
    again = keyframes_from_json(text)
    assert again.reach == chosen.reach
    assert again.alpha == chosen.alpha
    assert again.method == chosen.method == method
    for one, other in ((chosen.upper, again.upper), (chosen.lower, again.lower)):
        assert np.array_equal(one.frames, other.frames)
        assert np.array_equal(one.nearest, other.nearest)
        assert np.array_equal(one.represented, other.represented)
        assert np.allclose(one.distance, other.distance, atol=1e-5)
        assert (one.beta, one.coverage, one.printed_count) == (
            other.beta,
            other.coverage,
            other.printed_count,
        )
    data = json.loads(text)
    assert data["frames"] == sorted({*data["upper"], *data["lower"]})
    assert data["cost"] <= 0.015


def test_keyframes_of_a_version_that_did_not_tell_were_chosen_for_coverage(comparison):
    data = json.loads(keyframes_to_json(choose_keyframes(comparison, 50.0)))
    del data["method"]
    assert keyframes_from_json(json.dumps(data)).method == "coverage"
    with pytest.raises(ValueError, match="'method' must be one of coverage, paper"):
        keyframes_from_json(json.dumps(data | {"method": "luck"}))


def test_a_damaged_keyframes_json_says_what_is_wrong(comparison, tmp_path):
    data, file = (
        json.loads(keyframes_to_json(choose_keyframes(comparison, 50.0))),
        tmp_path / "keyframes.json",
    )
    for change, message in (
        ({"upper": [900]}, "outside 0..399"),
        ({"lower": [5, 3]}, "ascending"),
        ({"n_frames": 12}, "outside"),
        ({"T": -5}, "'T' cannot be -5"),
        ({"T": 2.5}, "2.5 is not a whole number"),
        ({"beta": None}, "'beta' tells nothing of upper"),
        ({"coverage": {"upper": 1.0, "lower": None}}, "'coverage' tells nothing of lower"),
        ({"upper": None}, "a value is missing or of another kind"),
        ({"gains": [1]}, "a value is missing or of another kind"),
        ({"alpha": float("nan")}, "NaN is not a number"),
        ({"represented": {"upper": [[0, 900]], "lower": []}}, "frames 0 to 900"),
    ):
        file.write_text(json.dumps({**data, **change}))
        with pytest.raises(KeyreconError, match=rf"keyframes\.json .*{message}"):
            read_keyframes(file)
    for damaged in (b"{", b"", b"\xff", b"[" * 10**5, b'{"T": 1e999}'):
        file.write_bytes(damaged)
        with pytest.raises(KeyreconError, match=r"keyframes\.json is not a choice of keyframes"):
            read_keyframes(file)


def test_inputs_are_left_as_they_were(comparison):
    frozen = replace(comparison, upper=comparison.upper.copy())
    for array in (
        frozen.upper,
        frozen.lower,
        frozen.consecutive_distance,
        frozen.visibility_score,
        frozen.row,
    ):
        array.setflags(write=False)
    choose_keyframes(frozen, 50.0)


@pytest.mark.parametrize(
    ("option", "value"),
    [("coverage", 1.5), ("coverage", float("nan")), ("budget", -1.0), ("budget", 3.0),
     ("budget", float("nan")), ("reach", -5)],
)  # fmt: skip
def test_what_cannot_be_asked_of_keyframes_is_told_by_its_name(option, value):
    with pytest.raises(KeyreconError, match=f"--{option} is"):
        count_labels(KeyframeOptions(**{option: value}), 1000, 50.0)


@pytest.mark.parametrize(
    ("seconds", "share"), [(5, 0.06), (10, 0.045), (20, 0.0225), (30, 0.015), (3600, 0.015)]
)
@pytest.mark.parametrize("fps", [25.0, 50.0, 240.0])
def test_a_short_video_takes_as_many_marks_as_half_a_minute_up_to_six_percent(seconds, share, fps):
    frames = round(seconds * fps)
    assert usual_budget(frames, fps) == pytest.approx(share)
    labels = count_labels(KeyframeOptions(), frames, fps)
    assert labels <= 2 * share * frames + 1e-6


@pytest.fixture(scope="module")
def repeated():
    """Strokes that come back, a minute of them at 25 frames a second."""
    return comparison_of(sporting_poses(1500, seed=4))


def test_what_repeats_itself_is_not_marked_again_however_long_it_lasts(repeated):
    limit, least = count_labels(KeyframeOptions(), 1500, 25.0), least_labels(25.0)
    found = choose_keyframes(repeated, 25.0)
    labels = len(found.upper.frames) + len(found.lower.frames)
    assert least <= labels < limit
    for half in (found.upper, found.lower):
        assert half.coverage >= 0.95
        assert half.beta <= KeyframeOptions().sufficient_beta


def test_frames_that_no_keyframe_can_cover_are_not_marked_for(repeated):
    """Of hours one frame stands for its neighbours; here every fifth differs much from it."""
    row = np.arange(1500)
    apart = repeated.exemplar_distance.copy()
    apart[:, (row // 25) % 5 == 2] = 0.1
    coarse = replace(repeated, exemplar_distance=apart)
    found = choose_keyframes(coarse, 25.0)
    labels = len(found.upper.frames) + len(found.lower.frames)
    assert labels <= count_labels(KeyframeOptions(), 1500, 25.0) - 4
    for half in (found.upper, found.lower):
        assert half.gains is not None
        assert 0.95 * 0.8 - 0.02 <= half.gains.coverage[-1] <= 0.85


def test_no_more_is_asked_for_than_the_limit_however_near_it_must_be(repeated):
    found = choose_keyframes(repeated, 25.0, KeyframeOptions(sufficient_beta=0.001))
    labels = len(found.upper.frames) + len(found.lower.frames)
    assert labels == count_labels(KeyframeOptions(), 1500, 25.0)


def test_marks_come_with_what_they_bring_the_best_first(comparison):
    half = choose_keyframes(comparison, 50.0, KeyframeOptions(budget=0.02, smoothing=0.0)).upper
    gains = half.gains
    assert gains is not None
    assert set(gains.order) == set(half.frames)
    steps = np.diff(gains.coverage, prepend=0)
    assert (steps >= 0).all()
    assert steps[0] == steps.max()
    near = comparison.upper < 0.02
    alone = [
        1 - CoverageGoal(find_neighborhoods(comparison.upper, comparison, np.zeros(400), 0.02), 10,
                         0, np.ones(400))
        .uncovered_frames(near[frame] | (np.arange(400) == frame)) / 400
        for frame in half.frames
    ]  # fmt: skip
    assert gains.coverage[0] == pytest.approx(max(alone), abs=0.005)


def test_the_next_mark_brings_what_one_more_keyframe_adds(comparison):
    few = choose_keyframes(comparison, 50.0, KeyframeOptions(budget=0.01)).upper
    assert few.gains is not None
    assert few.gains.next_gain > 0
    every = choose_keyframes(comparison, 50.0, KeyframeOptions(beta_upper=0.0005, beta_lower=0.05))
    assert every.upper.gains is not None
    assert every.upper.gains.next_gain < few.gains.next_gain


def test_the_next_mark_is_the_best_of_all_tried_one_by_one(comparison):
    half = choose_keyframes(comparison, 50.0, KeyframeOptions(budget=0.01)).upper
    options = KeyframeOptions()
    goal = half_distances(comparison, comparison.upper, 0, 10, options).sufficient_goal
    rows = comparison.row[half.frames].tolist()

    def covered(chosen):
        represented = goal.hoods.union(chosen)
        represented[comparison.frames[chosen]] = True
        return 1 - goal.uncovered_frames(represented) / len(represented)

    tried = [covered([*rows, row]) for row in range(len(comparison.frames))]
    assert half.gains.next_gain == pytest.approx(max(tried) - covered(rows))
    assert half.gains.coverage[-1] == pytest.approx(covered(rows))


def test_a_video_of_a_few_frames_can_be_marked_without_naming_a_budget():
    assert [count_labels(KeyframeOptions(), frames, 30.0) for frames in (1, 3, 16)] == [2, 2, 2]
