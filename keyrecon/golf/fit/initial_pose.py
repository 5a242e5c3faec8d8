"""Where the player stands in the picture, from the joints of one frame (CVPR 2005, Section 5.1).

With the mean motion at the normalised time of that frame, only the root pose G is unknown: six
numbers from six or more joints. The camera may look from any side, so the fit starts from several
headings and keeps the best one.
"""

from dataclasses import dataclass
from operator import itemgetter

import numpy as np
from jaxtyping import Float
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from keyrecon.body import LSP14
from keyrecon.golf.fit.residuals import project
from keyrecon.golf.prior.kinematics import find_joints, place_body
from keyrecon.golf.prior.motion_model import cross_matrix, left_jacobian, posture_at
from keyrecon.golf.records import (
    Body,
    Camera,
    InitialJoints,
    MotionModel,
    Observations,
    SwingFit,
    SwingState,
)

HEADINGS = 12
"""Sides of the player that are tried. Chosen on rendered swings; see benchmarks/golf.py."""
LEVEL = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]])
"""Swing axes as a level camera behind the player sees them."""
LEAN_SPREAD = 0.06
"""Radians by which a camera is usually off the level. Chosen on rendered swings; see
benchmarks/golf.py."""
JOINT_SPREAD = 0.0465
"""Metres by which a click, or the mean player's joint, is usually off: a click by 2 to 3 px of a
player 310 px tall, a player's proportions by 4 % of a limb. Chosen on rendered swings of that
height (8 px); see benchmarks/golf.py."""


@dataclass(frozen=True, eq=False)
class Placement:
    """Where the swing axes lie in camera axes."""

    rotation: Float[np.ndarray, "3 3"]
    position: Float[np.ndarray, "3"]
    """Metres."""


def initial_fit(observations: Observations, model: MotionModel, body: Body) -> SwingFit:
    """The mean motion by a player who stands where the initial joints are."""
    phase = float(observations.phase[observations.initial.frame])
    place = estimate_initial_pose(observations.initial, phase, observations.camera, model, body)
    return SwingFit(model, body, repeat_pose(place, observations.phase))


def estimate_initial_pose(
    joints: InitialJoints, phase: float, camera: Camera, model: MotionModel, body: Body
) -> Placement:
    """Where the player stands who has these joints at a normalised time of the mean motion."""
    points, pixels = _mean_points(joints.names, phase, model, body), joints.places
    tall = np.ptp(pixels[:, 1]) / max(np.ptp(points[:, 1]), 1e-6)
    depth = camera.focal / max(tall, 1e-6)
    middle = (pixels.mean(axis=0) - camera.principal) * depth / camera.focal
    spread = JOINT_SPREAD * max(tall, 1e-6)

    def turned(unknown: np.ndarray, base: np.ndarray) -> np.ndarray:
        there: np.ndarray = Rotation.from_rotvec(unknown[:3]).as_matrix() @ base
        return there

    def errors(unknown: np.ndarray, base: np.ndarray) -> np.ndarray:
        turn = turned(unknown, base)
        projected, _ = project(points @ turn.T + unknown[3:], camera)
        off = ((projected - pixels) / spread).ravel()
        return np.concatenate([off, turn[[0, 2], 1] / LEAN_SPREAD])

    def slopes(unknown: np.ndarray, base: np.ndarray) -> np.ndarray:
        turn = turned(unknown, base)
        rate = left_jacobian(unknown[:3])
        arms = points @ turn.T
        moved = np.tile(np.eye(3, 6, 3), (len(arms), 1, 1))
        moved[:, :, :3] = -cross_matrix(arms) @ rate
        _, slope = project(arms + unknown[3:], camera)
        lean = np.zeros((2, 6))
        lean[:, :3] = -(cross_matrix(turn[:, 1]) @ rate)[[0, 2]]
        off = (slope @ moved).reshape(-1, 6)
        return np.concatenate([off / spread, lean / LEAN_SPREAD])

    placements: list[tuple[float, Placement]] = []
    for heading in np.linspace(0, 2 * np.pi, HEADINGS, endpoint=False):
        base = LEVEL @ Rotation.from_euler("y", heading).as_matrix()
        start = np.append(middle, depth) - base @ points.mean(axis=0)
        fit = least_squares(errors, np.concatenate([np.zeros(3), start]), slopes, args=(base,),
                            loss="soft_l1", max_nfev=60)  # fmt: skip
        turn = Rotation.from_rotvec(fit.x[:3]).as_matrix()
        placements.append((fit.cost, Placement(turn @ base, fit.x[3:])))
    return min(placements, key=itemgetter(0))[1]


def _mean_points(
    names: tuple[str, ...], phase: float, model: MotionModel, body: Body
) -> Float[np.ndarray, "n 3"]:
    """Joints of the mean motion in swing axes."""
    still = SwingState(np.zeros(0), np.array([phase]), np.eye(3)[None], np.zeros((1, 3)))
    posture = posture_at(model, still.phase, still.coefficients)
    joints = find_joints(body, place_body(body, posture, still))[0]
    hips = joints[[LSP14.index("right_hip"), LSP14.index("left_hip")]].mean(axis=0)
    return np.array([hips if n == "root" else joints[LSP14.index(n)] for n in names])


def repeat_pose(place: Placement, phase: Float[np.ndarray, "T"]) -> SwingState:
    """The mean motion at some normalised times, in one place for all frames."""
    frames = len(phase)
    return SwingState(
        np.zeros(0), phase, np.tile(place.rotation, (frames, 1, 1)),
        np.tile(place.position, (frames, 1)),
    )  # fmt: skip
