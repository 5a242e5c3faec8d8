"""A multilayer perceptron that was learnt before: what it tells of what it is shown."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float


def apply_layers(
    shown: Float[np.ndarray, "n inputs"],
    weights: Sequence[Float[np.ndarray, "_ _"]],
    biases: Sequence[Float[np.ndarray, "_"]],
) -> Float[np.ndarray, "n outputs"]:
    """Layers one after another, rectified between; weights lead from what comes in (rows)."""
    for layer, (weight, bias) in enumerate(zip(weights, biases, strict=True)):
        shown = shown @ weight + bias
        if layer < len(weights) - 1:
            shown = np.maximum(shown, 0.0)
    return shown
