"""Captured motion as a swing: cut to the key postures, turned to the swing axes, right-handed.

Swing axes stand on the ankles at address, so that swings of all captures lie on one another
before anything is learnt from them. A left-hander is mirrored. Where a capture has no club, the
left wrist is set as in a typical full swing with a mid iron (`WRIST`).
"""

import numpy as np
from jaxtyping import Float
from scipy.interpolate import PchipInterpolator

from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.golf.keyposes import find_key_postures
from keyrecon.golf.records import Swing
from keyrecon.golf.skeleton import (
    ANKLE_HEIGHT,
    CLUB_LENGTH,
    GRIP,
    NAMES,
    chain_turns,
    turns_from_swing,
)

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
    way = (wrist - elbow) / np.linalg.norm(wrist - elbow, axis=1, keepdims=True)
    grip = wrist + GRIP * _stature(joints) * way
    return np.stack([grip, grip + CLUB_LENGTH * way], axis=1)


def _set_wrist(swing: Swing) -> Swing:
    """The swing with the club turned in the left hand as `WRIST` says."""
    forearm = chain_turns(turns_from_swing(swing)[0])[:, NAMES.index("left_forearm")]
    time = np.interp(np.arange(len(forearm)), swing.keys, WRIST_KEYS)
    way = PchipInterpolator(*zip(*WRIST, strict=True))(time)
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    grip = swing.club[:, 0]
    head = grip + CLUB_LENGTH * np.einsum("tij,tj->ti", forearm, way)
    return Swing(
        swing.name, swing.joints, swing.toes, np.stack([grip, head], axis=1), swing.keys,
        swing.fps, swing.stature,
    )  # fmt: skip
