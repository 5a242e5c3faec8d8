"""Bone lengths and the scale of every frame, from the lengths of bones in the picture.

"Each limb is parallel to the image somewhere": the lengths of a bone in the picture pile up just
below s l and stop there. That is a likelihood (see `foreshortening`), and all bones of all frames
together determine the lengths (left and right alike) and the scale s_t, which stays with the
tracked height of the player and may leave it only slowly. Without noise this is the lower bound of
Taylor (CVIU 80, 2000), s >= max |dp| / l, over the whole sequence.

The anthropometric table is a prior, not the answer: a length wrong by 10 % turns an in-plane
bone out of the plane by 25 degrees.
"""

import logging
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from jaxtyping import Float, Int
from scipy.optimize import OptimizeResult, minimize
from scipy.sparse import block_array, block_diag, csr_array, eye_array, vstack

from keyrecon.body import Skeleton, standing_length
from keyrecon.errors import KeyreconError
from keyrecon.lifting.foreshortening import log_densities
from keyrecon.ranges import within
from keyrecon.records import Annotations, JointTracks, Shots

logger = logging.getLogger(__name__)

_MIN_CONFIDENCE = 0.05
"""Confidence below which a joint's noise grows no more. A quarter more or less, others with it: at
most 2.8 mm on eight clips."""
_FACTORS = (0.6, 0.7, 0.8, 0.87, 1.15, 1.25, 1.4, 1.6)
"""Other lengths of a bone that are tried, as shares: from the shortest of adults to the longest."""
_HOPS, _LEAST_GAIN, _SEARCHED = 4, 0.5, 1200
"""How often the search goes on from another place, by how much the cost falls then, nats, and by
how many observations at most minima are told apart.

On volleys that hide the upper arms (one drawing of eight sequences) the first minimum had them 1.42
times too long, 200 nats above the lowest: PA-MPJPE 66.6 mm instead of 44.2."""


@dataclass(frozen=True)
class LengthOptions:
    """How far the body may differ from the table, and how well joints are known."""

    spread: Annotated[float, within(0.006, 2)] = 0.12
    """How far a bone may differ from the table of body proportions, as a share (standard
    deviation).

    All spreads, `knot` and `correlation` a quarter more or less, others with them: at most 2.8 mm
    on eight clips.
    """
    tie_spread: Annotated[float, within(0.004, 1)] = 0.07
    """The same for the ratio of thigh to shank and of shoulder bone to shoulder breadth."""
    scale_spread: Annotated[float, within(0.002, 0.6)] = 0.03
    """How far the size may differ from the tracked height, as a share (standard deviation)."""
    knot: Annotated[float, within(0.03, 10)] = 0.5
    """Seconds between which that difference may change.

    Between the knots of the scale's deviation from the tracked height.
    """
    click_noise: Annotated[float, within(0.0003, 0.1)] = 0.007
    """How exact marks are, player heights (standard deviation); more for careless marks.

    A quarter more costs 4.1 mm where nobody gave signs, on one of eight rendered clips of 6 s, and
    .8 where somebody did. One mark of each frame does not tell how another would lie.
    """
    track_noise: Annotated[float, within(0.0004, 0.2)] = 0.0063
    """How exact surely propagated joints are, player heights (standard deviation).

    Of full confidence; it grows with the inverse root of the confidence: .004 at .85, .009 at .45
    and .014 at .1 by marks of nine clips. With .009, this and .0045 PA-MPJPE is 35.7, 35.5 and 36.6
    mm on five rendered clips; 67.9, 65.0 and 64.5 mm on four real views with truth.
    """
    correlation: Annotated[float, within(0, 5)] = 0.15
    """Seconds over which errors of propagated joints stay alike and count once."""
    corrections: Annotated[int, within(0, 100)] = 4
    """How often lengths are corrected by what the depth model has learnt of bodies; 0 is never.

    0, 1, 2, 4 and 8 times: 39.2, 38.3, 37.9, 37.7 and 37.7 mm, eight captures that are projected.
    """


@dataclass(frozen=True, eq=False)
class BodySize:
    """The player's skeleton, how long its bones are and how large the body appears."""

    skeleton: Skeleton
    lengths: Float[np.ndarray, "B"]
    """Body heights; left and right alike."""
    breadths: Float[np.ndarray, "P"]
    """Hip and shoulder breadth, as `Skeleton.breadths` lists them, body heights."""
    scale: Float[np.ndarray, "T"]
    """px per body height"""


@dataclass(frozen=True, eq=False)
class _ObservedLengths:
    """Lengths of bones and breadths in the picture: one row each."""

    log_length: Float[np.ndarray, "n"]
    """Of px."""
    noise: Float[np.ndarray, "n"]
    """px"""
    group: Int[np.ndarray, "n"]
    frame: Int[np.ndarray, "n"]

    def part(self, rows: Int[np.ndarray, "n"]) -> "_ObservedLengths":
        """Some of the observations."""
        values = (self.log_length, self.noise, self.group, self.frame)
        return _ObservedLengths(*(value[rows] for value in values))


def estimate_lengths(
    tracks: JointTracks,
    annotations: Annotations,
    height_px: Float[np.ndarray, "T"],
    fps: float,
    options: LengthOptions = LengthOptions(),
    shots: Shots | None = None,
) -> BodySize:
    """Bone lengths, breadths and scale that explain the lengths in the picture.

    `height_px` is the player's standing height (head centre to mid-feet) in the picture, any
    constant factor aside. The unit is the body height: the picture shows proportions only, and
    what stands from head top to ankle is taken to be the table's share of it. Where the search
    does not converge, the better of its last step and the table is taken, with a warning. Raises
    KeyreconError where no bone has both ends marked or tracked.
    """
    skeleton = annotations.skeleton
    group_of, table = _length_groups(skeleton)
    observations = _observe_lengths(tracks, annotations, height_px, fps, options)
    if not len(observations.frame):
        raise KeyreconError(
            "No bone has both ends marked or tracked, so nothing tells how large the player is; "
            "mark more joints with `keyrecon annotate`."
        )
    if shots is None:
        shots = Shots.between((), len(height_px))
    drift = _drift_of_scale(shots, fps, options)
    ties = _length_ties(skeleton)
    fit = _fit(observations, np.log(table), ties, np.log(height_px), drift, options)
    bones = len(skeleton.bones)
    lengths = np.exp(fit.log_lengths)[group_of]
    tall = standing_length(skeleton.lengths, skeleton)
    size = standing_length(lengths[:bones], skeleton) / tall
    return BodySize(
        skeleton, lengths[:bones] / size, lengths[bones:] / size, np.exp(fit.log_scale) * size
    )


def joint_noise(
    confidence: Float[np.ndarray, "T J"], options: LengthOptions
) -> Float[np.ndarray, "T J"]:
    """Standard deviation of propagated joints, player heights."""
    return options.track_noise / np.sqrt(np.clip(confidence, _MIN_CONFIDENCE, 1.0))


def _length_groups(skeleton: Skeleton) -> tuple[Int[np.ndarray, "n"], Float[np.ndarray, "m"]]:
    """Which length each bone and breadth has (left and right share one), and the table of them,
    in statures."""
    group = skeleton.length_group
    _, names = np.unique(group, return_index=True)
    group_of = np.concatenate([group, len(names) + np.arange(len(skeleton.breadths))])
    table = np.concatenate(
        [skeleton.lengths[names], [breadth.length for breadth in skeleton.breadths]]
    )
    return group_of, table


def _length_ties(skeleton: Skeleton) -> Float[np.ndarray, "r m"]:
    """Pairs of lengths that grow together: one row each, 1 and -1."""
    group_of, table = _length_groups(skeleton)
    bone_of = {skeleton.names[child]: bone for bone, (_, child) in enumerate(skeleton.bones)}
    pairs = [
        (bone_of[first], bone_of[second])
        for first, second in (("left_knee", "left_ankle"),)
        if first in bone_of and second in bone_of
    ]
    for place, breadth in enumerate(skeleton.breadths):
        if skeleton.names[breadth.left] == "left_shoulder" and "left_shoulder" in bone_of:
            pairs.append((bone_of["left_shoulder"], len(skeleton.bones) + place))
    ties = np.zeros((len(pairs), len(table)))
    for row, (first, second) in enumerate(pairs):
        ties[row, group_of[first]], ties[row, group_of[second]] = 1.0, -1.0
    return ties


def _observe_lengths(
    tracks: JointTracks,
    annotations: Annotations,
    height_px: Float[np.ndarray, "T"],
    fps: float,
    options: LengthOptions,
) -> _ObservedLengths:
    """Every bone and breadth in every annotated frame, and in propagated ones now and then."""
    skeleton = annotations.skeleton
    pairs = [(breadth.left, breadth.right) for breadth in skeleton.breadths]
    ends = np.concatenate([skeleton.bones, np.array(pairs, dtype=np.int64).reshape(-1, 2)])
    group_of, _ = _length_groups(skeleton)
    step = max(1, round(options.correlation * fps))
    passing = np.setdiff1d(np.arange(0, len(height_px), step), annotations.frames)
    frames = np.concatenate([annotations.frames, passing])
    joints = np.concatenate([annotations.joints, tracks.joints[passing]])
    clicked = np.full(annotations.joints.shape[:2], options.click_noise)
    propagated = joint_noise(tracks.confidence[passing], options)
    sigma = np.concatenate([clicked, propagated])[:, ends]
    length = np.linalg.norm(joints[:, ends[:, 1]] - joints[:, ends[:, 0]], axis=-1)
    # what nobody saw, and what is too long to be, tells nothing of a length
    seen = np.concatenate([np.full(clicked.shape, True), tracks.confidence[passing] > 0])
    known = (length > 0) & seen[:, ends].all(axis=-1)
    row, column = np.nonzero(known)
    noise = np.linalg.norm(sigma, axis=-1) * height_px[frames, None]
    return _ObservedLengths(np.log(length[known]), noise[known], group_of[column], frames[row])


@dataclass(frozen=True, eq=False)
class _ScaleDrift:
    """How the scale strays from the tracked height: linear between knots, in each shot anew."""

    blend: csr_array
    """(T, k): share of each knot in each frame."""
    steps: csr_array
    """(q, k): from each knot to the next of its shot, one row each, -1 and 1."""


def _drift_of_scale(shots: Shots, fps: float, options: LengthOptions) -> _ScaleDrift:
    blends, steps = [], []
    for shot in shots.parts:
        count = shot.stop - shot.start
        knots = 2 + int(count / fps / options.knot)
        place = np.linspace(0, knots - 1, count)
        before = np.minimum(place.astype(int), knots - 2)
        share, rows = place - before, np.arange(count)
        near = np.concatenate([1 - share, share]), (np.tile(rows, 2), np.append(before, before + 1))
        blends.append(csr_array(near, shape=(count, knots)))
        steps.append(eye_array(knots - 1, knots, k=1) - eye_array(knots - 1, knots))
    return _ScaleDrift(block_diag(blends, format="csr"), block_diag(steps, format="csr"))


@dataclass(frozen=True, eq=False)
class _LengthFit:
    """The most probable lengths and scale."""

    log_lengths: Float[np.ndarray, "m"]
    """Of statures."""
    log_scale: Float[np.ndarray, "T"]
    """Of px per stature."""


@dataclass(frozen=True, eq=False)
class _Cost:
    """Negative log posterior of (log lengths, log factor, drift of the scale), and its slope."""

    observations: _ObservedLengths
    log_height: Float[np.ndarray, "T"]
    at_observation: csr_array
    """(n, k): rows of `_ScaleDrift.blend`."""
    prior: csr_array
    expected: Float[np.ndarray, "q"]
    """What the rows of the prior give for the table."""
    groups: int
    """Lengths there are."""

    def __call__(self, x: Float[np.ndarray, "n"]) -> tuple[float, Float[np.ndarray, "n"]]:
        """Value in nats, and slope."""
        seen, groups = self.observations, self.groups
        lengths, factor, drift = x[:groups], x[groups], x[groups + 1 :]
        log_scale = self.log_height[seen.frame] + factor + self.at_observation @ drift
        log_full = log_scale + lengths[seen.group]
        foreshortening = np.exp(seen.log_length - log_full)
        noise = seen.noise / np.exp(log_full)
        value, pull = _log_likelihood(seen.group, foreshortening, noise, groups)
        off = self.prior @ x - self.expected
        by_group = np.bincount(seen.group, pull, groups)
        slope = np.concatenate([by_group, [pull.sum()], self.at_observation.T @ pull])
        return float(-value + 0.5 * off @ off), slope + self.prior.T @ off

    def minimize(self, start: Float[np.ndarray, "n"]) -> OptimizeResult:
        """The local minimum that L-BFGS-B leads to."""
        return minimize(self, start, jac=True, method="L-BFGS-B")

    def thinned(self, most: int) -> "_Cost":
        """The cost of so many observations at most, chosen by chance.

        At even steps the same bones would be taken in every frame.
        """
        count = len(self.observations.frame)
        rows = np.sort(np.random.default_rng(0).permutation(count)[:most])
        seen, blend = self.observations.part(rows), self.at_observation[rows]
        return replace(self, observations=seen, at_observation=blend)


def _fit(
    observations: _ObservedLengths,
    log_table: Float[np.ndarray, "m"],
    ties: Float[np.ndarray, "r m"],
    log_height: Float[np.ndarray, "T"],
    scale_drift: _ScaleDrift,
    options: LengthOptions,
) -> _LengthFit:
    """Maximise the posterior: which minimum by some of the observations, its place by all."""
    groups, blend = len(log_table), scale_drift.blend
    prior = _prior(ties, scale_drift.steps, options)
    expected = prior[:, :groups] @ log_table
    cost = _Cost(observations, log_height, blend[observations.frame], prior, expected, groups)
    factor = _initial_factor(observations, log_table, log_height)
    start = np.concatenate([log_table, [factor], np.zeros(blend.shape[1])])
    optimum = cost.minimize(_find_basin(cost.thinned(_SEARCHED), start))
    best = optimum.x
    if not optimum.success:
        if not optimum.fun < cost(start)[0]:
            best = start
        logger.warning(
            "The search for bone lengths did not converge (%s); %s.",
            optimum.message,
            "the table's proportions are used" if best is start else "its last step is used",
        )
    return _LengthFit(best[:groups], log_height + best[groups] + blend @ best[groups + 1 :])


def _find_basin(cost: _Cost, start: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n"]:
    """The lowest of some local minima, from a start on.

    A bone that is always seen short may be short or always point at the camera, so there is more
    than one. From each that is found every length is changed by itself; from the lowest place the
    search goes on (basin hopping, Wales and Doye 1997, with the hops that this question has).
    """
    best = cost.minimize(start)
    for _ in range(_HOPS):
        hops = [_best_hop(cost, best.x, length) for length in range(cost.groups)]
        other = cost.minimize(min(hops, key=lambda hop: hop[0])[1])
        if other.fun > best.fun - _LEAST_GAIN:
            break
        best = other
    return best.x


def _best_hop(
    cost: _Cost, place: Float[np.ndarray, "n"], length: int
) -> tuple[float, Float[np.ndarray, "n"]]:
    """Cost and place of the best quite different value of one length, all else as it is."""
    places = np.tile(place, (len(_FACTORS), 1))
    places[:, length] += np.log(_FACTORS)
    costs = [cost(there)[0] for there in places]
    return min(costs), places[np.argmin(costs)]


def _prior(ties: Float[np.ndarray, "r m"], steps: csr_array, options: LengthOptions) -> csr_array:
    """Rows of what is expected to be small: (lengths, factor, drift of the scale) -> nats^0.5."""
    groups, knots = ties.shape[1], steps.shape[1]
    jump = options.scale_spread * np.sqrt(2 * (1 - np.exp(-0.5)))  # alike over two knots
    drift = vstack([eye_array(knots) / (2 * options.scale_spread), steps / jump])
    lengths = np.concatenate([np.eye(groups) / options.spread, ties / options.tie_spread])
    factor = csr_array((len(lengths), 1))
    return block_array([[lengths, factor, None], [None, None, drift]], format="csr")


def _log_likelihood(
    group: Int[np.ndarray, "n"],
    foreshortening: Float[np.ndarray, "n"],
    noise: Float[np.ndarray, "n"],
    groups: int,
) -> tuple[float, Float[np.ndarray, "n"]]:
    """Log likelihood of observed lengths, and what it loses per unit of the log full length.

    How much a bone prefers the image plane or the line of sight is not known (hips filmed from
    the side never have their full breadth): all observations of a group share one unknown
    inclination.
    """
    log_p, slopes = log_densities(foreshortening, noise)
    value = np.array([np.bincount(group, row, groups) for row in log_p])
    best = value.max(axis=0)
    weight = np.exp(value - best)
    total = weight.sum(axis=0)
    mean_slope = ((weight / total)[:, group] * slopes).sum(axis=0)
    return float((best + np.log(total)).sum()), mean_slope


def _initial_factor(
    observations: _ObservedLengths,
    log_table: Float[np.ndarray, "m"],
    log_height: Float[np.ndarray, "T"],
) -> float:
    """Log ratio of stature to tracked height at which most bones fit into their length."""
    ratio = observations.log_length - log_table[observations.group] - log_height[observations.frame]
    return float(np.quantile(ratio, 0.75))
