import cv2
import numpy as np
import pytest

from keyrecon.tracking.radial_symmetry import ellipse, find_peaks, gradient_field, radial_symmetry


def drawn_ellipse(center, axes, angle, size=(120, 160)):
    y, x = np.mgrid[: size[0], : size[1]]
    dx, dy = x - center[0], y - center[1]
    u = np.cos(angle) * dx + np.sin(angle) * dy
    v = -np.sin(angle) * dx + np.cos(angle) * dy
    inside = (u / axes[0]) ** 2 + (v / axes[1]) ** 2 <= 1
    return cv2.GaussianBlur(inside.astype(np.float32), (0, 0), 1.5)


def best(score):
    places, _ = find_peaks(score, 5.0, 1)
    return places[0]


def test_a_disc_is_found_at_its_centre():
    score = radial_symmetry(gradient_field(drawn_ellipse((70, 50), (9, 9), 0)), [8.0, 9.0, 10.0])
    assert best(score) == pytest.approx([70, 50], abs=0.5)


def test_a_disc_of_the_right_size_scores_higher_than_a_larger_one():
    small, large = (drawn_ellipse((70, 50), (r, r), 0) for r in (8, 20))
    score = [radial_symmetry(gradient_field(m), [8.0]).max() for m in (small, large)]
    assert score[0] > 2 * score[1]


def test_a_dark_disc_is_not_found():
    dark = 1 - drawn_ellipse((70, 50), (9, 9), 0)
    bright = drawn_ellipse((70, 50), (9, 9), 0)
    center = [radial_symmetry(gradient_field(m), [9.0])[50, 70] for m in (dark, bright)]
    assert center[0] < 0.05 * center[1]


@pytest.mark.parametrize("degrees", [0, 30, 45, -60])
def test_an_ellipse_is_found_at_its_centre_by_its_own_form(degrees):
    angle, ratio, radius = np.deg2rad(degrees), 2.0, 9.0
    axes = (radius * np.sqrt(ratio), radius / np.sqrt(ratio))
    slope = gradient_field(drawn_ellipse((80, 60), axes, angle))
    own = radial_symmetry(slope, [radius], 1.0, ellipse(ratio, angle))
    other = radial_symmetry(slope, [radius], 1.0, ellipse(ratio, angle + np.pi / 2))
    assert best(own) == pytest.approx([80, 60], abs=0.7)
    assert own.max() > 1.5 * other.max()


def test_the_vote_along_the_normal_of_an_ellipse_meets_its_centre_exactly():
    generator = np.random.default_rng(0)
    for _ in range(20):
        form = ellipse(generator.uniform(1, 4), generator.uniform(0, np.pi))
        size, angle = generator.uniform(1, 20), generator.uniform(0, 2 * np.pi)
        circle = np.array([np.cos(angle), np.sin(angle)])
        point = size * form @ circle
        inward = -np.linalg.inv(form).T @ circle
        vote = size * form @ form.T @ inward / np.linalg.norm(form.T @ inward)
        assert point + vote == pytest.approx([0, 0], abs=1e-9)


def test_two_discs_are_two_peaks_in_order_of_strength():
    both = drawn_ellipse((40, 40), (9, 9), 0) + 0.5 * drawn_ellipse((110, 80), (9, 9), 0)
    score = radial_symmetry(gradient_field(both), [9.0])
    places, strength = find_peaks(score, 6.0, 2)
    assert places == pytest.approx(np.array([[40, 40], [110, 80]]), abs=0.7)
    assert strength[0] > strength[1]


def test_an_even_map_has_no_peaks():
    score = radial_symmetry(gradient_field(np.zeros((40, 50), np.float32)), [5.0])
    assert len(find_peaks(score, 5.0, 4)[0]) == 0
