"""Captured motion as a swing: cut to the key postures, turned to the swing axes, right-handed.

Swing axes stand on the ankles at address, so that swings of all captures lie on one another
before anything is learnt from them. A left-hander is mirrored. Where a capture has no club, the
left wrist is set as in a typical full swing with a mid iron (`WRIST`).

A swing made by a player with other proportions, or with other angles.

Angles alone would lift the feet off the floor and the hands off the club. Trunk and left arm take
the angles as they are; ankles and toes keep their places (in statures), the pelvis its height as a
share of the legs, the right wrist its place beside the left one in the axes of the club. Legs and
right arm reach for these places by the law of cosines and bend to the side that the angles say.
"""

import numpy as np
from jaxtyping import Float
from scipy.interpolate import PchipInterpolator

from keyrecon.body import ANKLE_HEIGHT, LSP14
from keyrecon.errors import KeyreconError
from keyrecon.golf.prior.key_postures import find_key_postures
from keyrecon.golf.prior.kinematics import find_club, find_joints, place_body
from keyrecon.golf.prior.skeleton import (
    CLUB,
    CLUB_LENGTH,
    GRIP,
    NAMES,
    chain_turns,
    turns_from_swing,
)
from keyrecon.golf.records import Body, Posture, Swing, SwingState
from keyrecon.numerics.geometry import unit_vectors

MIRROR = np.array([-1.0, 1.0, 1.0])

WRIST_KEYS = (0.0, 0.43, 0.72, 1.0)
"""Times of the key postures in `WRIST`."""
WRIST = (
    (0.0, (-0.28, -0.34, -0.90)), (0.1, (0.13, -0.54, -0.83)), (0.2, (0.84, -0.41, -0.34)),
    (0.3, (0.99, 0.14, -0.04)), (0.38, (0.91, 0.38, 0.14)), (0.43, (0.92, 0.37, 0.14)),
    (0.5, (0.97, 0.23, 0.01)), (0.56, (0.99, 0.08, -0.14)), (0.62, (0.96, -0.13, -0.26)),
    (0.66, (0.91, -0.25, -0.34)), (0.69, (0.74, -0.43, -0.51)), (0.71, (0.43, -0.60, -0.67)),
    (0.73, (0.04, -0.68, -0.73)), (0.76, (-0.56, -0.49, -0.67)), (0.8, (-0.82, 0.07, -0.56)),
    (0.88, (-0.62, 0.40, -0.68)), (0.94, (-0.46, 0.58, -0.67)), (1.0, (-0.09, 0.75, -0.65)),
)  # fmt: skip
"""Direction of the club in the axes of the left forearm over the swing, as captured with markers
on the club (CMU subject 64, trial 07): cocked by 110 degrees at the top, straight at the hit."""


def make_swing(
    joints: Float[np.ndarray, "T 14 3"],
    toes: Float[np.ndarray, "T 2 3"] | None,
    club: Float[np.ndarray, "T 2 3"] | None,
    fps: float,
    name: str,
) -> Swing:
    """A swing from joints in metres with y up; raises KeyreconError when it is none."""
    if toes is None:
        raise KeyreconError(f"{name}: the capture has no toes, which the feet's turns need.")
    keys = find_key_postures(joints, club, fps)
    rotation, origin = _swing_axes(joints[keys[0]], _stature(joints))
    joints, toes = ((p - origin) @ rotation.T for p in (joints, toes))
    club = None if club is None else (club - origin) @ rotation.T
    wrists = joints[:, [LSP14.index("right_wrist"), LSP14.index("left_wrist")]].mean(axis=1)
    if wrists[keys[1], 0] < 0:  # the hands are on the player's left at the top: a left-hander
        joints, toes = joints[:, LSP14.mirror] * MIRROR, toes[:, ::-1] * MIRROR
        club = None if club is None else club * MIRROR
    swing = Swing(
        name, joints, toes, _hold_club(joints) if club is None else club, keys, fps,
        _stature(joints),
    )  # fmt: skip
    return swing if club is not None else _set_wrist(swing)


def _stature(joints: Float[np.ndarray, "T 14 3"]) -> float:
    """Stature that the bones' median lengths imply, metres."""
    parent, child = LSP14.bones.T
    lengths = np.median(np.linalg.norm(joints[:, child] - joints[:, parent], axis=2), axis=0)
    return float(lengths.sum() / LSP14.lengths.sum())


def _swing_axes(
    address: Float[np.ndarray, "14 3"], stature: float
) -> tuple[Float[np.ndarray, "3 3"], Float[np.ndarray, "3"]]:
    """Rotation from the capture's axes, and the origin in them."""
    right, left = address[LSP14.index("right_ankle")], address[LSP14.index("left_ankle")]
    across = (right - left) * np.array([1.0, 0.0, 1.0])
    across /= np.linalg.norm(across)
    up = np.array([0.0, 1.0, 0.0])
    origin = (right + left) / 2 - ANKLE_HEIGHT * stature * up
    return np.stack([across, up, np.cross(across, up)]), origin


def _hold_club(joints: Float[np.ndarray, "T 14 3"]) -> Float[np.ndarray, "T 2 3"]:
    """A club straight on from the left forearm."""
    wrist, elbow = (joints[:, LSP14.index(f"left_{n}")] for n in ("wrist", "elbow"))
    way = unit_vectors(wrist - elbow, 0.0)
    grip = wrist + GRIP * _stature(joints) * way
    return np.stack([grip, grip + CLUB_LENGTH * way], axis=1)


def _set_wrist(swing: Swing) -> Swing:
    """The swing with the club turned in the left hand as `WRIST` says."""
    forearm = chain_turns(turns_from_swing(swing)[0])[:, NAMES.index("left_forearm")]
    time = np.interp(np.arange(len(forearm)), swing.keys, WRIST_KEYS)
    way = unit_vectors(PchipInterpolator(*zip(*WRIST, strict=True))(time))
    grip = swing.club[:, 0]
    head = grip + CLUB_LENGTH * np.einsum("tij,tj->ti", forearm, way)
    return Swing(
        swing.name, swing.joints, swing.toes, np.stack([grip, head], axis=1), swing.keys,
        swing.fps, swing.stature,
    )  # fmt: skip


Points = Float[np.ndarray, "T 3"]
Turns = Float[np.ndarray, "T P 3 3"]
STRAIGHT = 0.998
"""Longest reach of a limb as a share of its length."""
FOLDED = 0.3
"""Shortest reach: an elbow bends by 145 degrees."""


def retarget_swing(swing: Swing, body: Body) -> Swing:
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
    side = unit_vectors(bend - np.sum(bend * way, axis=1, keepdims=True) * way, 1e-9)
    joints[:, middle] = joints[:, root] + along * way + out * side
    joints[:, end] = joints[:, root] + distance * way
