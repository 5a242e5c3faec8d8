import numpy as np
import pytest

from keyrecon.numerics.geometry import signed_angles, unit_vectors


def test_a_unit_vector_has_length_one_and_the_same_direction():
    vectors = np.random.default_rng(0).normal(size=(4, 5, 3))
    units = unit_vectors(vectors)
    assert np.linalg.norm(units, axis=-1) == pytest.approx(1)
    assert np.cross(units, vectors) == pytest.approx(0)
    assert ((units * vectors).sum(axis=-1) > 0).all()


def test_a_zero_vector_stays_zero_and_an_unknown_one_unknown():
    vectors = np.array([[0.0, 0.0], [np.nan, np.nan]])
    assert unit_vectors(vectors)[0].tolist() == [0.0, 0.0]
    assert np.isnan(unit_vectors(vectors)[1]).all()


def test_what_is_shorter_than_noise_is_not_blown_up():
    assert unit_vectors(np.array([[1e-12, 0.0]]), min_length=1e-9)[0, 0] == pytest.approx(1e-3)


def test_a_vector_is_turned_from_x_to_y_by_a_positive_angle_and_never_by_more_than_half_a_turn():
    degrees = np.array([0.0, 30.0, -30.0, 90.0, 179.0, -179.0])
    x_axis = np.tile([2.0, 0.0], (len(degrees), 1))
    turned = 5 * np.column_stack([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
    np.testing.assert_allclose(np.degrees(signed_angles(x_axis, turned)), degrees, atol=1e-9)
    np.testing.assert_allclose(np.degrees(signed_angles(turned[4:5], turned[5:])), 2.0)
