"""The body as volumetric primitives: tapered capsules on the segments (CVPR 2005, Fig. 1).

Radii are those of an adult in clothes and scale with stature; breadths of chest and pelvis are made
of two capsules side by side.
"""

import numpy as np

from keyrecon.golf.records import Body, Capsules
from keyrecon.golf.skeleton import LENGTHS, NAMES, REST

# segment, start and end (x, along, z in statures; along: share of the segment), radii in statures
_TRUNK = (
    ("trunk", (0.045, 0.30, 0.0), (0.070, 0.86, 0.0), (0.070, 0.066)),
    ("trunk", (-0.045, 0.30, 0.0), (-0.070, 0.86, 0.0), (0.070, 0.066)),
    ("pelvis", (0.045, 0.0, 0.0), (0.042, 0.30, 0.0), (0.078, 0.070)),
    ("pelvis", (-0.045, 0.0, 0.0), (-0.042, 0.30, 0.0), (0.078, 0.070)),
    ("head", (0.0, 0.0, 0.0), (0.0, 0.35, 0.0), (0.034, 0.034)),
    ("head", (0.0, 0.42, -0.012), (0.0, 0.70, -0.008), (0.044, 0.050)),
)
_LIMBS = (
    ("upper_arm", (0.032, 0.026)), ("forearm", (0.026, 0.019)), ("thigh", (0.056, 0.036)),
    ("shank", (0.035, 0.022)),
)  # fmt: skip
_HAND = ((0.0, 0.055), (0.022, 0.024))
"""Beyond the wrist along the forearm, and radii; statures."""
_FOOT = ((-0.025, 0.095), (0.026, 0.022))
"""Behind and before the ankle along the foot, and radii; statures."""


def build_capsules(body: Body) -> Capsules:
    """Capsules of a body in metres."""
    rows = [(name, _trunk_point(name, a), _trunk_point(name, b), radii)
            for name, a, b, radii in _TRUNK]  # fmt: skip
    for side in ("right", "left"):
        for part, radii in _LIMBS:
            name = f"{side}_{part}"
            rest = REST[NAMES.index(name)]
            rows.append((name, 0 * rest, LENGTHS[part] * rest, radii))
        forearm, foot = f"{side}_forearm", f"{side}_foot"
        rest = REST[NAMES.index(forearm)]
        hand = [(LENGTHS["forearm"] + along) * rest for along in _HAND[0]]
        rows.append((forearm, *hand, _HAND[1]))
        sole = [along * REST[NAMES.index(foot)] for along in _FOOT[0]]
        rows.append((foot, *sole, _FOOT[1]))
    names, starts, ends, radii = zip(*rows, strict=True)
    return Capsules(
        np.array([NAMES.index(name) for name in names]), body.stature * np.array(starts),
        body.stature * np.array(ends), body.stature * np.array(radii),
    )  # fmt: skip


def _trunk_point(name: str, point: tuple[float, float, float]) -> np.ndarray:
    """A point of pelvis, trunk or head in statures; `along` counts from the segment's origin."""
    length = LENGTHS["trunk" if name == "pelvis" else name]
    return np.array([point[0], point[1] * length, point[2]])
