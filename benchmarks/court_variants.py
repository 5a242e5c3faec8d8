"""The court in footage that nobody prepared for: real clips cropped, scaled, squeezed, spoilt.

    python benchmarks/court_variants.py [--work DIR] [--only NAME ...] [--clips NAME ...] [--none]

A stretch of each develop clip with a court is changed in one way at a time, encoded anew and given
to the calibration without a click. What it finds is held against the court found in the clip as it
is (to be looked at first: `benchmarks/world.py` draws it), carried along by the change:

    right     points of the court on the ground are within 1 % of the picture's width, median
    refused   the calibration says that it does not know, and why
    WRONG     a court is told, and it lies elsewhere: what must not happen

    off       of points of the court in the picture, % of its width, median and ninth decile
    found     share of the frames
    centre    the camera's place, off by so many % of its distance from the net, and in standard
              deviations that were told. Where the change is none that a camera makes (parts of
              the picture, squeezed ones) the ground is right all the same, and heights are not.

With --none the golf clips are changed, in which there is no court to be found.
"""

import argparse
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from real import DEVELOP, VIDEOS

from keyrecon.errors import KeyreconError
from keyrecon.io.video import Video, open_video
from keyrecon.io.video_writer import write_video
from keyrecon.tracking.camera_motion import estimate_camera_motion
from keyrecon.world.calibration import calibrate_court
from keyrecon.world.records import WorldCamera

FRAMES = 72
"""Of every clip, from its middle."""
RIGHT = 0.01
"""Share of the picture's width."""
FINE = 18
"""crf at which variants are encoded that are no worse for it."""
Points = Callable[[np.ndarray], np.ndarray]
Change = Callable[[np.ndarray, int], np.ndarray]


@dataclass(frozen=True)
class Variant:
    """A change of all frames of a clip."""

    name: str
    place: Callable[[tuple[int, int]], np.ndarray] = lambda size: np.eye(3)
    """Homography from the pixels of a clip of this size (width, height) to the variant's."""
    part: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0)
    """Left, top, right and bottom of the picture that is kept, in shares of the changed one."""
    look: Change = lambda picture, _: picture
    crf: int = FINE
    bend: float = 0.0
    """Radial distortion r (1 + bend r^2), r in half diagonals."""


def scaled(width: float, height: float | None = None) -> Callable[[tuple[int, int]], np.ndarray]:
    """To a width in px; with a height, both, whatever the proportions."""

    def place(size: tuple[int, int]) -> np.ndarray:
        sx = width / size[0]
        sy = sx if height is None else height / size[1]
        return np.array([[sx, 0, (sx - 1) / 2], [0, sy, (sy - 1) / 2], [0, 0, 1.0]])

    return place


def mirrored(size: tuple[int, int]) -> np.ndarray:
    """Left and right exchanged."""
    return np.array([[-1.0, 0, size[0] - 1], [0, 1, 0], [0, 0, 1]])


def rolled(degrees: float) -> Callable[[tuple[int, int]], np.ndarray]:
    """Turned about the middle."""

    def place(size: tuple[int, int]) -> np.ndarray:
        middle = (size[0] - 1) / 2, (size[1] - 1) / 2
        return np.vstack([cv2.getRotationMatrix2D(middle, degrees, 1.0), [0, 0, 1]])

    return place


def tone(gain: float, offset: float, gamma: float = 1.0) -> Change:
    """Other brightness and contrast."""
    table = 255 * (np.arange(256) / 255) ** gamma * gain + offset
    return lambda picture, _: np.clip(table, 0, 255).astype(np.uint8)[picture]


def blurred(share: float) -> Change:
    """Out of focus, standard deviation in shares of the width."""
    return lambda picture, _: cv2.GaussianBlur(picture, (0, 0), share * picture.shape[1])


def smeared(share: float) -> Change:
    """As by a camera that is swung, length in shares of the width."""

    def change(picture: np.ndarray, _: int) -> np.ndarray:
        length = max(2, round(share * picture.shape[1]))
        return cv2.filter2D(picture, -1, np.full((1, length), 1 / length))

    return change


def noisy(spread: float) -> Change:
    """Noise of a dark hall."""

    def change(picture: np.ndarray, frame: int) -> np.ndarray:
        noise = np.random.default_rng(frame).normal(0, spread, picture.shape[:2])
        return np.clip(picture + noise[..., None], 0, 255).astype(np.uint8)

    return change


def barred(share: float) -> Change:
    """Black bars above and below."""

    def change(picture: np.ndarray, _: int) -> np.ndarray:
        rows = round(share * len(picture))
        return np.vstack([0 * picture[:rows], picture[rows:-rows], 0 * picture[:rows]])

    return change


def captioned(picture: np.ndarray, _: int) -> np.ndarray:
    """A white frame, a table of scores with lines, and a caption."""
    made, (height, width) = picture.copy(), picture.shape[:2]
    cv2.rectangle(made, (8, 8), (width - 9, height - 9), (255, 255, 255), max(2, width // 400))
    for k in range(4):
        y = round((0.06 + 0.04 * k) * height)
        cv2.line(made, (width // 20, y), (width // 3, y), (240, 240, 240), 2)
    y = round(0.9 * height)
    cv2.rectangle(made, (width // 5, y), (4 * width // 5, y + height // 20), (250, 250, 250), -1)
    return made


VARIANTS = (
    Variant("as it is"),
    Variant("640 wide", scaled(640)),
    Variant("848 wide", scaled(848)),
    Variant("426 wide", scaled(426)),
    Variant("1920 wide", scaled(1920)),
    Variant("mirrored", mirrored),
    Variant("left 70 %", part=(0.0, 0.0, 0.7, 1.0)),
    Variant("right 70 %", part=(0.3, 0.0, 1.0, 1.0)),
    Variant("upper 70 %", part=(0.0, 0.0, 1.0, 0.7)),
    Variant("lower 60 %", part=(0.0, 0.4, 1.0, 1.0)),
    Variant("middle 60 %", part=(0.2, 0.2, 0.8, 0.8)),
    Variant("upright", part=(0.34, 0.0, 0.66, 1.0)),
    Variant("crf 38", crf=38),
    Variant("640, crf 36", scaled(640), crf=36),
    Variant("dark", look=tone(0.4, 0)),
    Variant("bright", look=tone(1.5, 20)),
    Variant("flat", look=tone(0.35, 90)),
    Variant("gamma 2", look=tone(1.0, 0, 2.0)),
    Variant("out of focus", look=blurred(0.0022)),
    Variant("swung", look=smeared(0.008)),
    Variant("noise", look=noisy(14)),
    Variant("bars", look=barred(0.12)),
    Variant("captions", look=captioned),
    Variant("rolled 4", rolled(4.0)),
    Variant("squeezed 4:3", scaled(960, 720)),
    Variant("wide lens", bend=-0.12),
)
SPOILT = ("as it is", "640 wide", "mirrored", "bright", "middle 60 %", "captions")
"""Variants in which no court is looked for."""


def write_variant(video: Video, variant: Variant, file: Path) -> Points:
    """Encode it; returns the way from the clip's pixels to the variant's."""
    size = video.width, video.height
    place = variant.place(size)
    corners = cv2.perspectiveTransform(
        np.array([[(0.0, 0.0), (size[0] - 1.0, size[1] - 1.0)]]), place
    )[0]
    whole = size if variant.name.startswith("rolled") else np.abs(corners[1] - corners[0]) + 1
    whole = np.rint(whole).astype(int)
    left, top, right, bottom = (np.tile(whole, 2) * variant.part).astype(int) // 2 * 2
    first = (len(video) - min(FRAMES, len(video))) // 2
    warp = _bent_maps(variant.bend, size)

    def frames() -> Iterator[np.ndarray]:
        for k in range(min(FRAMES, len(video))):
            picture = video.frame(first + k)
            if warp is not None:
                picture = cv2.remap(picture, *warp, cv2.INTER_LINEAR)
            how = cv2.INTER_AREA if whole[0] < size[0] else cv2.INTER_LINEAR
            if variant.name.endswith("wide"):
                picture = cv2.resize(picture, whole.tolist(), interpolation=how)
            elif not np.array_equal(place, np.eye(3)):
                picture = cv2.warpPerspective(picture, place, whole.tolist())
            yield variant.look(picture[top:bottom, left:right], k)

    write_video(file, frames(), video.fps, variant.crf)

    def points(pixels: np.ndarray) -> np.ndarray:
        bent = _bend(pixels, variant.bend, size)
        return cv2.perspectiveTransform(bent[None], place)[0] - (left, top)

    return points


def _bend(pixels: np.ndarray, bend: float, size: tuple[int, int]) -> np.ndarray:
    middle = (np.array(size) - 1) / 2
    away = (pixels - middle) / (np.hypot(*size) / 2)
    return middle + away * (1 + bend * (away**2).sum(1, keepdims=True)) * np.hypot(*size) / 2


def _bent_maps(bend: float, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray] | None:
    """Where each pixel of a bent picture comes from."""
    if not bend:
        return None
    grid = np.stack(np.meshgrid(np.arange(size[0]), np.arange(size[1])), -1).reshape(-1, 2)
    there = grid.astype(float)
    for _ in range(8):
        there = there - (_bend(there, bend, size) - grid)
    maps = there.reshape(size[1], size[0], 2).astype(np.float32)
    return maps[..., 0].copy(), maps[..., 1].copy()


@dataclass(frozen=True, eq=False)
class Reference:
    """The court of a clip as it is."""

    video: Video
    camera: WorldCamera

    def judge(self, found: WorldCamera, points: Points, variant: Variant, size: np.ndarray) -> str:
        """One row, beginning with the verdict."""
        first = (len(self.video) - len(found.found)) // 2
        grid = np.meshgrid(np.linspace(-5.4, 5.4, 9), np.linspace(-11.8, 11.8, 17))
        court = np.column_stack([grid[0].ravel(), grid[1].ravel(), np.zeros(grid[0].size)])
        turned = -1.0 if variant.name == "mirrored" else 1.0
        off: list[float] = []
        for t in np.flatnonzero(found.found)[::4]:
            there = points(self.camera.project(first + t, court))
            seen = ((there > 0) & (there < size)).all(axis=1)
            ways = [[turned, 1.0, 1.0], [-turned, -1.0, 1.0]]
            here = [np.linalg.norm(found.project(t, court * w) - there, axis=1)[seen] for w in ways]
            off += min(here, key=np.median).tolist()
        share = np.array(off) / size[0]
        middle, worst = np.median(share), np.percentile(share, 90)
        verdict = "right" if middle < RIGHT else "WRONG"
        t, true = np.flatnonzero(found.found)[0], self.camera.centre[first]
        ways = [np.array([turned, 1.0, 1.0]), np.array([-turned, -1.0, 1.0])]
        away = min((found.centre[t] * w - true for w in ways), key=np.linalg.norm)
        deviations = np.abs(away / found.sd_centre[t]).max()
        return (
            f"{verdict:<9}{middle:7.2%}{worst:8.2%}{found.found.mean():8.0%}"
            f"{np.linalg.norm(away) / np.linalg.norm(true):9.1%} ({deviations:.1f} sd)"
        )


def run(name: str, reference: Reference | None, video: Video, variant: Variant, work: Path) -> str:
    """One variant of one clip: its verdict and figures."""
    file = work / f"{name}-{variant.name.replace(' ', '-')}.mp4"
    points = write_variant(video, variant, file)
    changed = open_video(file)
    try:
        found = calibrate_court(changed, estimate_camera_motion(changed))
    except KeyreconError as fault:
        return f"refused  {str(fault)[:75]}"
    finally:
        file.unlink()
    if reference is None:
        return f"WRONG    {found.found.mean():.0%}"
    return reference.judge(found, points, variant, np.array([changed.width, changed.height]))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--work", type=Path, default=Path("bench"))
    parser.add_argument("--only", nargs="*", default=[], help="names of variants")
    parser.add_argument("--clips", nargs="*", default=[], help="instead of the develop half")
    parser.add_argument("--none", action="store_true", help="clips without a court")
    told = parser.parse_args()
    told.work.mkdir(parents=True, exist_ok=True)
    kind = "golf" if told.none else "tennis"
    chosen = told.only or (SPOILT if told.none else ())
    counts: Counter[str] = Counter()
    print(f"{'':<44}{'off, median, 9th':>24}{'found':>8}{'centre':>18}")
    for name in told.clips or [n for n in DEVELOP if n.startswith(kind)]:
        video = open_video(VIDEOS / f"{name}.mp4")
        reference = None
        if not told.none:
            reference = Reference(video, calibrate_court(video, estimate_camera_motion(video)))
        for variant in VARIANTS:
            if chosen and variant.name not in chosen:
                continue
            row = run(name, reference, video, variant, told.work)
            counts[row.split()[0]] += 1
            print(f"{name:<26}{variant.name:<15}{row}", flush=True)
    print(", ".join(f"{count} {verdict}" for verdict, count in counts.items()))


if __name__ == "__main__":
    main()
