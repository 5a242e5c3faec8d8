"""The nearest edge elements in place, direction and colour."""

import numpy as np
import pytest

from keyrecon.propagation.nearest_elements import (
    COLOR_SPACING,
    TANGENT_SCALE,
    describe_elements,
    find_nearest,
    find_nearest_in_parts,
    with_norms,
)

RADIUS = 0.15
FITS, QUERIES, ELEMENTS, PARTS = 7, 31, 53, 3


def elements(random, count):
    """(places within a player's height, directions, colours) of the elements of a few fits."""
    places = random.random((2, FITS, count))
    directions = np.exp(2j * np.pi * random.random((FITS, count)))
    return places[0] + 1j * places[1], directions, random.integers(0, 3, (FITS, count))


@pytest.fixture
def drawn():
    random = np.random.default_rng(0)
    part = random.integers(0, PARTS, (FITS, ELEMENTS))
    part[0] = 1  # all of one fit lie in one part
    return elements(random, QUERIES), elements(random, ELEMENTS), part


def nearest_one_by_one(queries, among, allowed):
    """Position of the nearest element of those that are allowed, and whether it is in reach."""
    nearest, matched = np.zeros((FITS, QUERIES), int), np.zeros((FITS, QUERIES), bool)
    for fit, query in np.ndindex(nearest.shape):
        point, tangent, color = (values[fit, query] for values in queries)
        squares = [
            abs(other[0] - point) ** 2
            + (TANGENT_SCALE * abs(other[1] - tangent)) ** 2
            + (COLOR_SPACING * (other[2] - color)) ** 2
            for other in zip(*(values[fit] for values in among), strict=True)
        ]
        squares = np.where(allowed[fit], squares, np.inf)
        matched[fit, query] = squares.min() < RADIUS**2
        nearest[fit, query] = squares.argmin()
    return nearest, matched


def test_the_nearest_element_is_that_of_a_search_one_by_one(drawn):
    queries, among, part = drawn
    described = with_norms(describe_elements(*among))
    nearest, matched = find_nearest(describe_elements(*queries), described, RADIUS)
    wanted, reached = nearest_one_by_one(queries, among, np.ones(part.shape, bool))
    assert 0.2 < reached.mean() < 0.9
    np.testing.assert_array_equal(matched, reached)
    np.testing.assert_array_equal(nearest, wanted)


def test_in_each_part_only_its_own_elements_are_found(drawn):
    queries, among, part = drawn
    described = with_norms(describe_elements(*among))
    nearest, matched = find_nearest_in_parts(
        describe_elements(*queries), described, part, PARTS, RADIUS
    )
    for number in range(PARTS):
        wanted, reached = nearest_one_by_one(queries, among, part == number)
        np.testing.assert_array_equal(matched[:, number], reached)
        np.testing.assert_array_equal(nearest[:, number], np.where(reached, wanted, 0))
    assert not matched[0, 0].any()
