"""`keyrecon golf fit` on real swings, from six clicks alone.

Run: python benchmarks/golf_real.py [--half develop|report|all] [--only NAME ...] [--slowmo told]
         [--correct N]

Clips and marks by eye are those of `benchmarks/real.py`. Six joints are clicked in the first frame
in which all of them were marked; nothing else is told, unless `--slowmo told` gives slow motion's
factor, from the marked downswing and the .25 s that a tour player's takes. With `--correct N` a
second row is of the fit after a coach corrected it: visible joints and shaft of its N worst frames
at least .08 s apart, or in their stead top or hit where they are off by more than two frames, are
given as marked by eye.

Columns: share of the visible marked joints that the fitted ones are near to, within a fifth of the
trunk (PCK.2); share of the fitted joints that lie on the marked figure (body), at most a limb's
half width from its bones; share of the marked clubs that the fitted one is within 5 and 15 degrees
of; errors of start, top, hit and finish in frames at 30 per second of real time; tempo; whether
the fit is warned of; seconds per frame of the video.
"""

import argparse
import json
import logging
import time
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from real import DEVELOP, TRUTH, VIDEOS, Clip, load_clip

from keyrecon.app.golf import GolfFit, fit_video, without_slow_motion_search
from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.golf.clicks import GolfClicks
from keyrecon.golf.records import NO_MARKS, SwingMarks
from keyrecon.golf.swing_fit import GolfOptions
from keyrecon.io.formats.model_file import BUILT_IN_SWING_PRIOR, read_motion_model
from keyrecon.io.held_video import hold_frames
from keyrecon.io.stages import StageStore
from keyrecon.io.video import open_video
from keyrecon.numerics.geometry import signed_angles
from keyrecon.report.golf_pictures import draw_golfer

KEY_NAMES = ("start", "top", "hit", "finish")
CLICKED = ("head_top", "right_knee", "left_knee", "right_ankle", "left_ankle")
TOUR_DOWNSWING = 0.25
"""Seconds from the top to the hit, by which slow motion's factor is told."""
LIMB = 0.035
"""Half the width of a limb with its sleeve, and the error of a mark, player heights."""
FARTHEST_KEY, CORRECTIONS_APART = 2.0, 0.08
"""Frames at 30 per second by which a key posture may be off, and seconds between corrections."""
SLOW = 1.6
"""A clip whose downswing takes so many times a tour player's is slow motion."""


@dataclass(frozen=True, eq=False)
class Swing:
    """A clip with what was marked of its swing."""

    clip: Clip
    events: dict[str, int | None]
    clubs: dict[int, np.ndarray]
    left_handed: bool

    @property
    def slow_motion(self) -> float:
        """Factor of slow motion, 1 for real time."""
        top, hit = self.events["top"], self.events["hit"]
        factor = (hit - top) / self.clip.video.fps / TOUR_DOWNSWING
        return round(factor, 1) if factor > SLOW else 1.0


def load_swing(name: str) -> Swing:
    """A clip with what was marked of its swing."""
    notes = json.loads((TRUTH / f"{name}.json").read_text())
    clubs = {int(t): np.array(ends) for t, ends in notes["club"].items()}
    return Swing(load_clip(name), notes["events"], clubs, bool(notes.get("left_handed")))


def click(swing: Swing) -> GolfClicks:
    """Six clicks in the first frame in which all of these joints were marked."""
    truth, clip = swing.clip.truth, swing.clip
    hips = [LSP14.index("right_hip"), LSP14.index("left_hip")]
    asked = [LSP14.index(name) for name in CLICKED]
    row = int(np.isfinite(truth.joints[:, asked + hips]).all(axis=(1, 2)).argmax())
    joints = {n: tuple(truth.joints[row, j].tolist()) for n, j in zip(CLICKED, asked, strict=True)}
    joints["root"] = tuple(truth.joints[row, hips].mean(axis=0).tolist())
    hidden = tuple(n for n, j in zip(CLICKED, asked, strict=True) if not clip.seen[row, j])
    return GolfClicks(
        int(truth.frames[row]), (clip.video.width, clip.video.height), joints, hidden,
        left_handed=swing.left_handed, stature=1.8,
    )  # fmt: skip


def fit(
    swing: Swing, told: bool, work: Path, marks: SwingMarks = NO_MARKS
) -> tuple[GolfFit, float]:
    """A fit from six clicks and corrections, and its seconds."""
    video = open_video(
        VIDEOS / f"{swing.clip.name}.mp4", slow_motion=swing.slow_motion if told else 1.0
    )
    store = StageStore(work / swing.clip.name / "cache")
    model = read_motion_model(BUILT_IN_SWING_PRIOR)
    began = time.perf_counter()
    options = without_slow_motion_search(GolfOptions()) if told else GolfOptions()
    frames = hold_frames(video)
    found = fit_video(frames, click(swing), model, options, store.keep, marks=marks)
    return found, time.perf_counter() - began


def correct(swing: Swing, found: GolfFit, most: int) -> SwingMarks:
    """What a coach would mark in the worst frames of a fit."""
    figures, clip = measure(swing, found), swing.clip
    off = [abs(figures[k]) > FARTHEST_KEY and k in ("top", "hit") for k in KEY_NAMES]
    keys = np.array([swing.events[k] if o else np.nan for k, o in zip(KEY_NAMES, off, strict=True)])
    away = np.linalg.norm(
        found.fitted.motion.points2d[clip.truth.frames] - clip.truth.joints, axis=2
    )
    missed = ((away > 0.2 * clip.torso) & clip.seen).sum(axis=1)
    wrong = dict(zip(clip.truth.frames.tolist(), missed.astype(float).tolist(), strict=True))
    for t, angle in zip(sorted(swing.clubs), club_angles(swing, found.fitted.club2d), strict=True):
        wrong[t] = wrong.get(t, 0.0) + (2 * min(angle / 15, 2.0) if angle > 5 else 0.0)
    apart = CORRECTIONS_APART * clip.video.fps * swing.slow_motion
    frames: list[int] = []
    for t in sorted(wrong, key=lambda t: -wrong[t]):
        if len(frames) < most - sum(off) and wrong[t] and all(abs(t - o) >= apart for o in frames):
            frames.append(t)
    at = np.array(sorted(frames), dtype=np.int64)
    joints, shafts = np.full((len(at), 14, 2), np.nan), np.full((len(at), 2, 2), np.nan)
    for row, t in enumerate(at.tolist()):
        shafts[row] = swing.clubs.get(t, np.nan)
        for k in np.flatnonzero(clip.truth.frames == t):
            joints[row, clip.seen[k]] = clip.truth.joints[k, clip.seen[k]]
    return SwingMarks(at, joints, shafts, keys)


def figure_distance(points: np.ndarray, joints: np.ndarray) -> np.ndarray:
    """(K, J): distance of points to the nearest marked bone of their frame, px."""
    bones = [*LSP14.bones, (LSP14.index("right_shoulder"), LSP14.index("left_hip")),
             (LSP14.index("left_shoulder"), LSP14.index("right_hip"))]  # fmt: skip
    near = np.full(points.shape[:2], np.inf)
    for a, b in bones:
        start, way = joints[:, a, None], (joints[:, b] - joints[:, a])[:, None]
        share = ((points - start) * way).sum(-1) / np.maximum((way**2).sum(-1), 1e-9)
        foot = start + np.clip(share, 0, 1)[..., None] * way
        near = np.fmin(near, np.linalg.norm(points - foot, axis=-1))
    return near


def club_angles(swing: Swing, club: np.ndarray) -> np.ndarray:
    """Degrees between fitted and marked clubs."""
    frames = sorted(swing.clubs)
    one = club[frames, 1] - club[frames, 0]
    other = np.array([swing.clubs[t][1] - swing.clubs[t][0] for t in frames])
    return np.abs(np.degrees(signed_angles(one, other)))


COLUMNS = (
    f"{'clip':<21}{'PCK.2':>6}{'body':>6}{'club5':>6}{'club15':>7}{'start':>7}{'top':>6}{'hit':>6}"
    f"{'finish':>7}{'tempo':>6}{'s/f':>6}  warned"
)


def measure(swing: Swing, found: GolfFit) -> dict[str, float]:
    """The figures of a row; NaN where nothing was marked."""
    clip, fitted = swing.clip, found.fitted
    points = fitted.motion.points2d[clip.truth.frames]
    off = np.linalg.norm(points - clip.truth.joints, axis=2)[clip.seen]
    on = figure_distance(points, clip.truth.joints) < LIMB * found.observations.height
    angles = club_angles(swing, fitted.club2d)
    usual = 30 / (clip.video.fps * swing.slow_motion)
    apart = {
        name: np.nan if marked is None else float(key - marked) * usual
        for key, (name, marked) in zip(
            fitted.keys, ((k, swing.events[k]) for k in KEY_NAMES), strict=True
        )
    }
    return apart | {
        "pck": float((off < 0.2 * clip.torso).mean()),
        "body": float(on.mean()),
        "club5": float((angles < 5).mean()),
        "club15": float((angles < 15).mean()),
    }


def describe(swing: Swing, found: GolfFit, seconds: float) -> str:
    """One row of the table."""
    clip, figures = swing.clip, measure(swing, found)
    apart = "".join(
        f"{figures[k]:>{width}.1f}" if np.isfinite(figures[k]) else " " * (width - 1) + "-"
        for k, width in zip(KEY_NAMES, (7, 6, 6, 7), strict=True)
    )
    start, top, hit, _ = found.fitted.keys
    doubts = found.doubts
    return (
        f"{clip.name:<21}{figures['pck']:6.0%}{figures['body']:6.0%}"
        f"{figures['club5']:6.0%}{figures['club15']:7.0%}{apart}"
        f"{(top - start) / (hit - top):6.1f}{seconds / len(clip.video):6.2f}  "
        + "; ".join(f"{d.text} ({d.frame})" for d in doubts)
        + (f"  [{'; '.join(found.notes)[:120]}]" if found.notes else "")
    )


def write_sheet(swing: Swing, found: GolfFit, path: Path) -> None:
    """Fitted golfers on marked frames through the swing."""
    clip, fitted = swing.clip, found.fitted
    frames = clip.truth.frames[np.linspace(0, len(clip.truth.frames) - 1, 18).round().astype(int)]
    reach = clip.truth.joints.reshape(-1, 2)
    height = found.observations.height
    x0, y0 = np.maximum(np.nanmin(reach, axis=0) - 0.4 * height, 0).astype(int)
    x1, y1 = (np.nanmax(reach, axis=0) + 0.4 * height).astype(int)
    tiles = []
    for t in frames.tolist():
        drawn = draw_golfer(clip.video.frame(t), fitted, found.observations.camera, t)
        tile = np.ascontiguousarray(drawn[y0:y1, x0:x1])
        for ends, colour in ((fitted.club2d[t], (255, 255, 0)),
                             (found.observations.club[t], (0, 255, 0))):  # fmt: skip
            if np.isfinite(ends).all():
                a, b = (tuple(np.rint(p - (x0, y0)).astype(int).tolist()) for p in ends)
                cv2.line(tile, a, b, colour, max(1, tile.shape[1] // 200))
        tile = cv2.resize(tile, (300, round(300 * tile.shape[0] / tile.shape[1])))
        tiles.append(cv2.putText(tile, str(t), (6, 20), 0, 0.6, (255, 255, 0), 2))
    rows = [np.hstack(tiles[i : i + 6]) for i in range(0, len(tiles), 6)]
    cv2.imwrite(str(path), np.vstack(rows)[..., ::-1])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--half", choices=("develop", "report", "all"), default="all")
    parser.add_argument("--only", nargs="*", help="names of clips")
    parser.add_argument("--slowmo", choices=("told", "found"), default="found")
    parser.add_argument("--work", type=Path, default=Path("benchmarks/work/golf_real"))
    parser.add_argument("--correct", type=int, default=0, help="frames that are corrected at most")
    parser.add_argument("--sheets", action="store_true", help="write contact sheets")
    words = parser.parse_args()
    logging.basicConfig(level=logging.INFO, format="  %(message)s")
    print(COLUMNS)
    for file in sorted(TRUTH.glob("golf*.json")):
        half = "develop" if file.stem in DEVELOP else "report"
        if words.half not in (half, "all") or (words.only and file.stem not in words.only):
            continue
        swing = load_swing(file.stem)
        try:
            found, seconds = fit(swing, words.slowmo == "told", words.work)
        except KeyreconError as fault:
            print(f"{file.stem:<21}{fault}", flush=True)
            continue
        print(describe(swing, found, seconds), flush=True)
        if words.correct:
            marks = correct(swing, found, words.correct)
            found, seconds = fit(swing, words.slowmo == "told", words.work, marks)
            print(f"{describe(swing, found, seconds)}  {marks.frames.tolist()}", flush=True)
        if words.sheets:
            write_sheet(swing, found, words.work / f"{file.stem}.png")


if __name__ == "__main__":
    main()
