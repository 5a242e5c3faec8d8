"""Where a posture puts the player's segments, and how they move with every unknown."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from keyrecon.golf.prior.motion_model import (
    cross_matrix,
    posture_at,
    posture_by_frame,
    turn_posture,
)
from keyrecon.golf.prior.skeleton import CLUB, PARENTS, REST, SEGMENTS
from keyrecon.golf.records import Body, Posture, RootPose, SwingFit, SwingState


def place_body(body: Body, posture: Posture, state: SwingState) -> RootPose:
    """Forward kinematics: every segment in camera axes."""
    frames = len(posture.turns)
    rotations = np.empty((frames, len(SEGMENTS), 3, 3))
    rotations[:, 0] = state.rotation @ posture.turns[:, 0]
    shift = body.stature * np.einsum("tij,tj->ti", state.rotation, posture.place)
    for p, parent in enumerate(PARENTS[1:], start=1):
        rotations[:, p] = rotations[:, parent] @ posture.turns[:, p]
    return RootPose(hang_segments(body, state.position + shift, rotations), rotations)


def hang_segments(
    body: Body, pelvis: Float[np.ndarray, "T 3"], rotations: Float[np.ndarray, "T P 3 3"]
) -> Float[np.ndarray, "T P 3"]:
    """Origins of all segments from the pelvis's, in camera axes."""
    origins = np.empty((len(pelvis), len(SEGMENTS), 3))
    origins[:, 0] = pelvis
    for p, parent in enumerate(PARENTS[1:], start=1):
        origins[:, p] = origins[:, parent] + rotations[:, parent] @ body.offsets[p]
    return origins


def fitted_pose(fit: SwingFit) -> RootPose:
    """All segments of a fitted swing in camera axes."""
    state = fit.state
    if state.frame_coefficients is None:
        posture = posture_at(fit.model, state.phase, state.coefficients)
    else:
        posture = posture_by_frame(fit.model, state.phase, state.frame_coefficients)
    if state.deviation is not None:
        posture = turn_posture(posture, state.deviation)
    return place_body(fit.body, posture, state)


@dataclass(frozen=True, eq=False)
class PoseRates:
    """How segments move with the unknowns of their frame; L = m + 1 + 6."""

    origins: Float[np.ndarray, "T P 3 L"]
    rotations: Float[np.ndarray, "T P 3 L"]
    """Rotation velocities in camera axes."""


def pose_rates(body: Body, posture: Posture, state: SwingState, pose: RootPose) -> PoseRates:
    """Velocities by coefficients, phase, turn and shift of G (IC/2004/90, Eq. 3-4).

    The turn of G is about `position`.
    """
    frames, _, _, learnt = posture.turn_rates.shape
    moved = np.zeros((frames, len(SEGMENTS), 3, learnt + 6))
    turned = np.zeros_like(moved)
    turned[:, 0, :, :learnt] = state.rotation @ posture.turn_rates[:, 0]
    turned[:, 0, :, learnt : learnt + 3] = np.eye(3)
    moved[:, 0, :, :learnt] = body.stature * state.rotation @ posture.place_rates
    moved[:, 0, :, learnt : learnt + 3] = -cross_matrix(pose.origins[:, 0] - state.position)
    moved[:, 0, :, learnt + 3 :] = np.eye(3)
    for p, parent in enumerate(PARENTS[1:], start=1):
        turned[:, p] = turned[:, parent]
        turned[:, p, :, :learnt] += pose.rotations[:, parent] @ posture.turn_rates[:, p]
        arm = pose.origins[:, p] - pose.origins[:, parent]
        moved[:, p] = moved[:, parent] - cross_matrix(arm) @ turned[:, parent]
    return PoseRates(moved, turned)


def find_joints(body: Body, pose: RootPose) -> Float[np.ndarray, "T 14 3"]:
    """LSP14's joints in camera axes, metres."""
    from_origin = pose.rotations[:, body.joint_segment] @ body.joint_place[..., None]
    return pose.origins[:, body.joint_segment] + from_origin[..., 0]


def find_club(body: Body, pose: RootPose) -> Float[np.ndarray, "T 2 3"]:
    """Grip and head of the club in camera axes, metres."""
    grip = pose.origins[:, CLUB]
    return np.stack([grip, grip + body.club * pose.rotations[:, CLUB] @ REST[CLUB]], axis=1)
