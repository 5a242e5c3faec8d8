"""Fit the motion model to what was observed of a whole swing.

The paper slides windows of three frames (`keyrecon.paper.sliding_windows`); all frames of a swing
share their coefficients, so one problem over the whole swing is better conditioned and is the
default. It goes from coarse to fine: first where the player stands, with the mean motion; then
everything.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Annotated

import numpy as np
from jaxtyping import Float, Int

from keyrecon.golf.fit.deviation import follow_picture
from keyrecon.golf.fit.parameterisation import (
    KnotSpacing,
    SplineBasis,
    constant_basis,
    swing_basis,
)
from keyrecon.golf.fit.regularisation import (
    PriorOptions,
    Rows,
    coefficient_rows,
    level_rows,
    phase_rows,
    root_rows,
    stack_rows,
)
from keyrecon.golf.fit.residuals import (
    MODEL_ERROR,
    build_capsules,
    club_residuals,
    foreground_residuals,
    joint_residuals,
    mark_residuals,
    match_residuals,
    shaft_mark_residuals,
    silhouette_residuals,
)
from keyrecon.golf.fit.solver import (
    Problem,
    Regulariser,
    ResidualBlock,
    SegmentEquations,
    robust_weights,
    solve,
)
from keyrecon.golf.observe.swing_timing import keep_order
from keyrecon.golf.prior.kinematics import place_body, pose_rates
from keyrecon.golf.prior.motion_model import posture_at
from keyrecon.golf.records import Body, Observations, SwingFit, SwingState
from keyrecon.ranges import within


@dataclass(frozen=True)
class WeightOptions:
    """How much each type of observation counts against the joints; 0 leaves it out."""

    joints: Annotated[float, within(0, 20)] = 1.0
    """Weight of tracked joints.

    Their residuals are in standard deviations.
    """
    club: Annotated[float, within(0, 20)] = 1.0
    """Weight of the ends of the club.

    In standard deviations.
    """
    marks: Annotated[float, within(0, 20)] = 1.0
    """Weight of joints and shafts that a person marked.

    Every marked frame counts as independent of all others.
    """
    foreground: Annotated[float, within(0, 10)] = 0.5
    """Weight of filling the player's outline.

    Lines of sight through the player's mask, made commensurate with the joints.
    """
    silhouette: Annotated[float, within(0, 3)] = 0.15
    """Weight of keeping limbs within the player's outline.

    Limbs that project outside of the mask, made commensurate with the joints.
    """
    matches: Annotated[float, within(0, 10)] = 0.5
    """Weight of points of the player that are followed from frame to frame.

    Surface points matched between consecutive frames, made commensurate with the joints.
    """


@dataclass(frozen=True)
class FitOptions:
    """How a swing is fitted."""

    components: Annotated[int, within(1, 1000)] = 40
    """Components of the prior used at most; fewer keep nearer to its mean swing.

    The paper used 4 of its 10 swings.
    """
    weights: WeightOptions = field(default_factory=WeightOptions)
    """What the fit looks at."""
    priors: PriorOptions = field(default_factory=PriorOptions)
    """What is expected of a swing."""
    follow: bool = True
    """The body may depart from the model of swings where the picture does."""
    robust: Annotated[float, within(0.1, 60)] = 3.0
    """A joint or an end of the club that is farther off than this many standard deviations counts
    less."""
    time_knots: Annotated[float, within(0.005, 2)] = 0.1
    """Seconds between which the pace of the swing may change; more is smoother.

    Between knots of the normalised time.
    """
    root_knots: Annotated[float, within(0.02, 8)] = 0.4
    """Seconds between which the player's place and turn may change; more is smoother."""
    steps: Annotated[int, within(1, 1000)] = 25
    """Steps of the solver at most."""


INDEPENDENT_PER_SECOND = 3.0
"""Independent observations of a joint per second: trackers drift and proportions are wrong for a
third of a second or longer, so that more frames do not make these errors smaller. Chosen on
rendered swings; see benchmarks/golf.py."""
ROBUST_FOREGROUND, ROBUST_SILHOUETTE, ROBUST_MATCH = 0.06, 0.039, 0.0096
"""Residuals beyond which a line of sight (m: the radius of a thigh), a limb off the mask (player
heights) and a match (player heights: the accuracy of Lucas-Kanade on cloth) count less. Chosen on
rendered swings (12 and 3 px of 310); see benchmarks/golf.py."""
UNFOLLOWED = 0.05
"""Metres by which a swing of the model misses marked joints, before the body may depart from it: of
the joints that fits of real swings have worst, .05 to .17. Were they due within `MODEL_ERROR`,
elbows and wrists that no capture has would be met by another time, and by other proportions.
Chosen on four corrected frames: eight real swings have joints off by .0642 trunk lengths with .05
and .0648 with .1 (with .03 one loses 3 % of its joints), seven rendered ones 35.9 and 36.6 mm, and
tops .6 and 1.1 frames off (35.4 and .7 with .03)."""
HELD = 100.0
"""Standard deviations beyond which a mark counts less where the fit follows the picture: no mark is
an outlier, however far the model was from it."""
FOLLOW_TOLERANCES = (10.0, 1.0)
"""Factors on `robust` while the fit follows the picture: a club that lies otherwise than in any
capture is no outlier before it was tried. On two real swings with such a finish clubs within 5
degrees rose from .73 to .93 and from .69 to .72."""
FIRST_COMPONENTS = 6
"""Coefficients that move before all do, the largest styles first. Chosen on rendered swings; see
benchmarks/golf.py."""


@dataclass(frozen=True, eq=False)
class _Level:
    """A step from coarse to fine."""

    basis: SplineBasis
    robust: float
    """Factor on the size of residuals that count less: far starts need more tolerance."""


def fit_swing(
    observations: Observations, initial: SwingFit, fps: float, options: FitOptions = FitOptions()
) -> SwingFit:
    """The swing that explains the observations, from a rough start with the mean motion."""
    frames = len(initial.state.phase)
    number, knots = min(options.components, len(initial.model.components)), _knots(fps, options)
    levels = [
        _Level(constant_basis(0, frames), 10.0),
        _Level(swing_basis(min(number, FIRST_COMPONENTS), frames, knots), 3.0),
        _Level(swing_basis(number, frames, knots), 1.0),
    ]
    blocks = _weighted_blocks(observations, initial, fps, options)
    state = replace(initial.state, coefficients=np.zeros(number))
    return _descend(initial, state, blocks, levels, observations, fps, options)


def refit_swing(
    observations: Observations,
    initial: SwingFit,
    previous: SwingState,
    fps: float,
    options: FitOptions = FitOptions(),
) -> SwingFit:
    """The same, going on from the state that was fitted before there were more observations."""
    basis = swing_basis(len(previous.coefficients), len(initial.state.phase), _knots(fps, options))
    blocks = _weighted_blocks(observations, initial, fps, options)
    return _descend(initial, previous, blocks, [_Level(basis, 1.0)], observations, fps, options)


def follow_observations(
    fit: SwingFit,
    observations: Observations,
    initial: SwingFit,
    fps: float,
    options: FitOptions = FitOptions(),
) -> SwingFit:
    """A fitted swing that follows the observations where they depart from the model."""
    # A marked frame counts as independent of all others here too.
    factor, own = max(1.0, fps / INDEPENDENT_PER_SECOND), replace(initial, body=fit.body)
    marks = [
        replace(block, weight=factor * block.weight)
        for block in mark_blocks(observations, fit.body, options, HELD)
    ]
    for tolerance in FOLLOW_TOLERANCES:
        wider = replace(options, robust=tolerance * options.robust)
        blocks = residual_blocks(observations, own, wider)
        fit = follow_picture(fit, [*blocks, *marks], fps)
    return fit


def _knots(fps: float, options: FitOptions) -> KnotSpacing:
    return KnotSpacing(options.time_knots * fps, options.root_knots * fps)


def _weighted_blocks(
    observations: Observations, initial: SwingFit, fps: float, options: FitOptions
) -> list[ResidualBlock]:
    """All types of observations, frames counted as far as they are independent."""
    blocks = residual_blocks(observations, initial, options)
    share = min(1.0, INDEPENDENT_PER_SECOND / fps)
    wider = UNFOLLOWED / MODEL_ERROR if options.follow else 1.0
    marks = mark_blocks(observations, initial.body, options, wider * options.robust)
    return [
        *(replace(block, weight=block.weight * share) for block in blocks),
        *(replace(block, weight=block.weight / wider**2) for block in marks),
    ]


def _descend(
    initial: SwingFit,
    state: SwingState,
    blocks: Sequence[ResidualBlock],
    levels: Sequence[_Level],
    observations: Observations,
    fps: float,
    options: FitOptions,
) -> SwingFit:
    """Solve level by level from a state; phases are guessed by the initial one."""
    model, body = initial.model, initial.body
    keys = observations.marks.keys
    marked = np.rint(keys[np.isfinite(keys)]).astype(int)
    for level in levels:
        regulariser = _whole_swing(level.basis, initial.state.phase, options.priors, fps, marked)
        wide = [replace(block, robust=level.robust * block.robust) for block in blocks]
        problem = Problem(model, body, level.basis, wide, regulariser)
        state = solve(problem, state, options.steps)
        state = replace(state, phase=keep_order(state.phase))
    return SwingFit(model, body, state)


def residual_blocks(
    observations: Observations, initial: SwingFit, options: FitOptions
) -> list[ResidualBlock]:
    """Types of observation that count, those of the surface made commensurate with the points."""
    points = point_blocks(observations, initial.body, options)
    reference = sum(block.weight * measure_influence(block, initial) for block in points)
    return points + [
        _make_commensurate(block, reference, initial)
        for block in surface_blocks(observations, initial.body, options)
    ]


def point_blocks(
    observations: Observations, body: Body, options: FitOptions
) -> list[ResidualBlock]:
    """Joints and club, in standard deviations."""
    weights, robust = options.weights, options.robust
    blocks = [
        ResidualBlock(partial(joint_residuals, observations, body), weights.joints, robust),
        ResidualBlock(partial(club_residuals, observations, body), weights.club, robust),
    ]
    return [block for block in blocks if block.weight]


def mark_blocks(
    observations: Observations,
    body: Body,
    options: FitOptions,
    robust: float,
) -> list[ResidualBlock]:
    """What a person marked, in standard deviations."""
    joints = partial(mark_residuals, observations, body)
    shafts = partial(shaft_mark_residuals, observations, body)
    return [ResidualBlock(marks, options.weights.marks, robust) for marks in (joints, shafts)]


def surface_blocks(
    observations: Observations, body: Body, options: FitOptions
) -> list[ResidualBlock]:
    """Mask and matched points; their weights are shares of the influence of the points."""
    weights, capsules, height = options.weights, build_capsules(body), observations.height
    foreground = partial(foreground_residuals, observations, capsules)
    silhouette = partial(silhouette_residuals, observations, capsules)
    matches = partial(match_residuals, observations, capsules)
    blocks = [
        ResidualBlock(foreground, weights.foreground, ROBUST_FOREGROUND),
        ResidualBlock(silhouette, weights.silhouette, ROBUST_SILHOUETTE * height),
        ResidualBlock(matches, weights.matches, ROBUST_MATCH * height),
    ]
    return [block for block in blocks if block.weight]


def _make_commensurate(block: ResidualBlock, reference: float, initial: SwingFit) -> ResidualBlock:
    """The block with its weight as a share of the influence of the points (Section 4)."""
    influence = measure_influence(block, initial)
    return replace(block, weight=block.weight * reference / influence if influence else 0.0)


def _whole_swing(
    basis: SplineBasis,
    guess: Float[np.ndarray, "T"],
    options: PriorOptions,
    fps: float,
    marked: Int[np.ndarray, "n"],
) -> Regulariser:
    """What is expected of a whole swing, with key postures `marked` in some frames."""

    def expect(state: SwingState) -> Rows:
        mean = np.zeros(basis.n_coefficients)
        return stack_rows(
            [
                coefficient_rows(state, basis, mean, options.coefficients),
                phase_rows(state, basis, guess, options, fps, marked),
                root_rows(state, basis, options, fps),
                level_rows(state, basis, options),
            ]
        )

    return expect


INFLUENCE_COMPONENTS = 4
"""Components whose influence is compared: m of the paper."""
TYPICAL_STEPS = np.array([1.0] * INFLUENCE_COMPONENTS + [0.01] + [0.03] * 3 + [0.02] * 3)
"""Steps of coefficients (their standard deviation), phase, turn (rad) and shift (m) that count as
equally large: each moves a hand by some centimetres."""


def measure_influence(block: ResidualBlock, fit: SwingFit) -> float:
    """Trace of J^T J of a block in typical steps of the unknowns, robustly weighted."""
    posture = posture_at(fit.model, fit.state.phase, np.zeros(INFLUENCE_COMPONENTS))
    pose = place_body(fit.body, posture, fit.state)
    rows = block.residuals(pose)
    rates = pose_rates(fit.body, posture, fit.state, pose)
    equations = SegmentEquations.none(pose)
    equations.add(rows, pose, robust_weights(rows, 10 * block.robust).weights)
    normal, _ = equations.by_unknowns(rates)
    return float(np.trace(normal.sum(axis=0) * TYPICAL_STEPS**2))
