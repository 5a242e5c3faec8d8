"""Errors of the body's surface agree with geometry and with finite differences."""

from dataclasses import replace

import numpy as np
import pytest
from golf_truth import observe

from keyrecon.golf.fit.residuals import (
    SightLines,
    find_closest_points,
    foreground_residuals,
    match_residuals,
    place_capsules,
    project,
    sight_directions,
    silhouette_residuals,
)
from keyrecon.golf.records import Camera, Capsules, Matches, RootPose

CAMERA = Camera(800.0, np.array([320.0, 240.0]))
CAPSULES = Capsules(
    np.array([0, 1]),
    np.array([[0.0, -0.3, 0.0], [-0.2, 0.0, 0.0]]),
    np.array([[0.0, 0.3, 0.1], [0.3, 0.1, 0.0]]),
    np.array([[0.12, 0.08], [0.05, 0.09]]),
)


def pose(frames=2, seed=0):
    rng = np.random.default_rng(seed)
    turns = np.linalg.qr(rng.normal(size=(frames, 2, 3, 3)))[0]
    turns *= np.linalg.det(turns)[..., None, None]
    return RootPose(np.array([0.0, 0.0, 4.0]) + rng.normal(0, 0.1, (frames, 2, 3)), turns)


def observed(**what):
    return replace(observe(np.ones((2, 14, 3)), np.ones((2, 2, 3)), CAMERA, 0.0), **what)


def shifted(placed, frame, segment, step):
    origins = placed.origins.copy()
    origins[frame, segment] += step
    return replace(placed, origins=origins)


def turned(placed, row, residuals, angle):
    """The pose after a small turn of a row's segment about its origin."""
    frame, segment = residuals.frame[row], residuals.segment[row]
    cross = np.cross(np.eye(3), angle)
    rotations = placed.rotations.copy()
    rotations[frame, segment] = (np.eye(3) + cross) @ rotations[frame, segment]
    return replace(placed, rotations=rotations)


def samples(seed=1):
    return np.random.default_rng(seed).uniform([150, 60], [500, 420], (60, 2))


def distances():
    picture = np.fromfunction(lambda y, x: 0.6 * x + 0.8 * y, (120, 160))
    return np.stack([picture, picture + 3.0])


def cases():
    start = np.random.default_rng(4).uniform([290, 180], [350, 300], (40, 2))
    matches = Matches(np.zeros(40, int), start, start + 3.0)
    return {
        "foreground": (foreground_residuals, observed(foreground=(samples(), samples(2)))),
        "silhouette": (silhouette_residuals, observed(silhouette_distance=distances())),
        "match": (match_residuals, observed(matches=matches)),
    }


@pytest.mark.parametrize("kind", ["foreground", "silhouette", "match"])
def test_slopes_agree_with_finite_differences(kind):
    observe_, observations = cases()[kind]
    placed = pose()
    rows = observe_(observations, CAPSULES, placed)
    assert len(rows.values) > 8
    step = 1e-5
    for row in range(0, len(rows.values), 3):
        if kind == "match" and rows.frame[row] == 0:
            continue
        frame, segment = rows.frame[row], rows.segment[row]
        arm = rows.point[row] - placed.origins[frame, segment]
        for axis in np.eye(3):
            later = observe_(observations, CAPSULES, shifted(placed, frame, segment, step * axis))
            slope = (later.values[row] - rows.values[row]) / step
            assert abs(slope - rows.gradient[row] @ axis) < 1e-3 * max(1, abs(slope))
            later = observe_(observations, CAPSULES, turned(placed, row, rows, step * axis))
            slope = (later.values[row] - rows.values[row]) / step
            assert abs(slope - rows.gradient[row] @ np.cross(axis, arm)) < 2e-3 * max(1, abs(slope))


def test_a_line_of_sight_through_the_body_misses_nothing():
    placed = pose()
    inside = placed.origins[:, 0] + np.einsum("tij,j->ti", placed.rotations[:, 0], [0, 0.1, 0.02])
    through = tuple(project(p[None], CAMERA)[0] for p in inside)
    assert len(foreground_residuals(observed(foreground=through), CAPSULES, placed).values) == 0


def test_the_distance_of_a_line_of_sight_is_that_of_the_nearest_point_of_the_surface():
    placed, ways = pose(1), sight_directions(samples(), CAMERA)
    lines = SightLines(ways, np.zeros(60, int))
    distances = find_closest_points(lines, place_capsules(CAPSULES, placed)).distance
    starts = placed.origins + np.einsum("tqij,qj->tqi", placed.rotations, CAPSULES.start)
    ends = placed.origins + np.einsum("tqij,qj->tqi", placed.rotations, CAPSULES.end)
    share = np.linspace(0, 1, 2001)[:, None, None]
    points = (1 - share) * starts[0] + share * ends[0]
    radii = CAPSULES.radii[:, 0] + share[..., 0] * (CAPSULES.radii[:, 1] - CAPSULES.radii[:, 0])
    for way, distance in zip(ways, distances, strict=True):
        apart = np.linalg.norm(points - (points @ way)[..., None] * way, axis=2) - radii
        np.testing.assert_allclose(distance, apart.min(axis=0), atol=1e-4)


def test_a_body_that_does_not_move_moves_its_points_nowhere():
    placed = pose()
    still = RootPose(placed.origins[:1].repeat(2, axis=0), placed.rotations[:1].repeat(2, axis=0))
    start = np.random.default_rng(4).uniform([290, 180], [350, 300], (40, 2))
    matches = Matches(np.zeros(40, int), start, start)
    rows = match_residuals(observed(matches=matches), CAPSULES, still)
    assert len(rows.values) > 8
    assert np.abs(rows.values).max() < 1e-6
