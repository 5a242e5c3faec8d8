"""Built-in tennis: serves, and rallies of split step, run, stroke and recovery.

The floor decides first: every foot has a list of steps, and between steps it does not move.
The pelvis follows the player's path at the height that both legs allow; legs and arms then
reach for feet and wrists (two bones, analytic), trunk and shoulders turn through the key
poses of `strokes`. Bones keep their lengths by construction. The same seed plays the same
points; no two strokes are alike.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

import numpy as np
from jaxtyping import Float
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter1d, minimum_filter1d

from keyrecon.body import LSP14
from keyrecon.ranges import BODY_HEIGHTS, SEEDS, within
from keyrecon.synthetic.figure import ANKLE_HEIGHT, STATURE, unit
from keyrecon.synthetic.rally import CHANNELS, PointPlan, ease, plan_points

_LENGTH = {LSP14.names[c]: LSP14.proportions[c] for _, c in LSP14.bones}


@dataclass(frozen=True)
class MotionOptions:
    """What is played."""

    seconds: Annotated[float, within(0.5, 3600)] = 36.0
    fps: Annotated[float, within(5, 1000)] = 50.0
    stature: Annotated[float, BODY_HEIGHTS] = 1.78
    """Metres."""
    left_handed: bool = False
    seed: Annotated[int, SEEDS] = 0


def play_tennis(options: MotionOptions = MotionOptions()) -> Float[np.ndarray, "T 14 3"]:
    """Joints in the world: metres, y up, floor at 0, the net towards negative z."""
    rng = np.random.default_rng([options.seed, 41])
    plan = plan_points(options.seconds, rng)
    times = np.arange(round(options.seconds * options.fps)) / options.fps
    points = place_joints(plan, times, options)
    if options.left_handed:
        points = points[:, LSP14.mirror] * [-1, 1, 1]
    return points


def place_joints(
    plan: PointPlan, times: Float[np.ndarray, "T"], options: MotionOptions
) -> Float[np.ndarray, "T 14 3"]:
    """Turn the plan into joints, limb by limb."""
    s = options.stature / STATURE
    rate = options.fps
    pose = _poses(plan, times, rate)
    pelvis_turn, shoulder_turn, pitch, roll = np.radians(pose[:, :4]).T
    ankles, headings = _feet(plan, times, s)
    ground = plan.base(times) + _turned(pose[:, 5:7] * s, 0 * pelvis_turn)
    sway = 0.02 * s * np.sin(2 * np.pi * 0.9 * times)[:, None] * np.array([1.0, 0.3])
    ground = gaussian_filter1d(ground + sway, 0.04 * rate, axis=0, mode="nearest")
    mean_turn = (pelvis_turn + shoulder_turn) / 2
    up = _lean(mean_turn, pitch, roll)
    across = unit(_square(_right(pelvis_turn), up))
    half_hips = 0.0955 * options.stature * across
    height = _pelvis_height(ground, half_hips, ankles, pose[:, 4] * s, rate, options.stature)
    pelvis = np.stack([ground[:, 0], height, -ground[:, 1]], axis=1)
    trunk = np.sqrt(_LENGTH["right_hip"] ** 2 - 0.0955**2) * options.stature
    points = np.empty((len(times), 14, 3))
    neck = pelvis + trunk * up
    points[:, LSP14.index("neck")] = neck
    points[:, LSP14.index("head_top")] = neck + _LENGTH["head_top"] * options.stature * unit(
        0.6 * up + [0, 0.5, 0] + 0.15 * _ahead(shoulder_turn * 0.4)
    )
    for index, (side, sign) in enumerate((("right", 1), ("left", -1))):
        hip = pelvis + sign * half_hips
        knee_way = unit(_ahead(headings[:, index]) + 0.6 * _ahead(pelvis_turn))
        _reach(points, f"{side}_hip", hip, ankles[:, index], knee_way, options.stature)
    _place_arms(points, (neck, up, _right(shoulder_turn)), pose[:, 7:], options.stature)
    return points


def _poses(plan: PointPlan, times: Float[np.ndarray, "T"], rate: float) -> Float[np.ndarray, "T C"]:
    """Key poses, interpolated without overshoot and rounded off in time."""
    kept: list[tuple[float, np.ndarray]] = []
    for time, numbers in sorted(plan.poses, key=lambda p: p[0]):
        if kept and time - kept[-1][0] < 0.06:
            kept.pop()
        kept.append((time, numbers))
    knots = np.array([t for t, _ in kept])
    curve = PchipInterpolator(knots, np.array([n for _, n in kept]), extrapolate=False)
    values = curve(np.clip(times, knots[0], knots[-1]))
    return gaussian_filter1d(values.reshape(-1, CHANNELS), 0.028 * rate, axis=0, mode="nearest")


def _right(turn: Float[np.ndarray, "T"]) -> Float[np.ndarray, "T 3"]:
    """To the player's right when turned by an angle to the right of the net."""
    return np.stack([np.cos(turn), 0 * turn, np.sin(turn)], axis=1)


def _ahead(turn: Float[np.ndarray, "T"]) -> Float[np.ndarray, "T 3"]:
    return np.stack([np.sin(turn), 0 * turn, -np.cos(turn)], axis=1)


def _turned(
    flat: Float[np.ndarray, "T 2"], turn: Float[np.ndarray, "T"]
) -> Float[np.ndarray, "T 2"]:
    c, s = np.cos(turn), np.sin(turn)
    return np.stack([c * flat[:, 0] + s * flat[:, 1], c * flat[:, 1] - s * flat[:, 0]], axis=1)


def _lean(turn: np.ndarray, pitch: np.ndarray, roll: np.ndarray) -> Float[np.ndarray, "T 3"]:
    """Direction of the trunk."""
    upright = np.array([0.0, 1.0, 0.0])
    return unit(
        upright + np.tan(pitch)[:, None] * _ahead(turn) + np.tan(roll)[:, None] * _right(turn)
    )


def _square(vectors: np.ndarray, to: np.ndarray) -> np.ndarray:
    """Vectors without their part along unit vectors."""
    return vectors - (vectors * to).sum(-1, keepdims=True) * to


def _feet(
    plan: PointPlan, times: Float[np.ndarray, "T"], scale: float
) -> tuple[Float[np.ndarray, "T 2 3"], Float[np.ndarray, "T 2"]]:
    """Ankles in the world and headings of the feet, right and left."""
    ankles = np.empty((len(times), 2, 3))
    headings = np.empty((len(times), 2))
    for foot, steps in enumerate(plan.steps):
        place = np.tile(np.array(steps[0].place), (len(times), 1))
        turn = np.full(len(times), np.radians(steps[0].heading))
        rise = np.zeros(len(times))
        for before, step in pairwise(steps):
            share = np.clip((times - step.lift) / (step.land - step.lift), 0, 1)
            way = np.array(step.place) - before.place
            place += ease(share)[:, None] * way
            turn += ease(share) * np.radians(step.heading - before.heading)
            length = float(np.linalg.norm(way))
            rise += (0.05 + 0.13 * min(length, 1.5)) * np.sin(np.pi * share) ** 2
        ankles[:, foot] = np.stack(
            [place[:, 0], (ANKLE_HEIGHT + rise) * scale, -place[:, 1]], axis=1
        )
        headings[:, foot] = turn
    return ankles, headings


def _pelvis_height(
    ground: Float[np.ndarray, "T 2"],
    half_hips: Float[np.ndarray, "T 3"],
    ankles: Float[np.ndarray, "T 2 3"],
    drop: Float[np.ndarray, "T"],
    rate: float,
    stature: float,
) -> Float[np.ndarray, "T"]:
    """As high as the pose wants, never higher than both legs reach."""
    leg = 0.985 * (_LENGTH["right_knee"] + _LENGTH["right_ankle"]) * stature
    middle = np.stack([ground[:, 0], 0 * drop, -ground[:, 1]], axis=1)
    limits = [leg + ANKLE_HEIGHT * stature / STATURE - drop]
    for foot, sign in enumerate((1, -1)):
        hip = middle + sign * half_hips
        apart = ((hip - ankles[:, foot]) * [1, 0, 1]) ** 2
        room = np.sqrt(np.maximum(leg**2 - apart.sum(axis=1), 0.05))
        limits.append(ankles[:, foot, 1] + room - hip[:, 1])
    lowest = np.min(limits, axis=0)
    reach = max(1, round(0.06 * rate))
    lowest = minimum_filter1d(lowest, 2 * reach + 1, mode="nearest")
    return gaussian_filter1d(lowest, reach / 2.5, mode="nearest", radius=reach)


def _place_arms(
    points: np.ndarray, trunk: tuple[np.ndarray, ...], wrists: np.ndarray, stature: float
) -> None:
    """Arms reach for the wrists' places in the axes of the shoulders."""
    neck, up, right = trunk
    right = unit(_square(right, up))
    axes = np.stack([right, up, np.cross(up, right)], axis=1)
    below = np.sqrt(_LENGTH["right_shoulder"] ** 2 - 0.129**2) * stature
    middle = neck - below * up
    for index, (side, sign) in enumerate((("right", 1), ("left", -1))):
        wrist, elbow = np.split(wrists[:, 6 * index : 6 * index + 6], 2, axis=1)
        goal = middle + np.einsum("tc,tcx->tx", wrist * stature / STATURE, axes)
        shoulder = middle + sign * 0.129 * stature * right
        _reach(points, f"{side}_shoulder", shoulder, goal,
               unit(np.einsum("tc,tcx->tx", elbow, axes)), stature)  # fmt: skip


_NEXT = {"hip": ("knee", "ankle"), "shoulder": ("elbow", "wrist")}


def _reach(
    points: np.ndarray,
    name: str,
    root: Float[np.ndarray, "T 3"],
    goal: Float[np.ndarray, "T 3"],
    bend: Float[np.ndarray, "T 3"],
    stature: float,
) -> None:
    """Enter a limb of two bones that reaches for a goal and bends towards a direction."""
    side, joint = name.split("_")
    upper, lower = (f"{side}_{n}" for n in _NEXT[joint])
    a, b = _LENGTH[upper] * stature, _LENGTH[lower] * stature
    way = goal - root
    distance = np.linalg.norm(way, axis=1, keepdims=True)
    way = way / distance
    distance = np.clip(distance, abs(a - b) + 0.04, 0.995 * (a + b))
    along = (a**2 - b**2 + distance**2) / (2 * distance)
    out = np.sqrt(np.maximum(a**2 - along**2, 0))
    points[:, LSP14.index(name)] = root
    points[:, LSP14.index(upper)] = root + along * way + out * unit(_square(bend, way))
    points[:, LSP14.index(lower)] = root + distance * way
