import numpy as np
import pytest

from keyrecon.numerics.geometry import unit_vectors


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
