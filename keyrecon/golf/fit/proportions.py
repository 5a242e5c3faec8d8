"""Lengths of a player's limbs from the joints that a person placed.

The body begins with average proportions. Six clicks tell how trunk and legs share its height, and
where this person has hips; marks of whole postures tell of the arms too. The fitted turns of
all segments make these joints linear in the lengths: with the player's place in every such frame
they are solved for by Gauss-Newton, close to the average. In turns with the fit, both converge.

A marked posture is another one than the model's by up to .25 rad in an arm (`deviation.SPREADS`):
an arm that points at the camera is moved as far by that as by any length, one across the picture
only aside. So the errors of a frame's marks count as those of turns as well, one for all joints
that hang on a segment, alike in postures that are a short time apart: marks of one held finish tell
its lengths once.
"""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from jaxtyping import Bool, Float

from keyrecon.body import LSP14
from keyrecon.golf.fit.deviation import DEPARTURES_PER_SECOND, SPREADS, part_name
from keyrecon.golf.fit.fitting import FitOptions, refit_swing
from keyrecon.golf.fit.residuals import MARK_SPREAD, MODEL_ERROR, project
from keyrecon.golf.marks import join_marks
from keyrecon.golf.prior.kinematics import find_joints, fitted_pose, hang_segments
from keyrecon.golf.prior.skeleton import NAMES, PARENTS
from keyrecon.golf.records import (
    Body,
    Camera,
    InitialJoints,
    Observations,
    RootPose,
    SwingFit,
    SwingMarks,
)
from keyrecon.ranges import within

PARTS = ("pelvis", "trunk", "head", "clavicle", "upper_arm", "forearm", "thigh", "shank")
"""Left and right are alike."""
HANGS = np.eye(len(NAMES))
"""Which segments (columns) hang on which (rows): themselves, and all that their ends carry."""
for _segment, _parent in enumerate(PARENTS[1:], start=1):
    HANGS[:, _segment] += HANGS[:, _parent]
STEPS = 4
"""Of Gauss and Newton: marks are linear in the lengths but for perspective, so few suffice."""


@dataclass(frozen=True)
class ProportionOptions:
    """How a player's proportions are estimated."""

    spread: Annotated[float, within(0.003, 1)] = 0.06
    """Share by which a part is usually longer or shorter than average: players differ by .04, and
    so do joints as they are marked from joint centres."""
    rounds: Annotated[int, within(0, 50)] = 3
    """Turns of proportions and fit."""


def refit_proportions(
    fit: SwingFit,
    observations: Observations,
    initial: SwingFit,
    fps: float,
    fit_options: FitOptions,
    options: ProportionOptions,
) -> SwingFit:
    """A fitted swing with the proportions that clicks and marks tell, and the fit with them, in
    turns.

    Where only clicks tell them the body alone changes, and what follows the picture adapts to it:
    six joints of one frame do not tell the time. Fitted in turns with them, one real swing in slow
    motion had its top four frames later and was warned of. Mean errors of the joints of five real
    swings went from .0391, .0313, .0314, .0322 and .0314 player heights to .0382, .0308, .0300,
    .0305 and .0304.
    """
    average, marks, camera = fit.body, observations.marks, observations.camera
    is_marked = bool(np.isfinite(marks.joints).any())

    def proportions(fit: SwingFit) -> Body:
        pose = fitted_pose(fit)
        clicks = clicked_joints(fit.body, pose, observations.initial, camera)
        if not is_marked:
            return fit_proportions(average, pose, clicks, camera, options.spread)
        places = join_marks(marks, clicks)
        return fit_proportions(average, pose, places, camera, options.spread, fps)

    if not is_marked:
        return replace(fit, body=proportions(fit))
    for _ in range(options.rounds):
        body = proportions(fit)
        fit = refit_swing(observations, replace(initial, body=body), fit.state, fps, fit_options)
    return fit


def clicked_joints(
    body: Body, pose: RootPose, initial: InitialJoints, camera: Camera
) -> SwingMarks:
    """The clicked joints as marks; the hips as far apart as fitted, around the clicked root."""
    fitted = project(find_joints(body, pose)[initial.frame], camera)[0]
    hips = [LSP14.index("right_hip"), LSP14.index("left_hip")]
    joints = np.full((1, len(LSP14.names), 2), np.nan)
    places = dict(zip(initial.names, initial.places, strict=True))
    if "root" in places:
        joints[0, hips] = fitted[hips] + places.pop("root") - fitted[hips].mean(axis=0)
    for name, place in places.items():
        joints[0, LSP14.index(name)] = place
    return SwingMarks.of_joints(np.array([initial.frame]), joints)


def fit_proportions(
    body: Body,
    pose: RootPose,
    marks: SwingMarks,
    camera: Camera,
    spread: float = ProportionOptions.spread,
    fps: float | None = None,
) -> Body:
    """The average body with the lengths at which a pose meets the marks best.

    `spread` is the share by which a part is usually longer or shorter than average. With
    `fps`, the frames in a second, segments may be turned otherwise than in the pose.
    """
    rotations, roots = pose.rotations[marks.frames], pose.origins[marks.frames, 0]
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
        levers = None
        if fps is not None:
            origins = hang_segments(scale_body(body, factors), roots + shift, rotations)
            levers = HANGS.T[body.joint_segment, :, None] * (joints[:, :, None] - origins[:, None])
        placed = _Placed(joints, by_part, levers, marks.frames / (fps or 1.0))
        step = _solve(placed, marks.joints, camera, factors, spread)
        factors, shift = factors + step[: len(PARTS)], shift + step[len(PARTS) :].reshape(-1, 3)
    return scale_body(body, factors)


def scale_body(body: Body, factors: Float[np.ndarray, "n"]) -> Body:
    """A body with its parts longer or shorter."""
    by_part = dict(zip(PARTS, factors, strict=True))
    factor = np.array([by_part.get(part_name(name), 1.0) for name in NAMES])
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


@dataclass(frozen=True, eq=False)
class _Placed:
    """Joints of some frames, and what moves them."""

    joints: Float[np.ndarray, "K 14 3"]
    by_part: Float[np.ndarray, "K 14 3 n"]
    """Their change by the parts' factors."""
    levers: Float[np.ndarray, "K 14 P 3"] | None
    """From the segments that they hang on, 0 from others; None where no segment turns."""
    time: Float[np.ndarray, "K"]
    """Seconds."""


def _uncorrelated(
    placed: _Placed,
    slope: Float[np.ndarray, "n 2 3"],
    off: Float[np.ndarray, "n"],
    kept: Bool[np.ndarray, "n"],
) -> Float[np.ndarray, "m m"]:
    """What turns errors of the kept joints, in standard deviations, into independent ones."""
    frames, joints = placed.joints.shape[:2]
    if placed.levers is None:
        return np.eye(2 * int(kept.sum()))
    turns = np.cross(np.eye(3), placed.levers[:, :, :, None])  # by each axis of each segment
    spread = np.array([SPREADS[part_name(name)] for name in NAMES])
    turns = np.moveaxis(turns * spread[:, None, None], 4, 2).reshape(len(off), 3, -1)
    moved = (slope @ turns / off[:, None, None]).reshape(frames, 2 * joints, -1)
    apart = np.abs(placed.time[:, None] - placed.time)
    alike = np.exp(-DEPARTURES_PER_SECOND * apart)
    every = np.einsum("iap,jbp,ij->iajb", moved, moved, alike).reshape(2 * len(off), -1)
    known = np.repeat(kept, 2)
    covariance = np.eye(int(known.sum())) + every[np.ix_(known, known)]
    inverse: Float[np.ndarray, "m m"] = np.linalg.inv(np.linalg.cholesky(covariance))
    return inverse


def _solve(
    placed: _Placed,
    marked: Float[np.ndarray, "K 14 2"],
    camera: Camera,
    factors: Float[np.ndarray, "n"],
    spread: float,
) -> Float[np.ndarray, "m"]:
    """Change of the parts' factors, then of the root's place in every marked frame."""
    joints, frames, parts = placed.joints, len(placed.joints), len(factors)
    pixels, slope = project(joints.reshape(-1, 3), camera)
    off = np.hypot(MARK_SPREAD, MODEL_ERROR * slope[:, 0, 0])
    rows = np.zeros((len(pixels), 2, parts + 3 * frames))
    rows[..., :parts] = slope @ placed.by_part.reshape(-1, 3, parts)
    frame = np.repeat(np.arange(frames), joints.shape[1])
    for axis in range(3):
        rows[np.arange(len(pixels)), :, parts + 3 * frame + axis] = slope[..., axis]
    rows, values = rows / off[:, None, None], (marked.reshape(-1, 2) - pixels) / off[:, None]
    kept = np.isfinite(marked).reshape(-1)
    near = np.eye(parts, parts + 3 * frames) / spread
    whiten = _uncorrelated(placed, slope, off, kept[::2])
    return np.linalg.lstsq(
        np.concatenate([whiten @ rows.reshape(len(kept), -1)[kept], near]),
        np.concatenate([whiten @ values.ravel()[kept], (1 - factors) / spread]),
    )[0]
