"""Videos of several shots, made here of points, close-ups, replays and black.

    python benchmarks/hours.py OUT --rendered SEQUENCE OTHER
    python benchmarks/hours.py OUT --rendered SEQUENCE OTHER --minutes 30 [--kills 10]
    python benchmarks/hours.py OUT --real CLIP CLIP ...

The first joins two points of a rendered sequence with a close-up, black, a replay in slow motion
and another player between, clicks in the first point alone, and prints what the shots are taken for
and PA-MPJPE of each point beside the same point run by itself at the same cost. SEQUENCE and OTHER
are folders that `accuracy.py` renders (video.mp4, picks.json, truth.npz). The second makes a match
of some minutes of them and runs the commands on it (`long_match.py`). The third joins real clips
with black and a close-up between; a person marks bodies in the first, as in `real.py`; prints the
shots and writes an overlay.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import long_match
import numpy as np
import real
from made_match import Piece, first_frames, join, made_match

from keyrecon.app.preparing import describe_shots
from keyrecon.io.formats.picks import read_picks
from keyrecon.io.stages import StageStore
from keyrecon.io.video import Video, open_video
from keyrecon.library import reconstruct
from keyrecon.metrics import pa_mpjpe, read_truth
from keyrecon.pipeline import Options, frames_to_mark, prepare
from keyrecon.records import PLAYER, Keyframes, Motion, Pick
from keyrecon.report.overlay import write_overlay
from keyrecon.synthetic.marks import MarkOptions, mark_from_truth


@dataclass(frozen=True, eq=False)
class Points:
    """Two points of one rendered sequence, of `length` frames from `starts` on."""

    folder: Path
    length: int
    starts: tuple[int, int]

    def run(
        self, video: Video, clicks: Sequence[Pick], rows: np.ndarray, budget: float, cache: Path
    ) -> tuple[Keyframes, Motion]:
        """The motion of a video whose frames show those of the sequence that `rows` names."""
        store, options = StageStore(cache), Options()
        options = replace(options, keyframes=replace(options.keyframes, budget=budget))
        preparation = prepare(video, clicks, options, store.keep)
        for line in describe_shots(preparation.shots):
            print(line)
        truth = read_truth(self.folder / "truth.npz")
        marks = mark_from_truth(
            preparation.keyframes,
            *(truth[name][rows] for name in ("points2d", "points3d", "visible")),
            MarkOptions(noise=1.0),
        )
        return preparation.keyframes, reconstruct(preparation, marks, options, store.keep)

    def clicks(self, point: int) -> list[Pick]:
        """Those of the sequence that lie in a point, whose frames count from its start."""
        first = self.starts[point]
        inside = (
            pick
            for pick in read_picks(self.folder / "picks.json")
            if first <= pick.frame < first + self.length
        )
        return [replace(pick, frame=pick.frame - first) for pick in inside]


def measure_rendered(folder: Path, other: Path, out: Path, length: int = 300) -> None:
    """Two points in one file against each by itself."""
    points = Points(folder, length, (120, 820))
    pieces = made_match(folder, other, length, points.starts)
    source = open_video(folder / "video.mp4")
    file = out / "match.mp4"
    join(pieces, file, (source.width, source.height), source.fps)
    firsts = first_frames(pieces)
    video = open_video(file)
    rows = np.concatenate([piece.first + np.arange(piece.frames) for piece in pieces])
    rows = np.minimum(rows, len(source) - 1)
    asked, motion = points.run(video, points.clicks(0), rows, 0.03, out / "joined")
    labels = len(asked.upper.frames) + len(asked.lower.frames)
    truth = read_truth(folder / "truth.npz")["points3d"]
    print(f"{labels} labels in {len(video)} frames; a motion in {motion.stretches}")
    for number, (start, shot) in enumerate(zip(points.starts, (0, len(pieces) - 1), strict=True)):
        rows = np.arange(start, start + length)
        own = open_video(folder / "video.mp4", start, start + length)
        alone = points.run(own, points.clicks(number), rows, 0.03, out / f"point{number}")
        cost = len(alone[0].upper.frames) + len(alone[0].lower.frames)
        joined = motion.points3d[firsts[shot] : firsts[shot] + length]
        print(
            f"point {number + 1}: PA-MPJPE {1000 * pa_mpjpe(joined, truth[rows]):.1f} mm in the "
            f"match, {1000 * pa_mpjpe(alone[1].points3d, truth[rows]):.1f} by itself ({cost} "
            "labels)"
        )


def measure_real(names: Sequence[str], out: Path) -> None:
    """Clips in one file; what its shots are taken for, and an overlay."""
    clips = [real.load_clip(name) for name in names]
    first = clips[0]
    pieces = [Piece(PLAYER, len(first.video), first.video.path)]
    for clip in clips[1:]:
        pieces += [
            Piece("black", 20),
            Piece("other", len(clip.video), clip.video.path),
            Piece("black", 20),
            Piece("close-up", 40, first.video.path, 10, focus=(0.5, 0.5)),
        ]
    pieces.append(Piece(PLAYER, len(first.video) // 2, first.video.path))
    size = first.video.width, first.video.height
    join(pieces, out / "real.mp4", size, first.video.fps)
    firsts = first_frames(pieces)
    video = open_video(out / "real.mp4")
    store, options = StageStore(out / "real"), Options()
    body = real.choose_bodies(first, 1)
    preparation = prepare(video, (), options, store.keep, marks=real.take(first, body, body))
    unsure = frames_to_mark(preparation, first.truth.frames[body], real.MORE_BODIES)
    print("asked for whole bodies in", unsure)
    rows = np.union1d(body, real.nearest_rows(first, unsure))
    bodies = real.take(first, rows, rows)
    preparation = prepare(video, (), options, store.keep, marks=bodies)
    print("made of", [(start, piece.shows) for start, piece in zip(firsts, pieces, strict=True)])
    print(*describe_shots(preparation.shots))
    marks = real.mark_keyframes(first, preparation.keyframes, rows)
    motion = reconstruct(preparation, marks, options, store.keep)
    write_overlay(out / "overlay.mp4", video, motion)
    known = motion.known[first.truth.frames]
    off = np.linalg.norm(motion.points2d[first.truth.frames] - first.truth.joints, axis=2)
    right = off[known][first.seen[known]] < 0.2 * first.torso
    print(f"{names[0]}: PCK@0.2 {right.mean():.1%}, marked frames among them")


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--rendered", nargs=2, type=Path)
    parser.add_argument("--minutes", type=float)
    parser.add_argument("--kills", type=int, default=0)
    parser.add_argument("--real", nargs="+")
    words = parser.parse_args()
    words.out.mkdir(parents=True, exist_ok=True)
    if words.rendered and words.minutes:
        long_match.measure(*words.rendered, words.out, words.minutes, words.kills)
    elif words.rendered:
        measure_rendered(*words.rendered, words.out)
    if words.real:
        measure_real(words.real, words.out)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--child"]:
        long_match.run_command(sys.argv[2:])
    else:
        main()
