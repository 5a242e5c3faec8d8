"""A swing whose every number is known, and what a perfect or a noisy tracker would observe."""

import numpy as np

from keyrecon.body import LSP14
from keyrecon.golf.fit.residuals import project
from keyrecon.golf.fit.result import describe_fit
from keyrecon.golf.observe.swing_timing import interpolate_times
from keyrecon.golf.prior.kinematics import find_club, find_joints, fitted_pose
from keyrecon.golf.prior.skeleton import size_body
from keyrecon.golf.records import (
    Camera,
    InitialJoints,
    Matches,
    Observations,
    SwingFit,
    SwingState,
)
from keyrecon.io.formats.model_file import read_motion_model

TRACKED = [LSP14.index(f"{s}_{n}") for s in ("right", "left") for n in ("ankle", "knee", "wrist")]
TRACKED.append(LSP14.index("head_top"))


def camera_before(azimuth, distance=5.0, height=1.2):
    """Rotation and position of the swing axes for a camera; 180 degrees is face-on."""
    angle = np.radians(azimuth)
    centre = np.array([distance * np.sin(angle), height, distance * np.cos(angle)])
    forward = np.array([0, 0.9, 0]) - centre
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0, 1.0, 0])
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    return rotation, -rotation @ centre


def even_times(frames, still=10):
    return np.clip((np.arange(frames) - still) / (frames - 2 * still), 0, 1)


def observe(joints, club, camera, noise, seed=0):
    """Observations of joints and club in camera axes (T, 14, 3) and (T, 2, 3)."""
    rng = np.random.default_rng(seed)
    frames = len(joints)
    seen = np.full((frames, 14, 2), np.nan)
    pixels = project(joints.reshape(-1, 3), camera)[0].reshape(frames, 14, 2)
    seen[:, TRACKED] = pixels[:, TRACKED] + rng.normal(0, noise, (frames, len(TRACKED), 2))
    ends = project(club.reshape(-1, 3), camera)[0].reshape(frames, 2, 2)
    nothing = tuple(np.zeros((0, 2)) for _ in range(frames))
    return Observations(
        camera=camera,
        initial=InitialJoints(0, (), np.zeros((0, 2))),
        height=300.0,
        stature=1.8,
        joints=seen,
        spread=np.full((frames, 14), 3.0),
        club=ends + rng.normal(0, noise, ends.shape),
        club_spread=np.full(frames, 4.0),
        club_along=np.full((frames, 2), 16.0),
        foreground=nothing,
        silhouette_distance=np.zeros((0, 2, 2)),
        matches=Matches(np.zeros(0, int), np.zeros((0, 2)), np.zeros((0, 2))),
        keys=np.arange(4.0),
        phase=np.zeros(frames),
        left_handed=False,
    )


FRAMES, FPS = 480, 240.0
KEYS = np.array([60.0, 250.0, 310.0, 430.0])


def swing_at(frames):
    """Some frames of a swing that takes 60 from the top to the hit."""
    fit, seen = played(frames)
    return describe_fit(fit, seen, frames / FPS)


def observed(frames):
    return played(frames)[1]


def played(frames):
    model, body = read_motion_model(), size_body(1.75)
    phase = interpolate_times(KEYS, model.keys, FRAMES)[frames]
    rotation, position = camera_before(180.0)
    turns, places = np.tile(rotation, (len(frames), 1, 1)), np.tile(position, (len(frames), 1))
    fit = SwingFit(model, body, SwingState(np.zeros(4), phase, turns, places))
    pose, camera = fitted_pose(fit), Camera(1000.0, np.array([639.5, 359.5]))
    return fit, observe(find_joints(body, pose), find_club(body, pose), camera, 0.0)
