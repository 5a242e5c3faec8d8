"""Fit the motion model to what was seen of a whole swing.

The paper slides windows of three frames (`windows`); all frames of a swing share their alphas, so
one problem over the whole swing is better conditioned and is the default. It goes from coarse to
fine: first where the player stands, with the mean motion; then everything.
"""

from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from jaxtyping import Float

from keyrecon.golf.fit.parameterisation import SplineBasis, constant_basis, swing_basis
from keyrecon.golf.fit.regularisation import (
    PriorOptions,
    Rows,
    expect_alphas,
    expect_level,
    expect_stillness,
    expect_times,
    stack_rows,
)
from keyrecon.golf.fit.residuals import (
    build_capsules,
    club_residuals,
    foreground_residuals,
    joint_residuals,
    mark_residuals,
    match_residuals,
    silhouette_distance_residuals,
)
from keyrecon.golf.fit.solver import (
    Problem,
    Regulariser,
    ResidualBlock,
    chain_rule,
    robust_weights,
    solve,
)
from keyrecon.golf.observe.swing_events import keep_order
from keyrecon.golf.prior.kinematics import place_body, pose_rates
from keyrecon.golf.prior.motion_model import posture_at
from keyrecon.golf.records import Body, MotionModel, Observations, SwingState
from keyrecon.paper.sliding_windows import (
    WindowOptions,
    cut_observations,
    free_root,
    root_of,
    slide_windows,
)


@dataclass(frozen=True)
class WeightOptions:
    """How much each kind of observation counts against the joints; 0 leaves it out."""

    joints: float = 1.0
    """Tracked joints; their errors are in standard deviations."""
    club: float = 1.0
    """Ends of the club, in standard deviations."""
    marks: float = 1.0
    """Joints that a person marked; every marked frame counts as a look of its own."""
    foreground: float = 0.5
    """Lines of sight through the player's mask, made commensurate with the joints."""
    away: float = 0.15
    """Limbs that project outside of the mask, made commensurate with the joints."""
    matches: float = 0.5
    """Surface points matched between consecutive frames, made commensurate with the joints."""


@dataclass(frozen=True)
class FitOptions:
    """How a swing is fitted."""

    components: int = 40
    """Alphas used at most; the paper used 4 of its 10 swings."""
    weights: WeightOptions = field(default_factory=WeightOptions)
    """Observations."""
    priors: PriorOptions = field(default_factory=PriorOptions)
    """Expectations."""
    robust: float = 3.0
    """Standard deviations beyond which a joint or club end counts less."""
    time_knots: float = 0.1
    """Seconds between knots of the normalised time."""
    root_knots: float = 0.4
    """Seconds between knots of the player's place and turn."""
    steps: int = 25
    """Steps of the solver at most."""
    windows: WindowOptions = field(default_factory=WindowOptions)
    """The paper's sliding windows, where they are asked for."""


OBSERVATION_KINDS = 3.0
"""Independent looks at the player per second: trackers drift and proportions are wrong for a third
of a second or longer, so that more frames do not make these errors smaller."""
FAR_SIGHT, FAR_AWAY, FAR_MATCH = 0.06, 12.0, 3.0
"""Errors beyond which a line of sight (m), a limb off the mask (px) and a match (px) count less."""
FIRST = 6
"""Alphas that move before all do: the largest styles first."""


def fit_swing(
    observations: Observations,
    model: MotionModel,
    body: Body,
    start: SwingState,
    fps: float,
    options: FitOptions = FitOptions(),
) -> tuple[MotionModel, Body, SwingState]:
    """The swing that explains what was seen, from a rough start; and what it is made of."""
    frames, alphas = len(start.mu), _count_alphas(model, options)
    knots = _knots(fps, options)
    stages = [
        (constant_basis(0, frames), 10.0),
        (swing_basis(min(alphas, FIRST), frames, knots), 3.0),
        (swing_basis(alphas, frames, knots), 1.0),
    ]
    state = replace(start, alpha=np.zeros(alphas))
    kinds = _weigh_kinds(observations, model, body, start, (fps, options))
    return model, body, _descend((model, body, kinds), stages, (state, start.mu), (fps, options))


def refit_swing(
    observations: Observations,
    model: MotionModel,
    body: Body,
    states: tuple[SwingState, SwingState],
    fps: float,
    options: FitOptions = FitOptions(),
) -> tuple[MotionModel, Body, SwingState]:
    """The same from the rough start and the swing that was fitted before more was seen."""
    start, before = states
    stages = [(swing_basis(len(before.alpha), len(start.mu), _knots(fps, options)), 1.0)]
    kinds = _weigh_kinds(observations, model, body, start, (fps, options))
    return model, body, _descend((model, body, kinds), stages, (before, start.mu), (fps, options))


def _count_alphas(model: MotionModel, options: FitOptions) -> int:
    return min(options.components, len(model.components))


def _knots(fps: float, options: FitOptions) -> tuple[float, float]:
    """Frames between the knots of normalised time and of the root."""
    return options.time_knots * fps, options.root_knots * fps


def _weigh_kinds(
    observations: Observations,
    model: MotionModel,
    body: Body,
    start: SwingState,
    settings: tuple[float, FitOptions],
) -> list[ResidualBlock]:
    """All kinds of observations, frames counted as far as they are independent looks."""
    fps, options = settings
    kinds = choose_kinds(observations, model, body, start, options)
    share = min(1.0, OBSERVATION_KINDS / fps)
    marks = partial(mark_residuals, observations, body)
    return [replace(kind, weight=kind.weight * share) for kind in kinds] + [
        ResidualBlock(marks, options.weights.marks, options.robust)
    ]


def _descend(
    setting: tuple[MotionModel, Body, list[ResidualBlock]],
    stages: list[tuple[SplineBasis, float]],
    states: tuple[SwingState, Float[np.ndarray, "T"]],
    settings: tuple[float, FitOptions],
) -> SwingState:
    """Solve stage by stage from a state; `states` also has the guessed times."""
    (model, body, kinds), (state, guess), (fps, options) = setting, states, settings
    for span, robust in stages:
        expect = _whole_swing(span, guess, options.priors, fps)
        wide = [replace(kind, robust=robust * kind.robust) for kind in kinds]
        state = solve(Problem(model, body, span, wide, expect), state, options.steps)
        state = replace(state, mu=keep_order(state.mu))
    return state


def fit_sliding_windows(
    observations: Observations,
    model: MotionModel,
    body: Body,
    start: SwingState,
    fps: float,
    options: FitOptions = FitOptions(),
) -> tuple[MotionModel, Body, SwingState]:
    """The fit as printed: windows of three frames, a free root, few components."""
    free = free_root(model)
    begin = root_of(replace(start, alpha=np.zeros(options.windows.components)), model, body)
    kinds = choose_kinds(observations, free, body, begin, options)
    weight = {kind.observe.func: kind.weight for kind in kinds}

    def kinds_of(chosen: slice) -> list[ResidualBlock]:
        own = choose_kinds(cut_observations(observations, chosen), free, body, None, options)
        return [replace(kind, weight=weight[kind.observe.func]) for kind in own]

    return free, body, slide_windows(begin, body, free, kinds_of, options.windows)


def choose_kinds(
    observations: Observations,
    model: MotionModel,
    body: Body,
    start: SwingState | None,
    options: FitOptions,
) -> list[ResidualBlock]:
    """Kinds of observation that count; made commensurate at the start, where there is one."""
    weights = options.weights
    points = [
        ResidualBlock(partial(joint_residuals, observations, body), weights.joints, options.robust),
        ResidualBlock(partial(club_residuals, observations, body), weights.club, options.robust),
    ]
    capsules = build_capsules(body)
    surfaces = [
        ResidualBlock(
            partial(foreground_residuals, observations, capsules), weights.foreground, FAR_SIGHT
        ),
        ResidualBlock(
            partial(silhouette_distance_residuals, observations, capsules), weights.away, FAR_AWAY
        ),
        ResidualBlock(partial(match_residuals, observations, capsules), weights.matches, FAR_MATCH),
    ]
    points = [kind for kind in points if kind.weight]
    surfaces = [kind for kind in surfaces if kind.weight]
    if start is None:
        return points + surfaces
    reference = sum(kind.weight * _influence(kind, model, body, start) for kind in points)
    return points + [_make_commensurate(k, reference, model, body, start) for k in surfaces]


def _make_commensurate(
    kind: ResidualBlock, reference: float, model: MotionModel, body: Body, start: SwingState
) -> ResidualBlock:
    """The kind with its weight as a share of the influence of the points."""
    own = _influence(kind, model, body, start)
    return replace(kind, weight=kind.weight * reference / own if own else 0.0)


def _whole_swing(
    span: SplineBasis, guess: Float[np.ndarray, "T"], options: PriorOptions, fps: float
) -> Regulariser:
    """Expectations over a whole swing."""

    def expect(state: SwingState) -> Rows:
        return stack_rows(
            [
                expect_alphas(state, span, np.zeros(span.alphas), options.alpha),
                expect_times(state, span, guess, options, fps),
                expect_stillness(state, span, options, fps),
                expect_level(state, span, options),
            ]
        )

    return expect


_SOME = 4
_TYPICAL = np.array([1.0] * _SOME + [0.01] + [0.03] * 3 + [0.02] * 3)
"""Steps of alpha, mu, turn (rad) and shift (m) that count as equally large."""


def _influence(kind: ResidualBlock, model: MotionModel, body: Body, state: SwingState) -> float:
    """Trace of J^T J in typical steps of the unknowns, robustly weighted."""
    posture = posture_at(model, state.mu, np.zeros(_SOME))
    pose = place_body(body, posture, state)
    rows = kind.observe(pose)
    slopes = chain_rule(rows, pose, pose_rates(body, posture, state, pose)) * _TYPICAL
    share, _ = robust_weights(rows, 10 * kind.robust)
    return float(((slopes**2).sum(axis=1) * share).sum())
