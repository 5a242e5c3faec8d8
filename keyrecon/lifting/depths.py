"""What depth bones usually have in a picture like this: a regression learnt from captured motion.

A flat picture of a whole body says more about depth than joint limits can put into words: which
way an arm reaches goes with how hips, shoulders and the other limbs look. A small network takes the
13 bones as the picture shows them (in shares of their lengths) and gives the depth share that
such bones had on average in motion capture seen from all around (as Martinez et al., ICCV 2017,
lift joints). Only its sign is of interest here, since lengths tell the rest better. An
average near zero says that the picture fits both signs, and then it does not count.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from keyrecon.body import LSP14, Skeleton
from keyrecon.errors import KeyreconError

VERSION = 1
"""Of the bones and features that a model is learnt for."""
_BONES = len(LSP14.bones)


@dataclass(frozen=True, eq=False)
class DepthModel:
    """A learnt guess of depth shares: two hidden layers of rectified units."""

    weights: tuple[Float[np.ndarray, "_ _"], ...]
    """Matrix of each layer: 26 in-plane shares come in, 13 depth shares go out."""
    biases: tuple[Float[np.ndarray, "_"], ...]
    provenance: str
    """What it was learnt from."""
    version: int = VERSION

    def __post_init__(self) -> None:
        """Raise KeyreconError where layers do not fit together."""
        sizes = [2 * _BONES, *(len(bias) for bias in self.biases)]
        shapes = list(pairwise(sizes))
        if sizes[-1] != _BONES or [w.shape for w in self.weights] != shapes:
            raise KeyreconError("The layers of this depth model do not fit together.")

    def depth_shares(self, flat: Float[np.ndarray, "T 13 2"]) -> Float[np.ndarray, "T 13"]:
        """Expected dz / length of LSP14's bones from their in-plane vectors / length."""
        layer = flat.reshape(len(flat), 2 * _BONES)
        *hidden, last = zip(self.weights, self.biases, strict=True)
        for weight, bias in hidden:
            layer = np.maximum(layer @ weight + bias, 0)
        return layer @ last[0] + last[1]


def usual_depths(
    model: DepthModel | None,
    vectors: Float[np.ndarray, "T B 2"],
    lengths: Float[np.ndarray, "B"],
    skeleton: Skeleton,
) -> Float[np.ndarray, "T B"]:
    """Depth that bones usually have where they look like this, in units of `lengths`.

    NaN for bones that the model does not know, for all of them where one of LSP14's is missing
    from the skeleton. A bone that is not seen (NaN) tells nothing about the others.
    """
    usual = np.full(vectors.shape[:2], np.nan)
    places = _places(skeleton)
    if model is None or places is None:
        return usual
    flat = np.nan_to_num(vectors[:, places] / lengths[places, None])
    flat = flat / np.maximum(np.linalg.norm(flat, axis=-1, keepdims=True), 1.0)
    usual[:, places] = model.depth_shares(flat) * lengths[places]
    return usual


def _places(skeleton: Skeleton) -> list[int] | None:
    """Where LSP14's bones stand in a skeleton; None unless all do."""
    bones = {
        (skeleton.names[parent], skeleton.names[child]): place
        for place, (parent, child) in enumerate(skeleton.bones)
    }
    wanted = [(LSP14.names[parent], LSP14.names[child]) for parent, child in LSP14.bones]
    return [bones[bone] for bone in wanted] if all(bone in bones for bone in wanted) else None
