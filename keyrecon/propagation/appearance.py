"""What the player looks like around each joint, learnt from the marks of this very video.

Many poses lie on edges alike; of these the one whose joints look like marked ones is more probably
right. It also tells sides: a shirt may be pink on one side and black on the other, one hand holds
the racket, and an arm before the trunk looks unlike one behind it.

Every frame is brought to one size with the player upright in its middle, and described by cells of
colour and of gradient energy in four directions, as in histograms of oriented gradients (Dalal and
Triggs, CVPR 2005). The cells around a place are whitened by their covariance over the whole body
of this player, so that only what is peculiar to a place counts (Hariharan, Malik and Ramanan,
ECCV 2012); likeness is the cosine to the most similar of the joint's marks.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Complex, Float32, Int, UInt8

from keyrecon.io.frame_reader import read_small, side_by_side
from keyrecon.io.video import Video
from keyrecon.propagation.body_frame import BodyFrame
from keyrecon.propagation.edge_template import AnnotatedPoses
from keyrecon.propagation.half_body import BodyHalf

RATE = 30.0
"""Frames described in a second: reading, not looking, is what takes time. A quarter more or less,
others with it: at most 1.2 points, 2.1 mm on nine clips."""
PLAYER_HEIGHT = 96
"""Height of the player in the described pictures, px. A quarter more or less, others with it: at
most 1.2 points, 2.1 mm on nine clips."""
REACH = 80
"""Half of such a picture's side, px: a raised arm is .75 player heights above the middle. A quarter
more or less, others with it: at most 1.5 points, 2.1 mm on nine clips."""
STRIDE = 2
"""Descriptions are made at every second pixel. At every third: 2.3 points more (five joints) on one
real rally."""
SPACING = 2
"""Cells around a place lie so many descriptions apart: 4 px, .04 player heights. A quarter more or
less, others with it: at most 1.2 points, 2.1 mm on nine clips."""
CELLS = 3
"""Cells around a place, each way. Tried with eight directions of gradients on five real clips with
three choices of marks each: 5 had as many joints right, within .1 points, 7 had .4 points fewer."""
DESCRIBED = 7
"""Values of a cell that tell what a place looks like; the others are its own colour alone."""
DIAGONAL = 0.5**0.5
"""Cosine of 45 degrees: the part of a gradient along a diagonal."""
FLAT = 4.0
"""Gradient energy per pixel, grey levels, up to which a place counts as even. A quarter more or
less, others with it: at most 1.5 points, 2.1 mm on nine clips."""
SAMPLES = 6000
"""Places of which the covariance is taken. A quarter more or less, others with it: at most 1.5
points, 2.1 mm on nine clips."""
SAMPLE_SPREAD = 0.12
"""How far they lie from joints, player heights: on the body and beside it. A quarter more or less,
others with it: at most 1.2 points, 2.1 mm on nine clips."""
COMPONENTS = 40
"""Principal components that are kept; the least of them is the noise that all have. A quarter more
or less, others with it: at most 1.5 points, 2.1 mm on nine clips."""
FRAMES_AT_A_TIME = 64
"""Joints of so many frames are compared at a time: they stay in the processor's cache."""


@dataclass(frozen=True, eq=False)
class PlayerFeatures:
    """Colour and gradients in some frames, in player coordinates."""

    frames: Int[np.ndarray, "D"]
    cells: UInt8[np.ndarray, "D N N C"]

    def around(
        self, frames: Int[np.ndarray, "P"], places: Complex[np.ndarray, "P"]
    ) -> Float32[np.ndarray, "P D"]:
        """The cells around places in described frames, those beyond the picture as at its edge."""
        last = self.cells.shape[1] - 1
        offsets = SPACING * (np.arange(CELLS) - CELLS // 2)
        column, row = (
            np.rint((PLAYER_HEIGHT * part + REACH - STRIDE / 2) / STRIDE).astype(int)
            for part in (places.real, places.imag)
        )
        rows = np.clip(row[:, None, None] + offsets[:, None], 0, last)
        columns = np.clip(column[:, None, None] + offsets, 0, last)
        described = np.searchsorted(self.frames, frames)
        cells = self.cells[described[:, None, None], rows, columns, :DESCRIBED]
        return cells.reshape(len(places), -1).astype(np.float32)


def regular_frames(video: Video) -> Int[np.ndarray, "k"]:
    """`RATE` frames a second."""
    return np.arange(0, len(video), max(1, round(video.fps / RATE)))


@dataclass(frozen=True, eq=False)
class UprightCrop:
    """Cuts the player out of pictures, upright in the middle and of one size."""

    body_frame: BodyFrame
    width: int
    """Of the reduced pictures that it cuts, px."""
    shrink: float

    @classmethod
    def of(cls, video: Video, body_frame: BodyFrame) -> "UprightCrop":
        """For pictures of a video, or of those of its frames that `body_frame` has."""
        tall = float(np.median(body_frame.height))
        width = min(video.width, max(16, round(video.width * PLAYER_HEIGHT / tall)))
        return cls(body_frame, width, width / video.width)

    def cut(self, frame: int, picture: UInt8[np.ndarray, "h w 3"]) -> UInt8[np.ndarray, "s s 3"]:
        """The player of one frame, by its place in `body_frame`, from its reduced picture."""
        grow = PLAYER_HEIGHT / (self.body_frame.height[frame] * self.shrink)
        middle = self.shrink * (self.body_frame.origin[frame] + 0.5 + 0.5j) - (0.5 + 0.5j)
        x, y = REACH - 0.5 - grow * middle.real, REACH - 0.5 - grow * middle.imag
        player: UInt8[np.ndarray, "s s 3"] = cv2.warpAffine(
            picture,
            np.array([[grow, 0, x], [0, grow, y]]),
            (2 * REACH, 2 * REACH),
            borderMode=cv2.BORDER_REPLICATE,
        )
        return player


def describe_player(
    video: Video, body_frame: BodyFrame, frames: Int[np.ndarray, "D"]
) -> PlayerFeatures:
    """Features of some frames, in order."""
    crop = UprightCrop.of(video, body_frame)
    pictures = read_small(video, crop.width, set(frames.tolist()))
    numbered = zip(frames.tolist(), pictures, strict=True)
    players = (crop.cut(frame, picture) for frame, picture in numbered)
    return PlayerFeatures(frames, np.stack(list(side_by_side(describe_cells, players))))


def describe_cells(picture: UInt8[np.ndarray, "s s 3"]) -> UInt8[np.ndarray, "n n C"]:
    """Colour in CIE Lab, and gradient energy in four directions relative to all around."""
    lab = cv2.cvtColor(picture, cv2.COLOR_RGB2LAB)
    light = lab[..., 0].astype(np.float32)
    x, y = (cv2.Sobel(light, cv2.CV_32F, *order, ksize=1) for order in ((1, 0), (0, 1)))
    directions = (x, y, (x + y) * DIAGONAL, (x - y) * DIAGONAL)
    size = (len(picture) // STRIDE,) * 2
    energy = cv2.resize(
        cv2.merge([np.abs(d) for d in directions]), size, interpolation=cv2.INTER_AREA
    )
    around = cv2.blur(energy.sum(axis=2), (3 * SPACING + 1,) * 2)
    relative = 255 * cv2.blur(energy, (SPACING + 1,) * 2) / (around + FLAT)[..., None]
    own = cv2.resize(lab, size, interpolation=cv2.INTER_AREA)
    color = cv2.blur(own, (SPACING + 1,) * 2)
    return np.concatenate([color, np.minimum(relative, 255).astype(np.uint8), own], axis=2)


@dataclass(frozen=True, eq=False)
class JointAppearance:
    """What joints, and the middles of bones, look like on the annotated frames."""

    features: PlayerFeatures
    half: BodyHalf
    mean: Float32[np.ndarray, "D"]
    whitening: Float32[np.ndarray, "D C"]
    marks: tuple[Float32[np.ndarray, "_ C"], ...]
    """Descriptions of the marks of every joint."""
    bones: tuple[Float32[np.ndarray, "_ C"], ...]
    """Of the middles of every bone between marks."""

    def describe(
        self, frames: Int[np.ndarray, "P"], places: Complex[np.ndarray, "P"]
    ) -> Float32[np.ndarray, "P C"]:
        """Whitened descriptions of length one."""
        described = (self.features.around(frames, places) - self.mean) @ self.whitening
        size = np.linalg.norm(described, axis=1, keepdims=True)
        return described / np.maximum(size, 1e-9)

    def unlikeness(self, joints: Complex[np.ndarray, "T S J"]) -> Float32[np.ndarray, "T S 2 J"]:
        """How unlike their most similar mark joints look, 0-2: the mark of the joint itself, then
        of its mirror image; 0 for joints of the other half of the body.

        Described frames count for those around them, which have 0.
        """
        return self._compare(joints, self.marks, self.half.free, self.half.mirror)

    def bone_unlikeness(
        self, joints: Complex[np.ndarray, "T S J"]
    ) -> Float32[np.ndarray, "T S 2 B"]:
        """The same of the middles of limbs' bones; 0 for those of the trunk."""
        middles = bone_middles(self.half, joints)
        limbs = np.flatnonzero(self.half.limb)
        return self._compare(middles, self.bones, limbs, self.half.bone_mirror)

    def _compare(
        self,
        places: Complex[np.ndarray, "T S P"],
        marks: tuple[Float32[np.ndarray, "_ C"], ...],
        compared: Int[np.ndarray, "n"],
        mirror: Int[np.ndarray, "P"],
    ) -> Float32[np.ndarray, "T S 2 P"]:
        width, share = places.shape[1], len(places) / len(self.features.frames)
        result = np.zeros((*places.shape[:2], 2, places.shape[2]), np.float32)
        for first in range(0, len(self.features.frames), FRAMES_AT_A_TIME):
            frames = self.features.frames[first : first + FRAMES_AT_A_TIME]
            repeated = np.repeat(frames, width)
            for place in compared.tolist():
                described = self.describe(repeated, places[frames, :, place].ravel())
                for side, marked in enumerate((place, mirror[place])):
                    if len(marks[marked]):
                        alike = (described @ marks[marked].T).max(axis=1)
                        result[frames, :, side, place] = share * (1 - alike.reshape(-1, width))
        return result


def bone_middles(
    half: BodyHalf, joints: Complex[np.ndarray, "*n J"]
) -> Complex[np.ndarray, "*n B"]:
    """Places halfway along every bone."""
    return (joints[..., half.bones[:, 0]] + joints[..., half.bones[:, 1]]) / 2


def learn_appearance(
    features: PlayerFeatures, poses: AnnotatedPoses, joints: Complex[np.ndarray, "T J"]
) -> JointAppearance:
    """From annotated poses; `joints` are about where the body is in every frame.

    Places that optical flow between two marks is sure of were tried as further examples: no better
    on nine real clips (.1 points of PCK fewer).
    """
    random = np.random.default_rng(0)
    frames = random.choice(features.frames, SAMPLES)
    which = random.integers(0, joints.shape[1], SAMPLES)
    beside = random.normal(0, SAMPLE_SPREAD, (2, SAMPLES))
    sampled = features.around(frames, joints[frames, which] + beside[0] + 1j * beside[1])
    mean = sampled.mean(axis=0)
    variance, axes = np.linalg.eigh(np.cov(sampled.T))
    kept = slice(-min(COMPONENTS, len(axes)), None)
    noise = np.sqrt(variance[kept] + variance[kept][0] + 1e-9)
    whitening = (axes[:, kept] / noise).astype(np.float32)
    learnt = JointAppearance(features, poses.half, mean, whitening, (), ())

    def describe_marks(
        places: Complex[np.ndarray, "K P"], known: Bool[np.ndarray, "K P"]
    ) -> tuple[Float32[np.ndarray, "_ C"], ...]:
        return tuple(
            learnt.describe(poses.frames[marked], place[marked])
            for place, marked in zip(places.T, known.T, strict=True)
        )

    marks = describe_marks(poses.joints, poses.known)
    between = np.asarray(poses.known[:, poses.half.bones].all(axis=2))
    bones = describe_marks(bone_middles(poses.half, poses.joints), between)
    return JointAppearance(features, poses.half, mean, whitening, marks, bones)
