"""A tennis court painted flat, as a known camera sees it: stripes with soft edges, and noise."""

import cv2
import numpy as np

from keyrecon.numerics.geometry import look_at
from keyrecon.world.court import CourtOptions, tennis_court
from keyrecon.world.pinhole import Pinhole

PAINTED = CourtOptions()


def camera_at(centre, target=(0.0, 0.0, 0.0), focal=1.5, size=(640, 360)):
    """A camera at a place on the court's axes; focal length in widths."""
    centre, target = np.array(centre, float), np.array(target, float)
    rotation = look_at(centre, target, np.array([0.0, 0.0, 1.0]))
    return Pinhole(focal * size[0], (np.array(size) - 1) / 2, rotation, centre)


def paint(camera, size=(640, 360), seed=0, court=tennis_court(PAINTED)):
    """The court in grey: dark ground, white lines as wide as they are, a white tape on the net."""
    finer = 4
    big = camera.resized(float(finer))
    picture = np.full((size[1] * finer, size[0] * finer), 90, np.uint8)
    for (start, end), width in zip(court.ends, court.width, strict=True):
        along = np.linspace(start, end, 40)
        up = np.array([0, 0, 1.0])
        aside = up if start[2] else np.cross((end - start) / np.linalg.norm(end - start), up)
        rims = [along + side * width / 2 * aside for side in (-1, 1)]
        for k in range(len(along) - 1):
            corners = np.array([rims[0][k], rims[0][k + 1], rims[1][k + 1], rims[1][k]])
            pixels = big.project(corners)
            if np.isfinite(pixels).all() and np.abs(pixels).max() < 2e4:
                cv2.fillConvexPoly(
                    picture, np.rint(pixels * 16).astype(np.int32), 215, cv2.LINE_8, 4
                )
    small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    noise = np.random.default_rng(seed).normal(0, 2.5, small.shape)
    return np.clip(small + noise, 0, 255).astype(np.uint8)


def court_error(camera, truth, size=(640, 360)):
    """Distances of points of the court in the picture from where they truly are, px."""
    grid = np.meshgrid(np.linspace(-5.4, 5.4, 7), np.linspace(-11.8, 11.8, 9))
    points = np.column_stack([grid[0].ravel(), grid[1].ravel(), np.zeros(63)])
    there = truth.project(points)
    inside = ((there > 0) & (there < size)).all(axis=1)
    return np.linalg.norm(camera.project(points) - there, axis=1)[inside]
