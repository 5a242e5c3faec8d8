"""Colours and cut of the player and the court, drawn from a seed.

Colours are sRGB, 0-255. In most looks one of the player's colours recurs in the scene, as it
does on real courts: clay is close to skin, lines to white shoes, a dark wall to dark shorts.
"""

from dataclasses import dataclass, field

import numpy as np

from keyrecon.synthetic.figure import Build

Rgb = tuple[float | int, float | int, float | int]

_SKINS = (
    (242, 205, 180), (226, 178, 146), (203, 150, 115), (172, 118, 84), (132, 86, 60), (92, 60, 44),
)  # fmt: skip
_HAIRS = ((34, 26, 22), (62, 42, 28), (104, 72, 42), (176, 138, 84), (120, 116, 112), (20, 18, 20))
_SHIRTS = (
    (238, 238, 236), (196, 40, 44), (34, 70, 160), (240, 200, 50), (38, 38, 44), (60, 150, 110),
    (230, 110, 50), (90, 170, 220), (220, 90, 150), (120, 60, 140),
)  # fmt: skip
_SHORTS = (
    (30, 32, 40), (236, 236, 234), (32, 48, 92), (96, 98, 104), (150, 36, 40), (70, 78, 56),
    (40, 40, 42),
)  # fmt: skip
_SHOES = ((240, 240, 238), (40, 40, 46), (230, 80, 40), (60, 110, 200), (220, 220, 60))


@dataclass(frozen=True)
class Court:
    """Colours of the surroundings."""

    surface: str = "hard"
    """hard, clay or grass"""
    inside: Rgb = (58, 98, 158)
    outside: Rgb = (64, 120, 84)
    line: Rgb = (236, 236, 232)
    wall: Rgb = (34, 52, 44)
    board: Rgb = (30, 70, 140)
    trees: Rgb = (58, 84, 46)
    sky: Rgb = (184, 206, 228)
    crowd: bool = False
    """Whether a stand full of people rises above the wall."""


@dataclass(frozen=True)
class Look:
    """Everything about a sequence that is neither motion nor camera."""

    skin: Rgb = _SKINS[1]
    hair: Rgb = _HAIRS[1]
    shirt: Rgb = _SHIRTS[0]
    sleeve: Rgb = _SHIRTS[0]
    shorts: Rgb = _SHORTS[0]
    shoe: Rgb = _SHOES[0]
    sock: Rgb = (235, 235, 232)
    racket: Rgb = (40, 40, 44)
    trim: Rgb = (200, 60, 50)
    """Stripes on shirt and shorts."""
    build: Build = field(default_factory=Build)
    court: Court = field(default_factory=Court)
    sun: tuple[float, float, float] = (0.4, 0.8, 0.45)
    """Direction towards the sun in the world."""
    sun_color: Rgb = (1.0, 0.97, 0.9)
    sunshine: float = 0.6
    """0 overcast, 1 hard sun."""

    @property
    def part_colors(self) -> np.ndarray:
        """Colours in the order of `figure.PARTS`."""
        parts = (
            (0, 0, 0), self.skin, self.hair, self.skin, self.shirt, self.sleeve, self.shorts,
            self.shoe, self.shoe, self.sock, self.racket,
        )  # fmt: skip
        return np.array(parts, np.float32)


def choose_look(seed: int) -> Look:
    """A look by its seed: seed 0 is plain, and surfaces take turns with the seed."""
    rng = np.random.default_rng([seed, 11])
    court = _choose_court(seed, rng)
    skin = _jitter(_SKINS[rng.integers(len(_SKINS))], rng, 6.0)
    shirt = _jitter(_SHIRTS[rng.integers(len(_SHIRTS))], rng)
    shorts = _jitter(_SHORTS[rng.integers(len(_SHORTS))], rng)
    shoe = _SHOES[rng.integers(len(_SHOES))] if rng.random() < 0.5 else _SHOES[0]
    if rng.random() < 0.4:  # the wall recurs in the shorts
        shorts = _jitter(court.wall, rng, 8.0)
    return Look(
        skin=skin,
        hair=_jitter(_HAIRS[rng.integers(len(_HAIRS))], rng, 6.0),
        shirt=shirt,
        sleeve=shirt if rng.random() < 0.7 else _jitter(_SHORTS[rng.integers(len(_SHORTS))], rng),
        shorts=shorts,
        shoe=shoe,
        sock=(235, 235, 232) if rng.random() < 0.8 else (40, 40, 44),
        racket=_jitter((46, 46, 52), rng, 20.0),
        trim=_jitter(_SHIRTS[rng.integers(len(_SHIRTS))], rng),
        build=_choose_build(rng),
        court=court,
        sun=_choose_sun(rng),
        sun_color=(1.0, float(rng.uniform(0.93, 0.99)), float(rng.uniform(0.82, 0.97))),
        sunshine=float(rng.uniform(0.15, 0.9)),
    )


def _jitter(color: Rgb, rng: np.random.Generator, spread: float = 12.0) -> Rgb:
    """A colour close to another."""
    red, green, blue = np.clip(np.add(color, rng.normal(0, spread, 3)), 12, 246).tolist()
    return red, green, blue


def _choose_sun(rng: np.random.Generator) -> tuple[float, float, float]:
    azimuth, height = rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(32, 68))
    flat = np.cos(height)
    return float(flat * np.cos(azimuth)), float(np.sin(height)), float(flat * np.sin(azimuth))


_SLEEVES = (0.55, 0.7, 1.9)


def _choose_build(rng: np.random.Generator) -> Build:
    kind = rng.choice(["shorts", "long shorts", "skirt", "trousers"], p=[0.45, 0.25, 0.2, 0.1])
    leg = {"shorts": 0.55, "long shorts": 0.85, "skirt": 0.42, "trousers": 1.93}[kind]
    skirt = kind == "skirt"
    return Build(
        girth=float(rng.uniform(0.92, 1.02) if skirt else rng.uniform(0.96, 1.12)),
        sleeve=float(rng.uniform(0.2, 0.5) if skirt else rng.choice(_SLEEVES, p=[0.5, 0.4, 0.1])),
        leg=leg,
        looseness=float(rng.uniform(0.6, 1.6)),
        skirt=skirt,
        ponytail=bool(skirt or rng.random() < 0.15),
        sock=float(rng.choice([0.08, 0.16, 0.3])),
    )


_HARD = (
    ((54, 92, 156), (62, 122, 88)), ((70, 126, 92), (150, 74, 62)), ((64, 104, 168), (52, 84, 146)),
)  # fmt: skip


def _choose_court(seed: int, rng: np.random.Generator) -> Court:
    surface = ("hard", "clay", "hard", "grass")[seed % 4]
    if surface == "clay":
        inside = _jitter((186, 112, 76), rng, 7.0)
        outside = _jitter((178, 104, 70), rng, 6.0)
    elif surface == "grass":
        inside, outside = _jitter((108, 134, 70), rng, 7.0), _jitter((88, 120, 60), rng, 7.0)
    else:
        inside, outside = (_jitter(c, rng, 8.0) for c in _HARD[rng.integers(len(_HARD))])
    walls = ((30, 50, 42), (28, 36, 58), (38, 38, 42), (120, 124, 120), (22, 70, 54))
    return Court(
        surface=surface,
        inside=inside,
        outside=outside,
        wall=_jitter(walls[rng.integers(len(walls))], rng, 6.0),
        board=_jitter(_SHIRTS[rng.integers(len(_SHIRTS))], rng),
        trees=_jitter((60, 86, 48), rng, 10.0),
        sky=_jitter((190, 208, 226), rng, 10.0),
        crowd=seed % 3 == 1,
    )
