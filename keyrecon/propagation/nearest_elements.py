"""Which of some edge elements is nearest to each of others in place, direction and colour together.

The chord between two unit tangents, times `TANGENT_SCALE`, counts like a distance. Elements that
differ by 45 degrees are so far apart already that they only match when they lie close, and opposite
ones never do, which is the paper's rule (Section 4.1) with a soft edge. Colour is a further axis on
which different values are out of range. A frame has a few hundred elements at most, so the
distances of all pairs of descriptors,

    |a - b|^2 = |a|^2 + (-2 a, 1) . (b, |b|^2),

come from one small matrix product in single precision, and no tree is as quick. Each coordinate of
the elements of one frame lies in a row of its own.
"""

import numpy as np
from jaxtyping import Bool, Complex, Float32, Int

TANGENT_SCALE = 0.08
"""Player heights that a chord of length one between tangents counts for. A quarter more or less: at
most 0.1 points, 0.3 mm on one clip."""
COLOR_SPACING = 0.25
"""Spacing of colours on their axis: more than any search radius, and little, for precision. A
quarter more or less, others with it: at most 1.5 points, 2.1 mm on nine clips."""
PADDING_DISTANCE = 1e3
"""Squared distance of what only fills up an array. A quarter more or less, others with it: at most
1.5 points, 2.1 mm on nine clips."""
CACHED_DISTANCES = 1 << 18
"""Distances in work at a time: they stay in the processor's cache."""


def describe_elements(
    points: Complex[np.ndarray, "*P n"],
    tangent: Complex[np.ndarray, "*P n"],
    color: Int[np.ndarray, "*P n"],
) -> Float32[np.ndarray, "*P 5 n"]:
    """Coordinates in which distance tells how well elements correspond."""
    descriptor = np.empty((*points.shape[:-1], 5, points.shape[-1]), np.float32)
    descriptor[..., 0, :], descriptor[..., 1, :] = points.real, points.imag
    descriptor[..., 2, :] = TANGENT_SCALE * tangent.real
    descriptor[..., 3, :] = TANGENT_SCALE * tangent.imag
    descriptor[..., 4, :] = COLOR_SPACING * color
    return descriptor


def with_norms(descriptor: Float32[np.ndarray, "*P 5 n"]) -> Float32[np.ndarray, "*P 6 n"]:
    """(b, |b|^2)"""
    return np.concatenate([descriptor, _squared_norms(descriptor)[..., None, :]], axis=-2)


def _squared_norms(descriptor: Float32[np.ndarray, "*P 5 n"]) -> Float32[np.ndarray, "*P n"]:
    return np.square(descriptor).sum(axis=-2)


def find_nearest(
    queries: Float32[np.ndarray, "P 5 Q"], descriptors: Float32[np.ndarray, "P 6 F"], radius: float
) -> tuple[Int[np.ndarray, "P Q"], Bool[np.ndarray, "P Q"]]:
    """(position of the nearest descriptor, whether it lies within `radius`)."""
    (count, _, width), among = queries.shape, descriptors.shape[2]
    factors = np.empty((count, 6, width), np.float32)
    factors[:, :5], factors[:, 5] = -2 * queries, 1
    factors = factors.transpose(0, 2, 1)
    nearest, least = np.empty((count, width), int), np.empty((count, width), np.float32)
    step = max(1, CACHED_DISTANCES // (width * among))
    distance = np.empty((step, width, among), np.float32)
    first = among * np.arange(step * width).reshape(step, width)
    for at in range(0, count, step):
        part = slice(at, at + step)
        size = len(factors[part])
        np.matmul(factors[part], descriptors[part], out=distance[:size])
        distance[:size].argmin(axis=2, out=nearest[part])
        least[part] = distance.ravel()[first[:size] + nearest[part]]
    return nearest, least + _squared_norms(queries) < radius**2


def find_nearest_in_parts(
    queries: Float32[np.ndarray, "P 5 Q"],
    descriptors: Float32[np.ndarray, "P 6 F"],
    part: Int[np.ndarray, "P F"],
    parts: int,
    radius: float,
) -> tuple[Int[np.ndarray, "P N Q"], Bool[np.ndarray, "P N Q"]]:
    """The same among the descriptors of each part, 0 to `parts` - 1; position 0 where none is."""
    nearest = np.zeros((len(queries), parts, queries.shape[2]), int)
    matched = np.zeros(nearest.shape, bool)
    for number in range(parts):
        own = part == number
        width = max(1, int(own.sum(axis=1).max(initial=0)))
        first = np.argsort(~own, axis=1, kind="stable")[:, :width]
        of_part = np.take_along_axis(descriptors, first[:, None], axis=2)
        of_part[:, 5] += PADDING_DISTANCE * ~np.take_along_axis(own, first, axis=1)
        place, matched[:, number] = find_nearest(queries, of_part, radius)
        nearest[:, number] = np.take_along_axis(first, place, axis=1)
    return np.where(matched, nearest, 0), matched
