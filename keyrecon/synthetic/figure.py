"""A clothed player around 14 joints: rounded cones for limbs, clothes, head, shoes.

Radii are those of an adult of 1.75 m and scale with stature; widths follow the body segment
tables of Winter, "Biomechanics and Motor Control of Human Movement". Solids are built for many
instants at once.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.synthetic.pointers import STATURE, UP, Pointers, joint, unit

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
