"""What limbs explain of the player's silhouette, and limbs looked for where it has one.

A hypothesis that puts both legs on one leg of the picture matches the edges, and leaves the other
leg of the picture unexplained. A silhouette does not tell which limb is which, but all of it
belongs to some limb: a pair of limbs is rated by the share of the silhouette that neither they nor
the trunk cover (`unexplained_silhouette`). Where no annotated frame has the pose, the silhouette
also proposes limbs: with one limb fixed, the other is placed where it explains most of what remains
and lies least outside the silhouette (`search_by_silhouette`). Bones are capsules.

A held racket that is part of the silhouette belongs to no limb; unexplained, it would favour arms
that lie along it. Whether a hand holds such a thing is learnt from marks: what the marked limbs
leave unexplained then lies for the most part in one piece at one of the wrists
(`find_holding_hand`). There one more capsule explains as much as a limb, in the direction in which
it covers most.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Complex, Float, Float32

from keyrecon.numerics.geometry import to_complex
from keyrecon.propagation.body_frame import BodyFrame
from keyrecon.propagation.edge_template import AnnotatedPoses
from keyrecon.propagation.half_body import BodyHalf
from keyrecon.records import Edges
from keyrecon.segmentation.contours import INSIDE_SPACING

LIMB_RADIUS, END_RADIUS, TRUNK_RADIUS = 0.04, 0.055, 0.06
"""Half widths of limbs, of hand or foot about the last joint, and of bones of the trunk, player
heights. Thighs and shanks with their own, all radii a quarter smaller, edges half or twice as soft:
within .2 points of the legs that were chosen right in single frames of five clips."""
SOFTNESS = 0.05
"""Distance from a limb's surface at which it explains nothing any more, player heights. A quarter
more or less, others with it: at most 1.2 points, 2.1 mm on nine clips."""
LIMB_REACH = 0.6
"""A limb's places are not farther from the middle of both shoulders or hips, player heights: a
stretched leg with its foot. A quarter more or less, others with it: at most 1.5 points, 2.1 mm on
nine clips."""
SHORTENING = 1.0, 0.6
"""Lengths of a bone that are tried, as shares of the longest that it can have."""
DIRECTIONS = 20
"""Directions of a bone that are tried."""
USUAL_LENGTH = 0.245
"""Length of a bone where none is marked, player heights: a thigh (Winter)."""
CORE_RADIUS = 0.02
"""Half width of what must lie on the silhouette, player heights: half a forearm's. A quarter more
or less, others with it: at most 1.5 points, 2.1 mm on nine clips."""
OUTSIDE_COST = 3.0
"""Cost of such a place beside the silhouette, against one that it explains. A quarter more or less,
others with it: at most 1.5 points, 2.1 mm on nine clips."""
HELD_FROM, HELD_TO, HELD_RADIUS = 0.08, 0.42, 0.06
"""Where a held thing lies, from the wrist, and half its width, player heights: from the end of the
hand to that of a racket, .685 m. A quarter more or less, others with them: at most 1.5 points, 2.1
mm on nine clips."""
HELD_DIRECTIONS = 12
"""Directions of it that are tried."""
LEAST_HELD, LEAST_HELD_PART = 0.03, 0.67
"""Share of the limbs' places that it covers on marked frames on the mean, and part of all that
limbs leave there. With rackets drawn with the player the shares are .04 and .08, the parts .8 and
.9, and racket wrists 97.2 % right with it, 94.1 % without (ground-back-static). Real rackets are
thin or blurred, and the shares .01 to .07, the parts .4 to .7: there PCK@0.2 would change by -1.2
to +.6 points, -.2 on the mean of nine choices of marks of five clips."""
SHORTEST = np.float32(1e-9)
"""Square of a bone's length at least: a bone may be seen end on. A quarter more or less, others
with it: at most 1.2 points, 2.1 mm on nine clips."""
FRAMES_AT_A_TIME = 256
"""Frames in work at a time."""
CELLS = round(LIMB_REACH / INSIDE_SPACING)
GRID = INSIDE_SPACING * np.arange(-CELLS, CELLS + 1)
"""Places of a limb from its first joint, along one axis. One cell more or less, others with it: at
most 1.2 points, 2.1 mm on nine clips."""


@dataclass(frozen=True, eq=False)
class Silhouettes:
    """Places on the player in every frame, player coordinates, `INSIDE_SPACING` apart."""

    points: Complex[np.ndarray, "T P"]
    valid: Bool[np.ndarray, "T P"]
    """False for padding."""

    def take(self, frames: slice) -> "Silhouettes":
        """Those of some frames."""
        return Silhouettes(self.points[frames], self.valid[frames])


def gather_silhouettes(edges: tuple[Edges, ...], body_frame: BodyFrame) -> Silhouettes:
    """Of all frames, side by side."""
    count = np.array([len(e.inside) for e in edges])
    valid = np.arange(max(1, count.max(initial=0))) < count[:, None]
    points = np.zeros(valid.shape, complex)
    frame, _ = np.nonzero(valid)
    pixels = np.concatenate([e.inside for e in edges])
    points[valid] = (to_complex(pixels) - body_frame.origin[frame]) / body_frame.height[frame]
    return Silhouettes(points, valid)


def limb_places(
    silhouettes: Silhouettes, half: BodyHalf, trunk: Complex[np.ndarray, "T J"]
) -> Silhouettes:
    """The places that limbs of one half can explain: in reach, above the hips or below them."""
    roots = trunk[:, [side[0] for side in half.sides]].mean(axis=1)
    hips = trunk[:, half.fixed].mean(axis=1) if half.fixed.any() else roots
    below = silhouettes.points.imag > hips.imag[:, None]
    near = np.abs(silhouettes.points - roots[:, None]) < LIMB_REACH
    own = silhouettes.valid & near & (below == (half.name == "lower"))
    width = max(1, int(own.sum(axis=1).max(initial=0)))
    order = np.argsort(~own, axis=1, kind="stable")[:, :width]
    points, valid = (np.take_along_axis(v, order, axis=1) for v in (silhouettes.points, own))
    return Silhouettes(points, valid)


def bone_gaps(
    points: Complex[np.ndarray, "..."],
    start: Complex[np.ndarray, "..."],
    stop: Complex[np.ndarray, "..."],
    radius: float,
) -> Float32[np.ndarray, "..."]:
    """Distance of places from a bone's surface, in `SOFTNESS`, 0-1; shapes broadcast."""
    points, start, stop = (places.astype(np.complex64) for places in (points, start, stop))
    bone, gap = stop - start, points - start
    along = gap.real * bone.real
    along = along + gap.imag * bone.imag
    along /= np.maximum(bone.real**2 + bone.imag**2, SHORTEST)
    return _soften(np.abs(gap - np.clip(along, 0, 1, out=along) * bone), radius)


def _soften(apart: Float32[np.ndarray, "..."], radius: float) -> Float32[np.ndarray, "..."]:
    apart -= np.float32(radius)
    apart /= np.float32(SOFTNESS)
    return np.clip(apart, 0, 1, out=apart)


def limb_gaps(
    points: Complex[np.ndarray, "..."], limb: tuple[Complex[np.ndarray, "..."], ...]
) -> Float32[np.ndarray, "..."]:
    """The same of a limb whose joints are given from the trunk outwards."""
    gaps = [bone_gaps(points, a, b, LIMB_RADIUS) for a, b in pairwise(limb)]
    end = points.astype(np.complex64) - limb[-1].astype(np.complex64)
    return reduce(np.minimum, gaps, _soften(np.abs(end), END_RADIUS))


def trunk_gaps(
    points: Complex[np.ndarray, "T P"], half: BodyHalf, trunk: Complex[np.ndarray, "T J"]
) -> Float32[np.ndarray, "T P"]:
    """The same of the bones of the trunk."""
    bones = half.bones[half.limb == 0]
    gaps = [bone_gaps(points, trunk[:, [a]], trunk[:, [b]], TRUNK_RADIUS) for a, b in bones]
    return reduce(np.minimum, gaps)


def unexplained_silhouette(
    places: Silhouettes,
    half: BodyHalf,
    trunk: Complex[np.ndarray, "T J"],
    limbs: tuple[Complex[np.ndarray, "T S j"], Complex[np.ndarray, "T S j"]],
    holding: int | None = None,
) -> Float[np.ndarray, "T S S"]:
    """Share of the `limb_places` that neither the trunk nor the limbs of a pair explain.

    The hand of the limb `holding` (0 or 1) holds something that explains places too.
    """
    unexplained_share = np.empty((*limbs[0].shape[:2], limbs[1].shape[1]))
    for frames in _blocks(len(trunk)):
        points, valid = places.points[frames], places.valid[frames]
        count = np.maximum(valid.sum(axis=1), 1)
        beside_trunk = trunk_gaps(points, half, trunk[frames]) * valid
        gaps = [
            limb_gaps(points[:, None], tuple(limb[frames].transpose(2, 0, 1)[..., None]))
            for limb in limbs
        ]
        if holding is not None:
            unexplained = gaps[holding] * beside_trunk[:, None]
            held, _ = find_held(points, unexplained, limbs[holding][frames, :, -1])
            gaps[holding] = np.minimum(gaps[holding], held)
        unexplained = (gaps[0] * beside_trunk[:, None]) @ gaps[1].transpose(0, 2, 1)
        unexplained_share[frames] = unexplained / count[:, None, None]
    return unexplained_share


def find_held(
    points: Complex[np.ndarray, "T P"],
    unexplained: Float32[np.ndarray, "T S P"],
    hands: Complex[np.ndarray, "T S"],
) -> tuple[Float32[np.ndarray, "T S P"], Float32[np.ndarray, "T S"]]:
    """The held thing at each hand, in the direction in which it covers most of the places that
    limbs leave `unexplained` (0-1): distance of places from its surface, in `SOFTNESS`, 0-1, and
    how many of them it covers."""
    gaps, most = np.ones(unexplained.shape, np.float32), np.full(hands.shape, -1, np.float32)
    apart = (points[:, None] - hands[..., None]).astype(np.complex64)
    for turn in np.exp(2j * np.pi * np.arange(HELD_DIRECTIONS) / HELD_DIRECTIONS):
        along = apart * np.complex64(turn)
        gap = np.hypot(along.real - np.clip(along.real, HELD_FROM, HELD_TO), along.imag)
        gap = _soften(gap, HELD_RADIUS)
        covers = ((1 - gap) * unexplained).sum(axis=2)
        gaps = np.where((covers > most)[..., None], gap, gaps)
        most = np.maximum(most, covers)
    return gaps, most


def find_holding_hand(silhouettes: Silhouettes, poses: AnnotatedPoses) -> int | None:
    """The side whose hand holds something that the silhouette has; None where marks show none."""
    half = poses.half
    whole = poses.known[:, np.concatenate(half.sides)].all(axis=1)
    if half.name != "upper" or not whole.any():
        return None
    joints, frames = poses.joints[whole], poses.frames[whole]
    marked = Silhouettes(silhouettes.points[frames], silhouettes.valid[frames])
    places = limb_places(marked, half, joints)
    unexplained = (trunk_gaps(places.points, half, joints) * places.valid).astype(np.float32)
    for side in half.sides:
        unexplained *= limb_gaps(places.points, tuple(joints[:, list(side)].T[..., None]))
    count = np.maximum(places.valid.sum(axis=1), 1)
    hands = joints[:, [side[-1] for side in half.sides]]
    _, covered = find_held(places.points, np.stack([unexplained, unexplained], axis=1), hands)
    share = (covered / count[:, None]).mean(axis=0)
    all_of_it = float((unexplained.sum(axis=1) / count).mean())
    best = int(share.argmax())
    return best if share[best] > max(LEAST_HELD, LEAST_HELD_PART * all_of_it) else None


@dataclass(frozen=True, eq=False)
class _LimbLibrary:
    """Limbs of two bones from their first joint, and the places of the grid about it."""

    middle: Complex[np.ndarray, "C"]
    outer: Complex[np.ndarray, "C"]
    explained: Float32[np.ndarray, "G C"]
    core: Float32[np.ndarray, "G C"]
    """1 along the bones."""


def search_by_silhouette(
    silhouettes: Silhouettes, poses: AnnotatedPoses, best: Complex[np.ndarray, "T J"]
) -> Complex[np.ndarray, "T _ J"]:
    """The poses that are given, with the one limb and with the other looked for anew.

    What hangs from the end of a limb, toes from an ankle, moves with it. None of a skeleton whose
    limbs are not two bones end to end.
    """
    half, bones = poses.half, poses.half.limb_bones(poses.half.sides[0])
    if bones is None:
        return best[:, None][:, :0]
    library = _make_library(poses, bones)
    joints = np.repeat(best[:, None], 2, axis=1)
    places = limb_places(silhouettes, half, best)
    for frames in _blocks(len(best)):
        whole, points = silhouettes.take(frames), places.points[frames]
        beside_trunk = trunk_gaps(points, half, best[frames]) * places.valid[frames]
        for number, (side, kept) in enumerate(zip(half.sides, half.sides[::-1], strict=True)):
            root = best[frames, side[0]][:, None]
            kept_limb = tuple(best[frames][:, kept].T[..., None])
            unexplained = beside_trunk * limb_gaps(points, kept_limb)
            explained = _splat(points - root, unexplained) @ library.explained
            inside = _splat(whole.points - root, whole.valid.astype(float))
            beside = (1 - np.minimum(inside, 1)) @ library.core
            chosen = (explained - OUTSIDE_COST * beside).argmax(axis=1)
            outer = root + library.outer[chosen][:, None]
            moved = best[frames][:, side[2:]] + outer - best[frames, side[2]][:, None]
            joints[frames, number, side[1]] = root[:, 0] + library.middle[chosen]
            joints[frames, number][:, side[2:]] = moved
    return joints


def _blocks(count: int) -> Iterator[slice]:
    for first in range(0, count, FRAMES_AT_A_TIME):
        yield slice(first, first + FRAMES_AT_A_TIME)


def _make_library(poses: AnnotatedPoses, bones: tuple[int, int]) -> _LimbLibrary:
    mirrored = poses.half.bone_mirror
    longest = [max(poses.longest[row], poses.longest[mirrored[row]]) for row in bones]
    turns = np.exp(2j * np.pi * np.arange(DIRECTIONS) / DIRECTIONS)
    steps = np.outer(SHORTENING, turns).ravel()
    one, two = (steps * (b if np.isfinite(b) else USUAL_LENGTH) for b in longest)
    joint = np.repeat(one, len(two))
    end = joint + np.tile(two, len(one))
    places = (GRID + 1j * GRID[:, None]).ravel()
    gaps = limb_gaps(places[:, None], (np.zeros(1, complex), joint[None], end[None]))
    ends = ((np.zeros(1, complex), joint), (joint, end))
    apart = [bone_gaps(places[:, None], a[None], b[None], CORE_RADIUS) for a, b in ends]
    core = (np.minimum(*apart) == 0).astype(np.float32)
    return _LimbLibrary(joint, end, 1 - gaps, core)


def _splat(
    places: Complex[np.ndarray, "T P"], values: Float[np.ndarray, "T P"]
) -> Float32[np.ndarray, "T G"]:
    """Values of places on the grid, shared bilinearly."""
    width = len(GRID)
    grid = np.zeros(len(places) * width * width)
    column, row = ((part - GRID[0]) / INSIDE_SPACING for part in (places.real, places.imag))
    left, top = np.floor(column).astype(int), np.floor(row).astype(int)
    first = np.arange(len(places))[:, None] * width * width
    for down in (0, 1):
        for right in (0, 1):
            x, y = left + right, top + down
            share = values * (1 - np.abs(column - x)) * (1 - np.abs(row - y))
            inside = (x >= 0) & (x < width) & (y >= 0) & (y < width)
            at = (first + y * width + x)[inside]
            grid += np.bincount(at, share[inside], len(grid))
    return grid.reshape(len(places), -1).astype(np.float32)
