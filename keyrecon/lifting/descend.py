"""Projected gradient descent as printed in the paper (Fig. 9)."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from keyrecon.lifting.constraints import Projection


def descend(
    start: Float[np.ndarray, "T J 3"],
    observed: Float[np.ndarray, "T J 2"],
    projections: Sequence[Projection],
    step: float,
    rounds: int,
) -> Float[np.ndarray, "T J 3"]:
    """Steps 3 to 5: move joints towards the observed ones, then onto the constraints, again.

    Eq. 6 with a factor one half, so that a step of 1 lands on the data; missing joints (NaN)
    do not pull, and nothing pulls along the depth. Positions in units of length.
    """
    points = start
    for _ in range(rounds):
        pull = np.nan_to_num(points[..., :2] - observed)
        moved = np.concatenate([points[..., :2] - step * pull, points[..., 2:]], axis=-1)
        for project in projections:
            moved = project(moved)
        change = np.sqrt(((moved - points) ** 2).mean())
        points = moved
        if change < 1e-5:
            break
    return points
