"""Lengths of a player's limbs from annotated keyframes.

Six clicks tell how large a player is, not how long arms and legs are, and the body begins with
average proportions. Where a person has marked the joints of whole postures, the fitted turns of
all segments make the marks linear in the lengths: with the player's place in every marked frame
they are solved for by Gauss-Newton, close to the average. In turns with the fit, both converge.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from keyrecon.golf.fit.fitting import FitOptions, refit_swing
from keyrecon.golf.fit.residuals import MARK, MODEL_ERROR, project
from keyrecon.golf.prior.kinematics import find_joints, hang_segments, place_body
from keyrecon.golf.prior.motion_model import posture_at
from keyrecon.golf.prior.skeleton import NAMES, PARENTS
from keyrecon.golf.records import (
    Body,
    Camera,
    MotionModel,
    Observations,
    RootPose,
    SwingMarks,
    SwingState,
)

PARTS = ("pelvis", "trunk", "head", "clavicle", "upper_arm", "forearm", "thigh", "shank")
"""Left and right are alike."""
STEPS = 4
"""Of Gauss and Newton, at most needed for perspective."""


@dataclass(frozen=True)
class ProportionOptions:
    """How a player's proportions are found."""

    spread: float = 0.06
    """Share by which a part is usually longer or shorter than average: players differ by .04, and
    so do joints as they are marked from joint centres."""
    rounds: int = 3
    """Turns of proportions and fit."""


def refit_proportions(
    found: tuple[MotionModel, Body, SwingState],
    seen: Observations,
    start: SwingState,
    fps: float,
    settings: tuple[FitOptions, ProportionOptions],
) -> tuple[MotionModel, Body, SwingState]:
    """A fitted swing with the proportions that its marks tell, and the fit with them, in turns."""
    (model, average, state), (fit, options) = found, settings
    for _ in range(options.rounds):
        _, body, state = found
        pose = place_body(body, posture_at(model, state.mu, state.alpha), state)
        body = fit_proportions(average, pose, seen.marks, seen.camera, options)
        found = refit_swing(seen, model, body, (start, state), fps, fit)
    return found


def fit_proportions(
    body: Body,
    pose: RootPose,
    marks: SwingMarks,
    camera: Camera,
    options: ProportionOptions = ProportionOptions(),
) -> Body:
    """The average body with the lengths at which a pose meets the marks best."""
    rotations, roots = pose.rotations[marks.frames], pose.origins[marks.frames, 0]
    known = np.isfinite(marks.joints)
    factors, shift = np.ones(len(PARTS)), np.zeros_like(roots)
    for _ in range(STEPS):
        joints = _joints(scale_body(body, factors), roots + shift, rotations)
        by_part = np.stack(
            [
                _joints(scale_body(body, factors + unit), roots + shift, rotations) - joints
                for unit in np.eye(len(PARTS))
            ],
            axis=3,
        )
        step = _solve(joints, by_part, (marks, known, camera), (factors, options.spread))
        factors, shift = factors + step[: len(PARTS)], shift + step[len(PARTS) :].reshape(-1, 3)
    return scale_body(body, factors)


def scale_body(body: Body, factors: Float[np.ndarray, "n"]) -> Body:
    """A body with its parts longer or shorter."""
    by_part = dict(zip(PARTS, factors, strict=True))
    names = [name.removeprefix("right_").removeprefix("left_") for name in NAMES]
    factor = np.array([by_part.get(name, 1.0) for name in names])
    above = np.maximum(PARENTS, 0)
    return replace(
        body,
        offsets=body.offsets * factor[above, None],
        joint_place=body.joint_place * factor[body.joint_segment, None],
    )


def _joints(
    body: Body, roots: Float[np.ndarray, "K 3"], rotations: Float[np.ndarray, "K P 3 3"]
) -> Float[np.ndarray, "K 14 3"]:
    return find_joints(body, RootPose(hang_segments(body, roots, rotations), rotations))


def _solve(
    joints: Float[np.ndarray, "K 14 3"],
    by_part: Float[np.ndarray, "K 14 3 n"],
    seen: tuple[SwingMarks, np.ndarray, Camera],
    expected: tuple[Float[np.ndarray, "n"], float],
) -> Float[np.ndarray, "m"]:
    """Change of the parts' factors, then of the root's place in every marked frame."""
    (marks, known, camera), (factors, spread) = seen, expected
    frames, parts = len(joints), len(factors)
    pixels, slope = project(joints.reshape(-1, 3), camera)
    off = np.hypot(MARK, MODEL_ERROR * slope[:, 0, 0])
    rows = np.zeros((len(pixels), 2, parts + 3 * frames))
    rows[..., :parts] = slope @ by_part.reshape(-1, 3, parts)
    frame = np.repeat(np.arange(frames), joints.shape[1])
    for axis in range(3):
        rows[np.arange(len(pixels)), :, parts + 3 * frame + axis] = slope[..., axis]
    rows, values = rows / off[:, None, None], (marks.joints.reshape(-1, 2) - pixels) / off[:, None]
    kept = known.reshape(-1)
    near = np.eye(parts, parts + 3 * frames) / spread
    return np.linalg.lstsq(
        np.concatenate([rows.reshape(len(kept), -1)[kept], near]),
        np.concatenate([values.ravel()[kept], (1 - factors) / spread]),
    )[0]
