"""Moments in which the player stands, from the picture and the lifted motion alone.

A foot stands whose ankle does not move against the background and is not the upper one; of one that
was not seen nothing is known. The stillest frame of every half second is taken: neighbouring frames
would say the same again.
"""

import numpy as np
from jaxtyping import Bool, Float

from keyrecon.numerics.geometry import warp_points
from keyrecon.records import Motion
from keyrecon.world.ground_evidence import Stances
from keyrecon.world.placement import HELD_SPEED, REACH, given_height, stature_in_units
from keyrecon.world.sight import unseen_joints
from keyrecon.world.world_terms import joint_masses

APART = 0.5
"""Seconds between moments."""
MOST = 240
"""Moments used at most, evenly spread."""
UPPER = 0.12
"""Statures by which a standing ankle may be higher in the picture than the other one: a stance
towards the camera shows so under cameras that look down."""
STATURE = 1.75
"""Metres of a player whose height is not known."""


def find_stances(
    motion: Motion,
    usable: Bool[np.ndarray, "T"],
    to_reference: Float[np.ndarray, "T 3 3"],
    zoom: Float[np.ndarray, "T"],
) -> Stances:
    """Where the player stands, in the pixels of a reference picture; may be empty.

    `zoom` is each frame's focal length in those of the reference picture.
    """
    skeleton = motion.skeleton
    ankles, hips = (
        [skeleton.index(f"{side}_{part}") for side in ("right", "left")]
        for part in ("ankle", "hip")
    )
    pixels = warp_points(to_reference[:, None], motion.points2d)
    scale = motion.scale / zoom
    seen = usable & np.isfinite(pixels).all(axis=(1, 2)) & np.isfinite(motion.points3d).all((1, 2))
    stature = stature_in_units(motion)
    metre = scale / (1.0 if motion.units == "m" else STATURE)
    feet = pixels[:, ankles]
    speed = _speed(feet, motion) / metre[:, None]
    lower = (
        feet[..., 1].max(axis=1, keepdims=True) - feet[..., 1] < UPPER * (scale * stature)[:, None]
    )
    with np.errstate(invalid="ignore"):
        still = (speed < HELD_SPEED) & lower & seen[:, None] & ~unseen_joints(motion)[:, ankles]
    speed = np.where(still, speed, np.inf)
    frames = _stillest(speed.min(axis=1), motion)
    foot = speed[frames].argmin(axis=1)
    middle = motion.points3d[:, hips, 2].mean(axis=1)
    masses, own = joint_masses(skeleton.names), motion.points2d
    between = feet[frames].mean(axis=1)
    return Stances(
        frames,
        feet[frames, foot],
        np.stack([own[:, ankles][frames, foot], own[:, hips].mean(axis=1)[frames]], axis=1),
        np.linalg.inv(to_reference[frames]),
        middle[frames] - motion.points3d[:, ankles, 2][frames, foot],
        motion.scale[frames],
        between,
        np.einsum("j,tjk->tk", masses, pixels[frames]) - between,
        stature,
        given_height(motion),
    )


def _speed(feet: Float[np.ndarray, "T 2 2"], motion: Motion) -> Float[np.ndarray, "T 2"]:
    """Of both feet, px per second."""
    count, reach = len(feet), max(1, round(REACH * motion.fps))
    before, after = (np.clip(np.arange(count) + k, 0, count - 1) for k in (-reach, reach))
    seconds = np.maximum(motion.time[after] - motion.time[before], 1e-6)
    return np.linalg.norm(feet[after] - feet[before], axis=2) / seconds[:, None]


def _stillest(speed: Float[np.ndarray, "T"], motion: Motion) -> np.ndarray:
    """The frame of least speed in every half second in which there is one."""
    part = np.floor((motion.time - motion.time[0]) / APART).astype(int)
    order = np.lexsort((np.arange(len(speed)), speed, part))
    first = np.ones(len(order), dtype=bool)
    first[1:] = part[order][1:] != part[order][:-1]
    frames = np.sort(order[first & np.isfinite(speed[order])])
    keep = np.linspace(0, len(frames) - 1, min(MOST, len(frames))).round().astype(int)
    return frames[keep]
