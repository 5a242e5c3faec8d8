"""Marked joints followed by optical flow, from the mark before and from the mark after.

Between two marks near in time, each joint is followed forwards from the first and backwards from the
second by pyramidal Lucas-Kanade (Bouguet, Intel 2001). The two ways know nothing of one another: where
they meet, and the place looks like one of the marks, the joint is there, whatever colours and edges
say. Where they part, limbs have turned or hidden one another, and flow says nothing.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from keyrecon.io.video import Video
from keyrecon.progress import Progress, silent
from keyrecon.records import Annotations, FlowTracks


@dataclass(frozen=True)
class FlowOptions:
    """How marked joints are followed."""

    player: float = 240.0
    """Height of the player in the pictures, px; larger follows thin limbs better and is slower."""
    window: float = 0.1
    """Side of the window that is matched, player heights: a forearm's length, two wrists."""
    longest: float = 3.0
    """Marks farther apart than this are not joined, seconds."""
    gap: float = 0.03
    """Distance of the two ways at which they begin to disagree, player heights: two eyes mark the
    same joint .016 apart in the median, .042 in the worst tenth."""
    likeness: float = 0.6
    """Correlation with the better of both marks' patches at which a place is half believed."""


def track_marked_joints(
    video: Video,
    marks: Annotations,
    options: FlowOptions = FlowOptions(),
    progress: Progress = silent,
) -> FlowTracks:
    """Joints between marks, and how sure they are; NaN and 0 where flow says nothing."""
    count, height = len(video), _marked_height(marks)
    shape = count, len(marks.skeleton.names)
    joints, confidence = np.full((*shape, 2), np.nan), np.zeros(shape)
    width = min(video.width, max(64, round(video.width * options.player / height)))
    shrink, longest = width / video.width, round(options.longest * video.fps)
    row_of = {int(frame): row for row, frame in enumerate(marks.frames)}
    last = np.full(shape[1], -1)
    pictures: dict[int, UInt8[np.ndarray, "h w"]] = {}
    frames = progress(video.frames(width=width), "Following marks", count)
    for t, picture in enumerate(frames):
        pictures[t] = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
        pictures.pop(t - longest - 1, None)
        if t not in row_of:
            continue
        marked = np.isfinite(marks.joints[row_of[t], :, 0])
        for first in np.unique(last[marked & (last >= 0)]).tolist():
            group = np.flatnonzero(marked & (last == first))
            if t - first > longest or t - first < 2:
                continue
            ends = [shrink * marks.joints[row_of[f], group] for f in (first, t)]
            between = [pictures[u] for u in range(first, t + 1)]
            places, sure = _join(between, ends[0], ends[1], height * shrink, options)
            inside = slice(first + 1, t)
            joints[inside, group] = places[1:-1] / shrink
            confidence[inside, group] = sure[1:-1]
        last[marked] = t
    return FlowTracks(joints, confidence)


def _marked_height(marks: Annotations) -> float:
    """Size of the player, px: the largest extent of a marked body, median over whole bodies."""
    extent = np.nanmax(marks.joints[..., 1], axis=1) - np.nanmin(marks.joints[..., 1], axis=1)
    return float(np.percentile(extent, 80))


def _join(
    pictures: list[UInt8[np.ndarray, "h w"]],
    first: Float[np.ndarray, "g 2"],
    last: Float[np.ndarray, "g 2"],
    height: float,
    options: FlowOptions,
) -> tuple[Float[np.ndarray, "n g 2"], Float[np.ndarray, "n g"]]:
    """Places in all pictures from the first to the last, and how sure they are."""
    side = max(7, 2 * round(options.window * height / 2) + 1)
    ahead = np.stack(list(_follow(pictures, first, side)))
    back = np.stack(list(_follow(pictures[::-1], last, side)))[::-1]
    share = np.linspace(0, 1, len(pictures))[:, None]
    apart = np.linalg.norm(ahead - back, axis=-1) / height
    places = (1 - share)[..., None] * ahead + share[..., None] * back
    patches = [
        [_patch(picture, place, side) for place in spots]
        for picture, spots in ((pictures[0], first), (pictures[-1], last))
    ]
    alike = np.array(
        [
            [
                max(_correlation(_patch(picture, place, side), end[g]) for end in patches)
                for g, place in enumerate(spots)
            ]
            for picture, spots in zip(pictures, places, strict=True)
        ]
    )
    believed = np.clip((alike - options.likeness) / (1 - options.likeness) * 2 + 0.5, 0, 1)
    return places, np.exp(-0.5 * (apart / options.gap) ** 2) * believed


def _follow(
    pictures: list[UInt8[np.ndarray, "h w"]], start: Float[np.ndarray, "g 2"], side: int
) -> Iterator[Float[np.ndarray, "g 2"]]:
    """Points followed from picture to picture."""
    places = start.astype(np.float32)[:, None]
    yield start
    for before, after in zip(pictures, pictures[1:], strict=False):
        places, _, _ = cv2.calcOpticalFlowPyrLK(
            before, after, places, None, winSize=(side, side), maxLevel=3
        )
        yield places[:, 0].astype(np.float64)


def _patch(
    picture: UInt8[np.ndarray, "h w"], place: Float[np.ndarray, "2"], side: int
) -> Float[np.ndarray, "s s"]:
    x, y = (float(np.clip(v, -1e4, 1e4)) for v in place)
    cut = cv2.getRectSubPix(picture, (side, side), (x, y)).astype(np.float32)
    return cut - cut.mean()


def _correlation(one: Float[np.ndarray, "s s"], other: Float[np.ndarray, "s s"]) -> float:
    """Normalised correlation of two patches without their means."""
    size = float(np.linalg.norm(one) * np.linalg.norm(other))
    return float((one * other).sum()) / size if size > 0 else 0.0
