"""Where the player stands in the picture, from the joints of one frame (CVPR 2005, Section 5.1).

With the mean motion at the normalised time of that frame, only the root pose G is unknown: six
numbers from six or more joints. The camera may look from any side, so the fit starts from several
headings, all at once, and keeps the best one.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial.transform import Rotation

from keyrecon.body import LSP14
from keyrecon.golf.fit.residuals import project
from keyrecon.golf.prior.kinematics import find_joints, place_body
from keyrecon.golf.prior.motion_model import cross_matrix, posture_at
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
JOINT_SPREAD = 8.0
"""px by which a click, or the mean player's joint, is usually off: a click by 2 to 3, a player's
proportions by 4 % of a limb. Chosen on rendered swings; see benchmarks/golf.py."""
STEPS, LEAST_FALL = 60, 1e-8
"""Steps of the descent at most, and the share of its cost by which the last one lowers it."""


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
    headings = np.linspace(0, 2 * np.pi, HEADINGS, endpoint=False)
    turn = LEVEL @ Rotation.from_euler("y", headings[:, None]).as_matrix()
    shift = np.append(middle, depth) - turn @ points.mean(axis=0)
    posed = _Clicked(points, pixels, camera)
    here, damping = posed.linearise(turn, shift), np.full(HEADINGS, 1e-3)
    for _ in range(STEPS):
        moved, turned = posed.step(here, damping)
        there = posed.linearise(turned @ turn, shift + moved)
        better = there.cost <= here.cost
        turn = np.where(better[:, None, None], turned @ turn, turn)
        shift = np.where(better[:, None], shift + moved, shift)
        fall = np.where(better, here.cost - there.cost, 0.0)
        settled = better & (fall <= LEAST_FALL * here.cost)
        here = here.where_better(there, better)
        damping = np.clip(np.where(better, damping / 5, damping * 5), 1e-9, 1e9)
        if (settled | (damping >= 1e9)).all():
            break
    best = int(here.cost.argmin())
    return Placement(turn[best], shift[best])


@dataclass(frozen=True, eq=False)
class _PlacementEquations:
    """Normal equations of turn and shift, and costs, by heading."""

    normal: Float[np.ndarray, "h 6 6"]
    slope: Float[np.ndarray, "h 6"]
    cost: Float[np.ndarray, "h"]

    def where_better(
        self, other: "_PlacementEquations", better: Bool[np.ndarray, "h"]
    ) -> "_PlacementEquations":
        """The other ones where they are better."""
        return _PlacementEquations(
            np.where(better[:, None, None], other.normal, self.normal),
            np.where(better[:, None], other.slope, self.slope),
            np.where(better, other.cost, self.cost),
        )


@dataclass(frozen=True, eq=False)
class _Clicked:
    """Joints of the mean motion, where they were clicked, and the camera that saw them."""

    points: Float[np.ndarray, "n 3"]
    pixels: Float[np.ndarray, "n 2"]
    camera: Camera

    def linearise(
        self, turn: Float[np.ndarray, "h 3 3"], shift: Float[np.ndarray, "h 3"]
    ) -> _PlacementEquations:
        """All headings at once; a residual z counts 2 (sqrt(1 + z^2) - 1), so that one click far
        off does not turn the player (SciPy's soft_l1)."""
        arms = self.points @ turn.swapaxes(1, 2)
        there = (arms + shift[:, None]).reshape(-1, 3)
        projected, slope = project(there, self.camera)
        slope = slope.reshape(*arms.shape[:2], 2, 3) / JOINT_SPREAD
        off = (projected.reshape(*arms.shape[:2], 2) - self.pixels) / JOINT_SPREAD
        by_turn = np.concatenate([slope @ -cross_matrix(arms), slope], axis=3)
        lean = np.zeros((len(turn), 2, 6))
        lean[..., :3] = -cross_matrix(turn[:, :, 1])[:, [0, 2]] / LEAN_SPREAD
        values = np.concatenate(
            [off.reshape(len(turn), -1), turn[:, [0, 2], 1] / LEAN_SPREAD], axis=1
        )
        slopes = np.concatenate([by_turn.reshape(len(turn), -1, 6), lean], axis=1)
        far = np.sqrt(1 + values**2)
        weighted = (slopes / far[..., None]).swapaxes(1, 2)
        return _PlacementEquations(
            weighted @ slopes, (weighted @ values[..., None])[..., 0], (far - 1).sum(axis=1)
        )

    def step(
        self, here: _PlacementEquations, damping: Float[np.ndarray, "h"]
    ) -> tuple[Float[np.ndarray, "h 3"], Float[np.ndarray, "h 3 3"]]:
        """Shift and turn of a damped step."""
        diagonal = np.einsum("hii->hi", here.normal)
        damped = here.normal + (damping[:, None] * diagonal)[:, None] * np.eye(6)
        step = -np.linalg.solve(damped, here.slope[..., None])[..., 0]
        return step[:, 3:], Rotation.from_rotvec(step[:, :3]).as_matrix()


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
