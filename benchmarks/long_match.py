"""A made match of some minutes, run as a user runs it: by the commands.

Prints how well cuts and usable shots are found, PA-MPJPE of the points, time of each command
against the length of the video, its peak memory (all, and without mapped files, which the system
can take back), what it read and wrote, and what stages take. With kills, the same commands are
killed at random and given again, and what they leave is held against what they left undisturbed.
"""

import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from threading import Event, Thread
from typing import Any

import numpy as np
from made_match import Piece, first_frames, join, long_match

from keyrecon.app.running import prepared
from keyrecon.io.formats.coco import write_coco
from keyrecon.io.formats.keyframes import read_keyframes
from keyrecon.io.formats.motion_file import read_motion
from keyrecon.io.formats.picks import read_picks, write_picks
from keyrecon.io.workspace import Workspace
from keyrecon.metrics import pa_mpjpe, read_truth
from keyrecon.pipeline import Options
from keyrecon.progress import silent
from keyrecon.records import PLAYER, Pick
from keyrecon.synthetic.marks import MarkOptions, mark_from_truth

SIZE, FPS = (1280, 720), 25
CLICKED = 3
"""Frames that a person clicks in."""
SAMPLED = 0.02
"""Seconds from one look at the memory to the next."""
LEAST_SHOWN = 0.05
"""Milliseconds per frame of a stage that is listed."""


def measure(folder: Path, other: Path, out: Path, minutes: float, kills: int) -> None:
    """Make the match, run the commands, print what they gave and took."""
    pieces, file = long_match(folder, other, minutes, FPS), out / "match.mp4"
    if not file.is_file():
        join(pieces, file, SIZE, FPS)
    frames = sum(piece.frames for piece in pieces)
    print(f"{len(pieces)} shots, {frames} frames, {frames / FPS / 60:.1f} minutes")
    begin, project = time.perf_counter(), out / "project"
    for name, told in run_all(project, file, pieces, folder, run_measured).items():
        show_command(name, told, frames)
    seconds = time.perf_counter() - begin
    print(f"all commands {seconds:.0f} s for {frames / FPS:.0f} s of video")
    cache = sum(path.stat().st_size for path in (project / "cache").iterdir())
    report = (project / "report.html").stat().st_size
    print(f"cache {cache / frames / 1000:.1f} kB per frame, report {report / 1e6:.1f} MB")
    score_shots(project, pieces)
    score_motion(project, pieces, folder)
    if kills:
        compare_killed(out, file, pieces, folder, kills, seconds)


Command = Callable[..., dict[str, Any]]


def run_all(
    project: Path, file: Path, pieces: Sequence[Piece], folder: Path, run: Command
) -> dict[str, dict[str, Any]]:
    """All that a user does from the beginning, with clicks and marks from the truth."""
    shutil.rmtree(project, ignore_errors=True)
    told = {"new": run("new", file, "--project", project)}
    write_picks(project / "picks.json", clicks(pieces, folder))
    told["keyframes"] = run("keyframes", project)
    truth, rows = read_truth(folder / "truth.npz"), source_rows(pieces)
    asked = read_keyframes(project / "keyframes.json")
    points = (truth[name][rows] for name in ("points2d", "points3d", "visible"))
    marks = mark_from_truth(asked, *points, MarkOptions(noise=1.0))
    write_coco(project / "marks.json", marks, SIZE)
    told["import"] = run("import", project, project / "marks.json")
    told["run"] = run("run", project)
    print(f"asked for {len(asked.frames)} frames")
    return told


def source_rows(pieces: Sequence[Piece]) -> np.ndarray:
    """The frame of the source that each frame shows; 0 where it shows none."""
    return np.concatenate(
        [
            (piece.shows == PLAYER) * (piece.first + piece.step * np.arange(piece.frames))
            for piece in pieces
        ]
    )


def clicks(pieces: Sequence[Piece], folder: Path) -> tuple[Pick, ...]:
    """Those of the sequence, in the first points that show the frames they are on."""
    rows, shown = (
        source_rows(pieces),
        np.repeat([piece.shows == PLAYER for piece in pieces], [piece.frames for piece in pieces]),
    )
    found: dict[int, list[Pick]] = {}
    for pick in read_picks(folder / "picks.json"):
        places = np.flatnonzero((rows == pick.frame) & shown)
        if len(places):
            found.setdefault(int(places[0]), []).append(replace(pick, frame=int(places[0])))
    return tuple(pick for frame in sorted(found)[:CLICKED] for pick in found[frame])


def environment() -> dict[str, str]:
    """That of the commands: this package, whatever is installed."""
    return {**os.environ, "PYTHONPATH": str(Path(__file__).parent.parent), "COLUMNS": "100"}


def run_measured(*words: object) -> dict[str, Any]:
    """A command in a process of its own that tells what it took."""
    began = time.perf_counter()
    script = Path(__file__).with_name("hours.py")
    ran = subprocess.run(
        [sys.executable, script, "--child", *map(str, words)],
        env=environment(), stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, check=True,
    )  # fmt: skip
    told: dict[str, Any] = json.loads(ran.stdout.splitlines()[-1])
    return told | {"wall": time.perf_counter() - began}


def run_command(words: list[str]) -> None:
    """Run a command in this process; the last line printed is JSON of what its stages took."""
    from keyrecon import cli
    from keyrecon.io.stages import StageStore

    watch, stages = MemoryWatch(), {}
    keep = StageStore.keep

    def keep_watched(
        store: StageStore, name: str, stage: Callable[..., Any], *inputs: object, **named: object
    ) -> Any:
        began, before = time.perf_counter(), watch.start()
        result = keep(store, name, stage, *inputs, **named)
        entry = stages.setdefault(name.partition("@")[0], {"seconds": 0.0, "own": 0, "left": 0})
        entry["seconds"] += time.perf_counter() - began
        entry["own"] = max(entry["own"], watch.peak - before)
        entry["left"] += watch.now() - before
        return result

    StageStore.keep = keep_watched  # type: ignore[method-assign]  # watched, and the same
    sys.argv = ["keyrecon", *words]
    try:
        cli.main()
    except SystemExit as stop:
        if stop.code:
            raise
    watch.stop()
    used = resource.getrusage(resource.RUSAGE_SELF)
    told = {
        "stages": stages,
        "peak": watch.highest,
        "all": 1024 * own_number("status", "VmHWM"),
        "processor": used.ru_utime + used.ru_stime,
        "read": own_number("io", "rchar"),
        "written": own_number("io", "wchar"),
    }
    print(json.dumps(told))


def own_number(file: str, name: str) -> int:
    """What the system tells of this process under /proc."""
    lines = (Path("/proc/self") / file).read_text().splitlines()
    return int(next(line.split()[1] for line in lines if line.startswith(f"{name}:")))


class MemoryWatch:
    """Looks at the memory of this process again and again, mapped files apart."""

    def __init__(self) -> None:
        """Begin."""
        self.peak = self.highest = 0
        self._end = Event()
        self._thread = Thread(target=self._look, daemon=True)
        self._thread.start()

    def now(self) -> int:
        """Bytes that are nobody's file."""
        return 1024 * own_number("status", "RssAnon")

    def start(self) -> int:
        """Count the peak from here on; what there is now."""
        self.peak = self.now()
        return self.peak

    def stop(self) -> None:
        """Look no more."""
        self._end.set()
        self._thread.join()

    def _look(self) -> None:
        while not self._end.wait(SAMPLED):
            now = self.now()
            self.peak, self.highest = max(self.peak, now), max(self.highest, now)


def show_command(name: str, told: dict[str, Any], frames: int) -> None:
    """What a command and its stages took."""
    share, each = told["wall"] / (frames / FPS), 1 / frames / 1000
    print(
        f"{name:<11}{told['wall']:7.1f} s, {share:.0%} of the video, of the processor "
        f"{told['processor'] / frames * 1000:.1f} ms per frame; peak {told['peak'] / 1e6:.0f} MB, "
        f"with mapped files {told['all'] / 1e6:.0f} MB; {told['read'] * each:.1f} kB per frame "
        f"read, {told['written'] * each:.1f} written"
    )
    for stage, took in told["stages"].items():
        wall = 1000 * took["seconds"] / frames
        if wall >= LEAST_SHOWN:
            print(
                f"  {stage:<11}{wall:6.2f} ms per frame   {took['own'] / 1e6:6.0f} MB at most "
                f"on top, {took['left'] / 1e6:5.0f} left ({took['left'] / frames / 1000:.2f} kB "
                "per frame)"
            )


def score_shots(project: Path, pieces: Sequence[Piece]) -> None:
    """F1 of the cuts within a frame, and the shots that are told rightly."""
    made = prepared(Workspace(project), Options(), silent)
    true, found = np.array(first_frames(pieces)[1:]), np.array(made.shots.first[1:])
    apart = np.abs(true[:, None] - found)
    f1 = 2 * np.sum(apart.min(axis=1, initial=9) <= 1) / max(len(true) + len(found), 1)
    usable = np.array(made.shots.usable)[made.shots.number]
    wrong = []
    for first, piece in zip(first_frames(pieces), pieces, strict=True):
        share = usable[first : first + piece.frames].mean()
        if abs(share - (piece.shows == PLAYER)) > 0.1:
            wrong.append(f"{piece.shows} at {first} ({share:.0%} used)")
    print(f"cuts F1 {f1:.3f}; {1 - len(wrong) / len(pieces):.1%} of the shots right", *wrong)


def score_motion(project: Path, pieces: Sequence[Piece], folder: Path) -> None:
    """PA-MPJPE of the frames that have a motion, of all points."""
    motion, rows = read_motion(project / "motion.npz"), source_rows(pieces)
    shown = np.repeat(
        [piece.shows == PLAYER for piece in pieces], [piece.frames for piece in pieces]
    )
    known = motion.known & shown
    truth = read_truth(folder / "truth.npz")["points3d"][rows[known]]
    error = 1000 * pa_mpjpe(motion.points3d[known], truth)
    print(f"PA-MPJPE {error:.1f} mm in {known.sum() / shown.sum():.1%} of the points' frames")


def compare_killed(
    out: Path, file: Path, pieces: Sequence[Piece], folder: Path, kills: int, seconds: float
) -> None:
    """The same by commands that are killed at random and given again.

    Undisturbed they took so many seconds, over which the kills are spread.
    """
    rng, left = random.Random(0), [kills]

    def run_killed(*words: object) -> dict[str, Any]:
        command = [sys.executable, "-m", "keyrecon", *map(str, words)]
        while True:
            kill = left[0] > 0 and words[0] in ("keyframes", "run")
            after = rng.uniform(3.0, max(6.0, 2 * seconds / kills)) if kill else None
            ended = run_for(command, after)
            if ended == 0:
                return {}
            if ended != -signal.SIGKILL:
                raise SystemExit(f"{words[0]} ended with {ended}")
            left[0] -= 1

    killed, whole = out / "killed", out / "project"
    run_all(killed, file, pieces, folder, run_killed)
    names = [Path(name) for name in ("keyframes.json", "motion.npz")]
    names += [path.relative_to(whole) for path in sorted((whole / "cache").glob("*.npz"))]
    other = [name for name in names if not same_bytes(whole / name, killed / name)]
    print(f"killed {kills - left[0]} times; of {len(names)} files these differ: {other or 'none'}")


def run_for(command: Sequence[str], seconds: float | None) -> int:
    """How a command ended that is killed after some seconds."""
    with subprocess.Popen(
        command, env=environment(), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as process:
        try:
            process.wait(seconds)
        except subprocess.TimeoutExpired:
            process.kill()
    return int(process.returncode)


def same_bytes(one: Path, other: Path) -> bool:
    """Whether both files are there, and alike."""
    return other.is_file() and one.read_bytes() == other.read_bytes()
