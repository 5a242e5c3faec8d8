"""The court's model keeps to the rules of tennis."""

import numpy as np

from keyrecon.world.court import POINTS, CourtOptions, tennis_court


def outer_edges(options):
    """Extent of all ground lines with their width."""
    court = tennis_court(options)
    ground = (court.ends[..., 2] == 0).all(axis=1)
    ends, half = court.ends[ground], court.width[ground] / 2
    upright = ends[:, 0, 0] == ends[:, 1, 0]
    x = np.abs(ends[..., 0]).max(axis=1) + np.where(upright, half, 0)
    y = np.abs(ends[..., 1]).max(axis=1) + np.where(upright, 0, half)
    return 2 * x.max(), 2 * y.max()


def test_the_court_measures_so_much_to_the_outside_of_its_lines():
    assert np.allclose(outer_edges(CourtOptions()), (10.97, 23.77))


def test_the_net_is_lower_in_the_middle():
    assert POINTS["net-middle"][2] == 0.914
    assert POINTS["net-left"][2] == POINTS["net-right"][2] == 1.07


def test_the_court_looks_the_same_from_both_ends():
    points = tennis_court().points
    turned = points * [-1, -1, 1]
    nearest = np.linalg.norm(points[:, None] - turned[None], axis=2).min(axis=1)
    assert nearest.max() < 0.06  # half the spacing of the points


def test_named_points_lie_on_lines_or_posts():
    points = tennis_court().points
    for name, place in POINTS.items():
        if "foot" not in name:
            assert np.linalg.norm(points - place, axis=1).min() < 0.12, name
