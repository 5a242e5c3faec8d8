import numpy as np

from keyrecon.golf.observe.club_lines import lay_on, measure_departure


def test_a_club_laid_on_a_line_keeps_its_length_and_its_hands_along_it():
    line, club = np.array([[0.0, 0.0], [10.0, 0.0]]), np.array([[3.0, 4.0], [3.0, 24.0]])
    np.testing.assert_allclose(lay_on(line, club), [[3.0, 0.0], [23.0, 0.0]])
    np.testing.assert_allclose(lay_on(line, np.full((2, 2), np.nan)), line)


def test_a_club_departs_by_what_it_was_turned_and_shifted_by():
    turn, length = np.radians(-20.0), 0.6
    expected = np.array([[0.2, 0.3], [0.2, 0.3 + length]])
    way = length * np.array([-np.sin(turn), np.cos(turn)])
    aside = 0.01 * np.array([-way[1], way[0]]) / length
    turned = np.stack([expected[0] + aside, expected[0] + aside + way])
    departure = measure_departure(expected, np.stack([expected, turned]), np.array([10.0, 0.02]))
    np.testing.assert_allclose(departure, [[0, 0], [-2, 0.5]], atol=1e-12)
