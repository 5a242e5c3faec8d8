"""A left-hander's film is fitted as a right-hander's, left and right of its pictures exchanged.

So a film and its mirror image take the same steps on the same pixels, and give the same swing to
the last digit, mirrored.
"""

import re
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from keyrecon.body import LSP14
from keyrecon.golf.clicks import ClickedPose
from keyrecon.golf.fit.handedness import (
    MIRROR_X,
    mirror_capsules,
    mirror_initial,
    mirror_observations,
    mirror_pixels,
    mirror_pose,
)
from keyrecon.golf.plausibility import SwingDoubt
from keyrecon.golf.records import Camera, CameraTurns, FittedSwing
from keyrecon.golf.swing_fit import FoundSwing


def mirror_clicks(pose: ClickedPose) -> ClickedPose:
    """The clicked pose of the player of the other hand in mirrored pictures."""
    width, camera = pose.size[0], pose.camera
    joints = mirror_initial(pose.joints, width)
    names = dict(zip(pose.joints.names, joints.names, strict=True))
    return replace(
        pose, joints=joints, hidden=tuple(names[name] for name in pose.hidden),
        camera=Camera(camera.focal, mirror_pixels(camera.principal, width)),
        left_handed=not pose.left_handed, mirrored=not pose.mirrored,
    )  # fmt: skip


def mirror_found(swing: FoundSwing, width: int) -> FoundSwing:
    """A swing found in mirrored pictures of some width, in the pictures as they are."""
    observations = mirror_observations(swing.observations, width)
    observations = replace(observations, left_handed=not swing.observations.left_handed)
    fitted = _mirror_fitted(swing.fitted, width)
    doubts = tuple(_mirror_doubt(d) for d in swing.doubts)
    return FoundSwing(fitted, observations, doubts, swing.notes, swing.shown)


def _mirror_fitted(fitted: FittedSwing, width: int) -> FittedSwing:
    motion, mirror = fitted.motion, LSP14.mirror

    def turned(points: Float[np.ndarray, "T 14 2"]) -> Float[np.ndarray, "T 14 2"]:
        return mirror_pixels(points[:, mirror], width)

    mirrored = replace(
        motion, points3d=motion.points3d[:, mirror] * MIRROR_X, points2d=turned(motion.points2d),
        points2d_propagated=turned(motion.points2d_propagated),
        confidence=motion.confidence[:, mirror], source=motion.source[:, mirror],
    )  # fmt: skip
    return replace(
        fitted, motion=mirrored, pose=mirror_pose(fitted.pose),
        capsules=mirror_capsules(fitted.capsules), club=fitted.club * MIRROR_X,
        club2d=mirror_pixels(fitted.club2d, width), camera=_mirror_turns(fitted.camera),
    )  # fmt: skip


def _mirror_turns(camera: CameraTurns | None) -> CameraTurns | None:
    if camera is None:
        return None
    flip = np.diag(MIRROR_X)
    return CameraTurns(flip @ camera.turns @ flip, camera.shifts * MIRROR_X)


def _mirror_doubt(doubt: SwingDoubt) -> SwingDoubt:
    other = {"left": "right", "right": "left"}
    text = re.sub(r"\b(left|right)_", lambda side: other[side[1]] + "_", doubt.text)
    return replace(doubt, text=text)
