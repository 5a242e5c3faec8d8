"""Colours along the bones of limbs, learnt from the marks of this very video.

A bare forearm before a white shirt, or a dark sleeve before a bright court, shows where the bone
lies by its colour, along its whole length, while what surrounds it changes with every pose. So
beside the likeness of places (`appearance`), which takes in what is around them, the pixels on a
bone are asked by themselves: how much more probable is their colour on this bone of the marks than
anywhere about the player? (Colour models of parts: Ramanan, "Learning to parse images of
articulated bodies", NIPS 2006.) Only colours that are less probable speak, against the bone: that a
sleeve of the shirt's colour lies on the shirt says nothing for it. Marks of hidden limbs count too:
a forearm that is hidden by the trunk in half of the marks has its colours half of the time.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float, Float32, Int, UInt8
from scipy.ndimage import gaussian_filter

from keyrecon.propagation.appearance import PLAYER_HEIGHT, REACH, STRIDE, PlayerFeatures
from keyrecon.propagation.edge_template import AnnotatedPoses
from keyrecon.propagation.half_body import BodyHalf

LEVELS = 16, 32, 32
"""Steps of CIE L, a and b that colours are counted in."""
SMOOTHING = 1.0
"""Spread of a colour that was counted, steps: a few marks have a hundred pixels of a bone."""
LEAST = 1e-9
"""Count of a colour that was never seen: the logarithm has an end."""
ALONG = np.linspace(0.15, 0.95, 9)
"""Places along a bone, as shares of it: where it begins, clothes end."""
ACROSS = np.array([-0.01, 0.0, 0.01])
"""Places across it, player heights: within the half width of a forearm."""
SAMPLES = 20_000
"""Places about the player of which usual colours are taken."""
SAMPLE_SPREAD = 0.2
"""How far they lie from joints, player heights: the player and what is around."""


@dataclass(frozen=True, eq=False)
class BoneColors:
    """What colours the bones of limbs have."""

    features: PlayerFeatures
    half: BodyHalf
    tables: Float32[np.ndarray, "B N"]
    """Logarithm of how much less probable each colour is on a bone than about the player; 0 where
    it is more probable, and for bones of the trunk."""

    def unlikeness(self, joints: Complex[np.ndarray, "T S J"]) -> Float32[np.ndarray, "T S 2 B"]:
        """Mean of the tables along every bone, nats: of the bone itself, then of its mirror image.

        Described frames count for those around them, which have 0.
        """
        frames, half = self.features.frames, self.half
        share = len(joints) / len(frames)
        result = np.zeros((*joints.shape[:2], 2, len(half.bones)), np.float32)
        every = np.arange(len(frames))[:, None, None]
        for number in np.flatnonzero(half.limb).tolist():
            start, stop = half.bones[number]
            places = along_bone(joints[frames, :, start], joints[frames, :, stop])
            colors = _colors_at(self.features, every, places)
            for side, bone in enumerate((number, half.bone_mirror[number])):
                result[frames, :, side, number] = share * self.tables[bone][colors].mean(axis=-1)
        return result

    def numbers(self, frame: int) -> Int[np.ndarray, "N N"]:
        """Which colour each cell of one described frame has."""
        return _number(self.features.cells[np.searchsorted(self.features.frames, frame), ..., -3:])

    def along(
        self,
        numbers: Int[np.ndarray, "N N"],
        bone: int,
        start: Complex[np.ndarray, "*n"],
        stop: Complex[np.ndarray, "*n"],
    ) -> Float32[np.ndarray, "*n"]:
        """The same of many places of one bone where cells have these `numbers`, by fewer places
        along it."""
        cost = self.tables[bone].take(numbers)
        shares = ALONG[::2].reshape(-1, *np.ones(start.ndim, int))
        row, column = _cells_of(len(numbers), start + (stop - start) * shares)
        return cost.take(row * len(numbers) + column).mean(axis=0)


def along_bone(
    start: Complex[np.ndarray, "*n"], stop: Complex[np.ndarray, "*n"]
) -> Complex[np.ndarray, "*n P"]:
    """Places on bones, in player coordinates."""
    bone = (stop - start)[..., None, None]
    across = 1j * bone / np.maximum(np.abs(bone), 1e-9)
    places = start[..., None, None] + bone * ALONG[:, None] + across * ACROSS
    return places.reshape(*start.shape, -1)


def learn_bone_colors(
    features: PlayerFeatures, poses: AnnotatedPoses, joints: Complex[np.ndarray, "T J"]
) -> BoneColors:
    """From annotated poses; `joints` are about where the body is in every frame.

    Beside the marks of the bone itself count one more, drawn from those of both sides, and one
    drawn from all colours about the player (Laplace's rule of succession): a colour that no mark
    has is never impossible.
    """
    random = np.random.default_rng(0)
    which = random.integers(0, len(features.frames), SAMPLES)
    joint = random.integers(0, joints.shape[1], SAMPLES)
    beside = random.normal(0, SAMPLE_SPREAD, (2, SAMPLES))
    places = joints[features.frames[which], joint] + beside[0] + 1j * beside[1]
    usual = _count(_colors_at(features, which, places))
    half = poses.half
    tables = np.zeros((len(half.bones), len(usual)), np.float32)
    for bone in np.flatnonzero(half.limb).tolist():
        own = _colors_of_marks(features, poses, bone)
        both = np.concatenate([own, _colors_of_marks(features, poses, int(half.bone_mirror[bone]))])
        if len(both):
            seen = len(own) * _count(own) + _count(both)
            tables[bone] = np.maximum(np.log((len(own) + 2) * usual / (seen + usual)), 0)
    return BoneColors(features, half, tables)


def _colors_of_marks(
    features: PlayerFeatures, poses: AnnotatedPoses, bone: int
) -> Int[np.ndarray, "K P"]:
    """Colours along one bone where both of its ends were marked."""
    start, stop = poses.half.bones[bone]
    known = poses.known[:, [start, stop]].all(axis=1)
    places = along_bone(poses.joints[known, start], poses.joints[known, stop])
    row = np.searchsorted(features.frames, poses.frames[known])
    return _colors_at(features, row[:, None], places)


def _count(colors: Int[np.ndarray, "..."]) -> Float[np.ndarray, "N"]:
    """Probability of each colour; of no colours, that all are alike."""
    counts = np.bincount(colors.ravel(), minlength=int(np.prod(LEVELS))).astype(float)
    smooth = gaussian_filter(counts.reshape(LEVELS), SMOOTHING, mode="nearest").ravel() + LEAST
    return smooth / smooth.sum()


def _colors_at(
    features: PlayerFeatures, row: Int[np.ndarray, "..."], places: Complex[np.ndarray, "..."]
) -> Int[np.ndarray, "..."]:
    """Numbers of the colours at places in described frames."""
    return _number(features.cells[row, *_cells_of(features.cells.shape[1], places), -3:])


def _cells_of(
    side: int, places: Complex[np.ndarray, "*n"]
) -> tuple[Int[np.ndarray, "*n"], Int[np.ndarray, "*n"]]:
    """Rows and columns of `side` cells each, those beyond the picture as at its edge."""
    row, column = (
        rounded_within((PLAYER_HEIGHT * part + REACH - STRIDE / 2) / STRIDE, side - 1).astype(int)
        for part in (places.imag, places.real)
    )
    return row, column


def rounded_within(values: Float[np.ndarray, "*n"], most: int) -> Float[np.ndarray, "*n"]:
    """Whole numbers from 0 to `most`, in the place of the values."""
    np.rint(values, out=values)
    np.maximum(values, 0, out=values)
    return np.minimum(values, most, out=values)


def _number(lab: UInt8[np.ndarray, "*n 3"]) -> Int[np.ndarray, "*n"]:
    """a and b, which stay within a quarter of their range, are counted in finer steps."""
    light = lab[..., 0].astype(np.int64) >> 4
    green, blue = ((lab[..., k].astype(np.int64) - 64) >> 2 for k in (1, 2))
    green, blue = (np.clip(c, 0, n - 1) for c, n in zip((green, blue), LEVELS[1:], strict=True))
    return (light * LEVELS[1] + green) * LEVELS[2] + blue
