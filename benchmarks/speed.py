"""Time of the commands as a user waits for them, stage by stage, on one rendered sequence.

    python benchmarks/speed.py [--work DIR] [--mocap DIR] [--only NAME] [--frames N]
        [--package FOLDER]

Runs `keyrecon keyframes` and `keyrecon run` in processes of their own, everything made anew, marks
from the truth, and prints wall clock and processor time of each command in milliseconds per frame,
the stages and pictures within them, what is left (Python's start, reading, writing the report), the
peak memory, and the size of the cache. `--package` measures the checkout in another folder with
the same script. Quote times with the number of cores; on a busy machine compare processor time.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
PICTURES = {
    "keyframe pictures": ("keyrecon.app.keyframing", "write_keyframe_pictures"),
    "report pictures": ("keyrecon.report.page", "cut_pictures"),
    "report page": ("keyrecon.report.page", "build_page"),
}
"""What takes time beside the stages: the module that calls it, and its name there."""
LEAST_SHOWN = 0.05
"""Milliseconds per frame."""


def measure_here(words: list[str]) -> None:
    """Run a command in this process; the last line printed is JSON of what took how long."""
    from importlib import import_module

    from keyrecon import cli
    from keyrecon.io.stages import StageStore

    seconds: dict[str, float] = {}

    def timed(name: str, work: Callable[..., Any], *inputs: object, **named: object) -> Any:
        began = time.perf_counter()
        result = work(*inputs, **named)
        seconds[name] = seconds.get(name, 0.0) + time.perf_counter() - began
        return result

    for name, (module, function) in PICTURES.items():
        place = import_module(module)
        setattr(place, function, partial(timed, name, getattr(place, function)))
    keep = StageStore.keep

    def keep_timed(
        store: StageStore, name: str, stage: Callable[..., Any], *inputs: object, **named: object
    ) -> Any:
        return timed(name.partition("@")[0], keep, store, name, stage, *inputs, **named)

    StageStore.keep = keep_timed  # type: ignore[method-assign]  # timed, and the same
    sys.argv = ["keyrecon", *words]
    try:
        cli.main()
    except SystemExit as stop:
        if stop.code:
            raise
    used = resource.getrusage(resource.RUSAGE_SELF)
    print(
        json.dumps(
            {
                "seconds": seconds,
                "processor": used.ru_utime + used.ru_stime,
                "peak": used.ru_maxrss / 1024,
            }
        )
    )


def measure(package: Path, *words: object) -> dict:
    """The same in a process of its own, with its wall clock."""
    began = time.perf_counter()
    ran = subprocess.run(
        [sys.executable, __file__, "--child", *map(str, words)],
        env={**os.environ, "PYTHONPATH": str(package), "COLUMNS": "100"},
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        check=True,
    )
    told = json.loads(ran.stdout.splitlines()[-1])
    return told | {"wall": time.perf_counter() - began}


def mark(project: Path, folder: Path, frames: int) -> None:
    """Marks from the truth at the keyframes."""
    from keyrecon.io.formats.coco import write_coco
    from keyrecon.io.formats.keyframes import read_keyframes
    from keyrecon.io.workspace import Workspace
    from keyrecon.metrics import read_truth
    from keyrecon.synthetic.marks import MarkOptions, mark_from_truth

    truth, video = read_truth(folder / "truth.npz"), Workspace(project).video()
    marks = mark_from_truth(
        read_keyframes(project / "keyframes.json"),
        *(truth[name][:frames] for name in ("points2d", "points3d", "visible")),
        MarkOptions(noise=1.0),
    )
    write_coco(project / "marks.json", marks, (video.width, video.height))


def main() -> None:
    """Print the table."""
    from sequences import DATA, TENNIS, render

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--work", type=Path, default=Path("benchmarks/work"))
    parser.add_argument("--mocap", type=Path, default=DATA / "mocap")
    parser.add_argument("--only", default=TENNIS[0].name, choices=[s.name for s in TENNIS])
    parser.add_argument("--frames", type=int, default=1800)
    parser.add_argument("--package", type=Path, default=ROOT)
    words = parser.parse_args()
    sequence = next(s for s in TENNIS if s.name == words.only)
    folder = render(sequence, words.work, words.mocap)
    with tempfile.TemporaryDirectory() as made:
        project, package = Path(made) / "project", words.package
        trim = () if words.frames >= 1800 else ("--end", words.frames)
        measure(package, "new", folder / "video.mp4", "--project", project, *trim)
        picks = json.loads((folder / "picks.json").read_text())
        picks["picks"] = [p for p in picks["picks"] if p["frame"] < words.frames]
        (project / "picks.json").write_text(json.dumps(picks))
        commands = {"keyframes": measure(package, "keyframes", project)}
        mark(project, folder, words.frames)
        measure(package, "import", project, project / "marks.json")
        commands["run"] = measure(package, "run", project)
        cache = sum(file.stat().st_size for file in (project / "cache").iterdir())
    print(f"{sequence.name}: {words.frames} frames, {os.cpu_count()} cores")
    for name, told in commands.items():
        show_command(name, told, 1000 / words.frames)
    print(f"cache {cache / words.frames / 1000:.1f} kB per frame")


def show_command(name: str, told: dict, each: float) -> None:
    """Milliseconds per frame of a command and of what it did."""
    print(
        f"{name:<20}{told['wall'] * each:8.1f} wall clock {told['processor'] * each:8.1f} "
        f"processor   peak {told['peak']:.0f} MB"
    )
    for part, seconds in told["seconds"].items():
        if seconds * each >= LEAST_SHOWN:
            print(f"  {part:<18}{seconds * each:8.1f}")
    rest = told["wall"] - sum(told["seconds"].values())
    print(f"  {'everything else':<18}{rest * each:8.1f}")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--child"]:
        measure_here(sys.argv[2:])
    else:
        main()
