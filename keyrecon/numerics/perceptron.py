"""Inference by a multilayer perceptron that was trained before."""

from collections.abc import Sequence
from itertools import pairwise

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


def layers_lead(
    weights: Sequence[Float[np.ndarray, "_ _"]],
    biases: Sequence[Float[np.ndarray, "_"]],
    inputs: int,
    outputs: int,
) -> bool:
    """Whether layers fit one another and lead from so many inputs to so many outputs."""
    sizes = [inputs, *(len(bias) for bias in biases)]
    return [weight.shape for weight in weights] == list(pairwise(sizes)) and sizes[-1] == outputs


def describe_layers(weights: Sequence[Float[np.ndarray, "_ _"]]) -> str:
    """Sizes of layers, for a message."""
    return ", ".join("x".join(map(str, weight.shape)) for weight in weights) or "missing"
