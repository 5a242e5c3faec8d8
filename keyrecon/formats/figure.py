"""What motion-capture files hold, before it is known which point is which joint."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True, eq=False)
class Figure:
    """Every point of a captured figure over time, in the file's own unit and axes."""

    names: tuple[str, ...]
    """One per point; an end site is called after its joint, with ' end' behind."""
    parents: tuple[int, ...]
    """-1 at the root."""
    positions: Float[np.ndarray, "T N 3"]
    rotations: Float[np.ndarray, "T N 3 3"]
    """From each point's local axes to the file's."""
    fps: float
