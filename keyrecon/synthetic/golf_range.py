"""A driving range: mown grass with a mat, marker boards, a line of trees and sky.

Drawn once per sequence by casting a ray per pixel, as the tennis court is.
"""

import numpy as np
from jaxtyping import Float

from keyrecon.synthetic.cameras import CameraMove
from keyrecon.synthetic.court import Background, cast_rays, sample
from keyrecon.synthetic.looks import Look
from keyrecon.synthetic.shading import make_noise

TREES_AWAY = 38.0
"""Metres from the player to the trees, all around."""
GRASS = (98, 132, 64)
MAT = (0.85, 0.75)
"""Half width and half depth of the mat, metres."""
MAT_COLOR = (52, 96, 66)
BOARDS = ((-14.0, (214, 60, 50)), (3.5, (238, 238, 232)), (16.0, (240, 196, 60)))
"""Marker boards: metres aside and colour."""


def draw_range(
    points: Float[np.ndarray, "T 14 3"], move: CameraMove, look: Look, seed: int
) -> Background:
    """Surroundings of a golfer as seen in all frames; nothing stands where `points` are."""
    rays, rotation, focal, corner = cast_rays(move)
    rng = np.random.default_rng([seed, 29])
    grain = make_noise(rng, 1024, (1.0, 4.0, 14.0))
    broad = make_noise(rng, 1024, (10.0, 35.0, 90.0))
    floor_t = rays.meet(1, 0.0)
    wall_t = np.minimum(
        rays.meet(0, np.where(rays.direction[0] > 0, TREES_AWAY, -TREES_AWAY).astype(np.float32)),
        rays.meet(2, np.where(rays.direction[2] > 0, TREES_AWAY, -TREES_AWAY).astype(np.float32)),
    )
    x, z = (np.clip(rays.at(floor_t, axis), -200, 200) for axis in (0, 2))
    x, z = x - points[..., 0].mean(), z - points[..., 2].mean()
    picture = _paint_grass(x, z, (grain, broad))
    along = rays.at(wall_t, 0) + rays.at(wall_t, 2)
    trees = _paint_trees(along, rays.at(wall_t, 1), look, (grain, broad))
    picture = np.where((floor_t < wall_t)[..., None], picture, trees)
    return Background(np.clip(picture, 0, 255).astype(np.uint8), rotation, focal, corner)


def _paint_grass(
    x: Float[np.ndarray, "h w"], z: Float[np.ndarray, "h w"], tiles: tuple
) -> Float[np.ndarray, "h w 3"]:
    """Grass mown in stripes, worn in places, and the mat that the player stands on."""
    grain, broad = tiles
    light = 1 + 0.10 * sample(grain, x, z, 0.012) + 0.07 * sample(broad, x, z, 0.03)
    light += 0.06 * np.sign(np.sin((x + 0.3 * z) * np.pi / 2.2))
    color = np.float32(GRASS) * light[..., None]
    mat = (np.abs(x) < MAT[0]) & (np.abs(z + 0.2) < MAT[1])
    weave = 1 + 0.06 * sample(grain, z, x, 0.006)
    return np.where(mat[..., None], np.float32(MAT_COLOR) * weave[..., None], color)


def _paint_trees(
    along: Float[np.ndarray, "h w"], height: Float[np.ndarray, "h w"], look: Look, tiles: tuple
) -> Float[np.ndarray, "h w 3"]:
    """Trees of uneven height with boards before them, sky above."""
    grain, broad = tiles
    along, height = np.clip(along, -200, 200), np.clip(height, -50, 300)
    crown = 5.5 + 1.8 * sample(broad, along, 0 * along, 0.07)
    crown += 0.4 * sample(grain, along, height, 0.04)
    leaves = 1 + 0.22 * sample(grain, along, height, 0.05)
    leaves += 0.25 * sample(broad, along, height, 0.03)
    trees = np.float32(look.court.trees) * np.clip(leaves, 0.25, 2)[..., None]
    sky = np.float32(look.court.sky) * (1 - 0.2 * np.clip((height - 4) / 40, 0, 1)[..., None])
    foot = np.abs(np.gradient(height, axis=0)) + 1e-3
    cover = np.clip((crown - height) / foot + 0.5, 0, 1)[..., None]
    picture = sky + cover * (trees - sky)
    for place, color in BOARDS:
        board = (np.abs(along - place) < 1.1) & (height > 0.4) & (height < 1.7)
        picture[board] = color
    return picture.astype(np.float32)
