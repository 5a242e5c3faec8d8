"""Expected depth of bones given the whole picture: a regression learnt from captured motion.

A flat picture of a whole body says more about depth than joint limits can put into words: which
way an arm reaches depends on how hips, shoulders and the other limbs are placed. The rule is a
polynomial of second degree in the picture of the 13 bones, in shares of their lengths: both
in-plane parts, and how much is left for depth (Taylor's sqrt(1 - q^2)). Its coefficients give the
depths of captured people, filmed from all around, with the least squared error. It helps to choose
signs, and its expectation is a prior on depth itself (`depth_spread`): near the picture's plane,
where legs and trunks mostly are, foreshortening tells less. A value near zero may also say that
the picture fits both signs.

The training poses are captured ones, varied and filmed from all around: mirrored or not, each
limb turned a little as other people would hold it, filmed by a camera from any side and from a
tripod or a stand, with bones as long and joints as exact as lengths and tracks really are. Left and
right share what is learnt, and so do all ways that a player may face. The coefficients then follow
from one linear system (ridge regression): the same captures give the same rule.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import scipy.linalg
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from keyrecon.body import LSP14, Skeleton
from keyrecon.errors import KeyreconError
from keyrecon.lifting.bone_directions import bone_vectors
from keyrecon.numerics.geometry import unit_vectors
from keyrecon.progress import Progress, silent
from keyrecon.ranges import SEEDS, within

DEPTH_MODEL_VERSION = 1
"""Of the bones and terms that a model has coefficients for."""
_BONES = len(LSP14.bones)
_INPUTS = 3 * _BONES
TERMS = 1 + _INPUTS + _INPUTS * (_INPUTS + 1) // 2
"""Of the polynomial: a constant, 39 linear ones, 780 products."""


@dataclass(frozen=True, eq=False)
class DepthModel:
    """A rule for the depth shares of LSP14's bones."""

    coefficients: Float[np.ndarray, "terms 13"]
    """Of each term, for each bone."""
    provenance: str
    """What it was learnt from."""
    version: int = DEPTH_MODEL_VERSION

    def __post_init__(self) -> None:
        """Raise KeyreconError for another number of coefficients."""
        if self.coefficients.shape != (TERMS, _BONES):
            raise KeyreconError(
                f"A depth model has {TERMS} x {_BONES} coefficients, this one "
                f"{' x '.join(map(str, self.coefficients.shape))}."
            )

    def depth_shares(self, flat: Float[np.ndarray, "T 13 2"]) -> Float[np.ndarray, "T 13"]:
        """Expected dz / length of LSP14's bones from their in-plane vectors / length."""
        return polynomial(flat) @ self.coefficients


def polynomial(flat: Float[np.ndarray, "n 13 2"]) -> Float[np.ndarray, "n terms"]:
    """All terms of a picture: in-plane vectors over lengths, depth left, products of any two.

    A bone cannot look longer than it is.
    """
    flat = flat / np.maximum(np.linalg.norm(flat, axis=-1, keepdims=True), 1)
    left = np.sqrt(np.clip(1 - (flat**2).sum(axis=-1), 0, 1))
    inputs = np.concatenate([flat.reshape(len(flat), -1), left], axis=1)
    one, other = np.triu_indices(_INPUTS)
    constant = np.ones((len(flat), 1), inputs.dtype)
    return np.concatenate([constant, inputs, inputs[:, one] * inputs[:, other]], axis=1)


def expected_depth(
    model: DepthModel | None,
    vectors: Float[np.ndarray, "T B 2"],
    lengths: Float[np.ndarray, "B"],
    skeleton: Skeleton,
) -> Float[np.ndarray, "T B"]:
    """Depth that the model expects of bones, in the unit of `lengths`.

    NaN for bones that the model does not know, for all of them where one of LSP14's is missing
    from the skeleton. A bone that is not observed (NaN) tells nothing about the others.
    """
    expected = np.full(vectors.shape[:2], np.nan)
    places = _places(skeleton)
    if model is None or places is None:
        return expected
    flat = np.nan_to_num(vectors[:, places] / lengths[places, None])
    expected[:, places] = model.depth_shares(flat) * lengths[places]
    return expected


def depth_spread(skeleton: Skeleton) -> Float[np.ndarray, "B"]:
    """Error of a depth model for each bone, in lengths of the bone; infinite for unknown bones.

    Root mean square over captures of two players in turn, filmed from all around, with models
    learnt from nine players less the one (`DepthTrainingOptions` without turned limbs).
    """
    ends = [skeleton.names[child].split("_")[-1] for _, child in skeleton.bones]
    return np.array([_SPREAD.get(end, np.inf) for end in ends])


_SPREAD = {
    "hip": 0.13,
    "shoulder": 0.21,
    "top": 0.18,
    "knee": 0.18,
    "ankle": 0.18,
    "elbow": 0.25,
    "wrist": 0.25,
}
"""By the far end of the bone: for instance 0.18 for a thigh, whose end is the knee."""


def _places(skeleton: Skeleton) -> list[int] | None:
    """Where LSP14's bones stand in a skeleton; None unless all do."""
    bones = {
        (skeleton.names[parent], skeleton.names[child]): place
        for place, (parent, child) in enumerate(skeleton.bones)
    }
    wanted = [(LSP14.names[parent], LSP14.names[child]) for parent, child in LSP14.bones]
    return [bones[bone] for bone in wanted] if all(bone in bones for bone in wanted) else None


_BONE_OF = {LSP14.names[child]: bone for bone, (_, child) in enumerate(LSP14.bones)}
_LIMBS = [
    [_BONE_OF[f"{side}_{upper}"], _BONE_OF[f"{side}_{lower}"]]
    for side in ("right", "left")
    for upper, lower in (("elbow", "wrist"), ("knee", "ankle"))
]
_ABOVE_HIPS = [bone for name, bone in _BONE_OF.items() if not LSP14.is_lower[LSP14.index(name)]]
_MIRROR = [_BONE_OF[LSP14.names[LSP14.mirror[child]]] for _, child in LSP14.bones]
_BATCH = 20_000
"""Poses weighed at once: 66 MB."""


@dataclass(frozen=True)
class DepthTrainingOptions:
    """How a depth model is learnt."""

    poses: Annotated[int, within(1, 100_000_000)] = 400_000
    """Poses drawn from the captures; more take longer.

    Rounded up to batches of 20000.
    """
    ridge: Annotated[float, within(1e-09, 10)] = 1e-4
    """How strongly the polynomial is kept small.

    What a squared coefficient costs, in mean squared errors.
    """
    limb_turn: Annotated[float, within(0, 2)] = 0.2
    """How far limbs are turned to make further poses, radians.

    Standard deviation per axis; half of it within limbs and for the body above the hips.
    """
    camera_up: tuple[Annotated[float, within(-90, 90)], Annotated[float, within(-90, 90)]] = (
        -3.0,
        20.0,
    )
    """Least and greatest angle by which the camera looks down, degrees.

    From a tripod to a stand. Tried: up to 32, where volleys filmed from 29 degrees above are 1 mm
    better, and ground strokes filmed from a tripod, without signs from the person, 6 mm worse.
    """
    camera_roll: Annotated[float, within(0, 90)] = 1.5
    """How far the camera leans sideways, degrees.

    Standard deviation.
    """
    length_error: Annotated[float, within(0, 1)] = 0.06
    """How far bone lengths are wrong, as a share.

    Standard deviation.
    """
    joint_error: Annotated[float, within(0, 1)] = 0.04
    """How far joints are wrong in the picture, in lengths of the bone.

    Standard deviation of a bone's vector.
    """
    seed: Annotated[int, SEEDS] = 0
    """Number from which the poses are drawn; another one gives others."""


def train_depth_model(
    captures: Sequence[Float[np.ndarray, "_ 14 3"]],
    provenance: str,
    options: DepthTrainingOptions = DepthTrainingOptions(),
    progress: Progress = silent,
) -> DepthModel:
    """Learn a depth model from joints of captured people: LSP14's, metres, Y up.

    A capture counts by the root of its length, so that a long one does not drown the others.
    Raises KeyreconError for options with which nothing can be learnt.
    """
    if options.poses < 1 or options.ridge <= 0:
        raise KeyreconError(
            f"Nothing can be learnt from {options.poses} poses with a ridge of {options.ridge:g}; "
            "both must be above 0."
        )
    rng = np.random.default_rng(options.seed)
    poses = [unit_vectors(bone_vectors(joints, LSP14)).astype(np.float32) for joints in captures]
    batches = -(-options.poses // _BATCH)
    normal, answer = np.zeros((TERMS, TERMS)), np.zeros((TERMS, len(LSP14.bones)))
    for _ in progress(range(batches), "Learning depths", batches):
        flat, depth = _draw(poses, rng, options)
        terms = polynomial(flat)
        normal += terms.T @ terms
        answer += terms.T @ depth
    damping = options.ridge * batches * _BATCH * np.eye(TERMS)
    return DepthModel(scipy.linalg.solve(normal + damping, answer, assume_a="pos"), provenance)


def _draw(
    captures: Sequence[Float[np.ndarray, "_ 13 3"]],
    rng: np.random.Generator,
    options: DepthTrainingOptions,
) -> tuple[Float[np.ndarray, "n 13 2"], Float[np.ndarray, "n 13"]]:
    """Poses in the picture and their depth shares, in random order."""
    chance = np.concatenate([np.full(len(c), len(c) ** -0.5) for c in captures])
    rows = rng.choice(len(chance), _BATCH, p=chance / chance.sum())
    poses = np.concatenate(captures)[rows]
    mirrored = poses[:, _MIRROR] * np.array([-1, 1, 1], np.float32)
    poses = np.where((rng.random(len(poses)) < 0.5)[:, None, None], mirrored, poses)
    filmed = _film(_vary(poses, rng, options.limb_turn), rng, options)
    error = 1 + options.length_error * rng.standard_normal((*filmed.shape[:2], 1))
    flat = filmed[..., :2] * error
    flat = flat + options.joint_error * rng.standard_normal(flat.shape)
    return flat.astype(np.float32), filmed[..., 2].astype(np.float32)


def _vary(
    poses: Float[np.ndarray, "n 13 3"], rng: np.random.Generator, spread: float
) -> Float[np.ndarray, "n 13 3"]:
    """Poses with limbs held a little differently."""
    poses = poses.copy()
    for bones, angle in [
        *((limb, spread) for limb in _LIMBS),
        *((limb[1:], spread / 2) for limb in _LIMBS),
        (_ABOVE_HIPS, spread / 2),
    ]:
        turn = Rotation.from_rotvec(angle * rng.standard_normal((len(poses), 3))).as_matrix()
        poses[:, bones] = np.einsum("nij,nbj->nbi", turn, poses[:, bones])
    return poses


def _film(
    poses: Float[np.ndarray, "n 13 3"], rng: np.random.Generator, options: DepthTrainingOptions
) -> Float[np.ndarray, "n 13 3"]:
    """Bone directions in the axes of cameras all around: x right, y down, z away."""
    count = len(poses)
    yaw = rng.uniform(0, 360, count)
    down = rng.uniform(*options.camera_up, count)
    roll = options.camera_roll * rng.standard_normal(count)
    turns = np.column_stack([roll, 180 + down, yaw])
    camera = Rotation.from_euler("ZXY", turns, degrees=True).as_matrix()
    return np.einsum("nij,nbj->nbi", camera, poses)
