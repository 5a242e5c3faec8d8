"""Expected depth and lengths of bones given how a body moves in the picture: learnt from captures.

A flat picture of a whole body says more about depth than joint limits can put into words: which
way an arm reaches depends on how hips, shoulders and the other limbs are placed, and on where they
were a moment before and will be. The rule is a multilayer perceptron: it is shown the 13 bones at
some moments around the frame (`OFFSETS`), in shares of their lengths, both in-plane parts and how
much is left for depth (Taylor's sqrt(1 - q^2)), and gives their depths with the least squared error
over captured people, filmed from all around. It helps to choose signs, and its expectation is a
prior on depth itself (`depth_spread`): near the picture's plane, where legs and trunks mostly are,
foreshortening tells less. A value near zero may also say that the picture fits both signs.
`depth_training.py` learns it. Of players that it has not seen it is off by .15 lengths of a bone
(.16 where lengths are wrong by a tenth), a polynomial of second degree of the frame alone, which it
took the place of, by .21.

It also tells by how much bones look longer or shorter than their lengths let them: a body that
stands as bodies do, seen with thighs that are always too short, has other thighs. A frame tells
little of it, a video more (`lifting/length_correction.py`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from keyrecon.body import LSP14, Skeleton
from keyrecon.errors import KeyreconError
from keyrecon.numerics.perceptron import apply_layers, describe_layers, layers_lead

DEPTH_MODEL_VERSION = 3
"""Of the bones and inputs that a model has weights for."""
OFFSETS = (-0.4, -0.2, -0.1, 0.0, 0.1, 0.2, 0.4)
"""Moments that the rule is shown, seconds from the frame."""
_BONES = len(LSP14.bones)
LENGTH_OF_BONE = tuple(LSP14.length_group.tolist())
"""Which of the lengths each of LSP14's bones has."""
LENGTHS = max(LENGTH_OF_BONE) + 1
INPUTS, OUTPUTS = 3 * _BONES * len(OFFSETS), _BONES + LENGTHS
LENGTH_UNIT = 0.2
"""Errors of lengths are learnt in this unit, which gives them about the spread of depths."""
_AT_ONCE = 10_000
"""Frames whose windows are held at a time: 22 MB."""


@dataclass(frozen=True, eq=False)
class DepthModel:
    """A rule for depths and lengths of LSP14's bones: layers of a perceptron, rectified between."""

    weights: Sequence[Float[np.ndarray, "_ _"]]
    """Of each layer, from what comes in (rows) to what goes out."""
    biases: Sequence[Float[np.ndarray, "_"]]
    provenance: str
    """What it was learnt from."""
    version: int = DEPTH_MODEL_VERSION

    def __post_init__(self) -> None:
        """Raise KeyreconError for layers that do not fit one another, or these bones."""
        if not layers_lead(self.weights, self.biases, INPUTS, OUTPUTS):
            raise KeyreconError(
                f"A depth model leads from {INPUTS} inputs to {_BONES} depths and {LENGTHS} "
                f"lengths; this one's layers are {describe_layers(self.weights)}."
            )

    def depth_shares(
        self, flat: Float[np.ndarray, "T 13 2"], fps: float
    ) -> Float[np.ndarray, "T 13"]:
        """Expected dz / length of LSP14's bones from their in-plane vectors / length.

        Frames of one shot, `fps` of them a second; beyond its ends it is held still.
        """
        return self._of_frames(flat, fps)[:, :_BONES]

    def length_errors(
        self, flat: Float[np.ndarray, "T 13 2"], fps: float
    ) -> Float[np.ndarray, "T 13"]:
        """Expected log of how much too long LSP14's bones look in each frame, as `depth_shares`."""
        return LENGTH_UNIT * self._of_frames(flat, fps)[:, _BONES:][:, LENGTH_OF_BONE]

    def forward(self, shown: Float[np.ndarray, "n inputs"]) -> Float[np.ndarray, "n outputs"]:
        """Depth shares and errors of lengths from what the rule is shown, inputs of all moments."""
        return apply_layers(shown, self.weights, self.biases)

    def _of_frames(
        self, flat: Float[np.ndarray, "T 13 2"], fps: float
    ) -> Float[np.ndarray, "T outputs"]:
        inputs, shown = frame_inputs(flat), frames_shown(len(flat), fps)
        parts = np.array_split(shown, max(len(flat) // _AT_ONCE, 1))
        return np.concatenate([self.forward(inputs[rows].reshape(-1, INPUTS)) for rows in parts])


def frames_shown(count: int, fps: float) -> Int[np.ndarray, "T m"]:
    """Which of `count` frames the rule is shown for each of them."""
    steps = np.round(np.array(OFFSETS) * fps).astype(int)
    return np.clip(np.arange(count)[:, None] + steps, 0, max(count - 1, 0))


def frame_inputs(flat: Float[np.ndarray, "*n 13 2"]) -> Float[np.ndarray, "*n 39"]:
    """What the rule is shown of a frame: in-plane vectors over lengths, and the depth left.

    A bone cannot look longer than it is.
    """
    flat = flat / np.maximum(np.linalg.norm(flat, axis=-1, keepdims=True), 1)
    left = np.sqrt(np.clip(1 - (flat**2).sum(axis=-1), 0, 1))
    return np.concatenate([flat.reshape(*flat.shape[:-2], 2 * _BONES), left], axis=-1)


def expected_depth(
    model: DepthModel | None,
    vectors: Float[np.ndarray, "T B 2"],
    lengths: Float[np.ndarray, "B"],
    skeleton: Skeleton,
    fps: float,
) -> Float[np.ndarray, "T B"]:
    """Depth that the model expects of bones in the frames of one shot, in the unit of `lengths`.

    NaN for bones that the model does not know, for all of them where one of LSP14's is missing
    from the skeleton. A bone that is not observed (NaN) is shown as one that points at the camera:
    signs of the others are told all the same, their depths less well.
    """
    if model is None:
        return np.full(vectors.shape[:2], np.nan)
    return _expect(model.depth_shares, vectors, lengths, skeleton, fps) * lengths


def length_errors(
    model: DepthModel,
    vectors: Float[np.ndarray, "T B 2"],
    lengths: Float[np.ndarray, "B"],
    skeleton: Skeleton,
    fps: float,
) -> Float[np.ndarray, "T B"]:
    """Log of how much too long bones look in the frames of one shot, as the model expects.

    NaN in frames where a bone is not observed at one of the moments shown, which would make the
    others look too long, and for bones that the model does not know, as in `expected_depth`.
    """
    errors = _expect(model.length_errors, vectors, lengths, skeleton, fps)
    whole = np.isfinite(vectors[:, places_of_bones(skeleton) or []]).all(axis=(1, 2))
    return np.where(whole[frames_shown(len(whole), fps)].all(axis=1)[:, None], errors, np.nan)


def _expect(
    rule: Callable[[Float[np.ndarray, "T 13 2"], float], Float[np.ndarray, "T 13"]],
    vectors: Float[np.ndarray, "T B 2"],
    lengths: Float[np.ndarray, "B"],
    skeleton: Skeleton,
    fps: float,
) -> Float[np.ndarray, "T B"]:
    """What a rule for LSP14's bones expects of a skeleton's; NaN for those it does not know."""
    expected = np.full(vectors.shape[:2], np.nan)
    places = places_of_bones(skeleton)
    if places is not None:
        flat = np.nan_to_num(vectors[:, places] / lengths[places, None])
        expected[:, places] = rule(flat, fps)
    return expected


def depth_spread(skeleton: Skeleton) -> Float[np.ndarray, "B"]:
    """Error of a depth model for each bone, in lengths of the bone; infinite for unknown bones.

    Root mean square over eight captures of two players, filmed from all around, with a model learnt
    from the other captures (`benchmarks/depth_error.py`), before models learnt lengths too; since
    then .01 less for hips and knees, .01 more for shoulders and elbows and .02 for wrists. A spread
    of its own for every bone of every frame, learnt besides, changed nothing: 42.2 and 48.8 mm
    instead of 42.1 and 48.5 with and without signs.
    """
    ends = [skeleton.names[child].split("_")[-1] for _, child in skeleton.bones]
    return np.array([_SPREAD.get(end, np.inf) for end in ends])


_SPREAD = {
    "hip": 0.10,
    "shoulder": 0.12,
    "top": 0.12,
    "knee": 0.16,
    "ankle": 0.16,
    "elbow": 0.16,
    "wrist": 0.18,
}
"""By the far end of the bone: for instance 0.16 for a thigh, whose end is the knee. Measured as
`depth_spread` tells."""


def places_of_bones(skeleton: Skeleton) -> list[int] | None:
    """Where LSP14's bones stand in a skeleton; None unless all do."""
    bones = {
        (skeleton.names[parent], skeleton.names[child]): place
        for place, (parent, child) in enumerate(skeleton.bones)
    }
    wanted = [(LSP14.names[parent], LSP14.names[child]) for parent, child in LSP14.bones]
    return [bones[bone] for bone in wanted] if all(bone in bones for bone in wanted) else None
