"""Draw rounded cones: depth, owner and surface normal of every pixel of a box.

Limbs, torso, head and shoes are rounded cones (see `cones`). Their forms are evaluated for a
whole box of pixels with three array operations each; depth, solid and place along its axis are
kept where it is nearest, and normals follow once at the end for the pixels that were hit.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from keyrecon.synthetic.cones import Forms, Solids, make_forms

FAR = np.float32(1e9)


@dataclass(frozen=True, eq=False)
class Surface:
    """What the pixels of a box show; N of them are hit."""

    left: int
    top: int
    solid: Int[np.ndarray, "h w"]
    """Index of the nearest solid, -1 where none is."""
    depth: Float[np.ndarray, "h w"]
    """px at the scale of the picture, counted from the camera; large where nothing is."""
    normal: Float[np.ndarray, "N 3"]
    """Outward unit vectors in camera axes, for the pixels with solid >= 0 in reading order."""
    place: Float[np.ndarray, "N 2"]
    """Where on its solid: metres along the axis, metres across (for textures)."""


def draw_solids(
    solids: Solids,
    focal: float,
    principal: Float[np.ndarray, "2"],
    size: tuple[int, int],
    shift: tuple[float, float] = (0.0, 0.0),
) -> Surface | None:
    """Nearest surfaces in the part of a picture of `size` (width, height) that holds the solids.

    `shift` moves the point of a pixel that is sampled, px. None when nothing is in the picture.
    """
    forms = make_forms(solids, focal, principal - np.asarray(shift))
    width, height = size
    lo = np.maximum(np.floor(forms.boxes[:, :2].min(axis=0)), 0).astype(int)
    hi = np.minimum(np.ceil(forms.boxes[:, 2:].max(axis=0)) + 1, [width, height]).astype(int)
    if (hi <= lo).any():
        return None
    shape = (hi[1] - lo[1], hi[0] - lo[0])
    depth = np.full(shape, FAR, np.float32)
    owner = np.full(shape, -1, np.int16)
    along = np.zeros(shape, np.float32)
    for index in range(len(forms.length)):
        _draw_one(forms, index, lo, (depth, owner, along), bool(solids.open_end[index]))
    normal, place = _normals(forms, depth, owner, along, lo)
    scale = focal / solids.start[:, 2].mean()
    return Surface(int(lo[0]), int(lo[1]), owner, depth, normal, place / np.float32(scale))


def _draw_one(
    forms: Forms,
    index: int,
    origin: Int[np.ndarray, "2"],
    buffers: tuple[np.ndarray, np.ndarray, np.ndarray],
    open_end: bool,
) -> None:
    """Enter one solid where it is nearer than what the buffers hold."""
    depth, owner, along = buffers
    height, width = depth.shape
    x0, y0 = np.maximum(np.floor(forms.boxes[index, :2]).astype(int) - origin, 0)
    x1, y1 = np.minimum(np.ceil(forms.boxes[index, 2:]).astype(int) + 1 - origin, [width, height])
    if x1 <= x0 or y1 <= y0:
        return
    start = forms.start[index]
    x = (np.arange(x0, x1) + (origin[0] - start[0])).astype(np.float32)[None]
    y = (np.arange(y0, y1) + (origin[1] - start[1])).astype(np.float32)[:, None]
    ray, place = _meet(forms, index, (x, y), open_end)
    region = (slice(y0, y1), slice(x0, x1))
    found = ray / np.float32(forms.ray[index, 3]) + np.float32(start[2])
    nearer = (ray < FAR) & (found < depth[region])
    np.copyto(depth[region], found, where=nearer)
    np.copyto(owner[region], np.int16(index), where=nearer)
    np.copyto(along[region], place, where=nearer)


def _meet(
    forms: Forms, index: int, pixels: tuple[np.ndarray, np.ndarray], open_end: bool
) -> tuple[Float[np.ndarray, "h w"], Float[np.ndarray, "h w"]]:
    """First hit of every ray (FAR where none), and where along the axis it lies, 0-1."""
    x, y = pixels
    m2, k2, d2, _ = forms.ray[index].astype(np.float32)
    best = np.full((y.size, x.size), FAR, np.float32)
    place = np.zeros_like(best)
    if d2 > 0 and k2 > 0:
        inside = _quadratic(forms.body[index], x, y)
        ray = (-np.sqrt(np.maximum(inside, 0)) - _linear(forms.advance[index], x, y)) / k2
        share = (_linear(forms.along[index], x, y) + ray * m2) / d2
        hit = (inside > 0) & (share > 0) & (share < 1)
        np.copyto(best, ray, where=hit)
        np.copyto(place, share, where=hit)
    for end in range(1 if open_end else 2):
        inside = _quadratic(forms.balls[index, end], x, y)
        ray = -_linear(forms.nearest[index, end], x, y) - np.sqrt(np.maximum(inside, 0))
        hit = (inside > 0) & (ray < best)
        np.copyto(best, ray, where=hit)
        np.copyto(place, np.float32(end), where=hit)
    return best, place


def _linear(
    form: Float[np.ndarray, "3"], x: Float[np.ndarray, "1 w"], y: Float[np.ndarray, "h 1"]
) -> Float[np.ndarray, "h w"]:
    a, b, c = form.astype(np.float32)
    return a * x + (b * y + c)


def _quadratic(
    form: Float[np.ndarray, "3 3"], x: Float[np.ndarray, "1 w"], y: Float[np.ndarray, "h 1"]
) -> Float[np.ndarray, "h w"]:
    f = form.astype(np.float32)
    columns = (f[0, 0] * x + 2 * f[0, 2]) * x + f[2, 2]
    rows = (f[1, 1] * y + 2 * f[1, 2]) * y
    value = (2 * f[0, 1] * y) * x
    value += columns
    value += rows
    return value


def _normals(
    forms: Forms,
    depth: Float[np.ndarray, "h w"],
    owner: Int[np.ndarray, "h w"],
    along: Float[np.ndarray, "h w"],
    origin: Int[np.ndarray, "2"],
) -> tuple[Float[np.ndarray, "N 3"], Float[np.ndarray, "N 2"]]:
    """Outward normals and texture places of the pixels that were hit."""
    rows, columns = np.nonzero(owner >= 0)
    which = owner[rows, columns]
    points = np.stack([columns + origin[0], rows + origin[1], depth[rows, columns]], axis=1)
    offset = (points - forms.start[which]).astype(np.float32)
    to_local = forms.to_local.astype(np.float32)[which]
    local = np.einsum("nij,nj->ni", to_local, offset)
    axial = local[:, 2].copy()
    local[:, 2] -= along[rows, columns] * forms.length.astype(np.float32)[which]
    normal = np.einsum("nij,ni->nj", to_local, local)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-6)
    return normal, np.stack([axial, local[:, 0]], axis=1)
