"""Arms searched for by appearance and by edges.

Few marked poses have the arm of a stroke, and edges do not show it before the trunk. So every place
that an arm can reach from its shoulder is compared with the marks of this video: as an elbow, as a
wrist, as the middle of an upper arm or of a forearm. All upper arms and forearms of a few lengths
and directions are scored, two links of a pictorial structure (Felzenszwalb and Huttenlocher, IJCV
2005), and the best arms that differ are hypotheses.

With them a hypothesis has the wrist right in 87, 81, 81 and 87 % of the frames marked by eye of
four real clips, without in 71, 63, 70 and 73 %; with the best of them alone 66, 31, 27 and 40 %:
looks propose, all evidence together chooses. With the colours along their bones (`bone_color`) some
hypothesis of six real clips has 98.4, 97.9, 96.0, 99.4, 95.0 and 99.2 % of the arms' joints right,
without 94.6, 96.5, 94.2, 99.0, 95.4 and 99.2 (measured while colours spoke for bones, too). Of legs
other hypotheses lack nothing (99.5 % right); where no keyframe has the kick of a serve it is 93.5
%, and with legs looked for likewise 94.2.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float, Float32, Int

from keyrecon.propagation.appearance import JointAppearance
from keyrecon.propagation.bone_color import BoneColors, rounded_within
from keyrecon.propagation.correspondence import ElementIndex, TemplateFits, score_limb
from keyrecon.propagation.edge_template import AnnotatedPoses, EdgeTemplates

FORESHORTENING = 1.0, 0.75, 0.45
"""Lengths of a bone that are tried, as shares of its longest mark."""
DIRECTIONS = 18
"""Directions of a bone that are tried."""
SPACING = 0.03
"""Distance of the places that are looked at, player heights. A quarter more or less, others with
it: at most 1.2 points, 2.1 mm on nine clips."""
REACH = 0.48
"""How far they lie from the middle of the shoulders, player heights: a stretched arm's wrist. A
quarter more or less, others with it: at most 1.5 points, 2.1 mm on nine clips."""
DISTINCTION = 0.06
"""Limbs that count as different have a joint so far from the other's, player heights. For annotated
limbs halved or doubled, others with it: at most 0.0 points, 0.1 mm on one clip."""
MAX_LIMBS = 24
"""Limbs tried; of more, those that differ most. Halved or doubled, others with it: at most 0.0
points, 0.1 mm on one clip."""
COLOR_COST = 0.15
"""Cost of a nat of colour along a bone, in units of likeness: about as the evidence weighs them."""
TAKEN = 99.0
"""Cost of an arm like one that was found: more than any. A quarter more or less, others with it: at
most 1.5 points, 2.1 mm on nine clips."""


@dataclass(frozen=True, eq=False)
class _Limb:
    """A limb of two bones, and where they may lead to."""

    joints: tuple[int, int, int]
    """From the trunk outwards."""
    bones: tuple[int, int]
    steps: tuple[Complex[np.ndarray, "n"], Complex[np.ndarray, "n"]]
    """Player heights."""


def search_by_edges(
    templates: EdgeTemplates, index: ElementIndex, trunk: Complex[np.ndarray, "T J"], count: int
) -> Complex[np.ndarray, "T N J"]:
    """Poses with the trunk that is given and, on both sides, the best annotated limbs in order."""
    frames = np.arange(len(trunk))
    library = _collect_limbs(templates)
    joints = np.repeat(trunk[:, None], count, axis=1)
    for side in map(np.array, templates.half.sides):
        limbs = trunk[:, side[:1], None] + library.T[None]
        limbs = np.moveaxis(limbs, 1, 2)
        residual = _score_limbs(templates, index, trunk, limbs, side)
        for rank in range(count):
            chosen = limbs[frames, residual.argmin(axis=1)]
            joints[:, rank, side] = chosen
            same = (np.abs(limbs - chosen[:, None]) < DISTINCTION).all(axis=2)
            residual[same] += 1
    return joints


def _collect_limbs(templates: EdgeTemplates) -> Complex[np.ndarray, "L j"]:
    """Limbs of both sides, from their first joint; the first one, then whichever differs most."""
    poses = templates.poses.joints
    limbs = np.concatenate(
        [poses[:, side] - poses[:, side[:1]] for side in map(list, templates.half.sides)]
    )
    chosen = [0]
    distance = np.full(len(limbs), np.inf)
    while len(chosen) < min(MAX_LIMBS, len(limbs)):
        distance = np.minimum(distance, np.abs(limbs - limbs[chosen[-1]]).max(axis=1))
        chosen.append(int(distance.argmax()))
    return limbs[chosen]


def _score_limbs(
    templates: EdgeTemplates,
    index: ElementIndex,
    trunk: Complex[np.ndarray, "T J"],
    limbs: Complex[np.ndarray, "T L j"],
    side: Int[np.ndarray, "j"],
) -> Float[np.ndarray, "T L"]:
    """Residual of every limb in every frame."""
    bones = np.flatnonzero(np.isin(templates.half.bones, side).all(axis=1))
    frames = np.repeat(np.arange(len(limbs)), limbs.shape[1])
    joints = trunk[frames]
    joints[:, side] = limbs.reshape(len(frames), -1)
    fits = TemplateFits(frames, np.full(len(frames), templates.average), joints)
    (residual,) = fits.in_blocks(lambda part: (score_limb(templates, index, part, bones),))
    return residual.reshape(limbs.shape[:2])


def search_by_appearance(
    appearance: JointAppearance,
    colors: BoneColors,
    poses: AnnotatedPoses,
    trunk: Complex[np.ndarray, "T J"],
    count: int,
) -> Complex[np.ndarray, "T N J"]:
    """Poses with the trunk that is given and the `count` best limbs of either side.

    Frames that were not described have the limbs of the nearest one that was. What hangs from the
    end of a limb, a hand from a wrist, moves with it. None of a skeleton whose limbs are not two
    bones end to end.
    """
    sides = poses.half.sides
    limbs = [limb for side in sides if (limb := _limb_of(poses, side)) is not None]
    if len(limbs) < len(sides):
        return trunk[:, None][:, :0]
    starts = [limb.joints[0] for limb in limbs]
    across = np.arange(-REACH, REACH + SPACING, SPACING)
    grid = across + 1j * across[:, None]
    described = appearance.features.frames
    marks = [_marks_of(appearance, limb) for limb in limbs]
    offsets = np.zeros((len(described), count, 2, 2), complex)
    for row, frame in enumerate(described.tolist()):
        middle = trunk[frame, starts].mean()
        looks = appearance.describe(np.full(grid.size, frame), (middle + grid).ravel())
        numbers = colors.numbers(frame)
        for number, limb in enumerate(limbs):
            start = trunk[frame, limb.joints[0]] - middle
            cost = _limb_costs(looks, marks[number], limb, start)
            cost += COLOR_COST * _color_costs(colors, numbers, limb, middle + start)
            offsets[row, :, number] = _best_limbs(cost, limb, count)
    nearest = _nearest(described, len(trunk))
    joints = np.repeat(trunk[:, None], count, axis=1)
    for number, (limb, side) in enumerate(zip(limbs, sides, strict=True)):
        start, _, end = limb.joints
        joints[:, :, limb.joints[1:]] = offsets[nearest, :, number] + trunk[:, start, None, None]
        moved = joints[:, :, end] - trunk[:, end, None]
        joints[:, :, side[3:]] += moved[:, :, None]
    return joints


def _nearest(described: np.ndarray, count: int) -> np.ndarray:
    """Row of the described frame nearest to each frame."""
    frames = np.arange(count)
    after = np.clip(np.searchsorted(described, frames), 0, len(described) - 1)
    before = np.maximum(after - 1, 0)
    nearer = np.abs(described[before] - frames) <= np.abs(described[after] - frames)
    return np.where(nearer, before, after)


def _limb_of(poses: AnnotatedPoses, side: tuple[int, ...]) -> _Limb | None:
    half, bones = poses.half, poses.half.limb_bones(side)
    if bones is None:
        return None
    inner, middle, outer = side[:3]
    lengths = np.abs(poses.joints[:, half.bones[:, 1]] - poses.joints[:, half.bones[:, 0]])
    lengths = np.where(poses.known[:, half.bones].all(axis=2), lengths, 0).max(axis=0)
    lengths = np.maximum(lengths, lengths[half.bone_mirror])
    turns = np.arange(DIRECTIONS)[:, None] + np.arange(len(FORESHORTENING)) / 2
    unit = (np.array(FORESHORTENING) * np.exp(2j * np.pi * turns / DIRECTIONS)).ravel()
    one, other = (unit * lengths[bone] for bone in bones)
    return _Limb((inner, middle, outer), bones, (one, other))


def _marks_of(appearance: JointAppearance, limb: _Limb) -> tuple[Float32[np.ndarray, "_ C"], ...]:
    """What its middle and outer joint look like, and the middles of its inner and outer bone."""
    joints = [appearance.marks[joint] for joint in limb.joints[1:]]
    return *joints, *(appearance.bones[bone] for bone in limb.bones)


def _limb_costs(
    looks: Float32[np.ndarray, "g C"],
    marks: tuple[Float32[np.ndarray, "_ C"], ...],
    limb: _Limb,
    start: complex,
) -> Float[np.ndarray, "n m"]:
    """How unlike marks limbs look; `start` from the middle of the places `looks` describes."""
    one, other = limb.steps
    middle = start + one
    outer = middle[:, None] + other
    of_middle, of_outer, of_inner_bone, of_outer_bone = marks
    cost = _unlike(looks, of_middle, middle)
    cost = cost + _unlike(looks, of_inner_bone, start + one / 2)
    total = cost[:, None] + _unlike(looks, of_outer, outer)
    total += _unlike(looks, of_outer_bone, middle[:, None] + other / 2)
    return total


def _color_costs(
    colors: BoneColors, numbers: Int[np.ndarray, "N N"], limb: _Limb, start: complex
) -> Float[np.ndarray, "n m"]:
    """How improbable the colours along limbs are; `start` in player coordinates."""
    one, other = limb.steps
    middle = start + one
    inner = colors.along(numbers, limb.bones[0], np.full(len(one), start), middle)
    outer = middle[:, None] + other
    first = np.broadcast_to(middle[:, None], outer.shape)
    return inner[:, None] + colors.along(numbers, limb.bones[1], first, outer)


def _best_limbs(
    cost: Float[np.ndarray, "n m"], limb: _Limb, count: int
) -> Complex[np.ndarray, "N 2"]:
    """Middle and outer joint of the best limbs that differ, from the first."""
    middle = limb.steps[0]
    outer = middle[:, None] + limb.steps[1]
    limbs = np.zeros((count, 2), complex)
    for rank in range(count):
        a, b = np.unravel_index(cost.argmin(), cost.shape)
        limbs[rank] = middle[a], outer[a, b]
        near = np.abs(middle - middle[a]) < DISTINCTION
        cost[near[:, None] & (np.abs(outer - outer[a, b]) < DISTINCTION)] = TAKEN
    return limbs


def _unlike(
    looks: Float32[np.ndarray, "g C"],
    marks: Float32[np.ndarray, "_ C"],
    places: Complex[np.ndarray, "*n"],
) -> Float[np.ndarray, "*n"]:
    """How unlike the most similar mark the described place next to each place looks, 0-2."""
    if not len(marks):
        return np.zeros(places.shape)
    # marks in rows: the greatest of columns is found several at a time
    unlike = 1 - (marks @ looks.T).max(axis=0).astype(float)
    width = round(len(looks) ** 0.5)
    column, row = (
        rounded_within((part + REACH) / SPACING, width - 1) for part in (places.real, places.imag)
    )
    return unlike.take((row * width + column).astype(np.intp))
