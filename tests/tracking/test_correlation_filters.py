import numpy as np
import pytest

from keyrecon.tracking.correlation_filters import peaks_at, respond, solve_filters, spectrum

SIZE = (48, 60)


def picture(spots, generator):
    """Two noisy channels: a leg above every spot in one, its shoe in the other."""
    leg, shoe = generator.normal(0, 0.1, (2, *SIZE))
    for x, y in spots:
        leg[y - 12 : y, x - 1 : x + 2] += 1
        shoe[y : y + 2, x - 2 : x + 3] += 1
    return np.stack([leg, shoe])


@pytest.fixture(scope="module")
def filters():
    generator = np.random.default_rng(0)
    places = generator.integers((12, 20), (48, 40), (30, 1, 2))
    spectra = np.stack([spectrum(picture(p, generator)) for p in places])
    targets = np.stack([peaks_at(p.astype(float), SIZE, 1.5)[None] for p in places])
    return solve_filters(spectra, targets)


def test_a_part_is_found_where_no_example_had_it(filters):
    response = respond(filters, spectrum(picture([(40, 33)], np.random.default_rng(1))))[0]
    assert np.unravel_index(response.argmax(), SIZE) == (33, 40)


def test_two_parts_give_two_peaks(filters):
    spots = [(15, 25), (40, 33)]
    response = respond(filters, spectrum(picture(spots, np.random.default_rng(1))))[0]
    elsewhere = peaks_at(np.array(spots, float), SIZE, 3.0) < 0.05
    assert min(response[y, x] for x, y in spots) > 2 * response[elsewhere].max()


def test_a_shoe_without_a_leg_responds_less(filters):
    whole = picture([(30, 30)], np.random.default_rng(1))
    lone = whole.copy()
    lone[0, 18:30, 29:32] -= 1
    strong, weak = (respond(filters, spectrum(p))[0, 30, 30] for p in (whole, lone))
    assert weak < 0.7 * strong
