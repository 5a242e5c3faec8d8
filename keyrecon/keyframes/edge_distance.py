"""Pose distance of two frames by corresponding their edge elements, exactly (Section 4.1-4.2).

Frames are aligned by what was tracked: elements are counted from the head (upper body) or from
the point between the feet (lower body), in player heights. No rotation: a leaning player is a
pose. Every element of one frame is matched to the nearest element of the other that has the
same colour and points less than 45 degrees away. The paper sets no limit to that distance, and
without one nearly everything finds a match; a match farther than `reach` is none. With A the
share of elements that found a match and B the mean distance of the matches,

    C = A B + (1 - A) max B

is a chamfer distance in which no element counts more than max B. `distance_matrix.py` measures the
same between all frames at once, with rounded positions; this file is its exact twin, and the source
of the correspondences that propagate joints.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.records import Edges, HalfName, Track

MAX_MATCH_DISTANCE = 0.12
"""Farthest match, player heights: about the width of a thigh, so that a limb never matches its
neighbour across a gap. A quarter more or less, others with it: at most 0.9 points, 2.2 mm on four
clips."""
MAX_DIRECTION_DIFFERENCE = np.pi / 4
"""Matched elements differ by less than this in direction (Section 4.1)."""


@dataclass(frozen=True)
class EdgeDistance:
    """How well one frame's edge elements match those of another frame."""

    matched: float
    """A: share of elements with a match, 0-1."""
    mean: float
    """B: mean distance of the matches, player heights; NaN without any."""

    def pooled(self, largest: float = MAX_MATCH_DISTANCE) -> float:
        """C, with `largest` in place of max B."""
        if self.matched == 0:
            return largest
        return self.matched * self.mean + (1 - self.matched) * largest


def half_of(edges: Edges, half: HalfName) -> Bool[np.ndarray, "E"]:
    """Which elements of a frame count for one half of the body."""
    return edges.upper if half == "upper" else edges.lower


def half_origins(track: Track, half: HalfName) -> Float[np.ndarray, "T 2"]:
    """What the elements of a half are seen from in every frame, px: the head, or mid-feet."""
    return track.head if half == "upper" else track.mid_feet


def align_edges(edges: Edges, track: Track, frame: int, half: HalfName) -> Edges:
    """One half of the body's elements, in player heights from the head or from mid-feet."""
    inside = half_of(edges, half)
    return Edges(
        points=(edges.points[inside] - half_origins(track, half)[frame]) / track.height[frame],
        tangent=edges.tangent[inside],
        color=edges.color[inside],
        upper=edges.upper[inside],
        lower=edges.lower[inside],
    )


def compatible(one: Edges, other: Edges) -> Bool[np.ndarray, "E F"]:
    """Which elements of two frames may correspond: same colour, direction within the cone."""
    same_color = one.color[:, None] == other.color[None]
    return same_color & (one.tangent @ other.tangent.T > np.cos(MAX_DIRECTION_DIFFERENCE))


def match_edges(
    one: Edges, other: Edges, reach: float = MAX_MATCH_DISTANCE
) -> tuple[Int[np.ndarray, "E"], Float[np.ndarray, "E"]]:
    """For each element of `one` its nearest compatible element of `other` and the distance.

    -1 and infinity where none lies within `reach`, which has the unit of the points.
    """
    if not len(one.points) or not len(other.points):
        return np.full(len(one.points), -1), np.full(len(one.points), np.inf)
    apart = np.linalg.norm(one.points[:, None] - other.points[None], axis=-1)
    apart[~compatible(one, other)] = np.inf
    nearest = apart.argmin(axis=1)
    distance = apart[np.arange(len(nearest)), nearest]
    near = distance < reach
    return np.where(near, nearest, -1), np.where(near, distance, np.inf)


def edge_distance(one: Edges, other: Edges, reach: float = MAX_MATCH_DISTANCE) -> EdgeDistance:
    """A and B of Section 4.2 from aligned elements of `one` to those of `other`."""
    match, distance = match_edges(one, other, reach)
    matched = match >= 0
    if not matched.any():
        return EdgeDistance(0.0, float("nan"))
    return EdgeDistance(float(matched.mean()), float(distance[matched].mean()))
