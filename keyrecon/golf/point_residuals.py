"""Errors of joints and of the club in the picture (CVPR 2005, Section 4.2).

The distance of a projected joint to where it was tracked is taken as two coordinates: the same
square, and smooth at zero. The club pulls by its two ends, each across and along the shaft: where
the shaft lies is surer than where it ends.
"""

import numpy as np
from jaxtyping import Float, Int

from keyrecon.body import LSP14
from keyrecon.golf.kinematics import find_club, find_joints
from keyrecon.golf.records import Body, Camera, Marks, Observations, Pose, Residuals
from keyrecon.golf.skeleton import CLUB

MODEL_ERROR = 0.03
"""Metres by which joints of the model miss the player's even at best: his proportions and what is
called a joint differ. Added to the tracker's error, it keeps the fit from explaining them away."""


MARK = 3.0
"""Standard deviation of a person's mark, px."""


def joint_residuals(observations: Observations, body: Body, pose: Pose) -> Residuals:
    """Projected minus tracked joints, in standard deviations of the track."""
    frame, joint = np.nonzero(np.isfinite(observations.joints).all(axis=2))
    points = find_joints(body, pose)[frame, joint]
    pixels, slope = project(points, observations.camera)
    spread = _total_spread(observations.spread[frame, joint], slope)
    values = (pixels - observations.joints[frame, joint]) / spread[:, None]
    return pair_rows(values, slope / spread[:, None, None], points,
                     frame, body.joint_segment[joint])  # fmt: skip


def mark_residuals(observations: Observations, body: Body, pose: Pose) -> Residuals:
    """Projected joints minus those that a person marked, in standard deviations."""
    marks = observations.marks
    if marks is None:
        marks = Marks(np.zeros(0, np.int64), np.zeros((0, len(LSP14.names), 2)))
    row, joint = np.nonzero(np.isfinite(marks.joints).all(axis=2))
    frame = marks.frames[row]
    points = find_joints(body, pose)[frame, joint]
    pixels, slope = project(points, observations.camera)
    spread = _total_spread(np.full(len(row), MARK), slope)
    values = (pixels - marks.joints[row, joint]) / spread[:, None]
    return pair_rows(values, slope / spread[:, None, None], points,
                     frame, body.joint_segment[joint])  # fmt: skip


def club_residuals(observations: Observations, body: Body, pose: Pose) -> Residuals:
    """Projected minus seen ends of the club, across and along the shaft, standard deviations."""
    frame = np.flatnonzero(np.isfinite(observations.club).all(axis=(1, 2)))
    points = find_club(body, pose)[frame].reshape(-1, 3)
    seen = observations.club[frame]
    pixels, slope = project(points, observations.camera)
    along = seen[:, 1] - seen[:, 0]
    along = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    axes = np.repeat(np.stack([across, along], axis=1), 2, axis=0)
    spreads = np.repeat(observations.club_spread[frame], 2), observations.club_along[frame].ravel()
    total = np.stack([_total_spread(spread, slope) for spread in spreads], axis=1)
    axes = axes / total[..., None]
    values = np.einsum("nij,nj->ni", axes, pixels - seen.reshape(-1, 2))
    return pair_rows(values, axes @ slope, points, np.repeat(frame, 2),
                     np.full(len(points), CLUB))  # fmt: skip


def _total_spread(
    tracked: Float[np.ndarray, "n"], slope: Float[np.ndarray, "n 2 3"]
) -> Float[np.ndarray, "n"]:
    """Standard deviation of tracker and model together, px."""
    return np.hypot(tracked, MODEL_ERROR * slope[:, 0, 0])


def project(
    points: Float[np.ndarray, "n 3"], camera: Camera
) -> tuple[Float[np.ndarray, "n 2"], Float[np.ndarray, "n 2 3"]]:
    """Pixels of points in camera axes, and their change by the points."""
    depth = np.maximum(points[:, 2], NEAREST)
    flat = points[:, :2] / depth[:, None]
    slope = np.zeros((len(points), 2, 3))
    slope[:, 0, 0] = slope[:, 1, 1] = camera.focal / depth
    slope[:, :, 2] = -camera.focal * flat / depth[:, None]
    return camera.focal * flat + camera.principal, slope


NEAREST = 0.1
"""Metres before the camera within which nothing is filmed."""


def pair_rows(
    values: Float[np.ndarray, "n 2"],
    gradient: Float[np.ndarray, "n 2 3"],
    points: Float[np.ndarray, "n 3"],
    frame: Int[np.ndarray, "n"],
    segment: Int[np.ndarray, "n"],
) -> Residuals:
    """Two rows for every error with two coordinates."""
    return Residuals(
        values.ravel(), np.repeat(frame, 2), np.repeat(segment, 2), np.repeat(points, 2, axis=0),
        gradient.reshape(-1, 3), np.repeat(np.arange(len(values)), 2),
    )  # fmt: skip
