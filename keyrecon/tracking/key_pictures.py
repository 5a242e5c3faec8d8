"""One picture of a view, and how another frame shows the same view.

Corners spread evenly over a key picture are tracked into a frame by pyramidal Lucas-Kanade
(Bouguet 2000) and a model is fitted by RANSAC, so that whatever moves on its own is outvoted. A
similarity is fitted first; a full homography replaces it only where it explains the corners
clearly better, since its extra freedom otherwise drifts where there are no corners. The RANSAC of
the homography is locally optimised (Chum, Matas and Kittler, DAGM 2003): a sample of four corners
carries their noise, and the best of many is refitted to all that agree with it.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from keyrecon.numerics.geometry import warp_points

Grey = UInt8[np.ndarray, "h w"]

MAX_CORNERS = 240
"""Corners tracked from a key picture. A quarter more or less, others with it: at most 1.9 points,
2.4 mm on four clips; halved: no change."""
INLIER_DISTANCE = 1.0
"""How far a corner may lie from where the camera's motion puts it, reduced px. A quarter more or
less, others with it: at most 1.9 points, 2.4 mm on four clips; halved: no change."""
AGREEING_DISTANCE = 0.35
"""How far a corner may lie from the homography that it is fitted to, reduced px: a few times what
Lucas-Kanade errs by. Beyond it are letters laid over the picture and limbs that move slowly.

Mean error of the path over 28 s of each of seven rendered videos of turning cameras, px: plain
RANSAC with 1 px .12 to 1.54; locally optimised with 1 px .10 to 1.43, with .35 .11 to .88, which is
.57 of the plain one's in the median, .96 at worst. On 12 s of them .18 and .25 gave what .35 did
within .06; .5 and .7 lay between in three of four.
"""
MIN_INLIERS = 12
"""Fewer agreeing corners say nothing about the camera. A quarter more or less, others with it: at
most 1.9 points, 2.4 mm on four clips; halved: no change."""
MAX_RESIDUAL_RATIO = 0.8
"""A homography must bring the median residual below this share of a similarity's. A quarter more or
less, others with it: at most 1.9 points, 2.4 mm on four clips; halved: no change."""
MIN_SCENE_MOTION = 3.0
"""A corner that the model moves by so much shows whether it belongs to the scene, reduced px. A
quarter more or less, others with it: at most 1.9 points, 2.4 mm on four clips; halved: no
change."""


@dataclass(frozen=True, eq=False)
class KeyPicture:
    """A picture that others are registered to."""

    picture: Grey
    corners: Float[np.ndarray, "n 2"]
    to_start: Float[np.ndarray, "3 3"]


@dataclass(frozen=True, eq=False)
class Match:
    """How a key picture is registered to a frame."""

    model: Float[np.ndarray, "3 3"]
    confidence: float
    """Share of agreeing corners."""
    moved: Float[np.ndarray, "m 2"]
    """Corners of the key picture that the model moves noticeably."""
    moves_along: Bool[np.ndarray, "m"]
    """Whether they were tracked to where it puts them."""


def find_corners(grey: Grey, overlaid: Bool[np.ndarray, "h w"] | None) -> Float[np.ndarray, "n 2"]:
    """Corners spread over the picture: the best of each cell of a grid, weak ones left out."""
    mask = None if overlaid is None else (~overlaid).astype(np.uint8)
    response = cv2.cornerMinEigenVal(grey, 5)
    if mask is not None:
        response = response * mask
    cell = max(6, round(np.sqrt(grey.size / MAX_CORNERS)))
    rows, columns = grey.shape[0] // cell, grey.shape[1] // cell
    blocks = response[: rows * cell, : columns * cell]
    blocks = blocks.reshape(rows, cell, columns, cell).swapaxes(1, 2).reshape(rows, columns, -1)
    best = blocks.argmax(axis=2)
    y = np.arange(rows)[:, None] * cell + best // cell
    x = np.arange(columns) * cell + best % cell
    good = blocks.max(axis=2) > max(1e-6, 0.002 * float(response.max()))
    return np.stack([x[good], y[good]], axis=1).astype(np.float32)


def match_key(key: KeyPicture, grey: Grey, guess: Float[np.ndarray, "3 3"]) -> Match | None:
    """Homography from a key picture to this one; None where too few corners agree."""
    if len(key.corners) < MIN_INLIERS:
        return None
    start = warp_points(guess, key.corners.astype(float)).astype(np.float32)
    size = np.array(grey.shape[::-1])
    inside = ((start > 4) & (start < size - 5)).all(axis=1)
    if inside.sum() < MIN_INLIERS:
        return None
    source = np.ascontiguousarray(key.corners[inside])
    tracked, status, _ = cv2.calcOpticalFlowPyrLK(
        key.picture, grey, source, start[inside].copy(), winSize=(15, 15), maxLevel=3,
        criteria=(cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 15, 0.02),
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )  # fmt: skip
    good = status.ravel() > 0
    source, tracked = source[good], tracked[good]
    model = _fit(source, tracked)
    if model is None:
        return None
    put = warp_points(model, source)
    agrees = np.linalg.norm(put - tracked, axis=1) < 1.5 * INLIER_DISTANCE
    if agrees.sum() < MIN_INLIERS:
        return None
    moved = np.linalg.norm(put - source, axis=1) > MIN_SCENE_MOTION
    return Match(model, float(agrees.sum()) / int(inside.sum()), source[moved], agrees[moved])


def _fit(
    source: Float[np.ndarray, "n 2"], target: Float[np.ndarray, "n 2"]
) -> Float[np.ndarray, "3 3"] | None:
    """A similarity, or a homography where that is clearly better."""
    if len(source) < MIN_INLIERS:
        return None
    similar, _ = cv2.estimateAffinePartial2D(
        source, target, method=cv2.RANSAC, ransacReprojThreshold=2 * INLIER_DISTANCE, maxIters=500
    )
    if similar is None:
        return None
    model = np.vstack([similar, [0, 0, 1]])
    # Four parameters more need many corners to be known well.
    if len(source) < 5 * MIN_INLIERS:
        return model
    full, _ = cv2.findHomography(source, target, cv2.USAC_FAST, AGREEING_DISTANCE, maxIters=500)
    if full is None:
        return model
    error, other = (
        np.median(np.minimum(np.linalg.norm(warp_points(m, source) - target, axis=1), 3))
        for m in (model, full)
    )
    return full if other < MAX_RESIDUAL_RATIO * error else model
