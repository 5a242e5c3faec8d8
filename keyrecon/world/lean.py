"""The lean of a lifted body along the line of sight, most of which is an error of the lifting.

A lifting guesses how far a camera looks down; on the court that is known. What legs or trunk lean
in the median of a clip, beyond what players do, is taken out.
"""

import numpy as np
from jaxtyping import Float

from keyrecon.numerics.geometry import unit_vectors
from keyrecon.world.motion_solver import Figure

LEGS_LEAN, TRUNK_LEANS = 0.055, 0.11
"""Slopes by which players lean forward, in the median of a clip; eight rendered sequences have 0 to
.11 and .07 to .22."""
LEGS_SHARE = 0.75
"""Part of any other lean of the legs along the line of sight common to all frames that is an error:
lifted ones had slopes of .08 too much, the true ones of .04."""
USUAL_TILT, TILT_ERROR = 0.1, 0.3
"""Slope by which cameras look down, which a lifting expects, and the part of what it is else that
it gets wrong: at 30 degrees all of the body leaned by a slope of .16, else nothing in common."""
LEAN_SPREAD = 0.05
"""Slope of a lean that is not the camera's."""
MIN_STANCE = 0.75
"""Height of legs and trunk, in their median, from which a lean is read."""


def remove_lean(
    directions: Float[np.ndarray, "T B 3"], figure: Figure
) -> Float[np.ndarray, "T B 3"]:
    """Directions without the lean along the line of sight that all frames share.

    How far a camera looks down, a lifting has to guess; on the court it is known. Legs and the rest
    are put right apart.
    """
    skeleton, axes = figure.skeleton, figure.axes
    hips, ankles = (
        figure.reach[[skeleton.index(f"{side}_{part}") for side in ("right", "left")]].mean(axis=0)
        for part in ("hip", "ankle")
    )
    legs = ankles - hips > 0
    along, level = sight_on_ground(axes)
    ahead = facing(directions, figure)
    up = np.einsum("tk,tbk->tb", axes[:, 2], directions)
    over = []
    for share, forward in ((hips - ankles, LEGS_LEAN), (-hips, TRUNK_LEANS)):
        part = np.einsum("tik,b,tbk->ti", axes, share, directions)
        high = part[:, 2] > MIN_STANCE * max(float(np.median(part[:, 2])), 1e-9)
        lean = (part[:, :2] * along).sum(axis=1)[high] / part[high, 2]
        over.append(float(np.median(lean - forward * ahead[high])) if high.any() else 0.0)
    tilt = TILT_ERROR * abs(float(np.median(-axes[:, 2, 2] / level)) - USUAL_TILT)
    common = tilt**2 / (tilt**2 + LEAN_SPREAD**2)
    slope = np.where(legs, LEGS_SHARE * over[0], common * 0.5 * sum(over))
    moved = directions.copy()
    moved[..., 2] -= slope * up / level[:, None]
    return unit_vectors(moved)


def facing(directions: Float[np.ndarray, "T B 3"], figure: Figure) -> Float[np.ndarray, "T"]:
    """Cosine of the angle on the ground between where the trunk faces and the line of sight."""
    skeleton, axes = figure.skeleton, figure.axes
    sides = [
        figure.reach[[skeleton.index(f"{side}_{part}") for part in ("hip", "shoulder")]].sum(axis=0)
        for side in ("right", "left")
    ]
    across = np.einsum("tik,b,tbk->ti", axes, sides[0] - sides[1], directions)[:, :2]
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
    along, _ = sight_on_ground(axes)
    return along[:, 1] * across[:, 0] - along[:, 0] * across[:, 1]


def sight_on_ground(
    axes: Float[np.ndarray, "T 3 3"],
) -> tuple[Float[np.ndarray, "T 2"], Float[np.ndarray, "T"]]:
    """The line of sight on the ground, and the cosine of its angle with it."""
    flat = axes[:, :2, 2]
    level = np.maximum(np.linalg.norm(flat, axis=1), 0.1)
    return flat / level[:, None], level
