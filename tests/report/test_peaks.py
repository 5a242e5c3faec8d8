"""Peaks that stand out."""

import numpy as np
import pytest
from scipy.signal import find_peaks

from keyrecon.report.peaks import prominent_peaks


@pytest.mark.parametrize("levels", [4, 1000])
@pytest.mark.parametrize("seed", range(20))
def test_peaks_are_those_that_scipy_finds(levels, seed):
    values = np.random.default_rng(seed).integers(0, levels, 200) / levels
    wanted, _ = find_peaks(values, height=0.4, prominence=0.5)
    assert 0 < len(wanted) < 100
    np.testing.assert_array_equal(prominent_peaks(values, 0.4, 0.5), wanted)


@pytest.mark.parametrize("values", [[], [1.0], [1.0, 1.0], [0.0, 1.0], [2.0, 1.0, 1.0, 3.0]])
def test_a_curve_that_only_rises_falls_or_stays_has_no_peak(values):
    assert not len(prominent_peaks(np.array(values, dtype=float), 0.0, 0.0))
