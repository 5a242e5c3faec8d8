"""Refinement: the motion fitted to the observed joints (Section 6.2 and Fig. 9).

Two ways. `descend_motion` is the paper's projected gradient descent: joints move towards the
observed ones, then bone lengths and a low-pass are enforced, again and again. `refine_motion`
minimises one cost over the unit directions of all bones: robust reprojection weighted by
confidence, small second differences in time, a pull to the slerped key poses, the breadths of
hips and shoulders, a head that continues the trunk, balance: people at work stand over their
feet, which holds the trunk's lean along the line of sight, and the depths that a model expects
of the whole picture. Lengths are exact in both.

Small second differences alone would take the speed from strokes, since most of the time a body
hardly accelerates. So they are measured in the tracks: what stands out of a bone's usual is
believed, and sets the bone free in depth as well (see `_smoothness`).
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import gaussian_filter1d

from keyrecon.body_models.depth_model import depth_spread
from keyrecon.lifting import terms
from keyrecon.lifting.limb_lengths import BodySize
from keyrecon.lifting.preprocessing import MAD_TO_SIGMA, PreparedTracks
from keyrecon.lifting.priors.anatomy import TILT, anatomy_of, sideways_spread, trunk_axes
from keyrecon.lifting.solver import MotionState, Smoothness, solve
from keyrecon.numerics.bone_directions import bone_vectors
from keyrecon.numerics.geometry import unit_vectors
from keyrecon.paper.gradient_descent import descend, keep_lengths, low_pass, sigma_at
from keyrecon.ranges import within
from keyrecon.records import Shots

_MIN_TRUNK_HEIGHT = 0.3
"""Height of the trunk's middle above the ankles from which the tilt of the camera is read."""
_HIPS_ALONG_SPINE = 0.95
"""Part of the bones from neck to hips that goes along the spine: trunk over neck to hip of
`keyrecon.body.MARKED_LENGTHS`. A quarter more or less, others with it: at most 2.8 mm on eight
clips."""

RATE = 50.0
"""Frames per second for which accelerations are given, and beyond which a frame counts less in what
holds the trunk together, in the key poses and in smoothness, so that these count as much per second
as the tracks do. Three motions projected at 120 frames a second (`benchmarks/projected.py --fps`),
PA-MPJPE with signs and without, mm, and peak hand speed: 36.5, 39.7 and .78, with every frame whole
43.2, 47.6 and .66; with half of the weight 36.1, 38.1 and .83, but of rendered ones at 50, whose
tracks are worse, 34.2 in place of 33.3 and 50.1 in place of 47.0. At 25 every frame counts whole:
eight projected motions 36.3, 39.4 and .88, with twice the weight 36.8, 41.7 and .83."""
MAX_ACCELERATION = 0.05
"""Second difference over 1/50 s beyond which a bone's end in the tracks has jumped, body heights:
210 m/s^2. The fastest of captured strokes and serves have 0.04."""
_COHERENCE = 0.02
"""Seconds, as a standard deviation, over which accelerations are averaged: a hand in a stroke gains
speed for 0.1 s; a track that trembles does not. A quarter more or less, others with it: at most 2.8
mm on eight clips."""

_JUMP_FREE_POWER = 8
"""Power of the share of frames around in which a bone does not jump: a track that jumps is not
asked how fast the body is. Where one frame in ten jumps, 0.43 of its acceleration is believed. A
quarter more or less, others with it: at most 2.8 mm on eight clips."""


@dataclass(frozen=True)
class RefineOptions:
    """How the motion is fitted to the observed joints."""

    # Values chosen on rendered sequences; see benchmarks/sensitivity.py.

    rounds: Annotated[int, within(1, 1000)] = 12
    """Steps of the fit at most; fewer are faster.

    Of the trajectory solver. A quarter more or less, others with it: at most 2.8 mm on eight clips.
    """
    tolerance: Annotated[float, within(0, 0.1)] = 1e-3
    """The fit stops when a step gains less than this share.

    A quarter more or less, others with it: at most 2.8 mm on eight clips.
    """
    acceleration: Annotated[float, within(0.0002, 0.08)] = 0.004
    """How much a resting bone's end may change its speed within 1/50 s, body heights; smaller is
    smoother.

    Second difference where the tracks show the bone at rest. A quarter more or less, others with
    it: at most 2.8 mm on eight clips.
    """
    root_acceleration: Annotated[float, within(0.0003, 0.1)] = 0.006
    """The same for the middle of the hips.

    Expected second difference of the root in 1/50 s. A quarter more or less, others with it: at
    most 2.8 mm on eight clips.
    """
    acceleration_window: Annotated[float, within(0.002, 0.6)] = 0.03
    """Seconds around a frame from which it is read how fast it moves.

    As a standard deviation. A quarter more or less, others with it: at most 2.8 mm on eight clips.
    """
    depth_freedom: Annotated[float, within(0.2, 80)] = 4.0
    """How much more a limb may move in depth than in the picture; 1 as much.

    Variance of accelerations in depth, in those that the picture shows per axis: a limb that swings
    turns out of the picture. Tried: 1 takes more speed from strokes, 16 gives 2 % more and costs a
    millimetre.
    """
    breadth_spread: Annotated[float, within(0.002, 0.6)] = 0.03
    """How far the breadth of hips and shoulders may change, body heights.

    A quarter more or less, others with it: at most 2.8 mm on eight clips.
    """
    head_spread: Annotated[float, within(0.02, 7)] = 0.35
    """How far the head may lean out of the trunk's line, radians.

    A quarter more or less, others with it: at most 2.8 mm on eight clips.
    """
    balance_spread: Annotated[float, within(0.003, 1)] = 0.055
    """How far the trunk may be from above the feet along the line of sight, body heights.

    0.03-0.08 in every activity. A quarter more or less, others with it: at most 2.8 mm on eight
    clips.
    """
    balance_correlation: Annotated[float, within(0, 5)] = 0.15
    """Seconds over which a lack of balance lasts and counts once.

    A quarter more or less, others with it: at most 2.8 mm on eight clips.
    """
    bend_noise: Annotated[float, within(0.006, 2)] = 0.12
    """How exact the bend of a limb in the picture is, as a difference of directions.

    Of unit directions: two eyes place hips 2.2 % of the height apart per axis, knees and ankles 1
    %, and a thigh is 24 % long.
    """
    bend_correlation: Annotated[float, within(0, 5)] = 0.15
    """Seconds over which a bend lasts and counts once.

    A quarter more or less, others with it: at most 2.8 mm on eight clips.
    """
    expectation: Annotated[float, within(0, 5)] = 0.06
    """Seconds over which errors of `--depths` stay alike and count once.

    Of a depth model. Eight sequences of 12 s, with and without signs: 41.6 and 47.3 mm at .15, 38.7
    and 43.4 at .06, 39.0 and 41.9 at .03, where straight knees are bent by 4 degrees (with a first
    network of the same inputs; `benchmarks/projected.py` measures the one that ships).
    """
    key_spread: Annotated[float, within(0.02, 8)] = 0.4
    """How far a bone may turn away from the motion between marked poses, radians.

    At no great cost; the slerped key poses. A quarter more or less, others with it: at most 2.8 mm
    on eight clips; halved: 3.1 mm.
    """
    step: Annotated[float, within(0.001, 2)] = 0.2
    """With method 'paper': step of the descent.

    lambda of Fig. 9. The paper's value (6.2).
    """
    descents: Annotated[int, within(1, 100_000)] = 3000
    """With method 'paper': steps at most; it stops where it has converged.

    Of Fig. 9. On one rendered sequence the error is 83 mm after 30 to 50, 93 after 300 and 99 when
    it has converged; as printed all the same.
    """
    sigma: Annotated[float, within(0.01, 50)] = 0.5
    """With method 'paper': how strongly the motion is smoothed, frames at 50 frames per second.

    Standard deviation of the low-pass of Fig. 9; at other rates it cuts off at the same frequency.
    With 1 one rendered sequence is off by 106 mm instead of 99.
    """


def refine_motion(
    start: MotionState,
    observed: PreparedTracks,
    initial: Float[np.ndarray, "T B 3"],
    size: BodySize,
    fps: float,
    options: RefineOptions = RefineOptions(),
    expected_depth: Float[np.ndarray, "T B"] | None = None,
) -> MotionState:
    """Root and bone directions fitted to the observed joints from a start near them.

    `initial` holds the directions of the initial motion, the slerped key poses; `expected_depth`
    is what a depth model expects, as shares of the bones' lengths, NaN where it expects nothing.
    """
    recipe = [terms.reprojection(observed, size.lengths, size.skeleton)]
    weight = _frame_weight(fps)
    recipe += _trunk_terms(size, weight, options)
    recipe += _balance_terms(start, size, fps, options)
    recipe += _bend_terms(start, size, fps, options)
    recipe.append(terms.key_pose_prior(initial, options.key_spread, weight))
    if expected_depth is not None:
        tilted = tilted_as(expected_depth, start.directions)
        share = 1 / max(options.expectation * fps, 1.0)
        recipe.append(terms.depth_prior(tilted, depth_spread(size.skeleton), share))
    smoothness = _smoothness(observed, size, fps, options)
    return solve(start, recipe, smoothness, options.rounds, options.tolerance)


def descend_motion(
    start: MotionState,
    observed: PreparedTracks,
    size: BodySize,
    shots: Shots,
    fps: float,
    options: RefineOptions = RefineOptions(),
) -> MotionState:
    """Projected gradient descent from the slerped key poses (Fig. 9), each shot by itself."""
    smooth = low_pass(sigma_at(options.sigma, fps / RATE, options.step))
    skeleton = size.skeleton
    root = skeleton.root
    points = start.points(size.lengths, skeleton)
    lengths = keep_lengths(size.lengths, skeleton)
    fitted = shots.in_each(
        lambda start, wanted: descend(
            start, wanted, (lengths, smooth), options.step, options.descents
        ),
        points,
        observed.joints,
    )
    valid = lengths(fitted)
    return MotionState(valid[:, root, :2], unit_vectors(bone_vectors(valid, skeleton)))


def _frame_weight(fps: float) -> float:
    """What a frame counts of terms that are given for `RATE`."""
    return min(1.0, RATE / fps)


def _trunk_terms(size: BodySize, weight: float, options: RefineOptions) -> list[terms.Term]:
    """What holds the trunk together: breadths, and the head above it."""
    lengths, skeleton = size.lengths, size.skeleton
    spread = options.breadth_spread / np.sqrt(weight)
    recipe = [
        terms.breadth(pair.left, pair.right, float(length), spread, lengths, skeleton)
        for pair, length in zip(skeleton.breadths, size.breadths, strict=True)
    ]
    anatomy = anatomy_of(skeleton)
    for limb in anatomy.limbs:
        if limb.kind == "head":
            share = np.zeros(len(lengths))
            share[list(anatomy.trunk[:2])] = 0.5 / _HIPS_ALONG_SPINE
            share[list(limb.bones)] = 1.0
            recipe.append(terms.alignment(share, options.head_spread / np.sqrt(weight)))
    return recipe


def _bend_terms(
    start: MotionState, size: BodySize, fps: float, options: RefineOptions
) -> list[terms.Term]:
    """Knees and elbows bend in depth as the picture gives reason for, knees not sideways."""
    weight = 1 / max(options.bend_correlation * fps, 1.0)
    anatomy, directions = anatomy_of(size.skeleton), start.directions
    recipe = []
    for limb in anatomy.limbs:
        if len(limb.bones) != 2:
            continue
        bones = limb.bones[0], limb.bones[1]
        recipe.append(terms.unseen_bend(bones, directions, options.bend_noise, weight))
        if limb.kind == "leg":
            corners = (size.lengths[:, None] * directions)[:, list(anatomy.trunk)]
            hips, _, _ = trunk_axes(corners)
            spread = sideways_spread(directions[:, bones[0]], directions[:, bones[1]], hips)
            recipe.append(terms.hinge(bones, hips, spread, weight))
    return recipe


def tilted_as(
    expected: Float[np.ndarray, "T B"], directions: Float[np.ndarray, "T B 3"]
) -> Float[np.ndarray, "T B"]:
    """Expected depths as a camera of another tilt sees them: the tilt that the motion has.

    How far a camera looks down, one picture tells badly, and a model expects the mean of what it
    has learnt: on a sequence filmed from 29 degrees above it expected 13. One tilt for all frames.
    """
    known = np.isfinite(expected)
    down = np.where(known, directions[..., 1], 0.0)
    off = np.where(known, directions[..., 2] - expected, 0.0)
    slope = (off * down).sum(axis=1) / np.maximum((down**2).sum(axis=1), 1e-9)
    return np.clip(expected + np.median(slope) * down, -1.0, 1.0)


def _smoothness(
    observed: PreparedTracks, size: BodySize, fps: float, options: RefineOptions
) -> Smoothness:
    """Accelerations of bones as the tracks show them, so far as they stand out.

    Most of the time a bone hardly accelerates: the median of what its track shows is noise, and
    taken for that. A stroke stands ten times above it. The prior on accelerations is a normal one
    whose scale is that of the frames around, so its tails over the whole motion are heavy. In the
    picture the posterior mean of prior and track costs nothing; in depth, where the track shows
    nothing, the scale alone is taken over. In the picture, too, nothing is held stiffer than a bone
    at rest: what tracks are off would else be explained by depth (knees bent by 4 degrees more).
    """
    lengths, step = size.lengths, RATE / fps
    usual = (options.acceleration * step**2) ** 2
    seen, known, jump = _seen_accelerations(bone_vectors(observed.joints, size.skeleton), fps)
    noise = _median_size(np.where(known, seen, np.nan)) ** 2
    window = options.acceleration_window * fps
    around = _mean_around((seen**2).mean(axis=-1, keepdims=True), window)
    jump_free = _mean_around(1.0 - jump, 3 * window)
    excess = jump_free**_JUMP_FREE_POWER * np.maximum(around - noise, 0.0)
    trust = np.where(known, excess / np.maximum(excess + noise, 1e-12), 0.0)
    flat = usual + (1 - trust) * excess
    variance = np.concatenate([flat, flat, usual + options.depth_freedom * excess], axis=-1)
    expected = np.concatenate([trust * seen, np.zeros_like(excess)], axis=-1)
    frame_weight = _frame_weight(fps)
    root = frame_weight / (options.root_acceleration * step**2) ** 2
    weight = frame_weight * lengths[:, None] ** 2 / variance
    return Smoothness(root, weight, expected / lengths[:, None])


def _seen_accelerations(
    bones: Float[np.ndarray, "T B 2"], fps: float
) -> tuple[Float[np.ndarray, "S B 2"], Bool[np.ndarray, "S B 1"], Bool[np.ndarray, "S B 1"]]:
    """Second differences of bones in the picture, the mean of those known around; where they are
    known, and where a track jumps instead."""
    seen = np.diff(bones, 2, axis=0)
    jump = np.linalg.norm(seen, axis=-1, keepdims=True) > MAX_ACCELERATION * (RATE / fps) ** 2
    known = np.isfinite(seen).all(axis=-1, keepdims=True) & ~jump
    share = _mean_around(known.astype(float), _COHERENCE * fps)
    total = _mean_around(np.where(known, seen, 0.0), _COHERENCE * fps)
    return total / np.maximum(share, 1e-9), known, jump


def _mean_around(values: Float[np.ndarray, "S B n"], frames: float) -> Float[np.ndarray, "S B n"]:
    """Mean of the frames around each, weighed by a normal distribution that wide."""
    blurred: np.ndarray = gaussian_filter1d(values, frames, axis=0, mode="nearest")
    return blurred


def _median_size(seen: Float[np.ndarray, "S B 2"]) -> Float[np.ndarray, "B 1"]:
    """Usual size of a bone's values per axis, as a standard deviation; 0 where all are NaN."""
    deviation = np.zeros((seen.shape[1], 1))
    known = np.isfinite(seen).any(axis=(0, 2))
    deviation[known, 0] = MAD_TO_SIGMA * np.nanmedian(np.abs(seen[:, known]), axis=(0, 2))
    return deviation


def _balance_terms(
    start: MotionState, size: BodySize, fps: float, options: RefineOptions
) -> list[terms.Term]:
    """The middle of the trunk stays over the point between the ankles."""
    skeleton = size.skeleton
    corners = [f"{side}_{name}" for name in ("hip", "ankle") for side in ("right", "left")]
    if not set(corners) <= set(skeleton.names):
        return []
    ways = skeleton.ancestry * size.lengths
    hips, ankles = ways[[skeleton.index(name) for name in corners]].reshape(2, 2, -1).mean(axis=1)
    share = 0.5 * (ways[skeleton.root] + hips) - ankles
    stance = np.einsum("b,tbi->ti", share, start.directions)
    high = stance[stance[:, 1] < -_MIN_TRUNK_HEIGHT]
    slope = float(np.median(high[:, 2] / high[:, 1])) if len(high) else TILT
    spread = options.balance_spread * np.sqrt(max(options.balance_correlation * fps, 1.0))
    return [terms.balance(share, 0.5 * (slope + TILT), spread)]
