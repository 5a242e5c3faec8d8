"""The fitted swing as a motion and as numbers, in the real camera and with the real hands."""

import numpy as np
from jaxtyping import Float

from keyrecon.body import LSP14
from keyrecon.golf.fit.mirror import ACROSS, mirror_capsules, mirror_pose
from keyrecon.golf.fit.residuals import build_capsules, project
from keyrecon.golf.prior.kinematics import find_club, find_joints, place_body
from keyrecon.golf.prior.motion_model import posture_at
from keyrecon.golf.records import Body, Camera, FittedSwing, MotionModel, Observations, SwingState
from keyrecon.records import SOURCES, Motion

REST = 0.02
"""Normalised time from either end within which the player still, or again, rests."""


def describe_fit(
    model: MotionModel,
    body: Body,
    state: SwingState,
    observations: Observations,
    time: Float[np.ndarray, "T"],
    clicked: int,
) -> FittedSwing:
    """The fitted swing; `observations` are the real ones, `state` that of a right-hander.

    `clicked` is the frame of the clicks, and `time` that of every frame in seconds.
    """
    pose = place_body(body, posture_at(model, state.mu, state.alpha), state)
    joints, club, capsules = find_joints(body, pose), find_club(body, pose), build_capsules(body)
    if observations.left_handed:
        joints, club = joints[:, LSP14.mirror] * ACROSS, club * ACROSS
        pose, capsules = mirror_pose(pose), mirror_capsules(capsules)
    fps = (len(time) - 1) / (time[-1] - time[0]) if len(time) > 1 else 1.0
    motion = _make_motion(joints, observations, time, float(fps), clicked)
    return FittedSwing(
        motion=motion,
        state=state,
        body=body,
        pose=pose,
        capsules=capsules,
        club=club,
        club_seen=_pixels(club, observations.camera),
        keys=_find_keys(model, state.mu),
    )


def _find_keys(model: MotionModel, mu: Float[np.ndarray, "T"]) -> Float[np.ndarray, "4"]:
    """Frames in which the normalised time passes those of the key postures."""
    times = np.clip(model.keys, REST, 1 - REST)
    frames = np.arange(len(mu))
    rising = np.concatenate([[True], np.diff(np.maximum.accumulate(mu)) > 0])
    return np.interp(times, mu[rising], frames[rising])


def _make_motion(
    joints: Float[np.ndarray, "T 14 3"],
    observations: Observations,
    time: Float[np.ndarray, "T"],
    fps: float,
    clicked: int,
) -> Motion:
    """Joints as a motion: followed ones count as propagated, all others as filled in."""
    followed = np.isfinite(observations.joints).all(axis=2)
    source = np.where(followed, SOURCES.index("propagated"), SOURCES.index("interpolated"))
    tracked = np.where(followed[..., None], observations.joints, np.nan)
    sure = np.where(followed, 1.0, MODELLED)
    return Motion(
        skeleton=LSP14,
        points3d=joints,
        points2d=_pixels(joints, observations.camera),
        points2d_propagated=tracked,
        confidence=sure,
        source=source,
        scale=observations.camera.focal / joints[..., 2].mean(axis=1),
        fps=fps,
        time=time,
        units="m",
        keyframes=np.array([clicked]),
    )


MODELLED = 0.5
"""Confidence of joints that only the motion model tells."""


def _pixels(points: Float[np.ndarray, "T n 3"], camera: Camera) -> Float[np.ndarray, "T n 2"]:
    return project(points.reshape(-1, 3), camera)[0].reshape(*points.shape[:2], 2)
