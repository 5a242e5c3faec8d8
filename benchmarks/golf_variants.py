"""Real golf clips made harder in ways that are known: what breaks a fit, and whether it says so.

Run: python benchmarks/golf_variants.py [--variant NAME ...] [--only CLIP ...] [--work DIR]

The clips are those of `golf_real.py` that may be looked at, and so are the columns. Variants, all
from fixed seeds:

    shake     the camera drifts by 4 % of the width and is held by hand, up to 13 px at 720 rows
    clicks    the clicks are of another frame, each off by 5 px at 720 rows (clicks2: once more)
    crowd     people of other colours sway close beside the player, on either side
    double    a second golfer swings beside the player, mirrored
    half      half the size, compressed hard
    rate      every other frame
    dark      a third of the light, and noise
    mirror    mirrored, with the player's hand told: the same swing to the digit

At the end stands how many fits of each variant are right, silently or with a warning, and wrong,
with one or silently; refused ones gave no fit and said why. A wrong one has fewer than LEAST_PCK of
the joints near the marked ones, or top or hit more than FARTHEST_KEY frames off.
"""

import argparse
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from changed_clips import (
    ROWS,
    Change,
    Picture,
    change_clip,
    crowd,
    dark,
    half,
    move_points,
    rate,
    same_place,
    shake,
)
from golf_real import COLUMNS, Swing, click, describe, load_swing, measure, write_sheet
from real import DEVELOP, TRUTH, Clip, mirror_clip

from keyrecon.app.golf import GolfFit, fit_video
from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.golf.clicks import GolfClicks
from keyrecon.io.formats.model_file import BUILT_IN_SWING_PRIOR, read_motion_model
from keyrecon.io.held_video import hold_frames
from keyrecon.io.stages import StageStore

LEAST_PCK, FARTHEST_KEY = 0.85, 3.0
"""Of a right fit: share of the joints near the marked ones, and frames of top and hit. Of joints on
the marked figure, which `body` counts, the fits of the clips as they are have no more than .81 to
.91."""


def double(clip: Clip) -> Change:
    """A second golfer swings beside the player: he himself, mirrored, three quarters as tall."""
    marked = clip.truth.joints.reshape(-1, 2)
    low, high = np.nanmin(marked, axis=0), np.nanmax(marked, axis=0)
    tall, width = high[1] - low[1], clip.video.width
    middle = float((low[0] + high[0]) / 2)
    side = 1 if width - 1 - high[0] > low[0] else -1

    def picture(_: int, shown: Picture) -> Picture:
        reach = int(0.45 * tall)
        left, right = (int(np.clip(middle + k * reach, 0, width)) for k in (-1, 1))
        rows = slice(max(0, int(low[1] - 0.1 * tall)), int(high[1] + 0.05 * tall))
        other = np.ascontiguousarray(shown[rows, left:right][:, ::-1])
        other = cv2.resize(other, None, fx=0.75, fy=0.75, interpolation=cv2.INTER_AREA)
        out = shown.copy()
        bottom, start = rows.stop, int(middle + side * 0.9 * tall - other.shape[1] / 2)
        first, last = max(0, start), min(width, start + other.shape[1])
        if last > first:
            out[bottom - len(other) : bottom, first:last] = other[:, first - start : last - start]
        return out

    return Change(picture, same_place)


CHANGES: dict[str, Callable[[Clip], Change]] = {
    "shake": shake, "crowd": crowd, "double": double, "half": half, "rate": rate, "dark": dark,
}  # fmt: skip
VARIANTS = ("plain", *CHANGES, "clicks", "clicks2", "mirror")


def change_swing(swing: Swing, change: Change, path: Path) -> Swing:
    """A clip with its truth as a variant shows it; the file is written once."""
    step = change.step
    clubs = {
        t // step: move_points(change, t, ends) for t, ends in swing.clubs.items() if t % step == 0
    }
    events = {k: None if t is None else t / step for k, t in swing.events.items()}
    return Swing(change_clip(swing.clip, change, path), events, clubs, swing.left_handed)


def mirror_swing(swing: Swing) -> Swing:
    """A clip in a mirror."""
    last = swing.clip.video.width - 1
    clubs = {t: ends * [-1, 1] + [last, 0] for t, ends in swing.clubs.items()}
    return Swing(mirror_clip(swing.clip), swing.events, clubs, not swing.left_handed)


def click_elsewhere(swing: Swing, seed: int) -> GolfClicks:
    """Six clicks of another marked frame of the address or the finish, each of them off."""
    usual, clip = click(swing), swing.clip
    random = np.random.default_rng(seed)
    frames = clip.truth.frames
    still = (frames < swing.events["start"]) | (frames == usual.frame)
    names = [LSP14.index(n) for n in usual.joints if n != "root"]
    hips = [LSP14.index("right_hip"), LSP14.index("left_hip")]
    whole = np.isfinite(clip.truth.joints[:, names + hips]).all(axis=(1, 2))
    row = int(random.choice(np.flatnonzero(still & whole)))
    noise = 5 * clip.video.height / ROWS
    places = {
        n: clip.truth.joints[row, hips].mean(axis=0) if n == "root"
        else clip.truth.joints[row, LSP14.index(n)] for n in usual.joints
    }  # fmt: skip
    joints = {n: tuple((p + random.normal(0, noise, 2)).tolist()) for n, p in places.items()}
    seen = clip.seen[row]
    hidden = tuple(n for n in joints if n != "root" and not seen[LSP14.index(n)])
    return replace(usual, frame=int(frames[row]), joints=joints, hidden=hidden)


def show_variant(name: str, variant: str, work: Path) -> tuple[Swing, GolfClicks]:
    """A variant of a clip, and its clicks."""
    swing = load_swing(name)
    if variant in CHANGES:
        file = work / "videos" / f"{name}-{variant}.mp4"
        swing = change_swing(swing, CHANGES[variant](swing.clip), file)
    elif variant == "mirror":
        swing = mirror_swing(swing)
    if variant.startswith("clicks"):
        return swing, click_elsewhere(swing, len(variant))
    return swing, click(swing)


VERDICTS = ("right", "right, warned", "wrong, warned", "wrong, silent", "refused")


def verdict(swing: Swing, found: GolfFit) -> str:
    """Whether a fit is right, and whether it is warned of."""
    figures = measure(swing, found)
    keys = [figures["top"], figures["hit"]]
    if figures["pck"] >= LEAST_PCK and not (np.abs(keys) > FARTHEST_KEY).any():
        return "right, warned" if found.doubts else "right"
    return "wrong, warned" if found.doubts else "wrong, silent"


def fit_variants(names: list[str], variant: str, work: Path) -> Iterator[str]:
    """Fit a variant of every clip; prints a row for each and gives its verdict."""
    model = read_motion_model(BUILT_IN_SWING_PRIOR)
    for name in names:
        swing, clicks = show_variant(name, variant, work)
        store = StageStore(work / f"{name}-{variant}" / "cache")
        try:
            found = fit_video(hold_frames(swing.clip.video), clicks, model, keep=store.keep)
        except KeyreconError as fault:
            print(f"{variant:<8}{name:<21}{fault}", flush=True)
            yield "refused"
            continue
        seconds = sum(store.seconds.values())
        print(f"{variant:<8}{describe(swing, found, seconds)}", flush=True)
        write_sheet(swing, found, work / f"{name}-{variant}.png")
        yield verdict(swing, found)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--variant", nargs="*", choices=VARIANTS, default=list(VARIANTS[:-1]))
    parser.add_argument("--only", nargs="*", help="names of clips")
    parser.add_argument("--work", type=Path, default=Path("benchmarks/work/golf_variants"))
    words = parser.parse_args()
    clips = [f.stem for f in sorted(TRUTH.glob("golf*.json")) if f.stem in DEVELOP]
    clips = [n for n in clips if n in (words.only or clips)]
    print(f"{'':<8}{COLUMNS}")
    verdicts = {v: Counter(fit_variants(clips, v, words.work)) for v in words.variant}
    print("\n" + f"{'':<10}" + "".join(f"{name:>15}" for name in VERDICTS))
    for variant, counts in (verdicts | {"all": sum(verdicts.values(), Counter())}).items():
        print(f"{variant:<10}" + "".join(f"{counts[name]:>15}" for name in VERDICTS))


if __name__ == "__main__":
    main()
