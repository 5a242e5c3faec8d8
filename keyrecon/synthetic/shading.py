"""Colour of a surface: sun, sky and floor light, cloth folds, grain and soft occlusion.

Folds and grain come from noise tiles looked up by the place on the solid, so they move with the
body. Occlusion compares each pixel's depth with its surroundings (screen-space ambient
occlusion in its simplest form): what lies behind an edge is a little darker.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, Int

from keyrecon.numerics.geometry import unit_vectors
from keyrecon.synthetic.figure import PARTS
from keyrecon.synthetic.looks import Rgb
from keyrecon.synthetic.raster import FAR, Surface

TILE = 256
"""Side of a noise tile, texels."""
TEXELS = 420.0
"""Texels per metre on the figure."""


@dataclass(frozen=True, eq=False)
class Light:
    """Light in camera axes."""

    sun: Float[np.ndarray, "3"]
    """Unit vector towards the sun."""
    up: Float[np.ndarray, "3"]
    """Unit vector towards the sky."""
    color: Rgb
    """Of sunlight, 1 = full."""
    sunshine: float
    """0 overcast to 1 hard sun."""
    floor: Rgb
    """Colour of the floor, which lights surfaces that look down, 0-255."""


@dataclass(frozen=True, eq=False)
class Tiles:
    """Periodic noise, made once per sequence."""

    folds: Float[np.ndarray, "2 n n"]
    """Tilt of the normal along and across the solid."""
    grain: Float[np.ndarray, "n n"]
    """Relative brightness."""


def make_noise(rng: np.random.Generator, size: int, scales: tuple[float, ...]) -> np.ndarray:
    """Periodic noise of unit spread with features of the given sizes, texels."""
    total = np.zeros((size, size), np.float32)
    spectrum = np.fft.rfft2(rng.standard_normal((size, size)))
    fy, fx = np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size)[None]
    for scale in scales:
        layer = np.fft.irfft2(spectrum * np.exp(-2 * (np.pi * scale) ** 2 * (fx**2 + fy**2)))
        total += (layer / layer.std()).astype(np.float32)
        spectrum = np.roll(spectrum, 17, axis=1) * np.sign(fx + 0.1)
    return total / total.std()


def make_tiles(rng: np.random.Generator) -> Tiles:
    """Noise for one sequence."""
    height = make_noise(rng, TILE, (5.0, 11.0, 20.0)) * 9.0
    folds = np.stack([np.roll(height, -1, a) - np.roll(height, 1, a) for a in (0, 1)])
    folds *= 0.28 / folds.std()
    return Tiles(folds.astype(np.float32), make_noise(rng, TILE, (0.7, 2.0, 6.0)))


_CLOTH = np.isin(PARTS, ("shirt", "sleeve", "shorts"))
_GRAIN = np.array([{"hair": 0.16, "face": 0.025, "skin": 0.03}.get(p, 0.045) for p in PARTS])
_GLOSS = np.array([{"hair": 0.12, "skin": 0.1, "face": 0.08}.get(p, 0.02) for p in PARTS])


def paint_surface(
    surface: Surface,
    parts: Int[np.ndarray, "P"],
    colors: Float[np.ndarray, "P 3"],
    light: Light,
    tiles: Tiles,
) -> Float[np.ndarray, "h w 3"]:
    """Colours 0-255 of the hit pixels, 0 elsewhere; `colors` are those of each solid."""
    rows, columns = np.nonzero(surface.solid >= 0)
    which = surface.solid[rows, columns]
    part = parts[which]
    cell = (surface.place * TEXELS + which[:, None] * 37).astype(np.int32) & (TILE - 1)
    u, v = cell[:, 0], cell[:, 1]
    normal = surface.normal.astype(np.float32)
    tilt = _CLOTH[part].astype(np.float32)
    normal = normal + 0.34 * tilt[:, None] * np.stack(
        [tiles.folds[0][u, v], tiles.folds[1][u, v], np.zeros_like(tilt)], axis=1
    )
    normal = unit_vectors(normal, 0.0)
    shade = _light(normal, light, _GLOSS[part])
    shade *= (1 + _GRAIN[part] * tiles.grain[u, v])[:, None]
    shade *= _occlusion(surface)[rows, columns][:, None]
    picture = np.zeros((*surface.solid.shape, 3), np.float32)
    picture[rows, columns] = np.clip(colors[which] * shade, 0, 255)
    return picture


def _light(
    normal: Float[np.ndarray, "N 3"], light: Light, gloss: Float[np.ndarray, "N"]
) -> Float[np.ndarray, "N 3"]:
    """Light on surfaces, 1 = fully lit; sky above, floor colour below, sun with a soft edge."""
    to_sun = np.clip((normal @ light.sun.astype(np.float32) + 0.12) / 1.12, 0, 1)
    to_sky = 0.5 + 0.5 * (normal @ light.up.astype(np.float32))
    sky = np.array([0.97, 1.0, 1.04], np.float32)
    floor = np.array(light.floor, np.float32) / 255 * 0.75
    ambient = to_sky[:, None] * sky + (1 - to_sky)[:, None] * floor
    half = light.sun - np.array([0, 0, 1.0])
    shine = np.clip(normal @ (half / np.linalg.norm(half)).astype(np.float32), 0, 1) ** 12
    sun = np.array(light.color, np.float32)
    direct = (to_sun + gloss.astype(np.float32) * shine)[:, None] * sun
    share = np.float32(light.sunshine)
    return ambient * (1.08 - 0.42 * share) + direct * (0.14 + 0.72 * share)


def _occlusion(surface: Surface) -> Float[np.ndarray, "h w"]:
    """Factor below 1 where the surroundings lie nearer to the camera."""
    hit = surface.solid >= 0
    rows = np.nonzero(hit.any(axis=1))[0]
    radius = max(2, round(0.03 * (rows[-1] - rows[0] + 1)))
    depth = np.where(hit, surface.depth, 0)
    weight = cv2.blur(hit.astype(np.float32), (2 * radius + 1,) * 2)
    mean = cv2.blur(depth, (2 * radius + 1,) * 2) / np.maximum(weight, 1e-3)
    behind = np.where(surface.depth < FAR, surface.depth - mean, 0)
    return 1 - 0.45 * np.clip(behind / (4 * radius) - 0.05, 0, 1)
