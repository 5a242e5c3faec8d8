"""Cuts found in real clips and close-ups of them, and between them.

    python benchmarks/cuts.py

Every clip is looked at as it is and in four close-ups, in which somebody who moves fills half of
the picture or more: all cuts found there are false. Then clips are joined in pairs, by a cut and by
a dissolve. Each once with one shift for the whole picture alone, as before, and once with dense
optical flow where no shift fits (`keyrecon/tracking/shots.py`).
"""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from real import VIDEOS

from keyrecon.io.video import open_video
from keyrecon.tracking import shots
from keyrecon.tracking.shots import CutDetector, Thumbnail

CLOSE_UPS = ((1, 0.5, 0.4), (2, 0.5, 0.4), (3, 0.4, 0.5), (4, 0.5, 0.4), (4, 0.5, 0.3))
"""How much closer, and where the room beside is cut away, shares of it."""
MOST = 400
"""Frames of a clip."""
JOINED = (320, 180)
"""Size of the pictures of joined clips, px."""
PAIRS, BEFORE, AFTER = 120, 30, 40
"""Pairs of clips, and frames on both sides."""
SHORTEST, LONGEST = 8, 44
"""Frames of a dissolve."""


def read_grey(file: Path) -> list[np.ndarray]:
    """Pictures of a clip."""
    video = open_video(file)
    part = video.part(np.arange(min(MOST, len(video))))
    return [cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY) for picture in part.frames()]


def closer(grey: np.ndarray, zoom: float, across: float, down: float) -> np.ndarray:
    """A part of a picture."""
    height, width = (int(side / zoom) for side in grey.shape)
    y, x = int((grey.shape[0] - height) * down), int((grey.shape[1] - width) * across)
    return grey[y : y + height, x : x + width]


def detect(pictures: list[np.ndarray], fps: float) -> CutDetector:
    """The cuts of pictures."""
    detector = CutDetector.at_rate(fps)
    for _ in detector.watch(pictures):
        pass
    return detector


def dissolve(one: list[np.ndarray], other: list[np.ndarray], length: int) -> list[np.ndarray]:
    """A moving clip that dissolves into another."""
    last = len(one) - 1
    blended = [
        cv2.addWeighted(
            one[min(BEFORE + t, last)], 1 - (t + 1) / (length + 1),
            other[min(t, len(other) - 1)], (t + 1) / (length + 1), 0,
        )
        for t in range(length)
    ]  # fmt: skip
    after = [other[min(length + t, len(other) - 1)] for t in range(AFTER)]
    return [*one[:BEFORE], *blended, *after]


def count_false(clips: dict[str, list[np.ndarray]], rates: dict[str, float]) -> list[int]:
    """Cuts found in each kind of close-up of all clips."""
    return [
        sum(
            len(detect([closer(grey, *view) for grey in clip], rates[name]).cuts)
            for name, clip in clips.items()
        )
        for view in CLOSE_UPS
    ]


def count_lost(clips: dict[str, list[np.ndarray]]) -> tuple[int, int, int]:
    """Pairs of clips, cuts between them that are not found to the frame, and dissolves lost."""
    small = {
        name: [cv2.resize(grey, JOINED) for grey in clip[: BEFORE + LONGEST]]
        for name, clip in clips.items()
    }
    rng, names, pairs, cuts, dissolves = np.random.default_rng(0), list(small), 0, 0, 0
    for _ in range(PAIRS):
        first, second = rng.choice(names, 2, replace=False)
        length = int(rng.integers(SHORTEST, LONGEST + 1))
        one, other = small[first], small[second]
        cut = detect([*one[:BEFORE], *other[:BEFORE]], 25.0)
        blend = detect(dissolve(one, other, length), 25.0)
        pairs, cuts = pairs + 1, cuts + (cut.cuts != [BEFORE])
        dissolves += not blend.dissolves
    return pairs, cuts, dissolves


def without_flow(first: Thumbnail, second: Thumbnail) -> float:
    """Flow tells nothing."""
    return -1.0


def main() -> None:
    """Print both tables."""
    files = sorted(VIDEOS.glob("*.mp4"))
    clips = {file.stem: read_grey(file) for file in files}
    rates = {file.stem: open_video(file).fps for file in files}
    with_flow: Callable[[Thumbnail, Thumbnail], float] = shots.flow_correlation
    views = "".join(f"{f'{zoom}x':>6}" for zoom, *_ in CLOSE_UPS)
    print(f"false cuts in {len(clips)} clips{views}   of pairs: cuts, dissolves lost")
    for name, flow in (("one shift", without_flow), ("one shift or flow", with_flow)):
        shots.flow_correlation = flow
        false, (pairs, cuts, dissolves) = count_false(clips, rates), count_lost(clips)
        row = "".join(f"{count:6}" for count in false)
        print(f"{name:<24}{row}   {pairs:8}: {cuts}, {dissolves}")


if __name__ == "__main__":
    main()
