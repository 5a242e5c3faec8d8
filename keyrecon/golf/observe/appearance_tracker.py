"""Tracks of clicked points by an appearance that adapts: the WSL tracker.

After Jepson, Fleet and El-Maraghi (PAMI 25, 2003): every pixel of a patch around the point is
explained by one of three components. The stable one is a Gaussian learnt slowly over time, the
wandering one is what was there in the last frame, the lost one is anything at all. The patch moves
by translation, turn and scale so that the pixels agree with the component they belong to, stable
pixels weighing most by their small deviation; so clothes that hardly change hold the patch in
place, and what passes over it is lost. Here the pixels are Lab colours instead of the phases of
steerable filters, and pixels off the player do not count.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from keyrecon.numerics.picture_points import sample_picture
from keyrecon.ranges import within

PATCH_SIDE = 21
"""Pixels of a patch along each side. Chosen on rendered swings, like all values here; see
benchmarks/golf_tracks.py."""
_SIDE = np.arange(PATCH_SIDE) - (PATCH_SIDE - 1) / 2
GRID = np.stack([along.ravel() for along in np.meshgrid(_SIDE, _SIDE)])
"""Where its pixels lie around its middle, to the right and down."""
LEVELS = (4.0, 2.0, 1.0)
"""Blur of the picture and the patch from coarse to fine, pixels of the patch."""
LOST_DENSITY = 1e-6
"""Density of the lost component over Lab colours."""
LEAST_SPREAD = 4.0
"""Deviation that a stable pixel has at least: video noise, grey levels."""
CHROMA_WEIGHT = 1.6
"""Weight of a and b against L: chroma varies less with light."""


@dataclass(frozen=True)
class AppearanceOptions:
    """How a patch is tracked."""

    size: Annotated[float, within(0.005, 2)] = 0.1
    """Side of the patch, player heights."""
    memory: Annotated[float, within(0.02, 8)] = 0.4
    """Time over which the stable component is learnt, seconds."""
    wander: Annotated[float, within(0.3, 100)] = 7.0
    """Deviation of a pixel from that of the last frame, grey levels."""
    steps: Annotated[int, within(1, 200)] = 6
    """Steps of the least-squares at each level."""
    turn: Annotated[float, within(0.003, 1)] = 0.05
    """Usual turn of a patch from one frame to the next, radians; its scale likewise."""
    move: Annotated[float, within(0.002, 0.6)] = 0.03
    """Usual change of the movement from one frame to the next, player heights."""


@dataclass(frozen=True, eq=False)
class _Model:
    """Appearance of a patch: colours with the share of each pixel's components."""

    stable: Float[np.ndarray, "n 3"]
    variance: Float[np.ndarray, "n"]
    last: Float[np.ndarray, "n 3"]
    share: Float[np.ndarray, "n 3"]
    """Of the stable, wandering and lost component."""


@dataclass(frozen=True, eq=False)
class PointTrack:
    """Where a patch moved."""

    places: Float[np.ndarray, "T 2"]
    """px of the pictures given"""
    turns: Float[np.ndarray, "T"]
    """Radians from the first frame."""
    confidence: Float[np.ndarray, "T"]
    """Share of the patch that is not lost, 0-1; a patch that slides off the player loses pixels."""


def track_patch(
    pictures: Sequence[UInt8[np.ndarray, "h w 3"]],
    weights: Sequence[UInt8[np.ndarray, "h w"]],
    start: Float[np.ndarray, "2"],
    height: float,
    fps: float,
    options: AppearanceOptions = AppearanceOptions(),
) -> PointTrack:
    """Track a point of the first of some Lab pictures through the others.

    `weights` tell where the player is (255); `height` is that of the player in these pictures, px.
    """
    pixel = options.size * height / PATCH_SIDE
    pose = np.array([*start, 0.0, np.log(pixel)])
    colors, inside = _cut(pictures[0], weights[0], pose)
    whole = float(inside.sum())
    shares = np.tile([0.4, 0.4, 0.2], (len(colors), 1))
    model = _Model(colors, np.full(len(colors), 100.0), colors, shares)
    rate = 1 / max(2.0, options.memory * fps)
    usual = np.array([options.move * height] * 2 + [options.turn] * 2)
    poses, confidence, speed = [pose], [1.0], np.zeros(4)
    for picture, weight in zip(pictures[1:], weights[1:], strict=True):
        before = pose
        expected = _ExpectedPose(before + speed, usual)
        pose = _align(model, picture, weight, expected, options)
        colors, inside = _cut(picture, weight, pose)
        responsibility = _responsibilities(model, colors, options)
        model = _learn(model, colors, responsibility, rate)
        speed = np.array([*(pose - before)[:2], 0.0, 0.0])
        poses.append(pose)
        inlying = float((inside * (1 - responsibility[:, 2])).sum())
        confidence.append(inlying / max(float(inside.sum()), whole, 1e-9))
    path = np.array(poses)
    return PointTrack(path[:, :2], path[:, 2], np.array(confidence))


def _places(pose: Float[np.ndarray, "4"]) -> Float[np.ndarray, "n 2"]:
    """Picture positions of the patch's pixels."""
    x, y = GRID * np.exp(pose[3])
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.stack([pose[0] + c * x - s * y, pose[1] + s * x + c * y], axis=1)


def _cut(
    picture: UInt8[np.ndarray, "h w 3"] | Float[np.ndarray, "h w 3"],
    weight: UInt8[np.ndarray, "h w"],
    pose: Float[np.ndarray, "4"],
) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n"]]:
    """Colours of a patch, and how far each pixel is on the player, 0-1."""
    return _read(picture, weight, _places(pose))


def _read(
    picture: UInt8[np.ndarray, "h w c"] | Float[np.ndarray, "h w c"],
    weight: UInt8[np.ndarray, "h w"],
    places: Float[np.ndarray, "n 2"],
) -> tuple[Float[np.ndarray, "n c"], Float[np.ndarray, "n"]]:
    """Lab layers of a picture at some places, chroma strengthened, and the weights there."""
    at = places[:, None]
    read = sample_picture(picture, at, cv2.BORDER_REPLICATE)
    inside = sample_picture(weight, at)
    strength = np.tile((1.0, CHROMA_WEIGHT, CHROMA_WEIGHT), read.shape[2] // 3)
    return read[:, 0].astype(float) * strength, inside.ravel() / 255.0


@dataclass(frozen=True, eq=False)
class _ExpectedPose:
    """Where a patch is expected, and how far off it usually is."""

    pose: Float[np.ndarray, "4"]
    """Place, turn and the logarithm of the scale."""
    spread: Float[np.ndarray, "4"]


def _align(
    model: _Model,
    picture: UInt8[np.ndarray, "h w 3"],
    weight: UInt8[np.ndarray, "h w"],
    expected: _ExpectedPose,
    options: AppearanceOptions,
) -> Float[np.ndarray, "4"]:
    """The pose at which a picture agrees best with the appearance, from coarse to fine."""
    rows, columns = _around(weight.shape, expected.pose)
    corner = np.array([float(columns.start), float(rows.start), 0.0, 0.0])
    crop, weight = picture[rows, columns].astype(np.float32), weight[rows, columns]
    pose = expected.pose - corner
    expected = _ExpectedPose(pose.copy(), expected.spread)
    for level in LEVELS:
        layers = _differentiate(crop, level * np.exp(pose[3]) / 2)
        smooth = _blur_model(model, level)
        for _ in range(options.steps):
            step = _step(smooth, layers, weight, pose, expected, options)
            pose = pose + step
            if np.abs(step[:2]).max() < 0.02:
                break
    return pose + corner


def _around(shape: tuple[int, int], guess: Float[np.ndarray, "4"]) -> tuple[slice, slice]:
    """Rows and columns of the part of a picture that a patch may reach."""
    reach = int(1.5 * PATCH_SIDE * np.exp(guess[3])) + 4
    size = np.array(shape[::-1])
    low = np.clip(np.round(guess[:2]).astype(int) - reach, 0, size - 4)
    high = np.clip(low + 2 * reach, low + 4, size)
    return slice(int(low[1]), int(high[1])), slice(int(low[0]), int(high[0]))


def _blur_model(model: _Model, level: float) -> _Model:
    """The appearance as seen through the blur of a level."""

    def blur(colors: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        return cv2.GaussianBlur(
            colors.reshape(PATCH_SIDE, PATCH_SIDE, 3), (0, 0), level / 2
        ).reshape(-1, 3)

    return replace(model, stable=blur(model.stable), last=blur(model.last))


def _differentiate(picture: Float[np.ndarray, "h w 3"], blur: float) -> Float[np.ndarray, "h w 9"]:
    """A blurred picture and its slopes to the right and down."""
    soft = cv2.GaussianBlur(picture, (0, 0), blur)
    slopes = [cv2.Sobel(soft, cv2.CV_32F, dx, 1 - dx, scale=1 / 8) for dx in (1, 0)]
    return np.concatenate([soft, *slopes], axis=2)


def _step(
    model: _Model,
    layers: Float[np.ndarray, "h w 9"],
    player: UInt8[np.ndarray, "h w"],
    pose: Float[np.ndarray, "4"],
    expected: _ExpectedPose,
    options: AppearanceOptions,
) -> Float[np.ndarray, "4"]:
    """A Gauss-Newton step."""
    places = _places(pose)
    read, inside = _read(layers, player, places)
    colors, right, down = np.split(read, 3, axis=1)
    responsibility = _responsibilities(model, colors, options)
    weight = inside[:, None] * responsibility[:, :2] / np.stack(
        [model.variance, np.full(len(colors), options.wander**2)], axis=1
    )  # fmt: skip
    x, y = (places - pose[:2]).T[..., None]
    slopes = np.stack([right, down, down * x - right * y, right * x + down * y], axis=2)
    total = weight.sum(axis=1)
    residual = colors * total[:, None] - weight[:, :1] * model.stable - weight[:, 1:] * model.last
    # Neighbouring pixels of a blurred picture tell the same: they count as a ninth of evidence.
    flat = slopes.reshape(-1, len(pose))
    normal = (flat * np.repeat(total, slopes.shape[1])[:, None]).T @ flat / 9
    slope = residual.ravel() @ flat / 9
    prior = np.diag(1 / expected.spread**2)
    return -np.linalg.solve(normal + prior, slope + prior @ (pose - expected.pose))


def _responsibilities(
    model: _Model, colors: Float[np.ndarray, "n 3"], options: AppearanceOptions
) -> Float[np.ndarray, "n 3"]:
    """Probability of each component, by how well it explains a pixel."""
    densities = []
    for mean, variance in ((model.stable, model.variance), (model.last, options.wander**2)):
        square = ((colors - mean) ** 2).sum(axis=1) / variance
        densities.append(np.exp(-0.5 * square) / (2 * np.pi * variance) ** 1.5)
    densities.append(np.full(len(colors), LOST_DENSITY))
    likely = model.share * np.stack(densities, axis=1)
    return likely / likely.sum(axis=1, keepdims=True)


def _learn(
    model: _Model,
    colors: Float[np.ndarray, "n 3"],
    responsibility: Float[np.ndarray, "n 3"],
    rate: float,
) -> _Model:
    """The appearance after one more frame; pixels that lost their stable part begin anew."""
    share = (1 - rate) * model.share + rate * responsibility
    pull = rate * responsibility[:, 0] / share[:, 0]
    off = colors - model.stable
    stable = model.stable + pull[:, None] * off
    variance = (1 - pull) * (model.variance + pull * (off**2).sum(axis=1) / 3)
    anew = share[:, 0] < 0.1
    stable[anew], variance[anew], share[anew] = colors[anew], 100.0, (0.2, 0.5, 0.3)
    return _Model(stable, np.maximum(variance, LEAST_SPREAD**2), colors, share)
