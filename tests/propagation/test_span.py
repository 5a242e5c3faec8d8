"""Facts about how far apart hands are, from marks."""

import numpy as np

from keyrecon.propagation.evidence import SPAN_SPREAD, span_cost


def test_hands_that_were_never_marked_apart_are_hardly_so():
    marked = np.random.default_rng(0).uniform(0.02, 0.06, 10)
    together, apart = span_cost(np.array([0.05, 0.3]), marked)
    assert together < 0.01
    assert apart > 2


def test_hands_that_were_marked_apart_once_are_free():
    marked = np.array([0.03] * 9 + [0.6])
    assert (span_cost(np.linspace(0.0, 0.6, 30), marked) == 0).all()


def test_two_marks_tell_less_than_twelve():
    far = np.array([10 * SPAN_SPREAD])
    costs = [span_cost(far, np.full(count, 0.02))[0] for count in (0, 2, 12)]
    assert costs[0] == 0 < costs[1] < costs[2]
