"""Which arm is the left one, by the pose of the whole body: learnt from captures.

Arms that were taken for one another make a body that hardly anybody makes: shoulders turned
against hips, an arm that swings with the leg of its side, a club in front of a back. So a
perceptron is shown the 13 bones at some moments around a frame, as the depth model is
(`body_models/depth_model.py`), and tells how probable it is that the arms are on the sides that
they are said to be on, given that the legs are. It answers both ways round, and half of the
difference counts, so that it cannot be for both. `side_training.py` learns it; `sides.md` tells
from what, and how often it is right.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float

from keyrecon.body import LSP14, Skeleton
from keyrecon.body_models.depth_model import (
    INPUTS,
    frame_inputs,
    frames_shown,
    places_of_bones,
)
from keyrecon.errors import KeyreconError
from keyrecon.numerics.bone_directions import bone_vectors
from keyrecon.numerics.perceptron import apply_layers, describe_layers, layers_lead

SIDE_MODEL_VERSION = 1
"""Of the bones and inputs that a model has weights for."""
SIDES = ("right", "left")
LONGEST_SEEN = 80.0
"""Percentile of the length of a bone in the picture, over what it is of a stature, that stands for
the stature: legs and trunks mostly lie near the picture's plane."""


_BONE_OF = {LSP14.names[child]: bone for bone, (_, child) in enumerate(LSP14.bones)}
ARM_BONES = tuple((_BONE_OF[f"{side}_elbow"], _BONE_OF[f"{side}_wrist"]) for side in SIDES)
"""Upper arm and forearm of either side, by their places among LSP14's bones."""


def _exchanged_bones() -> tuple[int, ...]:
    order = list(range(len(LSP14.bones)))
    for part in ("shoulder", "elbow", "wrist"):
        right, left = (_BONE_OF[f"{side}_{part}"] for side in SIDES)
        order[right], order[left] = left, right
    return tuple(order)


EXCHANGED = _exchanged_bones()
"""LSP14's bones with those of the arms exchanged."""


@dataclass(frozen=True, eq=False)
class SideModel:
    """A rule that tells arms apart: layers of a perceptron, rectified between."""

    weights: Sequence[Float[np.ndarray, "_ _"]]
    """Of each layer, from what comes in (rows) to what goes out."""
    biases: Sequence[Float[np.ndarray, "_"]]
    provenance: str
    """What it was learnt from."""
    version: int = SIDE_MODEL_VERSION

    def __post_init__(self) -> None:
        """Raise KeyreconError for layers that do not fit one another, or these bones."""
        if not layers_lead(self.weights, self.biases, INPUTS, 1):
            raise KeyreconError(
                f"A side model leads from {INPUTS} inputs to one answer; this one's layers are "
                f"{describe_layers(self.weights)}."
            )

    def log_odds(self, flat: Float[np.ndarray, "T 13 2"], fps: float) -> Float[np.ndarray, "T"]:
        """What LSP14's bones, in-plane vectors / length, say for the arms as they are and against
        the exchanged, nats.

        Frames of one shot, `fps` of them a second; beyond its ends it is held still.
        """
        shown = frames_shown(len(flat), fps)
        as_they_are, exchanged = (
            apply_layers(frame_inputs(bones)[shown].reshape(-1, INPUTS), self.weights, self.biases)
            for bones in (flat, flat[:, EXCHANGED])
        )
        return (as_they_are - exchanged)[:, 0] / 2


def arm_log_odds(
    model: SideModel, skeleton: Skeleton, joints: Complex[np.ndarray, "T J"], fps: float
) -> Float[np.ndarray, "T"]:
    """What whole bodies say for their arms as they are and against the exchanged, nats.

    0 for a skeleton without one of LSP14's bones. A bone that is not there (NaN) is shown as one
    that points at the camera.
    """
    places = places_of_bones(skeleton)
    if places is None:
        return np.zeros(len(joints))
    vectors = bone_vectors(np.stack([joints.real, joints.imag], axis=-1), skeleton)[:, places]
    size = np.linalg.norm(vectors, axis=2) / LSP14.lengths
    long = [bone for bone, (_, child) in enumerate(LSP14.bones) if LSP14.is_lower[child]]
    stature = np.nanpercentile(size[:, long], LONGEST_SEEN)
    return model.log_odds(np.nan_to_num(vectors / (stature * LSP14.lengths[:, None])), fps)
