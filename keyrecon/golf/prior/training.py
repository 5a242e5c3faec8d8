"""Learn the motion model: principal components of swings (CVPR 2005, Section 3).

Every swing is retargeted to one body, so that the model holds styles and not proportions, then
warped and sampled; captured swings are joined by variations of them. Components are those of the
motion vectors weighted by how far joints move: a degree at the pelvis moves the whole body, a
degree at the wrist only the club. They are scaled by their standard deviation, so that each
coefficient has unit variance and their squares add up to a Mahalanobis distance.

What the model is worth cross-validation tells: every captured swing is explained by a model learnt
without it. For each number m of components the left-out swing is replaced by the closest motion
that the others and their variations span, and both are compared as joints of the same body.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.golf.prior.captured_swing import change_swing, place_turns
from keyrecon.golf.prior.motion_vectors import (
    FARTHEST_TURN,
    farthest_turn,
    find_centre,
    mean_keys,
    motion_vector,
    sample_swing,
)
from keyrecon.golf.prior.shoulder_rhythm import follow_arms
from keyrecon.golf.prior.skeleton import NAMES, PARENTS, SEGMENTS, size_body, turns_from_swing
from keyrecon.golf.prior.variation import VariationOptions, vary_swing
from keyrecon.golf.records import Body, MotionModel, Swing
from keyrecon.metrics import mpjpe, pa_mpjpe
from keyrecon.progress import Progress, silent
from keyrecon.ranges import within

SWING_PRIOR_VERSION = 1
"""Of segments and motion vectors; a model of another version does not fit this program."""
REFERENCE = 1.75
"""Metres; stature of the body that swings are learnt on. Angles do not depend on it."""
LEAST_LEVER = 0.02
"""Metres per radian for segments without joints, such as feet."""
SMALLEST = 1e-4
"""Share of the variance under which a component is noise of rounding."""


@dataclass(frozen=True)
class TrainOptions:
    """How the model is learnt."""

    components: Annotated[int, within(1, 1000)] = 40
    """Components kept at most; fewer if there are fewer swings. A fit may use fewer still."""
    variation: VariationOptions = field(default_factory=VariationOptions)
    """Plausible variations that join the captured swings; count 0 for captured swings alone."""


@dataclass(frozen=True, eq=False)
class Database:
    """Swings on one body as motion vectors."""

    centre: Float[np.ndarray, "P 3 3"]
    vectors: Float[np.ndarray, "M N D"]
    keys: Float[np.ndarray, "4"]
    captured: int
    """How many of the first swings were captured; the others are variations, in the same order."""


def collect_swings(
    swings: Sequence[Swing], options: TrainOptions = TrainOptions(), progress: Progress = silent
) -> Database:
    """Motion vectors of swings and their variations; raises KeyreconError for fewer than two."""
    if len(swings) * (1 + options.variation.count) < 2:
        raise KeyreconError("One swing has no variance; give several, or variations of it.")
    body = size_body(REFERENCE)
    keys = mean_keys(swings)
    captured = [_with_shoulders(swing, body) for swing in swings]
    sampled = [sample_swing(swing, keys) for swing in captured]
    centre = find_centre(np.stack([turns for turns, _ in sampled]))
    vectors = [motion_vector(turns, place, centre) for turns, place in sampled]
    for swing, vector in zip(swings, vectors, strict=True):
        _check_turns(swing.name, vector)
    rng = np.random.default_rng(options.variation.seed)
    wanted = [swing for swing in captured for _ in range(options.variation.count)]
    for swing in progress(wanted, "Varying swings", len(wanted)):
        vectors.append(_vary(swing, keys, centre, options.variation, rng))
    return Database(centre, np.stack(vectors), keys, len(swings))


def _with_shoulders(swing: Swing, body: Body) -> Swing:
    """A captured swing as a player with this body makes it, his shoulders following his arms."""
    turns, place = turns_from_swing(swing)
    return change_swing(swing, body, follow_arms(turns), place)


def _check_turns(name: str, vector: Float[np.ndarray, "N D"]) -> None:
    segment, angle = farthest_turn(vector)
    if angle > FARTHEST_TURN:
        raise KeyreconError(
            f"{name}: the {segment.replace('_', ' ')} turns {np.degrees(angle):.0f} degrees away "
            "from its mean of all swings; leave this swing out."
        )


def _vary(
    swing: Swing,
    keys: Float[np.ndarray, "4"],
    centre: Float[np.ndarray, "P 3 3"],
    options: VariationOptions,
    rng: np.random.Generator,
) -> Float[np.ndarray, "N D"]:
    """A variation; one that turns a limb inside out is drawn again."""
    body = size_body(REFERENCE)
    while True:
        vector = motion_vector(*sample_swing(vary_swing(swing, body, options, rng), keys), centre)
        if farthest_turn(vector)[1] < FARTHEST_TURN:
            return vector


def learn_motion(
    database: Database, provenance: str, options: TrainOptions = TrainOptions()
) -> MotionModel:
    """Mean and principal components of the motion vectors."""
    vectors = database.vectors
    mean = vectors.mean(axis=0)
    weight = motion_weights()
    rows = ((vectors - mean) * weight).reshape(len(vectors), -1)
    _, spread, axes = np.linalg.svd(rows, full_matrices=False)
    variance = spread**2 / max(len(vectors) - 1, 1)
    share = variance / variance.sum()
    kept = min(options.components, int((share > SMALLEST).sum()))
    components = axes[:kept].reshape(kept, *mean.shape) / weight
    components *= np.sqrt(variance[:kept])[:, None, None]
    return MotionModel(
        version=SWING_PRIOR_VERSION,
        centre=database.centre,
        mean=mean,
        components=components,
        keys=database.keys,
        explained=np.cumsum(share)[:kept],
        provenance=provenance,
    )


def motion_weights() -> Float[np.ndarray, "D"]:
    """Metres that the joints behind a segment move per radian: root mean square of their arms."""
    body = size_body(REFERENCE)
    straight = np.tile(np.eye(3), (1, len(NAMES), 1, 1))
    joints, club = place_turns(body, straight, np.zeros((1, 3)))
    origins = np.zeros((len(NAMES), 3))
    for p, parent in enumerate(PARENTS[1:], start=1):
        origins[p] = origins[parent] + body.offsets[p]
    arms = np.zeros(len(NAMES))
    for p in range(len(NAMES)):
        moving = [j for j, s in enumerate(body.joint_segment) if _hangs_on(int(s), p)]
        reach = np.linalg.norm(joints[0, moving] - origins[p], axis=1)
        arms[p] = np.sqrt((reach**2).sum() / len(joints[0])) if moving else 0.0
    arms[NAMES.index("club")] = np.linalg.norm(club[0, 1] - club[0, 0]) / len(joints[0])
    arms = np.maximum(arms, LEAST_LEVER)
    return np.concatenate([np.repeat(arms, 3), np.full(3, REFERENCE)])


def _hangs_on(segment: int, ancestor: int) -> bool:
    while segment > ancestor:
        segment = PARENTS[segment]
    return segment == ancestor


@dataclass(frozen=True)
class CrossValidation:
    """Error of left-out swings, mean of all, for one number of components."""

    components: int
    mpjpe: float
    """mm, root-aligned."""
    pa_mpjpe: float
    """mm"""


def cross_validate(
    database: Database, options: TrainOptions = TrainOptions()
) -> list[CrossValidation]:
    """Errors per number of components, from 0 (the mean motion); empty for a single capture."""
    if database.captured < 2:
        return []
    rows = [_validate_without(database, out, options) for out in range(database.captured)]
    least = min(len(row) for row in rows)
    errors = np.mean([row[:least] for row in rows], axis=0)
    return [CrossValidation(m, float(both[0]), float(both[1])) for m, both in enumerate(errors)]


def without(database: Database, out: int) -> Database:
    """The database without one captured swing and its variations."""
    each = (len(database.vectors) - database.captured) // database.captured
    kept = np.ones(len(database.vectors), bool)
    kept[out] = False
    first = database.captured + out * each
    kept[first : first + each] = False
    return replace(database, vectors=database.vectors[kept], captured=database.captured - 1)


def _validate_without(
    database: Database, out: int, options: TrainOptions
) -> Float[np.ndarray, "C 2"]:
    """MPJPE and PA-MPJPE of one swing, mm, for 0, 1, 2 ... components of the others."""
    model = learn_motion(without(database, out), "", options)
    truth = database.vectors[out]
    weight = motion_weights()
    axes = (model.components * weight).reshape(len(model.components), -1)
    size = (axes**2).sum(axis=1)
    coefficients = axes @ ((truth - model.mean) * weight).ravel() / size
    joints = vector_joints(model, truth)
    root = [LSP14.index("right_hip"), LSP14.index("left_hip")]
    errors = []
    for m in range(len(coefficients) + 1):
        motion = model.mean + np.tensordot(coefficients[:m], model.components[:m], axes=1)
        ours = vector_joints(model, motion)
        errors.append((1000 * mpjpe(ours, joints, root), 1000 * pa_mpjpe(ours, joints)))
    return np.array(errors)


def vector_joints(
    model: MotionModel, motion: Float[np.ndarray, "N D"]
) -> Float[np.ndarray, "N 14 3"]:
    """Joints of the reference body in swing axes, metres."""
    turned = 3 * len(SEGMENTS)
    vectors = motion[:, :turned].reshape(-1, 3)
    turns = Rotation.from_rotvec(vectors).as_matrix().reshape(len(motion), -1, 3, 3)
    return place_turns(size_body(REFERENCE), model.centre @ turns, motion[:, turned:])[0]
