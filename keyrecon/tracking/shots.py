"""Where a video cuts from one shot to another.

Pictures are compared as thumbnails without their coarse brightness, the middle of one wherever in
the other it fits best: what lasts through a pan, a zoom or an exposure is the same scene. Over 18
real clips neighbours in time correlate by 0.80 or more, thumbnails of different clips by 0.47 at
most (6000 pairs). In a close-up somebody near moves one way and what is behind another, so that no
one shift fits: where these clips are blown up, neighbours correlate by 0.17 and more. There every
place of the picture may have moved by itself, by a smooth optical flow, and what it brings back is
held against the picture in finer detail. Cuts from one place to the same place are not found.

In a dissolve neighbours are alike throughout. But the picture in its middle is the weighted sum of
those before and after it, which have nothing in common: no motion of a camera gives that.
"""

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from keyrecon.io.video import Video
from keyrecon.numerics.picture_points import sample_picture

Grey = UInt8[np.ndarray, "y x"]

WIDTH = 64
"""Of a thumbnail, px. A quarter more or less, others with it: at most 1.9 points, 2.4 mm on four
clips."""
COARSE = 5.0
"""Standard deviation of the blur that is taken away, thumbnail px. A quarter more or less, others
with it: at most 1.9 points, 2.4 mm on four clips."""
SHIFT = 0.125
"""How far the picture may move from one frame to the next, shares of its width and height. A
quarter more or less, others with it: at most 1.9 points, 2.4 mm on four clips."""
SAME_SCENE = 0.6
"""Correlation above which two pictures show one scene: midway between neighbours and strangers. A
quarter more or less, others with it: at most 1.9 points, 2.4 mm on four clips."""
FINE = 192
"""Width of the pictures between which flow is sought, px."""
SMOOTH_FLOW = 2
"""Halvings of them at which it ends: finer, it makes any picture of any other. Ended at 0, 1 or at
2, one pair of strangers in a thousand comes out as alike as the least alike 19, 2 or 1 % of
neighbours do that no one shift brings together (249 pairs; fine pictures of 64, 192, 192 px)."""
NEIGHBOURS_BY_FLOW = 0.4
"""Correlation above which neighbours in time show one scene when one is brought back by the flow:
above it are 92 % of those neighbours, and 0.03 % of 3000 pairs of strangers. Of five close-ups in
each of 18 real clips 6 false cuts are left, of 130; of 120 cuts and as many dissolves between clips
none is lost by it."""
LEAST_SEEN = 1 / 3
"""Share of a picture that has to come from within the one before to be held against it by flow."""
FLOW_CONTRAST = 2.0
"""By how much pictures are stretched before their flow is sought: they vary by 30 grey values."""
PLAIN = 1.0
"""Contrast of a thumbnail below which it shows nothing, such as black, grey values. A quarter more
or less, others with it: at most 1.9 points, 2.4 mm on four clips."""
FLASH_FRAMES, FLASH_SECONDS = 3, 0.05
"""What is over within so many frames or seconds, a flash or a torn picture, is no cut. Frames a
quarter more or less, others with them: at most 1.9 points, 2.4 mm on four clips."""
SHORTEST_BLEND, LONGEST_BLEND = 8, 2.7
"""Frames that a dissolve takes, the doubles of which are tried in turn, and seconds at most."""
STRANGERS = 0.4
"""Correlation, place by place, up to which the pictures before and after may be of two scenes. A
quarter more or less, others with it: at most 1.9 points, 2.4 mm on four clips."""
BLENDED = 0.88
"""Correlation of the middle picture with the best sum of both from which it is that sum, and the
least weight that each has. Of 60 dissolves of 8 to 45 frames between moving clips all were found;
in 3056 frames of nine real and four rendered clips none was, nor where these were blown up two and
four times, which with .8 gave four. By flow the pictures before and after show one scene from
`SAME_SCENE` on, not from `NEIGHBOURS_BY_FLOW`: both may be blended in part themselves. Two false
dissolves in close-ups of real clips had .68 and .83."""
LEAST_WEIGHT = 0.25
UNEVEN_SUM = 0.2
"""How far from 1 the weights may add up to. Of blurred pictures the sum of two is the one half-way
between them as well, but fainter: its weights add up to more. A quarter more or less, others with
them: at most 1.9 points, 2.4 mm on four clips."""
MARGIN = 0.25
"""Share of the frames between these two pictures that is added on both sides: they may be blended
themselves already, by up to a third. A quarter more or less, others with it: at most 1.9 points,
2.4 mm on four clips."""


def blend_lengths(fps: float) -> tuple[int, ...]:
    """Frames that a dissolve may take, to be tried in turn."""
    doubled = max(0, int(np.log2(LONGEST_BLEND * fps / SHORTEST_BLEND)))
    return tuple(SHORTEST_BLEND << k for k in range(doubled + 1))


@dataclass(frozen=True, eq=False)
class Thumbnail:
    """A small picture without its coarse brightness."""

    pixels: Float[np.ndarray, "h w"]
    fine: UInt8[np.ndarray, "H W"]
    """The picture itself, larger."""

    @cached_property
    def contrast(self) -> float:
        """Standard deviation of the brightness."""
        return float(self.pixels.std())

    @cached_property
    def centred(self) -> Float[np.ndarray, "n"]:
        """All pixels in a row, with a mean of 0."""
        return self.pixels.ravel() - self.pixels.mean()

    @cached_property
    def detail(self) -> Float[np.ndarray, "H W"]:
        """The larger one without its coarse brightness."""
        return _without_coarse(self.fine)


@dataclass(eq=False)
class CutDetector:
    """Takes the frames of a video one by one."""

    blends: tuple[int, ...]
    """Frames that a dissolve may take, tried in turn."""
    flash: int
    """What is over within so many frames is no cut."""
    cuts: list[int] = field(default_factory=list)
    """First frames of new shots."""
    dissolves: list[int] = field(default_factory=list)
    """Those of them that are no shots but dissolves from one to the next."""
    _last: Thumbnail | None = None
    """Of the shot that goes on."""
    _since: list[Thumbnail] = field(default_factory=list)
    """Frames since the picture changed, not yet known to be a shot."""
    _recent: deque[Thumbnail] = field(default_factory=deque)
    """The last frames of the shot that goes on."""
    _blend: "_Blend | None" = None
    """The dissolve that is going on."""
    _count: int = 0

    @classmethod
    def at_rate(cls, fps: float) -> "CutDetector":
        """One for so many frames per second of real time."""
        return cls(blend_lengths(fps), max(FLASH_FRAMES, round(FLASH_SECONDS * fps)))

    @property
    def count(self) -> int:
        """Frames that it has seen."""
        return self._count

    def watch(self, pictures: Iterable[Grey]) -> Iterator[Grey]:
        """Pass the frames on, and look at each."""
        for grey in pictures:
            self.add(grey)
            yield grey
        self._end_blend()
        while self.cuts and self.cuts[-1] >= self._count:
            self.cuts.pop()

    def add(self, grey: Grey) -> None:
        """The next frame."""
        picture = thumbnail(grey)
        self._recent.append(picture)
        if len(self._recent) > self.blends[-1] + 1:
            self._recent.popleft()
        self._look_for_blend()
        if self._last is None or is_same_scene(self._last, picture, NEIGHBOURS_BY_FLOW):
            self._last, self._since = picture, []
        else:
            self._since.append(picture)
            if len(self._since) > self.flash:
                self._end_blend()
                if not self.cuts or self._count - self.flash > self.cuts[-1]:
                    self.cuts.append(self._count - self.flash)
                self._last, self._since = picture, []
                self._recent.clear()
        self._count += 1

    def _look_for_blend(self) -> None:
        """Whether a dissolve of some length ends with this frame, or the last one was the end."""
        now = find_blend(self._recent, self.blends)
        if now is not None:
            length, weight = now
            blend = _Blend(self._count - length + 1, self._count, abs(weight - 0.5))
            if self._blend is None or blend.uneven < self._blend.uneven:
                self._blend = blend
        elif self._blend is not None:
            self._end_blend()

    def _end_blend(self) -> None:
        """Take down the dissolve that was going on."""
        if self._blend is None:
            return
        before = self.cuts[-1] if self.cuts else 0
        margin = round(MARGIN * (self._blend.end - self._blend.first))
        first, end = max(self._blend.first - margin, before), self._blend.end + margin
        if first > before:
            self.cuts.append(first)
        if first > 0:
            self.dissolves.append(first)
        self.cuts.append(end)
        self._recent.clear()
        self._blend = None


class RecentPictures:
    """Pictures that were watched since the last shot, unless they are too many to be held."""

    def __init__(self, most: int) -> None:
        """At most so many bytes."""
        self._most = most
        self._first = 0
        self._pictures: list[Grey] = []

    def watch(self, pictures: Iterable[Grey]) -> Iterator[Grey]:
        """Pass the pictures on, and hold them."""
        for grey in pictures:
            self._pictures.append(grey)
            if grey.nbytes * len(self._pictures) > self._most:
                self._drop(len(self._pictures))
            yield grey

    def take(self, part: slice) -> list[Grey] | None:
        """Those of a shot, or None if not all of them are held; what lies before is let go."""
        start, stop = part.start - self._first, part.stop - self._first
        shot = self._pictures[max(0, start) : max(0, stop)]
        self._drop(max(0, min(stop, len(self._pictures))))
        return shot if start >= 0 and len(shot) == stop - start else None

    def _drop(self, count: int) -> None:
        del self._pictures[:count]
        self._first += count


def find_shots(watched: Iterator[Grey], detector: CutDetector, video: Video) -> Iterator[slice]:
    """Shots of the video as soon as their ends are known, while the pictures are watched."""
    start, cuts = 0, 0
    for _ in watched:
        if len(detector.cuts) == cuts or detector.cuts[-1] >= detector.count:
            continue
        cuts, last = len(detector.cuts), detector.cuts[-1]
        starts = [frame for frame in video.file_starts if frame < last]
        for end in sorted({*detector.cuts, *starts}):
            if end > start:
                yield slice(start, end)
                start = end
    for end in sorted({*detector.cuts, *video.file_starts, len(video)}):
        if end > start:
            yield slice(start, end)
            start = end


@dataclass(frozen=True)
class _Blend:
    """A dissolve, as well as it is known."""

    first: int
    end: int
    """The first frame that shows the new scene alone."""
    uneven: float
    """How far the weights of both scenes are from equal in its middle."""


def find_blend(recent: Sequence[Thumbnail], lengths: Sequence[int]) -> tuple[int, float] | None:
    """Length of a dissolve that ends with the last picture, and the weight of the scene before in
    its middle; None where there is no dissolve."""
    for length in lengths:
        if length >= len(recent):
            return None
        before, middle, after = recent[-1 - length], recent[-1 - length // 2], recent[-1]
        if min(one.contrast for one in (before, middle, after)) < PLAIN:
            continue
        a, m, b = (one.centred for one in (before, middle, after))
        aa, bb, ab = float(a @ a), float(b @ b), float(a @ b)
        if ab > STRANGERS * np.sqrt(aa * bb):
            continue
        weights = np.linalg.solve([[aa, ab], [ab, bb]], [a @ m, b @ m])
        if weights.min() < LEAST_WEIGHT or abs(weights.sum() - 1) > UNEVEN_SUM:
            continue
        blend = weights[0] * a + weights[1] * b
        alike = float(blend @ m) / float(np.linalg.norm(blend) * np.linalg.norm(m))
        if alike > BLENDED and not is_same_scene(before, after, SAME_SCENE):
            return length, float(weights[0] / weights.sum())
    return None


def thumbnail(grey: Grey) -> Thumbnail:
    """Of a picture."""
    return Thumbnail(_without_coarse(_reduced(grey, WIDTH)), _reduced(grey, FINE))


def _reduced(grey: Grey, width: int) -> UInt8[np.ndarray, "h w"]:
    height = max(width // 8, round(grey.shape[0] * width / grey.shape[1]))
    return cv2.resize(grey, (width, height), interpolation=cv2.INTER_AREA)


def _without_coarse(grey: UInt8[np.ndarray, "h w"]) -> Float[np.ndarray, "h w"]:
    values = grey.astype(np.float32)
    return values - cv2.GaussianBlur(values, (0, 0), COARSE)


def is_same_scene(first: Thumbnail, second: Thumbnail, by_flow: float) -> bool:
    """Whether two pictures show one scene, moved as a whole or, as alike as `by_flow`, each place
    by itself."""
    return correlation(first, second) >= SAME_SCENE or flow_correlation(first, second) >= by_flow


def correlation(first: Thumbnail, second: Thumbnail) -> float:
    """How alike two pictures are, -1 to 1, wherever the middle of the second fits best."""
    pixels = second.pixels
    down, right = (round(SHIFT * side) for side in pixels.shape)
    middle = pixels[down : pixels.shape[0] - down, right : pixels.shape[1] - right]
    contrasts = first.contrast, float(middle.std())
    if min(contrasts) < PLAIN:
        return float(max(contrasts) < PLAIN)
    return float(cv2.matchTemplate(first.pixels, middle, cv2.TM_CCOEFF_NORMED).max())


def flow_correlation(first: Thumbnail, second: Thumbnail) -> float:
    """How alike the second picture is to the first, -1 to 1, when every place of it is brought back
    by dense optical flow (Kroeger, Timofte, Dai, Van Gool, ECCV 2016)."""
    if min(first.contrast, second.contrast) < PLAIN:
        return 0.0
    estimator = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    estimator.setFinestScale(SMOOTH_FLOW)
    before, after = (_grey_values(one.detail) for one in (first, second))
    y, x = np.indices(after.shape)
    unmoved = np.zeros((*after.shape, 2), np.float32)
    origins = np.dstack([x, y]) + estimator.calc(after, before, unmoved)
    inside = ((origins >= 0) & (origins <= (x.max(), y.max()))).all(axis=-1)
    if inside.mean() < LEAST_SEEN:
        return 0.0
    back = sample_picture(first.detail, origins)[inside]
    return float(np.corrcoef(back, second.detail[inside])[0, 1]) if back.std() > 0 else 0.0


def _grey_values(detail: Float[np.ndarray, "h w"]) -> UInt8[np.ndarray, "h w"]:
    return np.clip(FLOW_CONTRAST * detail + 128, 0, 255).astype(np.uint8)
