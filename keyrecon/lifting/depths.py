"""What depth limbs usually have in a picture like this: a regression learnt from captured motion.

A flat picture of a whole body says more about depth than joint limits can put into words: which
way an arm reaches goes with how hips, shoulders and the other limbs look. The rule is a polynomial
of second degree in what the picture shows of the 13 bones, in shares of their lengths: both
in-plane parts, and how much is left for depth (Taylor's sqrt(1 - q^2)). Its coefficients give the
depths of captured people, seen from all around, with the least squared error. Only the sign of what
it gives is of interest here, since lengths tell the rest better; a value near zero says that the
picture fits both signs, and then it does not count.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from keyrecon.body import LSP14, Skeleton
from keyrecon.errors import KeyreconError

VERSION = 1
"""Of the bones and terms that a model has coefficients for."""
_BONES = len(LSP14.bones)
_SHOWN = 3 * _BONES
TERMS = 1 + _SHOWN + _SHOWN * (_SHOWN + 1) // 2
"""Of the polynomial: a constant, 39 linear ones, 780 products."""


@dataclass(frozen=True, eq=False)
class DepthModel:
    """A rule for the depth shares of LSP14's bones."""

    coefficients: Float[np.ndarray, "terms 13"]
    """Of each term, for each bone."""
    provenance: str
    """What it was learnt from."""
    version: int = VERSION

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
    shown = np.concatenate([flat.reshape(len(flat), -1), left], axis=1)
    one, other = np.triu_indices(_SHOWN)
    constant = np.ones((len(flat), 1), shown.dtype)
    return np.concatenate([constant, shown, shown[:, one] * shown[:, other]], axis=1)


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
