import cv2
import numpy as np
import pytest

from keyrecon.segmentation.contours import EdgeOptions, sample_inside, trace_edges

OPTIONS = EdgeOptions(player=100, step=0.02)
CENTER = np.array([80.0, 70.0])


def ring(outer, inner, value=1):
    y, x = np.mgrid[:140, :160]
    distance = np.hypot(x - CENTER[0], y - CENTER[1])
    return np.where((distance <= outer) & (distance >= inner), value, 0).astype(np.uint8)


def left_of(tangent):
    """On the picture, y pointing down."""
    return np.stack([tangent[:, 1], -tangent[:, 0]], axis=1)


def test_a_disc_lies_on_the_left_of_its_edge():
    found = trace_edges(ring(40, 0), OPTIONS)
    inward = CENTER - found.points
    assert ((left_of(found.tangent) * inward).sum(axis=1) > 0).all()
    assert (np.linalg.norm(inward, axis=1)) == pytest.approx(40.5, abs=1.0)


def test_an_annulus_lies_on_the_left_of_both_its_edges():
    found = trace_edges(ring(50, 25), OPTIONS)
    outward = found.points - CENTER
    distance = np.linalg.norm(outward, axis=1)
    side = (left_of(found.tangent) * outward).sum(axis=1) / distance
    assert (side[distance > 37] < -0.9).all()
    assert (side[distance < 37] > 0.9).all()
    assert (distance < 37).sum() == pytest.approx((distance > 37).sum() / 2, rel=0.1)


def test_elements_are_one_step_apart():
    points = trace_edges(ring(40, 0), OPTIONS).points
    gaps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    # A digital circle is longer than the circle by a few per cent.
    assert gaps == pytest.approx(0.02 * 100, rel=0.25)


def test_the_border_between_two_colours_is_an_edge_of_both():
    labels = ring(40, 0)
    labels[70:][labels[70:] > 0] = 2
    found = trace_edges(labels, OPTIONS)
    middle = (np.abs(found.points[:, 1] - 70) < 2) & (np.abs(found.points[:, 0] - 80) < 30)
    upper, lower = (found.tangent[middle & (found.color == c)] for c in (0, 1))
    assert len(upper) > 10
    assert len(lower) > 10
    # The upper region is on the left of a walk to the right.
    assert (upper[:, 0] > 0.9).all()
    assert (lower[:, 0] < -0.9).all()


def test_what_touches_the_border_of_the_crop_is_not_an_edge():
    labels = np.zeros((60, 60), np.uint8)
    labels[20:, 10:30] = 1
    found = trace_edges(labels, OPTIONS)
    assert found.points[:, 1].max() < 58
    assert found.points[:, 1].min() < 21


def test_an_empty_crop_has_no_edges():
    assert len(trace_edges(np.zeros((50, 50), np.uint8), OPTIONS).points) == 0


def test_a_crowded_crop_is_thinned_to_the_most_elements_allowed():
    labels = np.zeros((200, 200), np.uint8)
    for x in range(10, 190, 20):
        for y in range(10, 190, 20):
            cv2.circle(labels, (x, y), 7, 1, -1)
    assert len(trace_edges(labels, EdgeOptions(player=100, most=150)).points) == 150


def test_places_inside_fill_all_regions_evenly():
    labels = ring(40, 15)
    labels[:, 80:] *= 2
    places = sample_inside(labels, 4.5)
    distance = np.linalg.norm(places - CENTER, axis=1)
    assert ((distance > 13) & (distance < 42)).all()
    assert len(places) * 4.5**2 == pytest.approx(np.pi * (40**2 - 15**2), rel=0.05)


def test_there_is_no_place_inside_nothing():
    assert sample_inside(np.zeros((40, 50), np.uint8), 4.5).shape == (0, 2)
