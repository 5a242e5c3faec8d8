"""Where the player stands in the picture, from the clicks of one frame (CVPR 2005, Section 5.1).

With the mean motion at the normalised time of the clicked frame, only G is unknown: six numbers
from six or more joints. The camera may look from any side, so the fit starts from several headings
and keeps the best one.
"""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from keyrecon.body import LSP14
from keyrecon.golf.fit.residuals import project
from keyrecon.golf.prior.kinematics import find_joints, place_body
from keyrecon.golf.prior.motion_model import posture_at
from keyrecon.golf.records import Body, Camera, MotionModel, SwingState

HEADINGS = 12
"""Sides of the player that are tried."""
LEVEL = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]])
"""Swing axes as a level camera behind the player sees them."""
LEAN = 0.06
"""Radians by which a camera is usually off the level."""
CLICK = 8.0
"""px by which a click, or the mean player's joint, is usually off."""


def estimate_initial_pose(
    clicked: Mapping[str, tuple[float, float]],
    mu: float,
    camera: Camera,
    model: MotionModel,
    body: Body,
) -> tuple[Float[np.ndarray, "3 3"], Float[np.ndarray, "3"]]:
    """Rotation and position of the swing axes in camera axes.

    `clicked` has joints of LSP14 and possibly `root`, the middle between the hips.
    """
    still = SwingState(np.zeros(0), np.array([mu]), np.eye(3)[None], np.zeros((1, 3)))
    joints = find_joints(body, place_body(body, posture_at(model, still.mu, still.alpha), still))[0]
    hips = joints[[LSP14.index("right_hip"), LSP14.index("left_hip")]].mean(axis=0)
    points = np.array([hips if n == "root" else joints[LSP14.index(n)] for n in clicked])
    pixels = np.array(list(clicked.values()), float)
    tall = np.ptp(pixels[:, 1]) / max(np.ptp(points[:, 1]), 1e-6)
    depth = camera.focal / max(tall, 1e-6)
    middle = (pixels.mean(axis=0) - camera.principal) * depth / camera.focal

    def errors(unknown: np.ndarray, base: np.ndarray) -> np.ndarray:
        turned = Rotation.from_rotvec(unknown[:3]).as_matrix() @ base
        seen, _ = project(points @ turned.T + unknown[3:], camera)
        up = turned[:, 1]
        return np.concatenate([((seen - pixels) / CLICK).ravel(), up[[0, 2]] / LEAN])

    best = None
    for heading in np.linspace(0, 2 * np.pi, HEADINGS, endpoint=False):
        base = LEVEL @ Rotation.from_euler("y", heading).as_matrix()
        start = np.append(middle, depth) - base @ points.mean(axis=0)
        found = least_squares(errors, np.concatenate([np.zeros(3), start]), args=(base,),
                              loss="soft_l1", max_nfev=60)  # fmt: skip
        if best is None or found.cost < best[0]:
            best = found.cost, Rotation.from_rotvec(found.x[:3]).as_matrix() @ base, found.x[3:]
    return best[1], best[2]


def start_state(
    placed: tuple[Float[np.ndarray, "3 3"], Float[np.ndarray, "3"]], mu: Float[np.ndarray, "T"]
) -> SwingState:
    """The mean motion by a player who stands where he was clicked."""
    frames = len(mu)
    return SwingState(
        np.zeros(0), mu, np.tile(placed[0], (frames, 1, 1)), np.tile(placed[1], (frames, 1))
    )
