"""Bone lengths and the scale of every frame, from the lengths that bones show in the picture.

"Each limb is parallel to the image somewhere": the lengths that a bone shows pile up just
below s l and stop there. That is a likelihood (see `shown`), and all bones of all frames vote
at once for the lengths (left and right alike) and for the scale s_t, which follows the tracked
height of the player and may leave it only slowly. Without noise this is the lower bound of
Taylor (CVIU 80, 2000), s >= max |dp| / l, over the whole sequence.

The anthropometric table is a prior, not the answer: a length wrong by 10 % turns an in-plane
bone out of the plane by 25 degrees.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.optimize import minimize

from keyrecon.body import Skeleton
from keyrecon.lifting.bone_directions import ancestry, breadths
from keyrecon.lifting.foreshortening import INCLINATIONS, log_density
from keyrecon.records import Annotations, JointTracks

_LEAST_CONFIDENCE = 0.05


@dataclass(frozen=True)
class LengthOptions:
    """How far the body may differ from the table, and how well joints are known."""

    spread: float = 0.12
    """Standard deviation of a bone length about the table, relative."""
    tie_spread: float = 0.07
    """The same for the ratio of thigh to shank and of shoulder bone to shoulder breadth."""
    scale_spread: float = 0.03
    """Standard deviation of the scale about the tracked height, relative."""
    knot: float = 0.5
    """Seconds between the knots of the scale's deviation from the tracked height."""
    click_noise: float = 0.007
    """Standard deviation of an annotated joint, in player heights."""
    track_noise: float = 0.009
    """Standard deviation of a propagated joint of full confidence, in player heights; it grows
    with the inverse root of the confidence."""
    correlation: float = 0.15
    """Seconds over which errors of propagated joints stay alike; they count once."""


@dataclass(frozen=True, eq=False)
class BodySize:
    """How long the bones are and how large the body appears."""

    lengths: Float[np.ndarray, "B"]
    """Body heights; left and right alike."""
    breadths: Float[np.ndarray, "P"]
    """Hip and shoulder breadth, as `chain.breadths` lists them, body heights."""
    scale: Float[np.ndarray, "T"]
    """px per body height"""


@dataclass(frozen=True, eq=False)
class _LengthEvidence:
    """Lengths that were seen: one row each."""

    shown: Float[np.ndarray, "n"]
    """log of px"""
    noise: Float[np.ndarray, "n"]
    """px"""
    kind: Int[np.ndarray, "n"]
    frame: Int[np.ndarray, "n"]


def estimate_lengths(
    tracks: JointTracks,
    annotations: Annotations,
    height_px: Float[np.ndarray, "T"],
    fps: float,
    options: LengthOptions = LengthOptions(),
) -> BodySize:
    """Bone lengths, breadths and scale that explain the lengths seen in the picture.

    `height_px` is the player's standing height (head centre to mid-feet) in the picture, any
    constant factor aside. The unit is the body height: the picture shows proportions only, and
    what stands from head top to ankle is taken to be the table's share of it.
    """
    skeleton = annotations.skeleton
    kind_of, table = _kinds(skeleton)
    votes = _collect(tracks, annotations, height_px, fps, options)
    knots = np.linspace(0, len(height_px) - 1, 2 + int(len(height_px) / fps / options.knot))
    log_lengths, log_scale = _fit(
        votes, np.log(table), _ties(skeleton), np.log(height_px), knots, options
    )
    bones = len(skeleton.bones)
    lengths = np.exp(log_lengths)[kind_of]
    size = _standing(lengths[:bones], skeleton) / _standing(skeleton.lengths, skeleton)
    return BodySize(lengths[:bones] / size, lengths[bones:] / size, np.exp(log_scale) * size)


def joint_noise(
    confidence: Float[np.ndarray, "T J"], options: LengthOptions
) -> Float[np.ndarray, "T J"]:
    """Standard deviation of propagated joints, player heights."""
    return options.track_noise / np.sqrt(np.clip(confidence, _LEAST_CONFIDENCE, 1.0))


def marked_joints(tracks: JointTracks, annotations: Annotations) -> Float[np.ndarray, "T J 2"]:
    """The tracks with every annotated joint put where the person placed it."""
    joints = tracks.joints.copy()
    joints[annotations.frames] = np.where(
        np.isnan(annotations.joints), joints[annotations.frames], annotations.joints
    )
    return joints


def _kinds(skeleton: Skeleton) -> tuple[Int[np.ndarray, "n"], Float[np.ndarray, "m"]]:
    """Which length each bone and breadth has, and these lengths by the table, in statures."""
    pairs = breadths(skeleton)
    first = np.minimum(np.arange(len(skeleton.bones)), skeleton.bone_mirror)
    names, kind = np.unique(first, return_inverse=True)
    kind_of = np.concatenate([kind, len(names) + np.arange(len(pairs))])
    table = np.concatenate([skeleton.lengths[names], [breadth for *_, breadth in pairs]])
    return kind_of, table


def _ties(skeleton: Skeleton) -> Float[np.ndarray, "r m"]:
    """Pairs of lengths that grow together: one row each, 1 and -1."""
    kind_of, table = _kinds(skeleton)
    bone_of = {skeleton.names[child]: bone for bone, (_, child) in enumerate(skeleton.bones)}
    pairs = [
        (bone_of[first], bone_of[second])
        for first, second in (("left_knee", "left_ankle"),)
        if first in bone_of and second in bone_of
    ]
    for place, (left, _, _) in enumerate(breadths(skeleton)):
        if skeleton.names[left] == "left_shoulder" and "left_shoulder" in bone_of:
            pairs.append((bone_of["left_shoulder"], len(skeleton.bones) + place))
    ties = np.zeros((len(pairs), len(table)))
    for row, (first, second) in enumerate(pairs):
        ties[row, kind_of[first]], ties[row, kind_of[second]] = 1.0, -1.0
    return ties


def _collect(
    tracks: JointTracks,
    annotations: Annotations,
    height_px: Float[np.ndarray, "T"],
    fps: float,
    options: LengthOptions,
) -> _LengthEvidence:
    """Every bone and breadth in every annotated frame, and in propagated ones now and then."""
    skeleton = annotations.skeleton
    pairs = [(left, right) for left, right, _ in breadths(skeleton)]
    ends = np.concatenate([skeleton.bones, np.array(pairs, dtype=np.int64).reshape(-1, 2)])
    kind_of, _ = _kinds(skeleton)
    step = max(1, round(options.correlation * fps))
    passing = np.setdiff1d(np.arange(0, len(height_px), step), annotations.frames)
    frames = np.concatenate([annotations.frames, passing])
    joints = np.concatenate([annotations.joints, tracks.joints[passing]])
    clicked = np.full(annotations.joints.shape[:2], options.click_noise)
    carried = joint_noise(tracks.confidence[passing], options)
    sigma = np.concatenate([clicked, carried])[:, ends]
    shown = np.linalg.norm(joints[:, ends[:, 1]] - joints[:, ends[:, 0]], axis=-1)
    known = shown > 0
    row, column = np.nonzero(known)
    noise = np.linalg.norm(sigma, axis=-1) * height_px[frames, None]
    return _LengthEvidence(np.log(shown[known]), noise[known], kind_of[column], frames[row])


def _fit(
    votes: _LengthEvidence,
    log_table: Float[np.ndarray, "m"],
    ties: Float[np.ndarray, "r m"],
    log_height: Float[np.ndarray, "T"],
    knots: Float[np.ndarray, "k"],
    options: LengthOptions,
) -> tuple[Float[np.ndarray, "m"], Float[np.ndarray, "T"]]:
    """Most probable log lengths (statures) and log scale (px per stature) of every frame."""
    kinds = len(log_table)
    frames = np.arange(len(log_height))
    blend = np.stack([np.interp(frames, knots, row) for row in np.eye(len(knots))], axis=1)
    at_vote = blend[votes.frame]
    start = np.concatenate([log_table, [_first_factor(votes, log_table, log_height)], 0 * knots])
    prior = _prior(ties, len(knots), options)
    wanted = prior[:, :kinds] @ log_table

    def cost(x: Float[np.ndarray, "n"]) -> tuple[float, Float[np.ndarray, "n"]]:
        lengths, factor, drift = x[:kinds], x[kinds], x[kinds + 1 :]
        log_full = log_height[votes.frame] + factor + at_vote @ drift + lengths[votes.kind]
        shown = np.exp(votes.shown - log_full)
        value, pull = _agreement(votes, shown, votes.noise / np.exp(log_full), kinds)
        off = prior @ x - wanted
        by_kind = np.bincount(votes.kind, pull, kinds)
        gradient = np.concatenate([by_kind, [pull.sum()], at_vote.T @ pull]) + prior.T @ off
        return float(-value + 0.5 * off @ off), gradient

    best = minimize(cost, start, jac=True, method="L-BFGS-B").x
    return best[:kinds], log_height + best[kinds] + blend @ best[kinds + 1 :]


def _prior(
    ties: Float[np.ndarray, "r m"], knots: int, options: LengthOptions
) -> Float[np.ndarray, "q n"]:
    """Rows of what is expected to be small: (lengths, factor, drift of the scale) -> nats^0.5."""
    kinds = ties.shape[1]
    still = np.eye(knots)
    jump = options.scale_spread * np.sqrt(2 * (1 - np.exp(-0.5)))  # alike over two knots
    drift = np.concatenate([still / (2 * options.scale_spread), np.diff(still, axis=0) / jump])
    lengths = np.concatenate([np.eye(kinds) / options.spread, ties / options.tie_spread])
    rows = np.zeros((len(lengths) + len(drift), kinds + 1 + knots))
    rows[: len(lengths), :kinds] = lengths
    rows[len(lengths) :, kinds + 1 :] = drift
    return rows


def _agreement(
    votes: _LengthEvidence, shown: Float[np.ndarray, "n"], noise: Float[np.ndarray, "n"], kinds: int
) -> tuple[float, Float[np.ndarray, "n"]]:
    """Log likelihood of shown lengths, and what it loses per unit of the log full length.

    How much a bone prefers the image plane or the line of sight is not known (hips seen from
    the side never show their breadth): all of its votes share one unknown leaning.
    """
    value = np.empty((len(INCLINATIONS), kinds))
    slopes = []
    for row, leaning in enumerate(INCLINATIONS):
        log_p, slope = log_density(shown, noise, leaning)
        value[row] = np.bincount(votes.kind, log_p, kinds)
        slopes.append(slope)
    best = value.max(axis=0)
    weight = np.exp(value - best)
    total = weight.sum(axis=0)
    mean_slope = ((weight / total)[:, votes.kind] * np.array(slopes)).sum(axis=0)
    return float((best + np.log(total)).sum()), mean_slope * shown


def _first_factor(
    votes: _LengthEvidence, log_table: Float[np.ndarray, "m"], log_height: Float[np.ndarray, "T"]
) -> float:
    """Log ratio of stature to tracked height at which most bones fit into their length."""
    ratio = votes.shown - log_table[votes.kind] - log_height[votes.frame]
    return float(np.quantile(ratio, 0.75))


def _standing(lengths: Float[np.ndarray, "B"], skeleton: Skeleton) -> float:
    """How tall bones of these lengths stand: the longest leg and the longest midline chain."""
    reach = ancestry(skeleton) @ lengths
    midline = skeleton.mirror == np.arange(len(reach))
    lower = skeleton.is_lower
    return float(reach[lower].max(initial=0.0) + reach[midline].max(initial=0.0))
