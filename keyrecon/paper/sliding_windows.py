"""The fit as printed: windows of three frames slide over the video (CVPR 2005, Sections 4 and 5.1).

Equations are numbered as in CVPR 2005; TR is the same authors' report IC/2004/90. The unknowns of a
window are S = [alpha_1..alpha_m, mu_1..mu_f, G_1..G_f] (Eq. 3): coefficients common to the window,
and normalised time and root pose of every frame. Minimised is

    F = sum_i w_type(i) |Obs_type(i)(x_i, S)|^2
        + w_G |G_t - G^_t|^2 + w_mu (mu_t - mu^_t)^2 + w_alpha sum_i (alpha_i - alpha^_i)^2  (Eq. 4)

with plain squares, observations of the foreground (4.1), of joints and hands (4.2) and of matched
points (4.3), and the predictions G^_t = G_(t-1) + dG_(t-1) and mu^_t = mu_(t-1) + dmu_(t-1).

Where the text leaves a choice, and what was chosen: `choices.md`, rows of U.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from keyrecon.golf.fit.fitting import measure_influence
from keyrecon.golf.fit.parameterisation import ROOT, SplineBasis, window_basis
from keyrecon.golf.fit.regularisation import Rows, coefficient_rows, stack_rows
from keyrecon.golf.fit.residuals import (
    build_capsules,
    foreground_residuals,
    match_residuals,
    pair_rows,
    project,
)
from keyrecon.golf.fit.solver import Problem, Regulariser, ResidualBlock, solve
from keyrecon.golf.prior.kinematics import find_club, find_joints, fitted_pose
from keyrecon.golf.prior.motion_model import posture_by_frame
from keyrecon.golf.prior.skeleton import CLUB
from keyrecon.golf.records import (
    Body,
    Matches,
    MotionModel,
    Observations,
    Residuals,
    RootPose,
    SwingFit,
    SwingState,
)
from keyrecon.progress import Progress, silent
from keyrecon.ranges import within


@dataclass(frozen=True)
class WindowOptions:
    """Sliding windows; standard deviations stand for the weights w_G, w_mu and w_alpha.

    Their values are not printed. Tried on a rendered swing of benchmarks/golf.py, b-faceon-30:
    those below gave a PA-MPJPE of 66 mm; twice as much for the root, 59; three times as much for
    the coefficients and half as much for joints, 90; half as much for phase and joints, 79; half
    for root and phase with three times for the coefficients and twice for joints, 334: there the
    predictions outweigh the picture, and errors of the speeds add up until the windows run away.
    """

    frames: Annotated[int, within(2, 100)] = 3
    """f: frames of a window."""
    components: Annotated[int, within(1, 100)] = 4
    """m: coefficients."""
    root: Annotated[float, within(0.005, 2)] = 0.1
    """Metres by which the root is off its prediction; radians likewise."""
    phase: Annotated[float, within(0.001, 0.4)] = 0.02
    """Normalised time by which a frame is off its prediction."""
    coefficients: Annotated[float, within(0.005, 2)] = 0.1
    """Change of every coefficient from window to window."""
    joint: Annotated[float, within(0.0005, 0.2)] = 0.01
    """Player heights by which tracked joints are off."""
    steps: Annotated[int, within(1, 1000)] = 12
    """Steps of the solver for each window."""


def fit_sliding_windows(
    observations: Observations,
    initial: SwingFit,
    options: WindowOptions = WindowOptions(),
    progress: Progress = silent,
) -> SwingFit:
    """The whole motion from windows; `initial` has phases guessed and the root right in frame 0.

    The fit is one of the model of `initial`: its state places swing axes, not the pelvis.
    """
    pose = fitted_pose(initial)
    model, body = _free_root(initial.model), initial.body
    phase = initial.state.phase
    frames, size = len(phase), min(options.frames, len(phase))
    number = min(options.components, len(model.components))
    root = replace(initial.state, rotation=pose.rotations[:, 0], position=pose.origins[:, 0])
    weights = _commensurate_weights(observations, SwingFit(model, body, root), options)
    basis = window_basis(number, size)
    estimate = _stand_still(root, number)
    for first in progress(range(frames - size + 1), "Fitting windows", frames - size + 1):
        window = slice(first, first + size)
        expected = predict_window(estimate, window, phase)
        begin = _begin(estimate, expected, window, phase)
        blocks = _blocks(_cut_observations(observations, window), body, weights)
        regulariser = _regulariser(basis, expected, options)
        best = solve(Problem(model, body, basis, blocks, regulariser), begin, options.steps)
        estimate = _enter(estimate, best, window)
    return _with_root(SwingFit(initial.model, body, estimate))


def _free_root(model: MotionModel) -> MotionModel:
    """The model without the motion of the root: G is the root itself."""
    centre, mean, components = model.centre.copy(), model.mean.copy(), model.components.copy()
    centre[0] = np.eye(3)
    for values in (mean, components):
        values[..., :3] = 0
        values[..., -3:] = 0
    return replace(model, centre=centre, mean=mean, components=components)


def _with_root(fit: SwingFit) -> SwingFit:
    """A fit in which G was the pelvis, with swing axes that the model's own root moves in."""
    state = fit.state
    if state.frame_coefficients is None:
        raise ValueError("windows have coefficients of every frame")
    posture = posture_by_frame(fit.model, state.phase, state.frame_coefficients)
    rotation = state.rotation @ np.swapaxes(posture.turns[:, 0], 1, 2)
    shift = fit.body.stature * np.einsum("tij,tj->ti", rotation, posture.place)
    return replace(fit, state=replace(state, rotation=rotation, position=state.position - shift))


def _stand_still(root: SwingState, number: int) -> SwingState:
    """The root of frame 0 in all frames, and the mean motion."""
    frames = len(root.phase)
    return SwingState(
        coefficients=np.zeros(number),
        phase=root.phase,
        rotation=np.tile(root.rotation[0], (frames, 1, 1)),
        position=np.tile(root.position[0], (frames, 1)),
        frame_coefficients=np.zeros((frames, number)),
    )


def predict_window(
    estimate: SwingState, window: slice, guess: Float[np.ndarray, "T"]
) -> SwingState:
    """mu^, G^ and alpha^ of a window: each frame goes on at the speed of the two before it.

    Frame 1, which has but one before it, at the speed from that one to itself.
    """
    phase, rotation, position = (
        values[window].copy() for values in (guess, estimate.rotation, estimate.position)
    )
    if window.start:
        for row, t in enumerate(range(window.start, window.stop)):
            last, end = t - 1, max(t - 1, 1)
            now, then = (Rotation.from_matrix(estimate.rotation[k]) for k in (end, end - 1))
            start = Rotation.from_matrix(estimate.rotation[last])
            rotation[row] = (now * then.inv() * start).as_matrix()
            position[row], phase[row] = (
                values[last] + values[end] - values[end - 1]
                for values in (estimate.position, estimate.phase)
            )
    return SwingState(estimate.coefficients, phase, rotation, position)


def _begin(
    estimate: SwingState, expected: SwingState, window: slice, guess: Float[np.ndarray, "T"]
) -> SwingState:
    """Where the descent begins: a new frame at guess and prediction, others at their estimates."""
    phase, rotation, position = (
        values[window].copy() for values in (estimate.phase, estimate.rotation, estimate.position)
    )
    phase[-1], rotation[-1], position[-1] = (
        guess[window.stop - 1], expected.rotation[-1], expected.position[-1],
    )  # fmt: skip
    return SwingState(estimate.coefficients, phase, rotation, position)


def _enter(estimate: SwingState, best: SwingState, window: slice) -> SwingState:
    """The estimate with the frames of a window as it was fitted."""
    rows = np.arange(window.start, window.stop)
    if estimate.frame_coefficients is None:
        raise ValueError("the estimate of windows has coefficients of every frame")
    phase, rotation, position, coefficients = (
        values.copy()
        for values in (
            estimate.phase, estimate.rotation, estimate.position, estimate.frame_coefficients,
        )
    )  # fmt: skip
    phase[rows], rotation[rows], position[rows] = best.phase, best.rotation, best.position
    coefficients[rows] = best.coefficients
    return SwingState(best.coefficients, phase, rotation, position, coefficients)


def _regulariser(basis: SplineBasis, expected: SwingState, options: WindowOptions) -> Regulariser:
    """The last three terms of Eq. 4."""
    frames = len(expected.phase)

    def expect(state: SwingState) -> Rows:
        turn = state.rotation @ np.swapaxes(expected.rotation, 1, 2)
        off = np.hstack(
            [Rotation.from_matrix(turn).as_rotvec(), state.position - expected.position]
        )
        slopes = np.zeros((frames * (ROOT + 1), basis.size))
        slopes[:frames, basis.phase_columns] = np.eye(frames) / options.phase
        slopes[frames:, basis.root_columns] = np.eye(ROOT * frames) / options.root
        ahead = (state.phase - expected.phase) / options.phase
        values = np.concatenate([ahead, off.ravel() / options.root])
        return stack_rows(
            [
                coefficient_rows(state, basis, expected.coefficients, options.coefficients),
                Rows(values, slopes),
            ]
        )

    return expect


@dataclass(frozen=True)
class TypeWeights:
    """w_type of Eq. 4."""

    foreground: float
    joints: float
    matches: float


def _blocks(
    observations: Observations, body: Body, weights: TypeWeights
) -> Sequence[ResidualBlock]:
    """The types of observation of Sections 4.1 to 4.3, with plain squares."""
    capsules = build_capsules(body)
    foreground = partial(foreground_residuals, observations, capsules)
    joints = partial(projection_residuals, observations, body)
    matches = partial(match_residuals, observations, capsules)
    return [
        ResidualBlock(foreground, weights.foreground, np.inf),
        ResidualBlock(joints, weights.joints, np.inf),
        ResidualBlock(matches, weights.matches, np.inf),
    ]


def _commensurate_weights(
    observations: Observations, root: SwingFit, options: WindowOptions
) -> TypeWeights:
    """Weights at which all types of observation have the same influence at the start."""
    blocks = _blocks(observations, root.body, TypeWeights(1.0, 1.0, 1.0))
    foreground, joints, matches = (measure_influence(block, root) for block in blocks)
    scale = (options.joint * observations.height) ** -2
    return TypeWeights(
        scale * joints / foreground if foreground else 0.0,
        scale,
        scale * joints / matches if matches else 0.0,
    )


def projection_residuals(observations: Observations, body: Body, pose: RootPose) -> Residuals:
    """Projected minus tracked joints and hands, px (Section 4.2)."""
    frame, joint = np.nonzero(np.isfinite(observations.joints).all(axis=2))
    held = np.flatnonzero(np.isfinite(observations.club[:, 0]).all(axis=1))
    points = np.concatenate([find_joints(body, pose)[frame, joint], find_club(body, pose)[held, 0]])
    tracked = np.concatenate([observations.joints[frame, joint], observations.club[held, 0]])
    segment = np.concatenate([body.joint_segment[joint], np.full(len(held), CLUB)])
    pixels, slope = project(points, observations.camera)
    return pair_rows(pixels - tracked, slope, points, np.concatenate([frame, held]), segment)


def _cut_observations(observations: Observations, window: slice) -> Observations:
    """What was observed in a window; matches between its frames only."""
    matches = observations.matches
    inside = (matches.frame >= window.start) & (matches.frame < window.stop - 1)
    return replace(
        observations,
        joints=observations.joints[window],
        spread=observations.spread[window],
        club=observations.club[window],
        club_spread=observations.club_spread[window],
        club_along=observations.club_along[window],
        foreground=observations.foreground[window],
        silhouette_distance=observations.silhouette_distance[window],
        phase=observations.phase[window],
        matches=Matches(
            matches.frame[inside] - window.start, matches.start[inside], matches.end[inside]
        ),
    )
