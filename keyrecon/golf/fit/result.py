"""The fitted swing as a motion and as numbers, in the real camera and with the real hands."""

import numpy as np
from jaxtyping import Float

from keyrecon.body import LSP14
from keyrecon.golf.fit.handedness import MIRROR_X, mirror_capsules, mirror_pose
from keyrecon.golf.fit.residuals import build_capsules, project
from keyrecon.golf.prior.kinematics import find_club, find_joints, fitted_pose
from keyrecon.golf.records import Camera, FittedSwing, MotionModel, Observations, SwingFit
from keyrecon.records import SOURCES, Motion

STILL_PHASE = 0.02
"""Normalised time from either end within which the player still, or again, stands still: there the
learnt motion hardly moves, and noise decides when exactly it begins."""
MODELLED_CONFIDENCE = 0.5
"""Of joints that only the motion model tells: half that of tracked ones, by convention."""


def describe_fit(
    fit: SwingFit, observations: Observations, time: Float[np.ndarray, "T"]
) -> FittedSwing:
    """The fitted swing; `observations` are the real ones, the fit is that of a right-hander.

    `time` is that of every frame, seconds.
    """
    pose = fitted_pose(fit)
    joints, club = find_joints(fit.body, pose), find_club(fit.body, pose)
    capsules = build_capsules(fit.body)
    if observations.left_handed:
        joints, club = joints[:, LSP14.mirror] * MIRROR_X, club * MIRROR_X
        pose, capsules = mirror_pose(pose), mirror_capsules(capsules)
    return FittedSwing(
        motion=_make_motion(joints, observations, time),
        state=fit.state,
        body=fit.body,
        pose=pose,
        capsules=capsules,
        club=club,
        club2d=_pixels(club, observations.camera),
        keys=_find_keys(fit.model, fit.state.phase),
    )


def _find_keys(model: MotionModel, phase: Float[np.ndarray, "T"]) -> Float[np.ndarray, "4"]:
    """Frames in which the normalised time passes those of the key postures."""
    times = np.clip(model.keys, STILL_PHASE, 1 - STILL_PHASE)
    frames = np.arange(len(phase))
    rising = np.concatenate([[True], np.diff(np.maximum.accumulate(phase)) > 0])
    return np.interp(times, phase[rising], frames[rising])


def _make_motion(
    joints: Float[np.ndarray, "T 14 3"], observations: Observations, time: Float[np.ndarray, "T"]
) -> Motion:
    """Joints as a motion: tracked ones count as propagated, all others as interpolated."""
    fps = (len(time) - 1) / (time[-1] - time[0]) if len(time) > 1 else 1.0
    tracked = np.isfinite(observations.joints).all(axis=2)
    return Motion(
        skeleton=LSP14,
        points3d=joints,
        points2d=_pixels(joints, observations.camera),
        points2d_propagated=np.where(tracked[..., None], observations.joints, np.nan),
        confidence=np.where(tracked, 1.0, MODELLED_CONFIDENCE),
        source=np.where(tracked, SOURCES.index("propagated"), SOURCES.index("interpolated")),
        scale=observations.camera.focal / joints[..., 2].mean(axis=1),
        fps=float(fps),
        time=time,
        units="m",
        keyframes=np.array([observations.initial.frame]),
    )


def _pixels(points: Float[np.ndarray, "T n 3"], camera: Camera) -> Float[np.ndarray, "T n 2"]:
    return project(points.reshape(-1, 3), camera)[0].reshape(*points.shape[:2], 2)
