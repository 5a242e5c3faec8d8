"""A swing made by a player with other proportions, or with other angles.

Angles alone would lift the feet off the floor and the hands off the club. Trunk and left arm take
the angles as they are; ankles and toes keep their places (in statures), the pelvis its height as a
share of the legs, the right wrist its place beside the left one in the axes of the club. Legs and
right arm reach for these places by the law of cosines and bend to the side that the angles say.
"""

import numpy as np
from jaxtyping import Float

from keyrecon.body import LSP14
from keyrecon.golf.kinematics import find_club, find_joints, place_body
from keyrecon.golf.records import Body, Posture, Swing, SwingState
from keyrecon.golf.skeleton import CLUB, chain_turns, turns_from_swing

Points = Float[np.ndarray, "T 3"]
Turns = Float[np.ndarray, "T P 3 3"]
STRAIGHT = 0.998
"""Longest reach of a limb as a share of its length."""
FOLDED = 0.3
"""Shortest reach: an elbow bends by 145 degrees."""


def carry_swing(swing: Swing, body: Body) -> Swing:
    """The swing as a player with this body makes it, in that body's metres."""
    return change_swing(swing, body, *turns_from_swing(swing))


def change_swing(
    swing: Swing, body: Body, turns: Turns, place: Points, stance: float = 1.0
) -> Swing:
    """The swing with other turns and another place of the pelvis (statures).

    `stance` is a factor on the distance between the feet.
    """
    ratio = body.stature / swing.stature
    widen = np.array([stance, 1.0, 1.0])
    right_leg = LSP14.index("right_ankle"), LSP14.index("right_knee"), LSP14.index("right_hip")
    legs = _length(body.joint_place[list(right_leg[:2])]) / (ratio * _captured(swing, right_leg))
    ankle = swing.joints[:, right_leg[0], 1].min() / swing.stature
    raised = place.copy()
    raised[:, 1] = ankle + legs * (place[:, 1] - ankle)
    joints, club = place_turns(body, turns, raised)
    joints = joints.copy()
    for side in ("right", "left"):
        target = swing.joints[:, LSP14.index(f"{side}_ankle")] * ratio * widen
        _reach(joints, (f"{side}_hip", f"{side}_knee", f"{side}_ankle"), target)
    wrists = [LSP14.index("right_wrist"), LSP14.index("left_wrist")]
    apart = ratio * (swing.joints[:, wrists[0]] - swing.joints[:, wrists[1]])
    held = chain_turns(turns)[:, CLUB] @ np.swapaxes(
        chain_turns(turns_from_swing(swing)[0])[:, CLUB], 1, 2
    )
    target = joints[:, wrists[1]] + (held @ apart[..., None])[..., 0]
    _reach(joints, ("right_shoulder", "right_elbow", "right_wrist"), target)
    ankles = [LSP14.index("right_ankle"), LSP14.index("left_ankle")]
    toes = joints[:, ankles] + ratio * (swing.toes - swing.joints[:, ankles])
    return Swing(swing.name, joints, toes, club, swing.keys, swing.fps, body.stature)


def place_turns(
    body: Body, turns: Turns, place: Points
) -> tuple[Float[np.ndarray, "T 14 3"], Float[np.ndarray, "T 2 3"]]:
    """Joints and club in swing axes from local turns and the pelvis's place in statures."""
    frames = len(turns)
    still = np.zeros((frames, turns.shape[1], 3, 1))
    state = SwingState(
        np.zeros(0), np.zeros(frames), np.tile(np.eye(3), (frames, 1, 1)), np.zeros((frames, 3))
    )
    pose = place_body(body, Posture(turns, place, still, still[:, 0]), state)
    return find_joints(body, pose), find_club(body, pose)


def _length(bones: Float[np.ndarray, "*n 3"]) -> float:
    return float(np.linalg.norm(bones, axis=-1).sum())


def _captured(swing: Swing, chain: tuple[int, ...]) -> float:
    """Median length of a chain of joints, metres."""
    bones = np.linalg.norm(np.diff(swing.joints[:, list(chain)], axis=1), axis=2)
    return float(np.median(bones, axis=0).sum())


def _reach(joints: np.ndarray, names: tuple[str, str, str], target: Points) -> None:
    """Put a limb's end on a target; the middle joint stays on its side of the line."""
    root, middle, end = (LSP14.index(name) for name in names)
    bend = joints[:, middle] - joints[:, root]
    upper = np.linalg.norm(bend, axis=1, keepdims=True)
    lower = np.linalg.norm(joints[:, end] - joints[:, middle], axis=1, keepdims=True)
    way = target - joints[:, root]
    distance = np.linalg.norm(way, axis=1, keepdims=True)
    way = way / distance
    distance = np.clip(distance, FOLDED * (upper + lower), STRAIGHT * (upper + lower))
    along = (upper**2 - lower**2 + distance**2) / (2 * distance)
    out = np.sqrt(np.maximum(upper**2 - along**2, 0))
    side = bend - np.sum(bend * way, axis=1, keepdims=True) * way
    side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-9)
    joints[:, middle] = joints[:, root] + along * way + out * side
    joints[:, end] = joints[:, root] + distance * way
