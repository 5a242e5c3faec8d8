"""Shoulders that follow the arms, where a capture holds them fixed to the trunk.

A raised arm takes its shoulder along: collar bone and shoulder blade turn up with it, and forward
as it crosses the chest (scapulohumeral rhythm). Skeletons of motion capture whose shoulders hang
rigidly on the trunk leave that out: in the two built-in captures shoulders rise by .6 and 2.3
degrees, seen from the neck, while the arms rise by 100, and on real swings the fitted shoulders
hung .16 to .20 trunk lengths below the marked ones at the finish. What a capture lacks is added;
its arms keep their directions.

Five real swings, fitted once with priors of three seeds: joints within a fifth of the trunk .954,
.944 and .941 without, .968, .958 and .956 with it; mean distances from the marks .0816, .0884 and
.0862 trunk lengths, and .0782, .0860 and .0835.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from keyrecon.golf.prior.skeleton import NAMES, REST

RISE = 0.15
"""Turn of the line from neck to shoulder, upwards, by the arm's elevation: half of the shoulder
blade's .30 (.43 per degree of the shoulder joint; Braman et al., J. Shoulder Elbow Surg. 18, 2009),
whose axis lies between neck and shoulder. With .25 the real swings came out as well."""
HANGING = np.radians(30)
"""Elevation of the arm up to which its shoulder stays, rad: that of an address."""
FORWARD = 0.4
"""Turn forward of the shoulder of an arm that points straight across the chest, rad; no source was
found that gives it for a swing. None, .2 and .4: .0804, .0786 and .0779 trunk lengths."""

Turns = Float[np.ndarray, "T P 3 3"]


class _Shoulder(NamedTuple):
    clavicle: int
    arm: int
    outwards: float


SIDES = tuple(
    _Shoulder(NAMES.index(f"{side}_clavicle"), NAMES.index(f"{side}_upper_arm"), outwards)
    for side, outwards in (("right", 1.0), ("left", -1.0))
)


def follow_arms(turns: Turns) -> Turns:
    """Local turns of a swing whose shoulders follow the arms as far as they did not before."""
    turned, share = turns.copy(), 1 - shown_share(turns)
    for clavicle, arm, outwards in SIDES:
        upper_arm = turns[:, clavicle] @ turns[:, arm]
        way = upper_arm @ REST[arm]
        across = np.maximum(-outwards * way[:, 0], 0)
        vector = np.stack([0 * across, FORWARD * across, _usual_rise(way)], axis=1)
        more = Rotation.from_rotvec(share * outwards * vector).as_matrix()
        turned[:, clavicle] = more @ turns[:, clavicle]
        turned[:, arm] = np.swapaxes(turned[:, clavicle], 1, 2) @ upper_arm
    return turned


def shown_share(turns: Turns) -> float:
    """Share of the usual rise that a swing's shoulders show, 0-1.

    Means of both sides are compared: a trunk that bends aside lifts one shoulder as far as it
    lowers the other.
    """
    usual = np.mean([_usual_rise(turns[:, c] @ turns[:, a] @ REST[a]) for c, a, _ in SIDES], axis=0)
    shoulders = np.mean([_elevation(turns[:, c] @ REST[c]) for c, _, _ in SIDES], axis=0)
    slope = np.cov(usual, shoulders)[0, 1] / max(float(np.var(usual, ddof=1)), 1e-12)
    return float(np.clip(slope, 0, 1))


def _usual_rise(arms: Float[np.ndarray, "T 3"]) -> Float[np.ndarray, "T"]:
    """Rise of the shoulders by the directions of upper arms in the trunk's axes, rad."""
    return RISE * np.maximum(_elevation(arms) - HANGING, 0)


def _elevation(ways: Float[np.ndarray, "T 3"]) -> Float[np.ndarray, "T"]:
    """Angle of unit vectors in the trunk's axes from straight down, rad."""
    return np.arccos(np.clip(-ways[:, 1], -1, 1))
