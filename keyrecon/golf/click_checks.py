"""Whether clicks are those of one golfer, and which of them are exchanged, from geometry alone.

Six clicks say more than where the player is. A standing golfer filmed by a level camera has the
joints of the prior's key postures as seen from some side, so that clicks which no side explains are
wrong, and clicks that a side explains once left and right are exchanged tell what was exchanged
(`check_pose`). From the front and from behind both readings of two straight legs look alike; there
the swing decides. A right-hander's club rises on his right; where the observed club goes round the
other way, and would go right for the mirrored player, either the sides or the handedness are told
wrong (`check_direction`).

Nothing is exchanged in silence: the person may have clicked right and the program be mistaken.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool

from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.golf.clicks import STATURE, ClickedPose
from keyrecon.golf.fit.handedness import mirror_initial, mirror_observations, mirror_pixels
from keyrecon.golf.fit.initial_pose import (
    JOINT_SPREAD,
    LEAN_SPREAD,
    estimate_initial_pose,
    repeat_pose,
)
from keyrecon.golf.fit.residuals import project
from keyrecon.golf.prior.kinematics import find_club, find_joints, place_body
from keyrecon.golf.prior.motion_model import posture_at
from keyrecon.golf.prior.skeleton import size_body
from keyrecon.golf.records import Camera, InitialJoints, MotionModel, Observations

LEGS = ("right_knee", "left_knee", "right_ankle", "left_ankle")
CLICKED = ("head_top", "root", *LEGS)
"""Joints that every file of clicks has; the arms move too much to tell anything."""
NORMAL_HEIGHT = 300.0
"""px to which a player is scaled, so that spreads in px mean shares of his height."""
USUAL_MISFIT, LARGEST_MISFIT = 12.0, 25.0
"""Half the sum of squared residuals, in standard deviations, of six clicked joints. Marks by eye on
six real swings, anywhere in the swing: 0.7 to 10; with knees or ankles exchanged 11 to 60; with one
click a third of the player's height off 26 to 65, half as far 2 to 20."""
EXCHANGE_GAIN = 0.4
"""An exchange that explains the clicks leaves at most this share of the misfit. On those swings
0.01 to 0.35 where sides were exchanged, and no less than 0.8 where they were not."""
WRONG_WAY, RIGHT_WAY = np.radians(65), np.radians(40)
"""Mean angle between the observed club and that of the mean swing, placed by the clicks. On real
swings filmed face-on or obliquely 22 to 28 degrees as told, 75 to 99 with sides or handedness
wrong; from straight behind the hands, where both readings look alike, 40."""
LEAST_DIRECTIONS = 8
"""Frames in which the club must have been seen for its way to tell anything."""


@dataclass(frozen=True)
class ClickMisfit:
    """How badly a golfer explains clicks."""

    total: float
    """Half the sum of squared residuals, in standard deviations."""
    worst: str
    """The joint that is farthest off."""
    away: float
    """How far, player heights."""


def check_pose(pose: ClickedPose, model: MotionModel, origin: str) -> None:
    """Raises KeyreconError where no golfer has these joints, or one with sides exchanged has them.

    `origin` names the file that the clicks come from.
    """
    misfit = measure_misfit(pose, model)
    if misfit.total <= USUAL_MISFIT:
        return
    exchanges = {
        words: measure_misfit(_exchanged(pose, names), model).total
        for words, names in (
            ("the knees", LEGS[:2]), ("the ankles", LEGS[2:]), ("knees and ankles", LEGS),
        )
    }  # fmt: skip
    words = min(exchanges, key=lambda name: exchanges[name])
    if exchanges[words] < EXCHANGE_GAIN * misfit.total:
        raise KeyreconError(
            f"{origin}: left and right of {words} seem to be exchanged: nobody stands as clicked, "
            f"with {words} exchanged a golfer does. right_ is the player's own right, which is on "
            "the left of a picture from the front; mend the names, or click again."
        )
    if misfit.total > LARGEST_MISFIT:
        raise KeyreconError(
            f"{origin}: no golfer stands as clicked: {misfit.worst} is {misfit.away:.0%} of the "
            "player's height from where the other clicks would have it. Click all joints of one "
            "player in an upright picture, as near to the address as it shows him whole."
        )


def measure_misfit(pose: ClickedPose, model: MotionModel) -> ClickMisfit:
    """How far the clicks are from those of the mean swing's key postures, seen from any side."""
    joints = InitialJoints(
        pose.frame, CLICKED, np.array([pose.place(name) for name in CLICKED], float)
    )
    camera = pose.camera
    if pose.left_handed:
        joints = mirror_initial(joints, pose.size[0])
        camera = Camera(camera.focal, mirror_pixels(camera.principal, pose.size[0]))
    scale = NORMAL_HEIGHT / pose.height
    joints = replace(joints, places=joints.places * scale)
    camera = Camera(camera.focal * scale, camera.principal * scale)
    misfits = [_misfit_at(joints, camera, float(phase), model) for phase in model.keys]
    return min(misfits, key=lambda misfit: misfit.total)


def _misfit_at(
    joints: InitialJoints, camera: Camera, phase: float, model: MotionModel
) -> ClickMisfit:
    body = size_body(STATURE)
    place = estimate_initial_pose(joints, phase, camera, model, body)
    state = repeat_pose(place, np.array([phase]))
    posture = posture_at(model, state.phase, state.coefficients)
    posed = find_joints(body, place_body(body, posture, state))[0]
    hips = posed[[LSP14.index("right_hip"), LSP14.index("left_hip")]].mean(axis=0)
    points = np.array([hips if n == "root" else posed[LSP14.index(n)] for n in joints.names])
    away = np.linalg.norm(project(points, camera)[0] - joints.places, axis=1)
    lean = place.rotation[[0, 2], 1] / LEAN_SPREAD
    total = ((away / JOINT_SPREAD) ** 2).sum() / 2 + (lean**2).sum() / 2
    worst = int(away.argmax())
    return ClickMisfit(float(total), joints.names[worst], float(away[worst] / NORMAL_HEIGHT))


def check_direction(
    observations: Observations, pose: ClickedPose, model: MotionModel, origin: str
) -> None:
    """Raises KeyreconError where the club goes round the other way than clicks and hand tell."""
    if _with_club(observations).sum() < LEAST_DIRECTIONS:
        return
    width = pose.size[0]
    if measure_direction(observations, model, width) < WRONG_WAY:
        return
    other_hand = replace(observations, left_handed=not observations.left_handed)
    if measure_direction(other_hand, model, width) > RIGHT_WAY:
        return
    left_handed = observations.left_handed != pose.mirrored
    hand, other = ("left", "right") if left_handed else ("right", "left")
    raise KeyreconError(
        f"{origin}: the club goes round the other way than that of a {hand}-hander who stands as "
        f'clicked. Either the player is {other}-handed (say "left_handed": '
        f"{'false' if left_handed else 'true'}), or left and right of the clicks are "
        "exchanged: right_ is the player's own right, on the left of a picture from the front."
    )


def measure_direction(observations: Observations, model: MotionModel, width: int) -> float:
    """Mean angle between the observed club and that of the mean swing, radians.

    The mean swing is placed by the clicked joints and timed by the key postures; pictures are
    `width` px wide. Raises nothing: without a club in the swing the angle is NaN.
    """
    if observations.left_handed:
        observations = mirror_observations(observations, width)
    body = size_body(observations.stature)
    phase = float(observations.phase[observations.initial.frame])
    place = estimate_initial_pose(observations.initial, phase, observations.camera, model, body)
    state = repeat_pose(place, observations.phase)
    posture = posture_at(model, state.phase, state.coefficients)
    club = find_club(body, place_body(body, posture, state))
    seen = _with_club(observations)
    expected = project(club[seen].reshape(-1, 3), observations.camera)[0].reshape(-1, 2, 2)
    ways = [ends[:, 1] - ends[:, 0] for ends in (expected, observations.club[seen])]
    cross = ways[0][:, 0] * ways[1][:, 1] - ways[0][:, 1] * ways[1][:, 0]
    return float(np.abs(np.arctan2(cross, (ways[0] * ways[1]).sum(axis=1))).mean())


def _with_club(observations: Observations) -> Bool[np.ndarray, "T"]:
    """Frames between beginning and finish in which the club was seen."""
    frames = np.arange(len(observations.club))
    inside = (frames >= observations.keys[0]) & (frames <= observations.keys[3])
    return inside & np.isfinite(observations.club).all(axis=(1, 2))


def _exchanged(pose: ClickedPose, exchanged: tuple[str, ...]) -> ClickedPose:
    """The pose with left and right of some joints exchanged."""
    names = tuple(_other_side(name) if name in exchanged else name for name in pose.joints.names)
    return replace(pose, joints=replace(pose.joints, names=names))


def _other_side(name: str) -> str:
    side, joint = name.split("_", 1)
    return f"{'left' if side == 'right' else 'right'}_{joint}"
