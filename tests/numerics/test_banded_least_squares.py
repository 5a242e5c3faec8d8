"""Banded least squares against the same systems written out in full."""

import numpy as np
import pytest

from keyrecon.numerics.banded_least_squares import (
    add_second_differences,
    apply_bands,
    band_from_blocks,
    second_difference_bands,
    solve_banded,
    upper_form,
)


def dense_penalty(count):
    """D'D with the second difference D as a matrix."""
    second = np.diff(np.eye(count), 2, axis=0)
    return second.T @ second


def dense_from_diagonals(bands):
    """The symmetric matrix of main, first and second diagonal."""
    count = bands.shape[1]
    matrix = np.diag(bands[0])
    for offset in (1, 2):
        matrix += np.diag(bands[offset][: count - offset], offset)
        matrix += np.diag(bands[offset][: count - offset], -offset)
    return matrix


@pytest.mark.parametrize("count", [3, 4, 5, 12])
def test_the_bands_are_those_of_the_second_difference(count):
    np.testing.assert_array_equal(
        dense_from_diagonals(second_difference_bands(count)), dense_penalty(count)
    )


@pytest.mark.parametrize("count", [1, 2])
def test_fewer_than_three_frames_have_no_second_difference(count):
    assert not second_difference_bands(count).any()


def test_bands_times_values_are_the_matrix_times_values():
    values = np.random.default_rng(0).normal(size=(9, 4))
    found = apply_bands(second_difference_bands(9), values)
    np.testing.assert_allclose(found, dense_penalty(9) @ values, atol=1e-12)


def chain(count=7, size=3, seed=1):
    """Blocks of single frames with a smoothness penalty, and the same as one dense matrix."""
    rng = np.random.default_rng(seed)
    roots = rng.normal(size=(count, size, size))
    main = roots @ roots.swapaxes(1, 2) + np.eye(size)
    weight = np.diag(rng.uniform(1, 5, size))
    dense = np.kron(dense_penalty(count), weight)
    for t in range(count):
        rows = slice(t * size, (t + 1) * size)
        dense[rows, rows] += main[t]
    diagonals = [main.copy(), *np.zeros((2, count, size, size))]
    add_second_differences(diagonals, weight)
    return diagonals, dense


@pytest.mark.parametrize("count", [1, 2, 3, 7])
def test_a_banded_chain_is_solved_like_a_dense_one(count):
    diagonals, dense = chain(count)
    right = np.random.default_rng(2).normal(size=len(dense))
    found = solve_banded(band_from_blocks(diagonals, 9), right)
    np.testing.assert_allclose(found, np.linalg.solve(dense, right), atol=1e-9)


def test_a_band_no_wider_than_what_is_not_zero_holds_all_of_it():
    # diagonal coupling: nothing lies farther off than two blocks
    diagonals, dense = chain()
    right = np.ones(len(dense))
    found = solve_banded(band_from_blocks(diagonals, 7), right)
    np.testing.assert_allclose(found, np.linalg.solve(dense, right), atol=1e-9)


@pytest.mark.parametrize("count", [3, 8])
def test_the_upper_form_holds_the_same_matrix(count):
    bands = second_difference_bands(count) + np.array([[1.0], [0], [0]])
    right = np.random.default_rng(3).normal(size=(count, 2))
    found = solve_banded(upper_form(bands), right, lower=False)
    np.testing.assert_allclose(found, solve_banded(bands, right), atol=1e-9)
