"""How a side model is learnt: captured motion filmed from all around, arms exchanged or not.

Windows are drawn as for a depth model (`body_models/depth_training.py`), with errors of joints
and lengths as tracks have them; in half of them the arms are exchanged, and the perceptron,
scikit-learn's, learns to tell which (logistic loss, Adam).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from jaxtyping import Bool, Float

from keyrecon.body import LSP14
from keyrecon.body_models.depth_model import OFFSETS, frame_inputs
from keyrecon.body_models.depth_training import (
    DepthTrainingOptions,
    Poses,
    draw_windows,
    gather,
    neural_networks,
)
from keyrecon.body_models.side_model import ARM_BONES, EXCHANGED, SideModel
from keyrecon.progress import Progress, silent
from keyrecon.ranges import SEEDS, within

_DRAWN = 20_000
"""Windows drawn at once: 22 MB."""
_STEP = 1000
"""Windows of one step of Adam."""
_DECAY = 1e-5
"""What a squared weight costs: next to nothing, as no window is drawn twice."""


@dataclass(frozen=True)
class SideTrainingOptions:
    """How a side model is learnt."""

    poses: Annotated[int, within(1, 100_000_000)] = 1_600_000
    """Poses drawn from the captures, each with what is around it; more take longer.

    Rounded up to batches of 20000.
    """
    units: Annotated[int, within(1, 4096)] = 128
    """Of each of the two layers of the perceptron."""
    length_error: Annotated[float, within(0, 1)] = 0.1
    """How far bone lengths are wrong at most, as a share.

    Standard deviation.
    """
    joint_error: Annotated[float, within(0, 0.2)] = 0.015
    """How far joints are wrong in the picture, in statures.

    Standard deviation in x and in y: limbs that were mistaken are farther off than others.
    """
    mistaken: Annotated[float, within(0, 1)] = 0.3
    """Share of the arms that lie somewhere else, as arms do that were mistaken."""
    mistake: Annotated[float, within(0, 1)] = 0.1
    """How far their wrists are off, in statures; elbows by half of it.

    Standard deviation in x and in y, alike within a window.
    """
    seed: Annotated[int, SEEDS] = 0
    """Number from which the poses are drawn; another one gives others."""


def train_side_model(
    captures: Sequence[Float[np.ndarray, "_ 14 3"]],
    rate: float,
    provenance: str,
    options: SideTrainingOptions = SideTrainingOptions(),
    progress: Progress = silent,
) -> SideModel:
    """Learn a side model from joints of captured people: LSP14's, metres, Y up, `rate` a second.

    The same captures in the same order give the same model on one machine; the last digits hang on
    its linear algebra. Raises KeyreconError without scikit-learn.
    """
    rng, network = np.random.default_rng(options.seed), _network(options)
    source, draws = gather(captures), -(-options.poses // _DRAWN)
    count = min(_DRAWN, options.poses)
    for _ in progress(range(draws), "Learning sides", draws):
        inputs, right = _draw(source, rate, count, rng, options)
        network.partial_fit(inputs, right, classes=[False, True])
    return SideModel(tuple(network.coefs_), tuple(network.intercepts_), provenance)


def _network(options: SideTrainingOptions) -> Any:  # scikit-learn has no types
    """The perceptron before it has learnt; raises KeyreconError without scikit-learn."""
    return neural_networks("sides").MLPClassifier(
        hidden_layer_sizes=(options.units,) * 2,
        batch_size=min(_STEP, options.poses),
        alpha=_DECAY,
        random_state=options.seed,
    )


def _draw(
    source: Poses, rate: float, count: int, rng: np.random.Generator, options: SideTrainingOptions
) -> tuple[Float[np.ndarray, "n inputs"], Bool[np.ndarray, "n"]]:
    """What the rule is shown of some windows, and whether arms are on their sides in each."""
    drawing = DepthTrainingOptions(
        length_error=options.length_error, joint_error=options.joint_error
    )
    shown = draw_windows(source, rate, count, rng, drawing).inputs
    bones = len(EXCHANGED)
    flat = shown.reshape(count, len(OFFSETS), -1)[:, :, : 2 * bones]
    flat = _mistake_arms(flat.reshape(count, len(OFFSETS), bones, 2), rng, options)
    right = rng.random(count) < 0.5
    flat = np.where(right[:, None, None, None], flat, flat[:, :, EXCHANGED])
    return frame_inputs(flat.astype(np.float32)).reshape(count, -1), right


def _mistake_arms(
    flat: Float[np.ndarray, "n W 13 2"], rng: np.random.Generator, options: SideTrainingOptions
) -> Float[np.ndarray, "n W 13 2"]:
    """In-plane vectors over lengths, with elbows and wrists of some arms somewhere else."""
    flat = flat.copy()
    for upper, lower in ARM_BONES:
        wrong = options.mistake * (rng.random((len(flat), 1)) < options.mistaken)
        elbow, wrist = wrong[..., None] * rng.standard_normal((2, len(flat), 1, 2))
        flat[:, :, upper] += elbow / 2 / LSP14.lengths[upper]
        flat[:, :, lower] += (wrist - elbow / 2) / LSP14.lengths[lower]
    return flat
