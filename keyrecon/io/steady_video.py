"""A video as a camera that stands still would have filmed it, without frames shown twice.

Whoever compares pictures with one scene wants every pixel of the scene in one place. So each
picture is warped by the camera's homography into the picture of one frame; what no picture shows at
a place is taken from the others, which see it (a plate, the median of some). Frames are decoded
once and held, warped when they are read.
"""

import hashlib
from collections.abc import Container, Iterator
from dataclasses import dataclass, fields
from functools import cached_property

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from keyrecon.io.held_video import HeldVideo, hold_frames
from keyrecon.io.video import Video
from keyrecon.numerics.order_statistics import value_of_rank

PLATE_FRAMES = 15
"""Frames whose median fills what another frame does not show."""


@dataclass(frozen=True, eq=False)
class SteadyVideo(Video):
    """Some frames of a video, all in the picture of one of them."""

    source: HeldVideo
    numbers: Int[np.ndarray, "T"]
    """Frames of the source."""
    warps: Float[np.ndarray, "T 3 3"] | None
    """Homographies from the source's pixels to these; none where the camera stood still."""

    @cached_property
    def fingerprint(self) -> str:
        """Tells this video from others: its file, its frames, its warps, what evens its light."""
        digest = hashlib.sha256(self.source.fingerprint.encode() + self.numbers.tobytes())
        for more in (self.warps, self.source.exposure):
            if more is not None:
                digest.update(more.tobytes())
        return digest.hexdigest()[:32]

    def frames(
        self, start: int = 0, stop: int | None = None, width: int | None = None
    ) -> Iterator[UInt8[np.ndarray, "h w 3"]]:
        """Frames start..stop-1 in order; reduced to `width` if given."""
        stop = len(self) if stop is None else min(stop, len(self))
        yield from self._read(set(range(start, stop)), stop - 1, width)

    def chosen_frames(self, numbers: Container[int], last: int) -> Iterator[np.ndarray]:
        """The frames with these numbers up to `last`."""
        yield from self._read(numbers, min(last, len(self) - 1), None)

    def grey_frames(
        self, wanted: Container[int] | None = None
    ) -> Iterator[UInt8[np.ndarray, "h w"]]:
        """The brightness of all frames, or of the wanted ones, in order."""
        rows = [t for t in range(len(self)) if wanted is None or t in wanted]
        chosen = set(self.numbers[rows].tolist())
        place = 0
        for number, grey in zip(sorted(chosen), self.source.grey_frames(chosen), strict=True):
            while place < len(rows) and self.numbers[rows[place]] == number:
                plain = self.warps is None
                yield grey if plain else self._warp(rows[place], grey, self._grey_plate)
                place += 1

    def _read(
        self, wanted: Container[int], last: int, width: int | None
    ) -> Iterator[UInt8[np.ndarray, "h w 3"]]:
        rows = [t for t in range(last + 1) if t in wanted]
        chosen = set(self.numbers[rows].tolist())
        if not chosen:
            return
        plain = self.warps is None
        if plain and width:
            pictures = (self.source.frame(int(self.numbers[t]), width) for t in rows)
            yield from pictures
            return
        read = self.source.chosen_frames(chosen, max(chosen))
        for row, picture in zip(rows, read, strict=True):
            warped = picture if plain else self._warp(row, picture, self._colour_plate)
            if width and width != self.width:
                size = (width, max(1, round(self.height * width / self.width)))
                warped = cv2.resize(warped, size, interpolation=cv2.INTER_AREA)
            yield warped

    def _warp(self, row: int, picture: np.ndarray, plate: np.ndarray) -> np.ndarray:
        """A picture in the common one, the plate where it shows nothing."""
        if self.warps is None:
            return picture
        return _fill(*_warped(picture, self.warps[row], (self.width, self.height)), plate)

    @cached_property
    def _colour_plate(self) -> UInt8[np.ndarray, "h w 3"]:
        """The scene that all frames together show."""
        chosen = self._plate_frames()
        return self._plate(self.source.chosen_frames(chosen, max(chosen)), chosen)

    @cached_property
    def _grey_plate(self) -> UInt8[np.ndarray, "h w"]:
        """The same in brightness."""
        chosen = self._plate_frames()
        return self._plate(self.source.grey_frames(chosen), chosen)

    def _plate_frames(self) -> dict[int, int]:
        """Rows of the frames that the scene is taken from, by their numbers in the source."""
        rows = np.unique(np.linspace(0, len(self) - 1, PLATE_FRAMES).astype(int))
        return dict(zip(self.numbers[rows].tolist(), rows.tolist(), strict=True))

    def _plate(self, pictures: Iterator[np.ndarray], chosen: dict[int, int]) -> np.ndarray:
        """The median of some pictures, black where every frame shows the scene itself."""
        if self.warps is None:
            raise ValueError("a camera that stands still needs no plate")
        size, needed = (self.width, self.height), self._filled
        stack, seen = [], []
        for picture, row in zip(pictures, chosen.values(), strict=True):
            warped, there = _warped(picture, self.warps[row], size)
            stack.append(warped[needed])
            seen.append(there[needed])
        plate = np.zeros((*needed.shape, *stack[0].shape[1:]), np.uint8)
        plate[needed] = _masked_median(np.stack(stack), np.stack(seen))
        return plate

    @cached_property
    def _filled(self) -> Bool[np.ndarray, "h w"]:
        """Pixels that some frame does not show."""
        everywhere = np.ones((self.height, self.width), bool)
        for warp in self.warps if self.warps is not None else ():
            everywhere &= _seen(warp, (self.source.width, self.source.height), everywhere.shape)
        return ~everywhere


def steady_video(
    video: Video,
    numbers: Int[np.ndarray, "T"],
    time: Float[np.ndarray, "T"],
    warps: Float[np.ndarray, "T 3 3"] | None,
    size: tuple[int, int],
) -> SteadyVideo:
    """Some frames of a video at their times in the world, warped into pictures of some size."""
    source = video if isinstance(video, HeldVideo) else hold_frames(video)
    inherited = {field.name: getattr(video, field.name) for field in fields(Video)}
    fps = 1 / float(np.median(np.diff(time))) if len(time) > 1 else video.fps
    inherited |= {"width": size[0], "height": size[1], "stamps": video.stamps[numbers]}
    inherited |= {"time": time, "fps": fps, "exposure": None}  # which the source evens
    return SteadyVideo(**inherited, source=source, numbers=numbers, warps=warps)


def _warped(
    picture: np.ndarray, warp: Float[np.ndarray, "3 3"], size: tuple[int, int]
) -> tuple[np.ndarray, Bool[np.ndarray, "h w"]]:
    """A picture in the common one, and where it shows something."""
    moved = cv2.warpPerspective(
        picture, warp, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    return moved, _seen(warp, (picture.shape[1], picture.shape[0]), (size[1], size[0]))


def _seen(
    warp: Float[np.ndarray, "3 3"], size: tuple[int, int], shape: tuple[int, ...]
) -> Bool[np.ndarray, "h w"]:
    """Where a warped picture of some size shows something in the common one of some shape."""
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * (np.array(size) - 1.0)
    frame = cv2.perspectiveTransform(corners[None], warp)[0]
    seen = np.zeros(shape, np.uint8)
    cv2.fillConvexPoly(seen, np.round(frame).astype(np.int32), 1)
    return seen > 0


def _fill(picture: np.ndarray, seen: Bool[np.ndarray, "h w"], plate: np.ndarray) -> np.ndarray:
    if not seen.all():
        np.copyto(picture, plate, where=~(seen if picture.ndim == 2 else seen[..., None]))
    return picture


def _masked_median(
    stack: UInt8[np.ndarray, "n p *c"], seen: Bool[np.ndarray, "n p"]
) -> UInt8[np.ndarray, "p *c"]:
    """Median over the pictures that see a pixel; over all where none does."""
    count = seen.sum(axis=0)
    middle = np.maximum(count - 1, 0) // 2
    colors = stack.reshape(*seen.shape, -1)
    channels = [value_of_rank(colors[..., c], middle, seen) for c in range(colors.shape[2])]
    median: np.ndarray = np.stack(channels, axis=-1).reshape(stack.shape[1:])
    never = count == 0
    median[never] = np.median(stack[:, never], axis=0)
    return median
