"""Joints that follow the picture where it departs from the motion model.

A model learnt from a few captures has no posture of a new player quite right. After it was fitted,
every segment may therefore turn away from its parent by w(t), and the player shift and turn, as
cubic splines in time close to zero: by how much, published ranges of golfers tell, and what nothing
in the picture asks for stays with the model. The unknowns of a knot meet only those of the next
three, so the normal equations are banded and a step costs as much as the frames are many.

The right hand, which holds no club in the model's chain of segments, stays with the left one: from
its wrist to the grip the model's way is kept, in the club's axes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float
from scipy.linalg import solveh_banded
from scipy.sparse import csr_array
from scipy.spatial.transform import Rotation

from keyrecon.body import LSP14
from keyrecon.golf.fit.parameterisation import ROOT, spline_matrix
from keyrecon.golf.fit.solver import ResidualBlock, sum_blocks
from keyrecon.golf.prior.kinematics import PoseRates, find_joints, place_body, pose_rates
from keyrecon.golf.prior.motion_model import left_jacobian, posture_at, turn_posture
from keyrecon.golf.prior.skeleton import CLUB, SEGMENTS
from keyrecon.golf.records import Body, Posture, RootPose, SwingFit, SwingState
from keyrecon.numerics.levenberg_marquardt import Damping, minimise

SPREADS = {
    "pelvis": 0.10, "trunk": 0.15, "head": 0.25, "clavicle": 0.12, "upper_arm": 0.25,
    "forearm": 0.25, "thigh": 0.12, "shank": 0.12, "foot": 0.15, "club": 0.30,
}  # fmt: skip
"""Standard deviation of each segment's turn from its parent, rad. Tour players and amateurs differ
among themselves by 6 to 9 degrees in turns of pelvis and trunk, 10 to 17 in shoulder and elbow and
10 to 20 in the wrist at the top (Zheng et al., Int. J. Sports Med. 29, 2008; Meister et al., J.
Appl. Biomech. 27, 2011; Cheetham et al., Sports Biomech. 2008)."""
BENDS = {"club": 400.0, "forearm": 300.0}
BEND = 100.0
"""Change of such a turn's speed that is usual, rad/s^2, of some segments and of all others. Wrists
uncock at up to 17 rad/s, reached within 0.05 to 0.08 s (Zheng et al., 2008): 200 to 350 rad/s^2,
which one player does earlier than another altogether. Tried on five real swings, clubs within 5
degrees: 60 for all gave .50, .69, .83, .96 and 1, these .63, .72, .87, 1 and 1."""
DEPARTURES_PER_SECOND = 3.0
"""Independent departures from the model per second: a posture that is another player's own stays so
for a third of a second. Tried on five real swings, joints within a fifth of the trunk: 10, as many
as observations, gave .915, .924, .928, .886 and .896, 3 gave .918, .940, .936, .908 and .894, 2
gave .915, .942, .947, .916 and .887; but of a rendered swing down the line with four keyframes the
joints were off by 41.7, 42 and 42.9 mm."""
ROOT_WALK = np.array([0.05, 0.05, 0.05, 0.15, 0.10, 0.05])
"""By how much the player turns (rad) and shifts (m; aside, up and down, in depth) in a second
beyond the model, at the scale of a random walk: the captures sway by .1 m where others turn on the
spot. Turns are the pelvis's own and depth is hardly seen: .15 for all made the joints of a rendered
swing down the line 5 mm worse, once aligned in scale alone."""
GRIP_SPREAD = 0.02
"""Metres by which the right hand slides on the grip."""
KNOTS = 0.06
"""Seconds between knots: a quarter of the fastest downswing's."""
INDEPENDENT_PER_SECOND = 10.0
"""Independent observations per second."""
DAMPING = Damping(start=1e-3, increase=8.0, decrease=4.0, largest=1e4)
LEAST_FALL = 2e-3
"""Share of the cost by which the last step lowers it."""
RIGHT_WRIST = LSP14.index("right_wrist")

CHANNELS = 3 * len(SEGMENTS) + ROOT
"""Unknowns of a knot: a rotation vector per segment, then turn and shift of the player."""


def follow_picture(
    fit: SwingFit, blocks: Sequence[ResidualBlock], fps: float, steps: int = 8
) -> SwingFit:
    """A fitted swing whose segments turn away from the model where the observations ask for it.

    `blocks` are weighted as if every frame were independent of all others.
    """
    problem = _Problem(fit, blocks, spline_matrix(len(fit.state.phase), KNOTS * fps), fps)
    start = np.zeros((problem.spline.shape[1], CHANNELS))
    known = fit.state.deviation
    if known is not None:
        start[:, :-ROOT] = np.linalg.lstsq(
            problem.spline, known.reshape(len(known), -1), rcond=None
        )[0]

    def converged(before: float, after: float) -> bool:
        return before - after < LEAST_FALL * after

    knots = minimise(
        start, problem.linearise, problem.step, lambda a, b: b <= a, converged, DAMPING, steps
    )
    return replace(fit, state=problem.state(knots))


@dataclass(frozen=True, eq=False)
class _Linearised:
    cost: float
    lags: Float[np.ndarray, "4 B C C"]
    """Normal equations of each knot with itself and the three after it."""
    gradient: Float[np.ndarray, "B C"]


@dataclass(frozen=True, eq=False)
class _Problem:
    """What is minimised over the knots."""

    fit: SwingFit
    blocks: Sequence[ResidualBlock]
    spline: Float[np.ndarray, "T B"]
    fps: float

    @cached_property
    def learnt(self) -> Posture:
        """The model's postures, from which segments turn away."""
        state = self.fit.state
        return posture_at(self.fit.model, state.phase, state.coefficients)

    @cached_property
    def usual_grip(self) -> Float[np.ndarray, "T 3"]:
        """From the grip to the right wrist as the model has it, in the club's axes."""
        body = self.fit.body
        return _grip_offset(body, place_body(body, self.learnt, self.fit.state))

    def state(self, knots: Float[np.ndarray, "B C"]) -> SwingState:
        """The fitted state with the segments' own turns, and the player moved."""
        values, state = self.spline @ knots, self.fit.state
        turn = Rotation.from_rotvec(values[:, -ROOT:-3]).as_matrix()
        return replace(
            state,
            rotation=turn @ state.rotation,
            position=state.position + values[:, -3:],
            deviation=values[:, :-ROOT].reshape(len(values), -1, 3),
        )

    def posture(self, state: SwingState) -> Posture:
        """Postures with their rates by the segments' own turns alone."""
        if state.deviation is None:
            raise ValueError("a state without turns of its own")
        turned = turn_posture(self.learnt, state.deviation)
        frames, segments = state.deviation.shape[:2]
        rates = np.zeros((frames, segments, 3, 3 * segments))
        slopes = left_jacobian(state.deviation)
        for p in range(segments):
            rates[:, p, :, 3 * p : 3 * p + 3] = slopes[:, p]
        return Posture(turned.turns, turned.place, rates, np.zeros((frames, 3, 3 * segments)))

    def linearise(self, knots: Float[np.ndarray, "B C"]) -> _Linearised:
        """Residuals at some knots; which primitive a line of sight meets changes."""
        state, body = self.state(knots), self.fit.body
        posture = self.posture(state)
        pose = place_body(body, posture, state)
        rates = _by_values(pose_rates(body, posture, state, pose), self.spline @ knots)
        share = min(1.0, INDEPENDENT_PER_SECOND / self.fps)
        equations, cost = sum_blocks(self.blocks, pose, share)
        normal, slope = equations.by_unknowns(rates)
        cost += self._add_grip(normal, slope, pose, rates, share)
        lags, gradient = _on_knots(self.spline, normal, slope)
        cost += self._add_prior(lags, gradient, knots)
        return _Linearised(cost, lags, gradient)

    def _add_grip(
        self,
        normal: Float[np.ndarray, "T C C"],
        slope: Float[np.ndarray, "T C"],
        pose: RootPose,
        rates: PoseRates,
        share: float,
    ) -> float:
        """The right wrist keeps its place at the grip, in the club's axes."""
        body, usual = self.fit.body, self.usual_grip
        off = _grip_offset(body, pose) - usual
        turn = np.swapaxes(pose.rotations[:, CLUB], 1, 2)
        segment = int(body.joint_segment[RIGHT_WRIST])
        arm = find_joints(body, pose)[:, RIGHT_WRIST] - pose.origins[:, segment]
        moved = rates.origins[:, segment] + np.cross(
            rates.rotations[:, segment], arm[:, :, None], axis=1
        )
        away = turn.swapaxes(1, 2) @ (off + usual)[..., None]
        swung = np.cross(rates.rotations[:, CLUB], away, axis=1)
        slopes = turn @ (moved - rates.origins[:, CLUB] - swung) / GRIP_SPREAD
        values = off / GRIP_SPREAD
        normal += share * np.einsum("tic,tid->tcd", slopes, slopes)
        slope += share * np.einsum("tic,ti->tc", slopes, values)
        return share * float((values**2).sum())

    def _add_prior(
        self,
        lags: Float[np.ndarray, "4 B C C"],
        gradient: Float[np.ndarray, "B C"],
        knots: Float[np.ndarray, "B C"],
    ) -> float:
        """Turns close to none and smooth; the player moves like a random walk."""
        count = len(knots)
        seconds = len(self.spline) / self.fps / count
        spread = np.repeat([SPREADS[part_name(s.name)] for s in SEGMENTS], 3)
        near = np.zeros(CHANNELS)
        near[:-ROOT] = min(1.0, DEPARTURES_PER_SECOND * seconds) / spread**2
        near[-ROOT:] = 1e-2 / ROOT_WALK**2
        bends = np.repeat([BENDS.get(part_name(s.name), BEND) for s in SEGMENTS], 3)
        bend = np.zeros(CHANNELS)
        bend[:-ROOT] = 1 / (bends * seconds**2) ** 2
        walk = np.zeros(CHANNELS)
        walk[-ROOT:] = 1 / (ROOT_WALK**2 * seconds)
        cost = 0.0
        for order, weight in ((0, near), (1, walk), (2, bend)):
            rows = np.diff(np.eye(count), n=order, axis=0)
            square, values = rows.T @ rows, rows @ knots
            cost += float((weight * values**2).sum())
            gradient += weight * (rows.T @ values)
            for lag in range(min(order + 1, count)):
                diagonal = np.diagonal(square, -lag)
                lags[lag, : count - lag] += diagonal[:, None, None] * np.diag(weight)
        return cost

    def step(
        self, knots: Float[np.ndarray, "B C"], here: _Linearised, damping: float
    ) -> Float[np.ndarray, "B C"]:
        """Knots after a damped step."""
        count = len(knots)
        reach = min(len(here.lags), count)
        band = np.zeros((reach * CHANNELS, count * CHANNELS))
        for lag in range(reach):
            first = here.lags[lag, : count - lag]
            for j in range(CHANNELS):
                row, top = lag * CHANNELS - j, j if lag == 0 else 0
                below = band[row + top : row + CHANNELS, j : (count - lag) * CHANNELS : CHANNELS]
                below[:] = first[:, top:, j].T
        band[0] += damping * band[0] + 1e-9 * band[0].max()
        return knots - solveh_banded(band, here.gradient.ravel(), lower=True).reshape(knots.shape)


def part_name(segment: str) -> str:
    """The part of the body that a segment is, left or right."""
    return segment.removeprefix("right_").removeprefix("left_")


def _grip_offset(body: Body, pose: RootPose) -> Float[np.ndarray, "T 3"]:
    """From the grip to the right wrist, in the club's axes."""
    apart = find_joints(body, pose)[:, RIGHT_WRIST] - pose.origins[:, CLUB]
    return np.einsum("tij,ti->tj", pose.rotations[:, CLUB], apart)


def _by_values(rates: PoseRates, values: Float[np.ndarray, "T C"]) -> PoseRates:
    """Rates by the splines' values: a turn of the player is a rotation vector too."""
    slopes = left_jacobian(values[:, -ROOT:-3])[:, None]
    origins, rotations = rates.origins.copy(), rates.rotations.copy()
    for of_rates in (origins, rotations):
        of_rates[..., -ROOT:-3] = of_rates[..., -ROOT:-3] @ slopes
    return PoseRates(origins, rotations)


def _on_knots(
    spline: Float[np.ndarray, "T B"],
    normal: Float[np.ndarray, "T C C"],
    slope: Float[np.ndarray, "T C"],
) -> tuple[Float[np.ndarray, "4 B C C"], Float[np.ndarray, "B C"]]:
    """Normal equations of the frames as those of the knots."""
    count, channels = spline.shape[1], normal.shape[1]
    flat = normal.reshape(len(normal), -1)
    lags = np.zeros((4, count, channels, channels))
    for lag in range(min(4, count)):
        both = csr_array((spline[:, : count - lag] * spline[:, lag:]).T)
        lags[lag, : count - lag] = (both @ flat).reshape(-1, channels, channels)
    return lags, spline.T @ slope
