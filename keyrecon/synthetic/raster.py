"""Rounded cones as quadratic forms in pixel coordinates.

A solid is the hull of two spheres, squeezed along two axes. Its end points are projected in true
perspective; within one solid the rays count as parallel. A linear map takes pixels and depth to
axes in which the solid is round, stands at the origin and points along the third axis. There,
the ray through a pixel meets the cone between the spheres where a form quadratic in (x, y, 1) is
positive, and each sphere likewise (Quilez, "Round cone intersection", gives the derivation and
the names k0, k1, k2, m1 ... that are kept here).

Draw rounded cones: depth, owner and surface normal of every pixel of a box.

Limbs, torso, head and shoes are rounded cones (see `cones`). Their forms are evaluated for a
whole box of pixels with three array operations each; depth, solid and place along its axis are
kept where it is nearest, and normals follow once at the end for the pixels that were hit.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.numerics.geometry import unit_vectors


@dataclass(frozen=True, eq=False)
class Solids:
    """Rounded cones in camera axes, metres; P of them."""

    start: Float[np.ndarray, "*t P 3"]
    end: Float[np.ndarray, "*t P 3"]
    side: Float[np.ndarray, "*t P 3"]
    """Direction across the axis along which `squeeze[..., 0]` acts."""
    radii: Float[np.ndarray, "P 2"]
    """At start and end, metres."""
    squeeze: Float[np.ndarray, "P 2"]
    """Factors on the radius along `side` and across both."""
    open_end: Bool[np.ndarray, "P"]
    """Cut flat at the end, as a sleeve."""


@dataclass(frozen=True, eq=False)
class Forms:
    """Solids as forms over (x, y, 1), with pixels counted from each solid's start."""

    start: Float[np.ndarray, "P 3"]
    """x, y in px, depth in px at the scale of the picture."""
    to_local: Float[np.ndarray, "P 3 3"]
    """Pixels and depth to axes in which the solid is round: side, across, axis."""
    length: Float[np.ndarray, "P"]
    boxes: Float[np.ndarray, "P 4"]
    """x0, y0, x1, y1 of each solid, px."""
    body: Float[np.ndarray, "P 3 3"]
    """Positive where the ray meets the cone between the spheres."""
    balls: Float[np.ndarray, "P 2 3 3"]
    """Positive where the ray meets each sphere."""
    advance: Float[np.ndarray, "P 3"]
    """k1: minus the ray parameter midway between both hits, times k2."""
    along: Float[np.ndarray, "P 3"]
    """Place along the axis of a hit at ray parameter 0, times d2."""
    nearest: Float[np.ndarray, "P 2 3"]
    """Minus the ray parameter of the point nearest to each sphere's centre."""
    ray: Float[np.ndarray, "P 4"]
    """m2, k2, d2, and the local length of a ray per px of depth."""


_ONE = np.array([0.0, 0.0, 1.0])
_UNIT = np.outer(_ONE, _ONE)


def make_forms(solids: Solids, focal: float, principal: Float[np.ndarray, "2"]) -> Forms:
    """Project the end points of solids and set up their forms."""
    ends = np.stack([solids.start, solids.end], axis=1)
    scale = focal / ends[..., 2]
    reference = focal / solids.start[:, 2].mean()
    pixels = np.concatenate(
        [ends[..., :2] * scale[..., None] + principal, ends[..., 2:] * reference], axis=-1
    )
    radii = solids.radii * scale
    axis = pixels[:, 1] - pixels[:, 0]
    length = np.linalg.norm(axis, axis=-1)
    basis = _bases(axis / np.maximum(length, 1e-9)[:, None], solids.side)
    stretch = np.concatenate([1 / solids.squeeze, np.ones((len(length), 1))], axis=1)
    to_local = stretch[:, :, None] * basis
    boxes = _boxes(pixels, radii, np.linalg.inv(to_local))
    return _derive(pixels[:, 0], to_local, length, radii, boxes)


def _derive(
    start: Float[np.ndarray, "P 3"],
    to_local: Float[np.ndarray, "P 3 3"],
    length: Float[np.ndarray, "P"],
    radii: Float[np.ndarray, "P 2"],
    boxes: Float[np.ndarray, "P 4"],
) -> Forms:
    """The forms of Quilez's derivation, for all pixels at once."""
    per_px = np.linalg.norm(to_local[:, :, 2], axis=1)
    ray = to_local[:, :, 2] / per_px[:, None]
    plane = np.concatenate([to_local[:, :, :2], np.zeros((len(length), 3, 1))], axis=2)
    slope = radii[:, 0] - radii[:, 1]
    lean = (slope * radii[:, 0])[:, None]
    d2, m2 = length**2 - slope**2, length * ray[:, 2]
    k2 = d2 - m2**2
    m1 = length[:, None] * plane[:, 2]
    m3, m5 = _toward(ray, plane)
    k1 = d2[:, None] * m3 - m1 * m2[:, None] + m2[:, None] * lean * _ONE
    k0 = d2[:, None, None] * m5 - _outer(m1, m1) + 2 * lean[..., None] * _outer(m1, _ONE[None])
    k0 = (k0 + k0.transpose(0, 2, 1)) / 2 - (length * radii[:, 0])[:, None, None] ** 2 * _UNIT
    beyond = plane.copy()
    beyond[:, 2, 2] -= length
    m6, m7 = _toward(ray, beyond)
    balls = np.stack([_outer(m3, m3) - m5, _outer(m6, m6) - m7], axis=1)
    balls += radii[:, :, None, None] ** 2 * _UNIT
    return Forms(
        start, to_local, length, boxes, _outer(k1, k1) - k2[:, None, None] * k0, balls, k1,
        m1 - lean * _ONE, np.stack([m3, m6], axis=1), np.stack([m2, k2, d2, per_px], axis=1),
    )  # fmt: skip


def _toward(
    ray: Float[np.ndarray, "P 3"], plane: Float[np.ndarray, "P 3 3"]
) -> tuple[Float[np.ndarray, "P 3"], Float[np.ndarray, "P 3 3"]]:
    """Part along the ray, and squared length, of local points on the plane of the picture."""
    return np.einsum("pi,pij->pj", ray, plane), np.einsum("pij,pik->pjk", plane, plane)


def _outer(a: Float[np.ndarray, "P 3"], b: Float[np.ndarray, "#P 3"]) -> Float[np.ndarray, "P 3 3"]:
    return a[:, :, None] * b[:, None, :]


def _bases(
    axis: Float[np.ndarray, "P 3"], side: Float[np.ndarray, "P 3"]
) -> Float[np.ndarray, "P 3 3"]:
    """Rows: side made square to the axis, across both, axis."""
    across = unit_vectors(np.cross(axis, side), 1e-9)
    return np.stack([np.cross(across, axis), across, axis], axis=1)


def _boxes(
    pixels: Float[np.ndarray, "P 2 3"],
    radii: Float[np.ndarray, "P 2"],
    to_pixels: Float[np.ndarray, "P 3 3"],
) -> Float[np.ndarray, "P 4"]:
    """Pixel boxes around both squeezed spheres of every solid."""
    reach = radii[:, :, None] * np.linalg.norm(to_pixels[:, :2], axis=2)[:, None]
    lo = (pixels[..., :2] - reach).min(axis=1)
    hi = (pixels[..., :2] + reach).max(axis=1)
    return np.concatenate([lo, hi], axis=1)


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
    surface = ray / np.float32(forms.ray[index, 3]) + np.float32(start[2])
    nearer = (ray < FAR) & (surface < depth[region])
    np.copyto(depth[region], surface, where=nearer)
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
    normal = unit_vectors(np.einsum("nij,ni->nj", to_local, local), 1e-6)
    return normal, np.stack([axial, local[:, 0]], axis=1)
