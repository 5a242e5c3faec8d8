"""The figure seen from cameras that were not there (Fig. 11), as small drawings.

Views are exact parallel projections around the root: from the player's side of the picture (a
camera turned by 90 degrees about the vertical) and from above. Beside a known truth they show
what one camera cannot: whether the depth is right.
"""

import numpy as np
from jaxtyping import Float

from keyrecon.body import Skeleton
from keyrecon.report.drawing import bone_sides, drawn_bones

VIEWS = {
    "from the camera": np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1]]),
    "from the right": np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]]),
    "from above": np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]),
}
"""Rotations from camera axes to those of the view: right, down, away."""
SPAN = 1.35
"""Side of a drawing in statures: a raised arm fits."""
SEAM_FROM = 0.2
"""Where along a bone the seam begins that sets it off from what lies behind; not at the joints."""
SIDE_CLASSES = ("left", "right", "trunk")


def pose_drawing(
    pose: Float[np.ndarray, "J 3"], skeleton: Skeleton, view: str, stature: float
) -> str:
    """An SVG of one pose, centred on its middle; SPAN statures to a side."""
    if not np.isfinite(pose).any():
        return '<svg viewBox="-50 -50 100 100" role="img" aria-label="unknown pose"></svg>'
    seen = pose @ VIEWS[view].T
    low, high = np.nanmin(seen, axis=0), np.nanmax(seen, axis=0)
    placed = (seen - (low + high) / 2) * (100 / (SPAN * stature))
    bones, sides = drawn_bones(skeleton), bone_sides(skeleton)
    known = np.isfinite(placed[bones]).all(axis=(1, 2))
    far_to_near = np.argsort(-np.nan_to_num(placed[bones][:, :, 2].mean(axis=1)), kind="stable")
    lines = []
    for bone in far_to_near[known[far_to_near]]:
        start, stop = placed[bones[bone], :2]
        inner = SEAM_FROM * (stop - start)
        lines.append(_line("seam", start + inner, stop - inner))
        lines.append(_line(SIDE_CLASSES[sides[bone]], start, stop))
    return f'<svg viewBox="-50 -50 100 100" aria-hidden="true">{"".join(lines)}</svg>'


def _line(kind: str, start: Float[np.ndarray, "2"], stop: Float[np.ndarray, "2"]) -> str:
    path = f"M{start[0]:.1f} {start[1]:.1f}L{stop[0]:.1f} {stop[1]:.1f}"
    return f'<path class="{kind}" d="{path}"/>'
