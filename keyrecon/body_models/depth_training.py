"""How a depth model is learnt: captured motion, varied and filmed from all around.

Each window of a capture is mirrored or not, played faster or slower or held still, each limb turned
a little as other people would hold it, filmed by a camera from any side and from a tripod or a
stand, with bones as long and joints as exact as lengths and tracks really are: errors that last,
errors that wander, and noise. Left and right share what is learnt, and so do all ways that a player
may face. The perceptron is scikit-learn's, learnt by Adam from windows that are drawn anew each
time; its weights are averaged over the last draws (Polyak and Juditsky, 1992), which stands for
steps that grow shorter.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial.transform import Rotation

from keyrecon.body import LSP14
from keyrecon.body_models.depth_model import (
    INPUTS,
    LENGTH_OF_BONE,
    LENGTH_UNIT,
    LENGTHS,
    OFFSETS,
    DepthModel,
    frame_inputs,
)
from keyrecon.errors import KeyreconError
from keyrecon.numerics.bone_directions import bone_vectors
from keyrecon.numerics.geometry import unit_vectors
from keyrecon.progress import Progress, silent
from keyrecon.ranges import SEEDS, within

_BONE_OF = {LSP14.names[child]: bone for bone, (_, child) in enumerate(LSP14.bones)}
_LIMBS = [
    [_BONE_OF[f"{side}_{upper}"], _BONE_OF[f"{side}_{lower}"]]
    for side in ("right", "left")
    for upper, lower in (("elbow", "wrist"), ("knee", "ankle"))
]
_ABOVE_HIPS = [bone for name, bone in _BONE_OF.items() if not LSP14.is_lower[LSP14.index(name)]]
_MIRROR = [_BONE_OF[LSP14.names[LSP14.mirror[child]]] for _, child in LSP14.bones]
_DRAWN = 20_000
"""Windows drawn at once: 66 MB."""
_STEP = 1000
"""Windows of one step of Adam."""
_DECAY = 1e-5
"""What a squared weight costs: next to nothing, as no window is drawn twice."""
_AVERAGED = 0.4
"""Share of the draws, the last ones, over which weights are averaged."""


@dataclass(frozen=True)
class DepthTrainingOptions:
    """How a depth model is learnt."""

    poses: Annotated[int, within(1, 100_000_000)] = 4_000_000
    """Poses drawn from the captures, each with what is around it; more take longer.

    Rounded up to batches of 20000.
    """
    units: Annotated[int, within(1, 4096)] = 256
    """Of each of the three layers of the perceptron.
    """
    limb_turn: Annotated[float, within(0, 2)] = 0.2
    """How far limbs are turned to make further poses, radians.

    Standard deviation per axis; half of it within limbs and for the body above the hips.
    """
    pace: Annotated[float, within(0, 0.9)] = 0.3
    """By what share motion is played faster or slower at most.
    """
    still: Annotated[float, within(0, 1)] = 0.1
    """Share of poses that are shown without what is around them, as if held.

    A single marked frame, or the end of a shot, is seen like this.
    """
    camera_up: tuple[Annotated[float, within(-90, 90)], Annotated[float, within(-90, 90)]] = (
        -3.0,
        35.0,
    )
    """Least and greatest angle by which the camera looks down, degrees.

    From a tripod to a broadcast from high up. Up to 20, volleys filmed from 29 degrees above come
    out at 47 instead of 41 mm, and the other seven sequences at 38.2 and 43.2 instead of 38.4 and
    43.9 with and without signs from a person.
    """
    camera_roll: Annotated[float, within(0, 90)] = 1.5
    """How far the camera leans sideways, degrees.

    Standard deviation.
    """
    length_error: Annotated[float, within(0, 1)] = 0.08
    """How far bone lengths are wrong at most, as a share.

    Standard deviation: once more for all bones of a body together. Every window draws how much of
    it there is, from nothing to all, so that lengths that are right are left alone.
    """
    joint_error: Annotated[float, within(0, 0.2)] = 0.009
    """How far joints are wrong in the picture, in statures.

    Standard deviation in x and in y: most of it stays alike within a window.
    """
    seed: Annotated[int, SEEDS] = 0
    """Number from which the poses are drawn; another one gives others."""


def train_depth_model(
    captures: Sequence[Float[np.ndarray, "_ 14 3"]],
    rate: float,
    provenance: str,
    options: DepthTrainingOptions = DepthTrainingOptions(),
    progress: Progress = silent,
) -> DepthModel:
    """Learn a depth model from joints of captured people: LSP14's, metres, Y up, `rate` a second.

    A capture counts by the root of its length, so that a long one does not drown the others. The
    same captures in the same order give the same model on one machine; the last digits hang on its
    linear algebra.
    Raises KeyreconError without scikit-learn.
    """
    rng = np.random.default_rng(options.seed)
    source = gather(captures)
    draws = -(-options.poses // _DRAWN)
    network, first = _network(options), draws - max(round(_AVERAGED * draws), 1)
    sums: list[np.ndarray] = []
    for draw in progress(range(draws), "Learning depths", draws):
        windows = draw_windows(source, rate, min(_DRAWN, options.poses), rng, options)
        targets = [windows.depth_shares, windows.length_errors / LENGTH_UNIT]
        network.partial_fit(windows.inputs, np.concatenate(targets, axis=1, dtype=np.float32))
        if draw >= first:
            layers = [*network.coefs_, *network.intercepts_]
            sums = _added(sums, layers)
    mean = [total / (draws - first) for total in sums]
    half = len(mean) // 2
    return DepthModel(tuple(mean[:half]), tuple(mean[half:]), provenance)


def _added(sums: Sequence[np.ndarray], layers: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Sums with one more draw's weights; new arrays, as the network learns on in its own."""
    if not sums:
        return [layer.copy() for layer in layers]
    return [np.add(*pair) for pair in zip(sums, layers, strict=True)]


def _network(options: DepthTrainingOptions) -> Any:  # scikit-learn has no types
    """The perceptron before it has learnt; raises KeyreconError without scikit-learn."""
    return neural_networks("depths").MLPRegressor(
        hidden_layer_sizes=(options.units,) * 3,
        batch_size=min(_STEP, options.poses),
        alpha=_DECAY,
        random_state=options.seed,
    )


def neural_networks(learnt: str) -> Any:
    """scikit-learn's perceptrons; raises KeyreconError where it is not installed."""
    try:
        import sklearn.neural_network as networks
    except ImportError as fault:
        raise KeyreconError(
            f"Learning {learnt} needs scikit-learn: pip install 'keyrecon[learn]'."
        ) from fault
    return networks


class Poses(NamedTuple):
    """Bone directions of all captures one after another."""

    directions: Float[np.ndarray, "N 13 3"]
    first: Int[np.ndarray, "N"]
    """First row of the capture that a row belongs to; `last` is its last."""
    last: Int[np.ndarray, "N"]
    chance: Float[np.ndarray, "N"]
    """How likely a row is drawn."""


def gather(captures: Sequence[Float[np.ndarray, "_ 14 3"]]) -> Poses:
    """Bone directions of captures: joints in metres, Y up, as many a second in each."""
    lengths = np.array([len(joints) for joints in captures])
    ends = np.cumsum(lengths)
    chance = np.repeat(lengths**-0.5, lengths)
    directions = [unit_vectors(bone_vectors(joints, LSP14)) for joints in captures]
    return Poses(
        np.concatenate(directions).astype(np.float32),
        np.repeat(ends - lengths, lengths),
        np.repeat(ends - 1, lengths),
        chance / chance.sum(),
    )


class FilmedWindows(NamedTuple):
    """What a model is shown of windows in the picture, and what it is to tell of them."""

    inputs: Float[np.ndarray, "n inputs"]
    depth_shares: Float[np.ndarray, "n 13"]
    """In their middles."""
    length_errors: Float[np.ndarray, "n 7"]
    """Log of how much too long each length looks."""


def draw_windows(
    source: Poses, rate: float, count: int, rng: np.random.Generator, options: DepthTrainingOptions
) -> FilmedWindows:
    """Windows of captures as they are seen, with lengths and joints that are wrong."""
    rows = rng.choice(len(source.chance), count, p=source.chance)
    pace = 1 + options.pace * rng.uniform(-1, 1, count)
    pace[rng.random(count) < options.still] = 0
    near = rows[:, None] + np.round(rate * pace[:, None] * OFFSETS).astype(int)
    near = np.clip(near, source.first[rows, None], source.last[rows, None])
    poses = source.directions[near]
    mirrored = poses[:, :, _MIRROR] * np.array([-1, 1, 1], np.float32)
    poses = np.where((rng.random(count) < 0.5)[:, None, None, None], mirrored, poses)
    filmed = _film(_vary(poses, rng, options.limb_turn), rng, options)
    lengths = _length_errors(count, rng, options.length_error)
    seen = filmed[..., :2] * np.exp(lengths[:, LENGTH_OF_BONE])[:, None, :, None]
    flat = _add_errors(seen, pace, rng, options)
    inputs = frame_inputs(flat.astype(np.float32)).reshape(count, INPUTS)
    return FilmedWindows(inputs, filmed[:, OFFSETS.index(0.0), :, 2], lengths)


def _length_errors(count: int, rng: np.random.Generator, spread: float) -> Float[np.ndarray, "n 7"]:
    """Logs of errors of lengths, alike for both sides, with a part that all have in common."""
    alike, own = rng.standard_normal((count, 1)), rng.standard_normal((count, LENGTHS))
    return spread * rng.random((count, 1)) * (alike + own)


def _vary(
    poses: Float[np.ndarray, "n W 13 3"], rng: np.random.Generator, spread: float
) -> Float[np.ndarray, "n W 13 3"]:
    """Poses with limbs held a little differently, alike within a window."""
    poses = poses.copy()
    for bones, angle in [
        *((limb, spread) for limb in _LIMBS),
        *((limb[1:], spread / 2) for limb in _LIMBS),
        (_ABOVE_HIPS, spread / 2),
    ]:
        turn = Rotation.from_rotvec(angle * rng.standard_normal((len(poses), 3))).as_matrix()
        poses[:, :, bones] = _turned(poses[:, :, bones], turn)
    return poses


def _film(
    poses: Float[np.ndarray, "n W 13 3"], rng: np.random.Generator, options: DepthTrainingOptions
) -> Float[np.ndarray, "n W 13 3"]:
    """Bone directions in the axes of cameras all around: x right, y down, z away."""
    count = len(poses)
    yaw = rng.uniform(0, 360, count)
    down = rng.uniform(*options.camera_up, count)
    roll = options.camera_roll * rng.standard_normal(count)
    turns = np.column_stack([roll, 180 + down, yaw])
    return _turned(poses, Rotation.from_euler("ZXY", turns, degrees=True).as_matrix())


def _turned(
    poses: Float[np.ndarray, "n W b 3"], turn: Float[np.ndarray, "n 3 3"]
) -> Float[np.ndarray, "n W b 3"]:
    """All directions of a window turned alike."""
    flat = poses.reshape(len(poses), -1, 3)
    turned = flat @ turn.astype(np.float32).transpose(0, 2, 1)
    return turned.reshape(poses.shape)


_LASTING, _WANDERING, _NOISE = 0.6, 0.75, 0.28
"""Parts of the error of a joint, as shares of its standard deviation: squares add to 1."""
_SIDES_DIFFER = 0.25
"""How far a bone's length differs from its pair's mean, as a share of what pairs are wrong by."""
_WANDER_SECONDS = 0.24
"""Time within which the wandering part stays alike: joints are propagated from keyframes, and their
errors come and go with the limbs that are mistaken."""


def _add_errors(
    flat: Float[np.ndarray, "n W 13 2"],
    pace: Float[np.ndarray, "n"],
    rng: np.random.Generator,
    options: DepthTrainingOptions,
) -> Float[np.ndarray, "n W 13 2"]:
    """In-plane vectors over lengths: joints are found with errors, and sides differ a little."""
    count, width = flat.shape[:2]
    apart = np.abs(np.subtract.outer(OFFSETS, OFFSETS)) / _WANDER_SECONDS
    root = np.linalg.cholesky(np.exp(-apart) + 1e-9 * np.eye(width))
    joints = len(LSP14.names)
    wander = rng.standard_normal((width, count, joints, 2))
    wander = np.tensordot(root, wander, 1).transpose(1, 0, 2, 3)
    wander = np.where(pace[:, None, None, None] > 0, wander, wander[:, :1])
    noise = rng.standard_normal((count, width, joints, 2))
    noise = np.where(pace[:, None, None, None] > 0, noise, noise[:, :1])
    lasting = rng.standard_normal((count, 1, joints, 2))
    error = _LASTING * lasting + _WANDERING * wander + _NOISE * noise
    bones = bone_vectors(error.reshape(-1, joints, 2), LSP14) / LSP14.lengths[:, None]
    sides = 1 + _SIDES_DIFFER * options.length_error * rng.standard_normal((count, 1, 13, 1))
    return flat * sides + options.joint_error * bones.reshape(flat.shape)
