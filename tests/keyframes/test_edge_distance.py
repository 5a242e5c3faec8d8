import numpy as np
import pytest
from stick_figure import moving_figure

from keyrecon.keyframes.edge_distance import align_edges, edge_distance, match_edges
from keyrecon.records import Edges


def line_of_edges(x, direction=(0.0, 1.0), color=0, count=10):
    points = np.stack([np.full(count, x), np.linspace(0, 1, count)], axis=1)
    ones = np.ones(count, dtype=bool)
    tangent = np.tile(np.array(direction) / np.linalg.norm(direction), (count, 1))
    return Edges(points, tangent, np.full(count, color), ones, ones)


def test_parallel_lines_are_their_gap_apart():
    result = edge_distance(line_of_edges(0.0), line_of_edges(0.05), reach=0.12)
    assert result.matched == 1
    assert result.mean == pytest.approx(0.05)
    assert result.pooled(0.12) == pytest.approx(0.05)


@pytest.mark.parametrize(
    "other",
    [
        line_of_edges(0.01, color=1),
        line_of_edges(0.01, direction=(0, -1)),
        line_of_edges(0.01, direction=(1, 0.98)),
        line_of_edges(0.13),
    ],
    ids=["other colour", "other side inside", "more than 45 degrees", "out of reach"],
)
def test_incompatible_elements_never_match(other):
    result = edge_distance(line_of_edges(0.0), other, reach=0.12)
    assert result.matched == 0
    assert result.pooled(0.12) == 0.12


def test_an_element_matches_the_nearest_compatible_one_past_a_nearer_incompatible_one():
    near, far = line_of_edges(0.01, color=1), line_of_edges(0.04)
    both = Edges(
        np.concatenate([near.points, far.points]),
        np.concatenate([near.tangent, far.tangent]),
        np.concatenate([near.color, far.color]),
        np.ones(20, dtype=bool),
        np.ones(20, dtype=bool),
    )
    match, distance = match_edges(line_of_edges(0.0), both)
    assert (match >= 10).all()
    assert np.allclose(distance, 0.04)


def test_pooled_distance_is_a_truncated_chamfer_mean():
    edges, track = moving_figure(60)
    one, other = (align_edges(edges[t], track, t, "upper") for t in (5, 40))
    _, distance = match_edges(one, other)
    assert edge_distance(one, other).pooled(0.12) == pytest.approx(
        np.minimum(distance, 0.12).mean()
    )


def test_distance_forgets_where_and_how_large_the_player_stands():
    near, track_near = moving_figure(3, scale=300.0)
    far, track_far = moving_figure(3, scale=90.0)
    for half in ("upper", "lower"):
        one = align_edges(near[2], track_near, 2, half)
        other = align_edges(far[2], track_far, 2, half)
        assert edge_distance(one, other).pooled() < 1e-6


def test_nothing_to_match_is_as_far_as_can_be():
    empty = line_of_edges(0.0, count=0)
    assert edge_distance(empty, line_of_edges(0.0)).pooled(0.12) == 0.12
    assert edge_distance(line_of_edges(0.0), empty).pooled(0.12) == 0.12
