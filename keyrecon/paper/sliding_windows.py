"""The fit as printed: windows of three frames slide over the video (CVPR 2005, Section 4).

The unknowns of a window are S = [alpha, mu_1..mu_f, G_1..G_f]. G is the player's root itself: its
motion is not part of the model. What is expected of a window comes from the one before: frames
that it shares keep their estimate, alphas stay. Printed is that the new frame goes on at the last
speed of mu and G; errors of these speeds add up until the windows run away. Ours goes on at the
pace of the first guess of mu and at half the speed of G (`inertia` 1 and `pace` "last" as printed).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from keyrecon.golf.fit.parameterisation import ROOT, SplineBasis, window_basis
from keyrecon.golf.fit.regularisation import Rows, expect_alphas, stack_rows
from keyrecon.golf.fit.solver import Problem, Regulariser, ResidualBlock, solve
from keyrecon.golf.prior.kinematics import place_body
from keyrecon.golf.prior.motion_model import posture_at
from keyrecon.golf.records import Body, Matches, MotionModel, Observations, SwingMarks, SwingState
from keyrecon.progress import Progress, silent


@dataclass(frozen=True)
class WindowOptions:
    """Sliding windows; standard deviations stand for the printed weights w_G, w_mu, w_alpha."""

    frames: int = 3
    """f: frames of a window."""
    components: int = 4
    """m: alphas."""
    turn: float = 0.10
    """Radians by which the root turns otherwise than at its last speed."""
    shift: float = 0.03
    """Metres by which it shifts otherwise."""
    mu: float = 0.01
    """Normalised time by which a frame is off the last pace."""
    alpha: float = 0.3
    """Change of every alpha from window to window."""
    inertia: float = 0.5
    """Share of the root's last speed at which the next frame is expected; 1 as printed."""
    pace: Literal["guess", "last"] = "guess"
    """Whether mu goes on at the pace of its first guess, or at its last one as printed."""
    steps: int = 12
    """Steps of the solver for each window."""


def free_root(model: MotionModel) -> MotionModel:
    """The model without the motion of the root, as in the paper."""
    centre, mean, components = model.centre.copy(), model.mean.copy(), model.components.copy()
    centre[0] = np.eye(3)
    for values in (mean, components):
        values[..., :3] = 0
        values[..., -3:] = 0
    return replace(model, centre=centre, mean=mean, components=components)


def root_of(state: SwingState, model: MotionModel, body: Body) -> SwingState:
    """The state with G at the pelvis, for a model with a free root."""
    posture = posture_at(model, state.mu, state.alpha)
    pose = place_body(body, posture, state)
    return replace(state, rotation=pose.rotations[:, 0], position=pose.origins[:, 0])


def slide_windows(
    start: SwingState,
    body: Body,
    model: MotionModel,
    kinds_of: Callable[[slice], Sequence[ResidualBlock]],
    options: WindowOptions = WindowOptions(),
    progress: Progress = silent,
) -> SwingState:
    """The whole motion from windows; `start` has mu guessed and the root right in frame 0.

    `model` has a free root, and `kinds_of` gives the observations of some frames.
    """
    frames, size = len(start.mu), min(options.frames, len(start.mu))
    found = replace(
        start, alpha=np.zeros(min(options.components, len(model.components))), mu=start.mu.copy(),
        rotation=start.rotation.copy(), position=start.position.copy(),
    )  # fmt: skip
    span = window_basis(len(found.alpha), size)
    for first in progress(range(frames - size + 1), "Fitting windows", frames - size + 1):
        if first:
            _go_on(found, first + size - 1, start.mu, options)
        chosen = slice(first, first + size)
        expected = _cut(found, chosen)
        guess = replace(expected, mu=0.5 * (expected.mu + start.mu[chosen]))
        expect = _expect(span, expected, options)
        best = solve(Problem(model, body, span, kinds_of(chosen), expect), guess, options.steps)
        found = replace(found, alpha=best.alpha)
        for values, new in zip(_arrays(found), _arrays(best), strict=True):
            values[chosen] = new
    return replace(found, mu=np.clip(np.maximum.accumulate(found.mu), 0, 1))


def _arrays(state: SwingState) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return state.mu, state.rotation, state.position


def _cut(state: SwingState, chosen: slice) -> SwingState:
    return SwingState(state.alpha, *(values[chosen].copy() for values in _arrays(state)))


def _go_on(
    found: SwingState, frame: int, guess: Float[np.ndarray, "T"], options: WindowOptions
) -> None:
    """Enter a frame that goes on from the two before it."""
    last, before = frame - 1, frame - 2
    now, then = (Rotation.from_matrix(found.rotation[t]) for t in (last, before))
    turn = Rotation.from_rotvec(options.inertia * (now * then.inv()).as_rotvec())
    shift = options.inertia * (found.position[last] - found.position[before])
    found.rotation[frame] = (turn * now).as_matrix()
    found.position[frame] = found.position[last] + shift
    pace = guess[frame] - guess[last]
    if options.pace == "last":
        pace = found.mu[last] - found.mu[before]
    found.mu[frame] = min(found.mu[last] + pace, 1.0)


def _expect(span: SplineBasis, expected: SwingState, options: WindowOptions) -> Regulariser:
    """E_D of Eq. 7 with its squares: alpha, mu and G close to what is expected of them."""
    weight = 1 / np.repeat([options.turn, options.shift], 3)
    frames = len(expected.mu)
    first = span.alphas + frames

    def expect(state: SwingState) -> Rows:
        turn = state.rotation @ np.swapaxes(expected.rotation, 1, 2)
        off = np.hstack(
            [Rotation.from_matrix(turn).as_rotvec(), state.position - expected.position]
        )
        slopes = np.zeros((frames * (ROOT + 1), span.size))
        slopes[:frames, span.alphas : first] = np.eye(frames) / options.mu
        slopes[frames:, first:] = np.diag(np.tile(weight, frames))
        values = np.concatenate([(state.mu - expected.mu) / options.mu, (off * weight).ravel()])
        return stack_rows(
            [expect_alphas(state, span, expected.alpha, options.alpha), Rows(values, slopes)]
        )

    return expect


def cut_observations(observations: Observations, chosen: slice) -> Observations:
    """What was seen in some consecutive frames; matches between these frames only."""
    matches = observations.matches
    inside = (matches.frame >= chosen.start) & (matches.frame < chosen.stop - 1)
    return replace(
        observations,
        joints=observations.joints[chosen],
        spread=observations.spread[chosen],
        club=observations.club[chosen],
        club_spread=observations.club_spread[chosen],
        club_along=observations.club_along[chosen],
        foreground=observations.foreground[chosen],
        away=observations.away[chosen],
        matches=Matches(
            matches.frame[inside] - chosen.start, matches.start[inside], matches.end[inside]
        ),
        mu=observations.mu[chosen],
        marks=None if observations.marks is None else _cut_marks(observations.marks, chosen),
    )


def _cut_marks(marks: SwingMarks, chosen: slice) -> SwingMarks:
    inside = (marks.frames >= chosen.start) & (marks.frames < chosen.stop)
    return SwingMarks(marks.frames[inside] - chosen.start, marks.joints[inside])
