"""Accuracy on real videos whose joints were marked by eye (`annotations/real/`).

    python benchmarks/real.py [--half develop|report|all] [--only NAME ...] [--cost 0.06]
        [--work DIR] [--sheets] [--mirrored]

For every clip: a whole body is marked in one clear frame and in three more where the program is
least sure (no colour is clicked), the
program asks for keyframes, each is marked where the nearest frame with marks by eye is, joints are
propagated and lifted, and every other frame marked by eye is held against the result:

    asked     keyframes that the program asked for, upper + lower
    cost      half bodies that were marked, as a share of the frames
    PCK@0.2   joints in sight within 0.2 of the torso (right hip to left shoulder, median of the
              clip), before refinement; PCK@0.1 alike; `hidden`: hidden joints placed by eye
    action    PCK@0.2 within the strokes or the swing
    lines     PCK@0.2 of straight lines in time between the same marks
    flow      PCK@0.2 of optical flow (Lucas-Kanade) from the marks before and after, blended
    swaps     share of frames in which both legs, or both arms, are exchanged
    knee      3D angle minus the angle in the picture, degrees, median where that is above 165

With `--mirrored` every clip is shown mirrored, its marks too: the same motion, of which the program
may choose other keyframes and see other noise. How far a clip's two rows differ is how far one of
them can be trusted.

The frames that are marked by a person are left out of every figure. The clips fall into two halves:
those of `develop` were looked at while the program was changed, those of `report` were only
measured until the halves were exchanged, once, at the end.
"""

import argparse
import json
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from keyrecon.app.console import show
from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.coco import read_coco
from keyrecon.io.stages import StageStore
from keyrecon.io.video import Video, open_video
from keyrecon.library import reconstruct
from keyrecon.pipeline import (
    Options,
    frames_off_marks,
    frames_to_mark,
    prepare,
    with_marked_keyframes,
)
from keyrecon.records import Annotations, Keyframes, Motion, Preparation
from keyrecon.report.drawing import draw_pose

ROOT = Path(__file__).parent.parent
VIDEOS = ROOT.parent / "shared" / "data" / "video"
TRUTH = ROOT / "annotations" / "real"
DEVELOP = (
    "tennis_rally",
    "tennis_broadcast_purple",
    "tennis_broadcast_indoor",
    "golf_faceon",
    "golf_dtl_slow",
    "golf_faceon_tee",
    "golf_faceon_slow",
    "golf_dtl_links",
    "golf_faceon_small",
)
LEGS = ("right_knee", "right_ankle"), ("left_knee", "left_ankle")
ARMS = ("right_elbow", "right_wrist"), ("left_elbow", "left_wrist")
MORE_BODIES = 3
"""Whole bodies that the program asks for where it is least sure, before the keyframes."""
STRAIGHT = 165.0
"""Degrees in the picture above which a knee counts as straight."""


@dataclass(frozen=True, eq=False)
class Clip:
    """A video and its marks by eye."""

    name: str
    video: Video
    truth: Annotations
    seen: np.ndarray
    """(K, J): joints that can be seen, not only placed."""
    action: np.ndarray
    """(K,): frames within strokes or the swing."""
    torso: float
    """Right hip to left shoulder, median, px."""


MIRRORED = "-mirrored"


def load_clip(name: str, mirrored: bool = False) -> Clip:
    """A clip with its truth, as it is or in a mirror."""
    file, video = TRUTH / f"{name}.json", open_video(VIDEOS / f"{name}.mp4")
    truth = read_coco(file, LSP14, len(video), (video.width, video.height))
    notes = json.loads(file.read_text())
    inside = set(notes["action"])
    for first, last in notes.get("strokes", []):
        inside |= set(range(first, last + 1))
    action = np.isin(truth.frames, sorted(inside))
    trunk = (
        truth.joints[:, LSP14.index("right_hip")] - truth.joints[:, LSP14.index("left_shoulder")]
    )
    torso = float(np.nanmedian(np.linalg.norm(trunk, axis=1)))
    clip = Clip(name, video, truth, truth.visible, action, torso)
    return mirror_clip(clip) if mirrored else clip


def mirror_clip(clip: Clip) -> Clip:
    """The same clip seen in a mirror: another video of the same motion."""
    video, truth = clip.video, clip.truth
    mirrored = replace(video, mirrored=not video.mirrored, turns=-video.turns % 4)
    joints = truth.joints[:, LSP14.mirror] * [-1, 1] + [video.width - 1, 0]
    visible = truth.visible[:, LSP14.mirror]
    marks = replace(truth, joints=joints, visible=visible)
    return replace(clip, name=clip.name + MIRRORED, video=mirrored, truth=marks, seen=visible)


def choose_bodies(clip: Clip, count: int) -> np.ndarray:
    """Rows of the frames that a person marks first: most joints in sight, far apart in time."""
    clear = clip.seen.sum(axis=1) - 4.0 * clip.action
    chosen = [int(np.argmax(clear))]
    while len(chosen) < count:
        away = np.abs(clip.truth.frames[:, None] - clip.truth.frames[chosen]).min(axis=1)
        chosen.append(int(np.argmax(clear + 8.0 * away / away.max())))
    return np.array(sorted(chosen))


def take(clip: Clip, upper: np.ndarray, lower: np.ndarray) -> Annotations:
    """What a person marked: upper and lower joints of rows of the truth."""
    rows = np.union1d(upper, lower)
    asked = np.where(LSP14.is_lower, np.isin(rows, lower)[:, None], np.isin(rows, upper)[:, None])
    joints = np.where(asked[..., None], clip.truth.joints[rows], np.nan)
    return Annotations(
        LSP14,
        clip.truth.frames[rows],
        joints,
        asked & clip.truth.visible[rows],
        np.zeros((len(rows), len(LSP14.bones)), dtype=np.int64),
    )


def nearest_rows(clip: Clip, frames: np.ndarray) -> np.ndarray:
    """The rows of the truth nearest to frames that were asked for, none twice."""
    rows: list[int] = []
    for frame in frames:
        order = np.argsort(np.abs(clip.truth.frames - frame), kind="stable")
        rows += [int(r) for r in order if r not in rows][:1]
    return np.array(sorted(rows))


def mark_keyframes(clip: Clip, asked: Keyframes, first: np.ndarray) -> Annotations:
    """Marks where the program asked for them, as near as there are marks by eye.

    At most every second frame with marks by eye is used, so that enough are left to measure on.
    """
    halves, most = [], len(clip.truth.frames) // 2 - len(first)
    for half in (asked.upper, asked.lower):
        rows = np.setdiff1d(nearest_rows(clip, half.frames), first)
        if len(rows) > most:
            rows = rows[np.linspace(0, len(rows) - 1, most).round().astype(int)]
        halves.append(np.union1d(rows, first))
    return take(clip, *halves)


@dataclass(frozen=True, eq=False)
class Result:
    """A clip, its marks and what came out."""

    clip: Clip
    asked: Keyframes
    marks: Annotations
    motion: Motion
    seconds: float


def mark_clip(
    clip: Clip, options: Options, store: StageStore
) -> tuple[Preparation, Keyframes, Annotations]:
    """Mark bodies, choose keyframes, mark them: (prepared, the keyframes asked for, all marks)."""
    first = choose_bodies(clip, 1)
    preparation = prepare(clip.video, (), options, store.keep, show, take(clip, first, first))
    unsure = frames_to_mark(preparation, clip.truth.frames[first], MORE_BODIES)
    first = np.union1d(first, nearest_rows(clip, unsure))
    bodies = take(clip, first, first)
    preparation = prepare(clip.video, (), options, store.keep, show, bodies)
    preparation = with_marked_keyframes(preparation, bodies, options)
    asked = preparation.keyframes
    marks = mark_keyframes(clip, asked, first)
    if len(frames_off_marks(preparation, marks)):
        preparation = prepare(clip.video, (), options, store.keep, show, marks)
    return preparation, asked, marks


def solve(clip: Clip, cost: float, work: Path) -> Result:
    """Mark bodies, choose keyframes, mark them, reconstruct."""
    store = StageStore(work / clip.name / "cache")
    began = time.perf_counter()
    options = replace(Options(), keyframes=replace(Options().keyframes, budget=cost))
    preparation, asked, marks = mark_clip(clip, options, store)
    motion = reconstruct(preparation, marks, options, store.keep, show)
    return Result(clip, asked, marks, motion, time.perf_counter() - began)


def interpolate_lines(marks: Annotations, count: int) -> np.ndarray:
    """Joints on straight lines in time between the marks, (T, J, 2)."""
    joints = np.full((count, len(LSP14.names), 2), np.nan)
    for j in range(len(LSP14.names)):
        known = np.isfinite(marks.joints[:, j, 0])
        for axis in range(2):
            if known.any():
                joints[:, j, axis] = np.interp(
                    np.arange(count), marks.frames[known], marks.joints[known, j, axis]
                )
    return joints


def track_flow(marks: Annotations, video: Video) -> np.ndarray:
    """Joints by pyramidal Lucas-Kanade from the marks before and after, blended by nearness."""
    greys = [cv2.cvtColor(f, cv2.COLOR_RGB2GRAY) for f in video.frames()]
    joints, weights = (np.zeros((len(greys), len(LSP14.names), n)) for n in (2, 1))
    for order in (1, -1):
        place = np.full((len(LSP14.names), 2), np.nan, np.float32)
        age = np.zeros(len(LSP14.names))
        frames = range(len(greys))[::order]
        for t in frames:
            if t != frames[0] and np.isfinite(place).any():
                known = np.isfinite(place[:, 0])
                moved, _, _ = cv2.calcOpticalFlowPyrLK(
                    greys[t - order], greys[t], place[known][:, None], None, winSize=(21, 21)
                )
                place[known] = moved[:, 0]
            age += 1
            row = np.flatnonzero(marks.frames == t)
            if len(row):
                marked = np.isfinite(marks.joints[row[0], :, 0])
                place[marked], age[marked] = marks.joints[row[0], marked], 1e-3
            known = np.isfinite(place[:, 0])
            joints[t, known] += place[known] / age[known, None]
            weights[t, known] += 1 / age[known, None]
    return joints / np.where(weights > 0, weights, np.nan)


def held_out(clip: Clip, marks: Annotations) -> np.ndarray:
    """(K, J): truth that nobody marked for the program."""
    known = np.isfinite(clip.truth.joints[..., 0])
    for row, frame in enumerate(marks.frames):
        at = np.flatnonzero(clip.truth.frames == frame)[0]
        known[at] &= ~np.isfinite(marks.joints[row, :, 0])
    return known


def hits(joints: np.ndarray, clip: Clip, share: float) -> np.ndarray:
    """(K, J): joints within a share of the torso of the truth."""
    off = np.linalg.norm(joints[clip.truth.frames] - clip.truth.joints, axis=2)
    return off < share * clip.torso


def count_swaps(joints: np.ndarray, clip: Clip, used: np.ndarray) -> float:
    """Share of frames in which legs or arms are exchanged: both joints nearer to the other's."""
    swapped, counted = 0, 0
    for right, left in (LEGS, ARMS):
        own = [LSP14.index(n) for n in (*right, *left)]
        other = [LSP14.index(n) for n in (*left, *right)]
        rows = np.flatnonzero(used[:, own].all(axis=1))
        found = joints[clip.truth.frames[rows]][:, own]
        straight = np.linalg.norm(found - clip.truth.joints[rows][:, own], axis=2).sum(axis=1)
        crossed = np.linalg.norm(found - clip.truth.joints[rows][:, other], axis=2).sum(axis=1)
        swapped += int((crossed + 0.4 * clip.torso < straight).sum())
        counted += len(rows)
    return swapped / max(counted, 1)


def angle(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Angle at b, degrees."""
    u, v = a - b, c - b
    cosine = (u * v).sum(-1) / (np.linalg.norm(u, axis=-1) * np.linalg.norm(v, axis=-1))
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


def knee_bias(result: Result) -> float:
    """Median of 3D knee angle minus that in the picture, where the truth's is straight."""
    off = []
    for side in ("right", "left"):
        names = [LSP14.index(f"{side}_{n}") for n in ("hip", "knee", "ankle")]
        flat = angle(*(result.clip.truth.joints[:, n] for n in names))
        solid = angle(*(result.motion.points3d[result.clip.truth.frames][:, n] for n in names))
        straight = flat > STRAIGHT
        off += (solid - flat)[straight].tolist()
    return float(np.median(off)) if off else float("nan")


COLUMNS = (
    f"{'clip':<34}{'half':<9}{'asked':>7}{'cost':>7}{'PCK.2':>7}{'PCK.1':>7}{'hidden':>8}"
    f"{'action':>8}{'lines':>7}{'flow':>7}{'swaps':>7}{'knee':>7}{'s':>6}"
)


def describe(result: Result) -> tuple[str, dict[str, float]]:
    """One row of the table."""
    clip, joints = result.clip, result.motion.points2d_propagated
    unknown = held_out(clip, result.marks)
    seen, hidden = unknown & clip.seen, unknown & ~clip.seen
    action = seen & clip.action[:, None]
    lines = interpolate_lines(result.marks, len(clip.video))
    flow = track_flow(result.marks, clip.video)
    near, close = hits(joints, clip, 0.2), hits(joints, clip, 0.1)
    labels = np.isfinite(result.marks.joints[..., 0]).any()
    upper = np.isfinite(result.marks.joints[:, ~LSP14.is_lower, 0]).any(axis=1).sum()
    lower = np.isfinite(result.marks.joints[:, LSP14.is_lower, 0]).any(axis=1).sum()
    figures = {
        "cost": (upper + lower) / 2 / len(clip.video) if labels else 0.0,
        "pck": near[seen].mean(),
        "pck1": close[seen].mean(),
        "hidden": near[hidden].mean() if hidden.any() else np.nan,
        "action": near[action].mean() if action.any() else np.nan,
        "lines": hits(lines, clip, 0.2)[seen].mean(),
        "flow": hits(flow, clip, 0.2)[seen].mean(),
        "swaps": count_swaps(joints, clip, unknown),
        "knee": knee_bias(result),
    }
    asked = f"{len(result.asked.upper.frames)}+{len(result.asked.lower.frames)}"
    half = "develop" if clip.name.removesuffix(MIRRORED) in DEVELOP else "report"
    f = figures
    text = (
        f"{clip.name:<34}{half:<9}{asked:>7}{f['cost']:7.1%}{f['pck']:7.1%}{f['pck1']:7.1%}"
        f"{f['hidden']:8.1%}{f['action']:8.1%}{f['lines']:7.1%}{f['flow']:7.1%}"
        f"{f['swaps']:7.1%}{f['knee']:7.1f}{result.seconds:6.0f}"
    )
    return text, figures


def tiles(clip: Clip, marks: Annotations, joints: np.ndarray) -> Iterator[np.ndarray]:
    """The held-out frames with the propagated joints, those that are off ringed in red."""
    unknown, near = held_out(clip, marks), hits(joints, clip, 0.2)
    tall = 3.4 * clip.torso
    for row, frame in enumerate(clip.truth.frames):
        if not (unknown[row] & clip.seen[row]).any():
            continue
        picture = clip.video.frame(int(frame)).copy()
        middle = np.nanmean(clip.truth.joints[row], axis=0)
        grow = 320 / tall
        turn = np.array([[grow, 0, 160 - grow * middle[0]], [0, grow, 160 - grow * middle[1]]])
        tile = cv2.warpAffine(picture, turn, (320, 320), flags=cv2.INTER_AREA)
        points = joints[frame] * grow + turn[:, 2]
        tile = draw_pose(tile, points, LSP14)
        for j in np.flatnonzero(unknown[row] & clip.seen[row] & ~near[row]):
            x, y = np.rint(clip.truth.joints[row, j] * grow + turn[:, 2]).astype(int)
            cv2.circle(tile, (int(x), int(y)), 6, (255, 40, 40), 2)
        cv2.putText(tile, str(frame), (6, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (255, 255, 0), 2)
        yield tile


def write_sheet(clip: Clip, marks: Annotations, joints: np.ndarray, file: Path) -> None:
    """A contact sheet of all held-out frames."""
    made = list(tiles(clip, marks, joints))
    made += [np.zeros_like(made[0])] * (-len(made) % 8)
    rows = [np.hstack(made[i : i + 8]) for i in range(0, len(made), 8)]
    cv2.imwrite(str(file), np.vstack(rows)[..., ::-1])


def summarise(table: list[dict[str, float]]) -> str:
    """Means over the clips, and the worst of them."""
    f = {name: np.nanmean([row[name] for row in table]) for name in table[0]}
    worst = min(row["pck"] for row in table)
    return (
        f"{'mean':<50}{f['cost']:7.1%}{f['pck']:7.1%}{f['pck1']:7.1%}{f['hidden']:8.1%}"
        f"{f['action']:8.1%}{f['lines']:7.1%}{f['flow']:7.1%}{f['swaps']:7.1%}{f['knee']:7.1f}"
        f"   worst PCK {worst:.1%}"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--half", choices=("develop", "report", "all"), default="all")
    parser.add_argument("--only", nargs="*", help="names of clips")
    parser.add_argument("--cost", type=float, default=0.06, help="annotation cost asked for")
    parser.add_argument("--work", type=Path, default=Path("benchmarks/work/real"))
    parser.add_argument("--sheets", action="store_true", help="write contact sheets")
    parser.add_argument("--mirrored", action="store_true", help="show every clip in a mirror")
    words = parser.parse_args()
    if not VIDEOS.is_dir():
        raise SystemExit(f"The real videos are not at {VIDEOS}.")
    words.work.mkdir(parents=True, exist_ok=True)
    names = [file.stem for file in sorted(TRUTH.glob("*.json"))]
    halves = {name: "develop" if name in DEVELOP else "report" for name in names}
    chosen = [n for n in names if words.half in (halves[n], "all")]
    print(COLUMNS)
    table = []
    for name in [n for n in chosen if not words.only or n in words.only]:
        try:
            result = solve(load_clip(name, words.mirrored), words.cost, words.work)
        except KeyreconError as fault:
            print(f"{name:<34}{halves[name]:<9}{fault}", flush=True)
            continue
        text, figures = describe(result)
        table.append(figures)
        print(text, flush=True)
        if words.sheets:
            joints = result.motion.points2d_propagated
            write_sheet(result.clip, result.marks, joints, words.work / f"{name}.jpg")
    if table:
        print(summarise(table))


if __name__ == "__main__":
    main()
