"""Whether clicks are those of one golfer, and which of them are exchanged, from geometry alone.

Six clicks say more than where the player is. A standing golfer filmed by a level camera has the
joints of the prior's key postures as seen from some side, so that clicks which no side explains are
wrong, and clicks that a side explains once left and right are exchanged tell what was exchanged
(`check_pose`). From the front and from behind both readings of two straight legs look alike; there
the swing decides. A right-hander's club rises on his right; where a player of the other hand who
stands as clicked explains silhouettes and clubs of the film far better, either the sides or the
handedness are told wrong (`check_hand`): as soon as they are seen, before anything is tracked or
fitted.

Nothing is exchanged in silence: the person may have clicked right and the program be mistaken.
"""

from dataclasses import dataclass, replace

import numpy as np

from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.golf.candidates import gather_evidence, least_cost
from keyrecon.golf.clicks import STATURE, ClickedPose
from keyrecon.golf.fit.handedness import mirror_initial, mirror_pixels
from keyrecon.golf.fit.initial_pose import LEAN_SPREAD, estimate_initial_pose, repeat_pose
from keyrecon.golf.fit.residuals import project
from keyrecon.golf.prior.kinematics import find_joints, place_body
from keyrecon.golf.prior.motion_model import posture_at
from keyrecon.golf.prior.skeleton import size_body
from keyrecon.golf.records import Camera, InitialJoints, MotionModel
from keyrecon.golf.scene import SwingScene

LEGS = ("right_knee", "left_knee", "right_ankle", "left_ankle")
CLICKED = ("head_top", "root", *LEGS)
"""Joints that every file of clicks has; the arms move too much to tell anything."""
NORMAL_HEIGHT = 300.0
"""px to which a player is scaled, so that spreads in px mean shares of his height."""
CLICK_SPREAD = 8.0
"""px of such a player by which a click, or the mean player's joint, is usually off; misfits below
were measured with it."""
USUAL_MISFIT, LARGEST_MISFIT = 12.0, 16.0
"""Half the sum of squared residuals, in standard deviations, of six clicked joints. Marks by eye on
six real swings, anywhere in the swing: 0.7 to 10; with knees or ankles exchanged 11 to 60; with one
click a third of the player's height off 26 to 65, half as far 2 to 20; with the head of somebody
half a height beside 14 to 129, all but one above 18."""
EXCHANGE_GAIN = 0.4
"""An exchange that explains the clicks leaves at most this share of the misfit. On those swings
0.01 to 0.35 where sides were exchanged, and no less than 0.8 where they were not."""
HAND_GAIN = 0.1
"""By how much less the mean swing of the other hand costs in the search (`fit.swing_search`) where
the hand or the sides of the clicks are told wrong. Of five real swings it cost .15 to .37 less,
and as much more where all was told right; a sixth, slowed down thirtyfold and not found, .05 either
way. By silhouettes alone, ten a second, these were .01 to .47: nothing earlier than the club tells
them all."""


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
    total = ((away / CLICK_SPREAD) ** 2).sum() / 2 + (lean**2).sum() / 2
    worst = int(away.argmax())
    return ClickMisfit(float(total), joints.names[worst], float(away[worst] / NORMAL_HEIGHT))


@dataclass(frozen=True)
class HandCosts:
    """How badly the mean swing explains a film at best (`candidates.least_cost`)."""

    given: float
    """Of a player of the hand that was given."""
    other: float


def measure_hands(scene: SwingScene, pose: ClickedPose, model: MotionModel) -> HandCosts:
    """What either hand costs a player who stands as clicked; `pose` is placed in the film."""
    evidence = gather_evidence(scene)
    other = replace(pose, left_handed=not pose.left_handed)
    return HandCosts(least_cost(evidence, pose, model), least_cost(evidence, other, model))


def check_hand(costs: HandCosts, pose: ClickedPose, origin: str) -> None:
    """Raises KeyreconError where a player of the other hand explains a film far better."""
    if not costs.given - costs.other >= HAND_GAIN:
        return
    left_handed = pose.left_handed != pose.mirrored
    hand, opposite = ("left", "right") if left_handed else ("right", "left")
    raise KeyreconError(
        f"{origin}: the swing goes round the other way than that of a {hand}-hander who stands as "
        f'clicked. Either the player is {opposite}-handed (say "left_handed": '
        f"{'false' if left_handed else 'true'}), or left and right of the clicks are "
        "exchanged: right_ is the player's own right, on the left of a picture from the front. "
        "If all of it is right, mark the top of the swing on the page and fit again: who marks is "
        "believed."
    )


def _exchanged(pose: ClickedPose, exchanged: tuple[str, ...]) -> ClickedPose:
    """The pose with left and right of some joints exchanged."""
    names = tuple(_other_side(name) if name in exchanged else name for name in pose.joints.names)
    return replace(pose, joints=replace(pose.joints, names=names))


def _other_side(name: str) -> str:
    side, joint = name.split("_", 1)
    return f"{'left' if side == 'right' else 'right'}_{joint}"
