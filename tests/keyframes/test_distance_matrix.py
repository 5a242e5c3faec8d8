from dataclasses import fields, replace

import numpy as np
import pytest
from stick_figure import moving_figure

from keyrecon.errors import KeyreconError
from keyrecon.io.storage import load_record, save_record
from keyrecon.keyframes.distance_matrix import CompareOptions, compare_frames, measure_matrix
from keyrecon.keyframes.edge_distance import align_edges, edge_distance
from keyrecon.keyframes.exemplars import find_exemplars
from keyrecon.records import Edges


@pytest.fixture(scope="module")
def clip():
    edges, track = moving_figure(150, noise=0.002)
    for frame in edges:
        for array in (frame.points, frame.tangent, frame.color):
            array.setflags(write=False)
    return edges, track


@pytest.fixture(scope="module")
def some_frames(clip):
    edges, track = clip
    kept = np.arange(0, 150, 4)
    return tuple(edges[t] for t in kept), replace(
        track,
        head=track.head[kept],
        feet=track.feet[kept],
        height=track.height[kept],
        box=track.box[kept],
        confidence=track.confidence[kept],
    )


@pytest.fixture(scope="module")
def exact_parts(some_frames):
    """What every frame misses of every other, by half of the body: the slow twin."""
    edges, track = some_frames
    parts = {}
    for half in ("upper", "lower"):
        aligned = [align_edges(e, track, t, half) for t, e in enumerate(edges)]
        parts[half] = [[edge_distance(one, other) for other in aligned] for one in aligned]
    return parts


@pytest.fixture(scope="module")
def compared(clip):
    """All frames of the clip compared with all."""
    return compare_frames(*clip)


@pytest.fixture(scope="module")
def by_exemplars(clip):
    """The clip compared as a long video is."""
    return compare_frames(*clip, CompareOptions(most=75))


def off_diagonal(matrix):
    return matrix[~np.eye(len(matrix), dtype=bool)]


@pytest.mark.parametrize("half", ["upper", "lower"])
def test_the_fast_matrix_agrees_with_its_exact_twin(some_frames, exact_parts, half):
    exact = np.array([[d.pooled() for d in row] for row in exact_parts[half]])
    exact = off_diagonal((exact + exact.T) / 2)
    fast = off_diagonal(measure_matrix(*some_frames, half))
    assert np.corrcoef(fast, exact)[0, 1] > 0.997
    assert np.abs(fast - exact).mean() < 0.05 * exact.mean()


def test_max_b_can_be_the_largest_mean_distance_of_the_video(some_frames, exact_parts):
    parts = exact_parts["upper"]
    largest = max(
        d.mean for i, row in enumerate(parts) for j, d in enumerate(row) if i != j and d.matched
    )
    exact = np.array([[d.pooled(largest) for d in row] for row in parts])
    exact = off_diagonal((exact + exact.T) / 2)
    fast = off_diagonal(measure_matrix(*some_frames, "upper", CompareOptions(largest="observed")))
    assert np.corrcoef(fast, exact)[0, 1] > 0.99
    assert np.abs(fast - exact).mean() < 0.06 * exact.mean()


def test_smaller_cells_come_closer_to_the_twin(some_frames, exact_parts):
    exact = np.array([[d.pooled() for d in row] for row in exact_parts["upper"]])
    exact = (exact + exact.T) / 2
    np.fill_diagonal(exact, 0)
    coarse, fine = (
        np.abs(measure_matrix(*some_frames, "upper", options) - exact).mean()
        for options in (CompareOptions(cell=1 / 24), CompareOptions(cell=1 / 128, directions=48))
    )
    assert fine < coarse / 2


def test_distances_are_symmetric_bounded_and_zero_to_themselves(compared):
    for matrix in (compared.upper, compared.lower):
        assert matrix.dtype == np.float32
        assert np.array_equal(matrix, matrix.T)
        assert (np.diag(matrix) == 0).all()
        assert matrix.min() >= 0
        assert matrix.max() <= np.float32(0.12)
    assert np.array_equal(compared.consecutive_distance[0], np.diag(compared.upper, 1))


def test_a_frame_without_edges_is_as_far_as_can_be_from_all_others(some_frames):
    edges, track = some_frames
    nothing = Edges(
        np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0, int), np.zeros(0, bool), np.zeros(0, bool)
    )
    comparison = compare_frames((*edges[:5], nothing, *edges[6:]), track)
    others = np.delete(comparison.upper[5], 5)
    assert np.allclose(others, 0.12)
    assert comparison.visibility_score[5] == 0


def test_a_video_without_edges_says_what_would_help(some_frames):
    edges, track = some_frames
    hidden = tuple(replace(e, lower=np.zeros_like(e.lower)) for e in edges)
    with pytest.raises(KeyreconError, match="lower body; pick the colours"):
        compare_frames(hidden, track)


def test_frames_of_no_confidence_are_not_clear(some_frames):
    edges, track = some_frames
    confidence = np.ones(len(edges))
    confidence[3] = 0
    visibility_score = compare_frames(edges, replace(track, confidence=confidence)).visibility_score
    assert visibility_score[3] == 0
    assert visibility_score[4] > 0.5


def test_new_frames_are_compared_with_known_ones_as_all_are_with_all(clip):
    full = measure_matrix(*clip, "upper")
    new = measure_matrix(*clip, "upper", n_known=70)
    assert np.array_equal(new, full[70:])


def line_of_poses(position):
    """Distances of poses on a line, as `find_exemplars` asks for them."""

    def compare(known, parts):
        for new in parts:
            apart = np.abs(position[new][:, None] - position[np.concatenate([known, new])])
            yield np.stack([apart, apart / 2]).astype(np.float32)

    return compare


def test_exemplars_gather_where_the_player_moves():
    position = np.concatenate([np.zeros(200), np.arange(100.0), np.full(200, 100.0)])
    found = find_exemplars(line_of_poses(position), np.ones(500, dtype=bool), 40)
    assert 20 <= len(found.frames) <= 40
    assert (np.diff(found.frames) > 0).all()
    assert np.array_equal(found.row[found.frames], np.arange(len(found.frames)))
    moving = (found.frames >= 200) & (found.frames < 300)
    assert moving.mean() > 0.9
    apart = np.abs(position - position[found.frames[found.row]])
    assert apart.max() <= 3
    assert np.allclose(found.distance, [apart, apart / 2])


def test_what_recurs_takes_no_more_exemplars():
    stroke = np.concatenate([np.arange(60.0), np.arange(60.0)[::-1]])
    repeated = np.tile(stroke, 20)
    found = find_exemplars(line_of_poses(repeated), np.ones(len(repeated), dtype=bool), 70)
    assert len(found.frames) == 60
    assert found.distance.max() == 0


def test_frames_that_show_nothing_are_no_exemplars():
    position = np.tile(np.arange(60.0), 3)
    may_lead = np.arange(180) % 7 > 0
    found = find_exemplars(line_of_poses(position), may_lead, 30)
    assert may_lead[found.frames].all()
    assert len(found.row) == 180


def test_a_long_video_is_compared_by_exemplars_as_it_would_be_in_full(compared, by_exemplars):
    assert len(by_exemplars.frames) <= 75
    spread = np.ix_(by_exemplars.row, by_exemplars.row)
    for half in ("upper", "lower"):
        direct, indirect = getattr(compared, half), getattr(by_exemplars, half)[spread]
        assert np.corrcoef(direct.ravel(), indirect.ravel())[0, 1] > 0.97
    steps = by_exemplars.consecutive_distance, compared.consecutive_distance
    assert np.allclose(*steps, atol=2e-3)


def test_parts_of_a_long_video_may_be_compared_elsewhere(clip, by_exemplars, tmp_path):
    def elsewhere(work, inputs):
        for arguments in inputs:
            save_record(tmp_path / "inputs.npz", arguments)
            yield work(*load_record(tmp_path / "inputs.npz"))

    there = compare_frames(*clip, CompareOptions(most=75), parallel_map=elsewhere)
    for field in fields(there):
        here = getattr(by_exemplars, field.name)
        np.testing.assert_array_equal(here, getattr(there, field.name))
