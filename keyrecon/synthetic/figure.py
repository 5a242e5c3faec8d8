"""Where chest, face, feet and racket point, which the 14 joints do not say.

Knees and pelvis tell the toes, the trunk the face, the forearm and the speed of the hand the
racket. Near the floor a foot lies flat or stands on its toes, and never reaches below it.

A clothed player around 14 joints: rounded cones for limbs, clothes, head, shoes.

Radii are those of an adult of 1.75 m and scale with stature; widths follow the body segment
tables of Winter, "Biomechanics and Motor Control of Human Movement". Solids are built for many
instants at once.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.ndimage import gaussian_filter1d

from keyrecon.body import LSP14
from keyrecon.numerics.geometry import unit_vectors

UP = np.array([0.0, 1.0, 0.0])
STATURE = 1.75
"""Metres; stature that sizes of the figure belong to."""
ANKLE_HEIGHT = 0.085
"""Metres from the sole to the ankle joint at that stature."""
FOOT_LENGTH = 0.17
"""Metres from the ankle to the toes along the floor at that stature."""

unit = partial(unit_vectors, min_length=1e-9)
"""Directions of bones and normals, whose rounding errors are far below a nanometre."""


@dataclass(frozen=True, eq=False)
class Pointers:
    """Directions that joints do not tell; unit vectors in the world, and the stature."""

    front: Float[np.ndarray, "T 3"]
    """Out of the chest."""
    face: Float[np.ndarray, "T 3"]
    toes: Float[np.ndarray, "T 2 3"]
    """Right, left foot, from the ankle to the toes along the sole."""
    racket: Float[np.ndarray, "T 3"]
    """From the hand to the tip of the racket."""
    strings: Float[np.ndarray, "T 3"]
    """Normal of the racket face."""
    stature: float
    left_handed: bool


def joint(points: Float[np.ndarray, "*t J 3"], name: str) -> Float[np.ndarray, "*t 3"]:
    """One joint by name."""
    return points[..., LSP14.index(name), :]


def estimate_stature(points: Float[np.ndarray, "T 14 3"]) -> float:
    """Stature from the median lengths of both legs and of trunk and head, metres."""
    bones = LSP14.bones
    lengths = np.median(np.linalg.norm(points[:, bones[:, 0]] - points[:, bones[:, 1]], axis=-1), 0)
    return float(lengths.sum() / LSP14.lengths.sum())


def point_figure(
    points: Float[np.ndarray, "T 14 3"], fps: float, left_handed: bool = False
) -> Pointers:
    """Directions of chest, face, feet and racket for every frame of a motion in the world."""
    stature = estimate_stature(points)
    trunk = joint(points, "neck") - (joint(points, "right_hip") + joint(points, "left_hip")) / 2
    across = joint(points, "left_shoulder") - joint(points, "right_shoulder")
    front = unit(_smooth(np.cross(across, trunk), fps, 0.04))
    racket, strings = _point_racket(points, fps, left_handed, front)
    neck_to_top = unit(joint(points, "head_top") - joint(points, "neck"))
    face = front - 0.8 * (front * neck_to_top).sum(-1, keepdims=True) * neck_to_top
    toes = np.stack([_point_toes(points, fps, side, stature) for side in ("right", "left")], axis=1)
    return Pointers(
        front, unit(_smooth(face, fps, 0.08)), toes, racket, strings, stature, left_handed
    )


def _smooth(vectors: Float[np.ndarray, "T 3"], fps: float, seconds: float) -> np.ndarray:
    """Low-pass along time."""
    return gaussian_filter1d(vectors, max(seconds * fps, 1e-3), axis=0, mode="nearest")


def _point_toes(
    points: Float[np.ndarray, "T 14 3"], fps: float, side: str, stature: float
) -> Float[np.ndarray, "T 3"]:
    """Toes point where the knee bends to; near the floor the sole does not go below it."""
    hip, knee, ankle = (joint(points, f"{side}_{name}") for name in ("hip", "knee", "ankle"))
    pelvis = joint(points, "left_hip") - joint(points, "right_hip")
    ahead = unit(np.cross(pelvis, UP))
    shank, thigh = unit(ankle - knee), unit(knee - hip)
    bend = thigh - (thigh * shank).sum(-1, keepdims=True) * shank
    ahead = unit(ahead + 2.0 * bend)
    heading = _smooth(ahead * [1, 0, 1], fps, 0.06)
    heading = unit(heading)
    hanging = unit(ahead - (ahead * shank).sum(-1, keepdims=True) * shank + 0.35 * shank)
    scale = stature / STATURE
    height = ankle[:, 1] - np.percentile(ankle[:, 1], 5)
    drop = np.clip(height / (FOOT_LENGTH * scale), -0.2, 0.85)
    flat = heading * np.sqrt(1 - drop**2)[:, None] - UP * drop[:, None]
    lifted = np.clip((height / scale - 0.12) / 0.2, 0, 1)[:, None]
    return unit(_smooth(unit(flat * (1 - lifted) + hanging * lifted), fps, 0.02))


def _point_racket(
    points: Float[np.ndarray, "T 14 3"], fps: float, left_handed: bool, front: np.ndarray
) -> tuple[Float[np.ndarray, "T 3"], Float[np.ndarray, "T 3"]]:
    """The racket leans off the forearm, up at rest and behind the hand when it is fast."""
    side = "left" if left_handed else "right"
    wrist, elbow = joint(points, f"{side}_wrist"), joint(points, f"{side}_elbow")
    forearm = unit(wrist - elbow)
    velocity = np.gradient(_smooth(wrist, fps, 0.03), 1 / fps, axis=0)
    speed = np.linalg.norm(velocity, axis=1, keepdims=True)
    lag = velocity / (speed + 4.0) * np.clip(speed / 4, 0, 1)
    lean = UP * (1 - np.clip(speed / 8, 0, 1)) + 0.3 * front
    lean = lean - 0.2 * fps * np.gradient(lag, axis=0)
    lean = lean - (lean * forearm).sum(-1, keepdims=True) * forearm
    racket = unit(_smooth(forearm + 0.8 * unit(lean), fps, 0.03))
    swing = velocity + 1.5 * front + 0.3 * UP
    swing = swing - (swing * racket).sum(-1, keepdims=True) * racket
    return racket, unit(_smooth(unit(swing), fps, 0.05))


PARTS = (
    "none", "skin", "hair", "face", "shirt", "sleeve", "shorts",
    "right_shoe", "left_shoe", "sock", "racket",
)  # fmt: skip
"""What a pixel of the picture may belong to; the index is its number in the part buffer."""


@dataclass(frozen=True)
class Build:
    """Shape of the player and the cut of the clothes."""

    girth: float = 1.0
    """Factor on all radii of the body."""
    sleeve: float = 0.6
    """Share of the upper arm that the sleeve covers; above 1 it goes down the forearm."""
    leg: float = 0.55
    """Share of the thigh that the shorts cover; 2 reaches the ankle."""
    looseness: float = 1.0
    """Factor on how far clothes stand off the body."""
    skirt: bool = False
    ponytail: bool = False
    sock: float = 0.25
    """Share of the shank that socks cover."""


@dataclass(frozen=True, eq=False)
class FigureSolids:
    """Solids of T instants in the world, and what each of them is."""

    start: Float[np.ndarray, "T P 3"]
    end: Float[np.ndarray, "T P 3"]
    side: Float[np.ndarray, "T P 3"]
    radii: Float[np.ndarray, "P 2"]
    squeeze: Float[np.ndarray, "P 2"]
    open_end: Bool[np.ndarray, "P"]
    part: Int[np.ndarray, "P"]


class _Assembly:
    """Collects solids one by one."""

    def __init__(self, scale: float) -> None:
        """Radii are multiplied with `scale`."""
        self.scale = scale
        self.rows: list[tuple] = []

    def add(self, part: str, ends: tuple, side: np.ndarray, radii: tuple, **more: object) -> None:
        """One solid between two points (T, 3) with radii in metres at STATURE."""
        self.rows.append((part, *ends, side, radii, more))

    def finish(self) -> FigureSolids:
        """Stack what was added."""
        parts, starts, ends, sides, radii, more = zip(*self.rows, strict=True)
        return FigureSolids(
            np.stack(starts, axis=1), np.stack(ends, axis=1), np.stack(sides, axis=1),
            np.array(radii) * self.scale,
            np.array([m.get("squeeze", (1.0, 1.0)) for m in more]),
            np.array([bool(m.get("cut", False)) for m in more]),
            np.array([PARTS.index(p) for p in parts]),
        )  # fmt: skip


def build_solids(
    points: Float[np.ndarray, "T 14 3"], pointers: Pointers, build: Build = Build()
) -> FigureSolids:
    """Solids of a clothed player; `pointers` belong to the same instants as `points`."""
    assembly = _Assembly(pointers.stature / STATURE)
    _add_trunk(assembly, points, pointers, build)
    _add_head(assembly, points, pointers, build)
    for index, side in enumerate(("right", "left")):
        _add_arm(assembly, points, pointers, build, side)
        _add_leg(assembly, points, pointers, build, index)
    return assembly.finish()


def between(a: np.ndarray, b: np.ndarray, share: float) -> np.ndarray:
    """Point a share of the way from a to b."""
    return a + share * (b - a)


def _add_trunk(body: _Assembly, points: np.ndarray, pointers: Pointers, build: Build) -> None:
    neck = joint(points, "neck")
    hips = [joint(points, f"{s}_hip") for s in ("right", "left")]
    shoulders = [joint(points, f"{s}_shoulder") for s in ("right", "left")]
    pelvis = (hips[0] + hips[1]) / 2
    across, low = unit(shoulders[1] - shoulders[0]), unit(hips[1] - hips[0])
    g, loose = build.girth, 0.012 * build.looseness
    chest = between(pelvis, neck, 0.64)
    waist = between(pelvis, neck, 0.26)
    hem = between(pelvis, neck, -0.02)
    body.add("shirt", (chest, waist), across, (0.162 * g, 0.138 * g + loose), squeeze=(1.0, 0.66))
    body.add(
        "shirt", (waist, hem), low, (0.14 * g + loose, 0.158 * g + 1.5 * loose),
        squeeze=(1.0, 0.72), cut=True,
    )  # fmt: skip
    tops = [between(s, neck, 0.12) for s in shoulders]
    collar, blades = between(pelvis, neck, 0.98), between(pelvis, neck, 0.83)
    body.add("shirt", (blades, chest), across, (0.112 * g, 0.14 * g), squeeze=(1.15, 0.78))
    for top in tops:
        body.add("shirt", (collar, top), pointers.front, (0.05 * g, 0.062 * g))
        body.add("shirt", (top, chest), across, (0.07 * g, 0.085 * g))
    seat = between(pelvis, neck, 0.1)
    body.add("shorts", (seat, pelvis), low, (0.142 * g, 0.15 * g), squeeze=(1.0, 0.75))
    if build.skirt:
        knees = (joint(points, "right_knee") + joint(points, "left_knee")) / 2
        hem = between(pelvis, knees, 0.8 * build.leg)
        body.add("shorts", (seat, hem), low, (0.135 * g + loose, 0.185 * g + loose),
                 squeeze=(1.0, 0.7), cut=True)  # fmt: skip
    for hip in hips:
        body.add("shorts", (between(hip, pelvis, 0.25), hip), low, (0.102 * g, 0.09 * g))


def _add_head(body: _Assembly, points: np.ndarray, pointers: Pointers, build: Build) -> None:
    neck, top = joint(points, "neck"), joint(points, "head_top")
    axis, face = unit(top - neck), pointers.face
    ear = unit(np.cross(axis, face))
    s = pointers.stature / STATURE
    base, middle = between(neck, top, -0.12), between(neck, top, 0.5)
    body.add("skin", (base, middle), ear, (0.068 * build.girth, 0.056 * build.girth))
    centre = top - 0.112 * s * axis
    forward = unit(face - (face * axis).sum(-1, keepdims=True) * axis)
    jaw = centre - 0.055 * s * axis + 0.026 * s * forward
    skull = centre + 0.012 * s * axis - 0.004 * s * forward
    body.add("face", (skull, jaw), ear, (0.088, 0.063), squeeze=(0.86, 1.0))
    nose = centre - 0.012 * s * axis + 0.088 * s * forward
    body.add("face", (nose, nose - 0.028 * s * axis + 0.012 * s * forward), ear, (0.01, 0.014))
    crown = centre + 0.02 * s * axis - 0.018 * s * forward
    nape = centre - 0.045 * s * axis - 0.03 * s * forward
    body.add("hair", (crown, nape), ear, (0.094, 0.07), squeeze=(0.9, 1.0))
    if build.ponytail:
        knot = centre + 0.02 * s * axis - 0.105 * s * forward
        tip = knot - 0.2 * s * UP - 0.05 * s * forward
        body.add("hair", (knot, tip), ear, (0.036, 0.022))


def _add_arm(
    body: _Assembly, points: np.ndarray, pointers: Pointers, build: Build, side: str
) -> None:
    shoulder, elbow, wrist = (joint(points, f"{side}_{n}") for n in ("shoulder", "elbow", "wrist"))
    upper, fore = unit(elbow - shoulder), unit(wrist - elbow)
    hinge = unit(np.cross(upper, fore) + 0.2 * pointers.front)
    g, loose = build.girth, 0.012 * build.looseness
    s = pointers.stature / STATURE
    body.add("skin", (shoulder, elbow), hinge, (0.052 * g, 0.041 * g))
    body.add("skin", (elbow, between(elbow, wrist, 0.3)), hinge, (0.041 * g, 0.043 * g))
    body.add("skin", (between(elbow, wrist, 0.3), wrist), hinge, (0.043 * g, 0.027 * g))
    reach = min(build.sleeve, 1.0)
    body.add(
        "sleeve", (between(shoulder, elbow, 0.02), between(shoulder, elbow, reach)), hinge,
        (0.064 * g + 0.5 * loose, 0.054 * g + loose), cut=build.sleeve <= 1,
    )  # fmt: skip
    if build.sleeve > 1:
        cuff = between(elbow, wrist, build.sleeve - 1)
        body.add("sleeve", (elbow, cuff), hinge, (0.054 * g + loose, 0.042 * g), cut=True)
    grip = pointers.racket if (side == "left") == pointers.left_handed else fore
    palm = wrist + 0.03 * s * fore
    body.add("skin", (palm, wrist + 0.075 * s * unit(fore + 0.5 * grip)), hinge, (0.034, 0.036),
             squeeze=(0.62, 1.0))  # fmt: skip


def _add_leg(
    body: _Assembly, points: np.ndarray, pointers: Pointers, build: Build, index: int
) -> None:
    side = ("right", "left")[index]
    hip, knee, ankle = (joint(points, f"{side}_{n}") for n in ("hip", "knee", "ankle"))
    toes = pointers.toes[:, index]
    across = unit(np.cross(knee - hip, toes))
    g, s = build.girth, pointers.stature / STATURE
    calf = between(knee, ankle, 0.3) - 0.012 * s * toes
    body.add("skin", (hip, knee), across, (0.088 * g, 0.056 * g))
    body.add("skin", (knee, calf), across, (0.055 * g, 0.058 * g))
    body.add("skin", (calf, ankle), across, (0.058 * g, 0.036 * g))
    sock = between(ankle, knee, build.sock)
    body.add("sock", (ankle, sock), across, (0.041 * g, 0.038 * g + 0.03 * build.sock), cut=True)
    _add_trousers(body, (hip, knee, ankle), across, build)
    sole = unit(toes)
    rise = unit(np.cross(across, sole))
    rise *= np.sign((rise * (knee - ankle)).sum(-1, keepdims=True))
    heel = ankle - 0.028 * s * sole - 0.044 * s * rise
    ball = ankle + 0.125 * s * sole - 0.054 * s * rise
    shoe = f"{side}_shoe"
    body.add(shoe, (heel, ball), across, (0.043, 0.038), squeeze=(1.0, 0.8))
    body.add(shoe, (between(heel, ball, 0.12) + 0.02 * s * rise, ankle), across, (0.046, 0.044))


def _add_trousers(
    body: _Assembly, leg: tuple[np.ndarray, ...], across: np.ndarray, build: Build
) -> None:
    hip, knee, ankle = leg
    g, loose = build.girth, 0.014 * build.looseness
    flare = 0.025 if build.skirt else 0.0
    reach = min(build.leg, 1.0)
    end = 0.096 * g + loose + flare - (0.03 * reach if not build.skirt else 0)
    body.add(
        "shorts", (between(hip, knee, 0.03), between(hip, knee, reach)), across,
        (0.09 * g + 0.4 * loose, end), cut=build.leg <= 1,
    )  # fmt: skip
    if build.leg > 1:
        cuff = between(knee, ankle, build.leg - 1)
        body.add("shorts", (knee, cuff), across, (end, 0.052 * g + loose), cut=True)
