"""Learning what depth bones usually have: captured poses, varied and seen from all around.

Every pose that is learnt from is drawn anew: mirrored or not, each limb turned a little as other
people would hold it, seen by a camera from any side and from a tripod or a stand, with bones
as long and joints as exact as lengths and tracks really are. Left and right share what is learnt,
and so do all ways that a player may face. The network is fitted by least squares (Adam; Kingma and
Ba, ICLR 2015), so its answer is the mean of all depths that the picture allows.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from keyrecon.body import LSP14
from keyrecon.lifting.chain import bone_vectors, unit
from keyrecon.lifting.depths import DepthModel
from keyrecon.progress import Progress, silent

_BONE_OF = {LSP14.names[child]: bone for bone, (_, child) in enumerate(LSP14.bones)}
_LIMBS = [
    [_BONE_OF[f"{side}_{upper}"], _BONE_OF[f"{side}_{lower}"]]
    for side in ("right", "left")
    for upper, lower in (("elbow", "wrist"), ("knee", "ankle"))
]
_ABOVE_HIPS = [bone for name, bone in _BONE_OF.items() if not LSP14.is_lower[LSP14.index(name)]]
_MIRROR = [_BONE_OF[LSP14.names[LSP14.mirror[child]]] for _, child in LSP14.bones]
_BATCH = 1024
_DECAY = 1e-3
"""Of the weights, per step, in learning rates."""


@dataclass(frozen=True)
class LearnDepthsOptions:
    """How a depth model is learnt."""

    rounds: int = 20
    """Times that a new set of poses is drawn and gone through."""
    poses: int = 100_000
    """Poses drawn for each round."""
    units: int = 256
    """Units of each of the two hidden layers."""
    rate: float = 2e-3
    """Learning rate at the start; falls to 0 along a cosine."""
    limb_turn: float = 0.25
    """Standard deviation by which limbs are turned, radians per axis; half of it within limbs
    and for the body above the hips."""
    camera_up: tuple[float, float] = (-3.0, 20.0)
    """Range of the angle by which the camera looks down, degrees: from a tripod to a stand."""
    camera_roll: float = 1.5
    """Standard deviation of the camera's roll, degrees."""
    length_error: float = 0.06
    """Standard deviation of bone lengths, as shares."""
    joint_error: float = 0.04
    """Standard deviation of a bone's vector in the picture, in lengths of the bone."""
    seed: int = 0


def learn_depths(
    captures: Sequence[Float[np.ndarray, "_ 14 3"]],
    provenance: str,
    options: LearnDepthsOptions = LearnDepthsOptions(),
    progress: Progress = silent,
) -> DepthModel:
    """Learn a depth model from joints of captured people: LSP14's, metres, Y up.

    A capture counts by the root of its length, so that a long one does not drown the others.
    """
    rng = np.random.default_rng(options.seed)
    poses = [unit(bone_vectors(joints, LSP14)).astype(np.float32) for joints in captures]
    bones = len(LSP14.bones)
    network = _Network((2 * bones, options.units, options.units, bones), rng)
    steps = options.rounds * (options.poses // _BATCH)
    for _ in progress(range(options.rounds), "Learning depths", options.rounds):
        flat, depth = _draw(poses, rng, options)
        for first in range(0, len(flat) - _BATCH + 1, _BATCH):
            rate = options.rate * 0.5 * (1 + np.cos(np.pi * network.steps / steps))
            network.learn(flat[first : first + _BATCH], depth[first : first + _BATCH], rate)
    weights, biases = network.parameters[::2], network.parameters[1::2]
    return DepthModel(tuple(weights), tuple(biases), provenance)


def _draw(
    captures: Sequence[Float[np.ndarray, "_ 13 3"]],
    rng: np.random.Generator,
    options: LearnDepthsOptions,
) -> tuple[Float[np.ndarray, "n 26"], Float[np.ndarray, "n 13"]]:
    """Poses in the picture and their depth shares, in random order."""
    chance = np.concatenate([np.full(len(c), len(c) ** -0.5) for c in captures])
    rows = rng.choice(len(chance), options.poses, p=chance / chance.sum())
    poses = np.concatenate(captures)[rows]
    mirrored = poses[:, _MIRROR] * np.float32([-1, 1, 1])
    poses = np.where((rng.random(len(poses)) < 0.5)[:, None, None], mirrored, poses)
    seen = _film(_vary(poses, rng, options.limb_turn), rng, options)
    error = 1 + options.length_error * rng.standard_normal((*seen.shape[:2], 1))
    flat = seen[..., :2] * error
    flat = flat + options.joint_error * rng.standard_normal(flat.shape)
    return flat.reshape(len(flat), -1).astype(np.float32), seen[..., 2].astype(np.float32)


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
    poses: Float[np.ndarray, "n 13 3"], rng: np.random.Generator, options: LearnDepthsOptions
) -> Float[np.ndarray, "n 13 3"]:
    """Bone directions in the axes of cameras all around: x right, y down, z away."""
    count = len(poses)
    yaw = rng.uniform(0, 360, count)
    down = rng.uniform(*options.camera_up, count)
    roll = options.camera_roll * rng.standard_normal(count)
    turns = np.column_stack([roll, 180 + down, yaw])
    camera = Rotation.from_euler("ZXY", turns, degrees=True).as_matrix()
    return np.einsum("nij,nbj->nbi", camera, poses)


class _Network:
    """Two hidden layers of rectified units, fitted by steps of Adam."""

    def __init__(self, sizes: tuple[int, ...], rng: np.random.Generator) -> None:
        """Random weights (He et al., ICCV 2015), the last ones small; biases 0."""
        self.parameters: list[np.ndarray] = []
        for inward, outward in itertools.pairwise(sizes):
            weight = rng.standard_normal((inward, outward)) * np.sqrt(2 / inward)
            self.parameters += [weight.astype(np.float32), np.zeros(outward, np.float32)]
        self.parameters[-2] *= 0.1
        self.steps = 0
        self._mean = [np.zeros_like(p) for p in self.parameters]
        self._square = [np.zeros_like(p) for p in self.parameters]

    def learn(
        self, flat: Float[np.ndarray, "n 26"], depth: Float[np.ndarray, "n 13"], rate: float
    ) -> None:
        """One step down the mean squared error of a batch."""
        self.steps += 1
        slopes = self._slopes(flat, depth)
        early = 1 - 0.9**self.steps, 1 - 0.999**self.steps
        moments = zip(self.parameters, self._mean, self._square, slopes, strict=True)
        for parameter, mean, square, slope in moments:
            mean += 0.1 * (slope - mean)
            square += 0.001 * (slope**2 - square)
            step = mean / early[0] / (np.sqrt(square / early[1]) + 1e-8)
            parameter -= np.float32(rate) * (step + _DECAY * parameter * (parameter.ndim == 2))

    def _slopes(
        self, flat: Float[np.ndarray, "n 26"], depth: Float[np.ndarray, "n 13"]
    ) -> list[np.ndarray]:
        """Derivatives of half the mean squared error by the parameters."""
        layers = [flat]
        for place in range(0, len(self.parameters) - 2, 2):
            weight, bias = self.parameters[place : place + 2]
            layers.append(np.maximum(layers[-1] @ weight + bias, 0))
        error = (layers[-1] @ self.parameters[-2] + self.parameters[-1] - depth) / len(flat)
        slopes: list[np.ndarray] = []
        for place, layer in reversed(list(enumerate(layers))):
            slopes[:0] = [layer.T @ error, error.sum(axis=0)]
            error = (error @ self.parameters[2 * place].T) * (layer > 0)
        return slopes
