"""How much the result hangs on each number that somebody set.

    python benchmarks/sensitivity.py [--work DIR] [--mocap DIR] [--videos DIR] [--frames N]
        [--only CLIP ...] [--package FOLDER ...] [--constants NAME ...] [--factors X ...]
        [--clicks] [--workers N] [--out CSV] [--plan | --summary]

Every tuned number (see tuned_numbers.py) by +-25 % on the rendered sequences and on the real clips
whose marks are kept: change of carried PCK@0.2 (points) and of PA-MPJPE (mm), with depth signs
from the person and without (`auto`). Each is run as if it had been written so in the source, in a
process of its own, from the first stage that it can affect; what comes before is taken from the
clip's store. `--clicks` moves the picked heads and feet by 0.15 of a head or a shin, and repeats
the clips with other clicks on the joints: the size of a change that tells nothing. Rows are
appended to the CSV as they are measured; started again, rows of the same code are not measured
again. A whole run over everything takes days of one core: choose clips, folders and `--frames`.
"""

import argparse
import ast
import csv
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path

import numpy as np
from sensitivity_rows import Row, print_summary, read_rows, shorten
from tuned_numbers import (
    FOLDERS,
    TunedNumber,
    code_digest,
    find_numbers,
    find_stages,
    first_stage,
    is_used,
    read_package,
    vary,
)
from varied_import import vary_imports

ROOT = Path(__file__).parent.parent
DATA = ROOT.parent / "shared" / "data"
RENDERED = (
    "ground-back-static",
    "ground-oblique-pan",
    "serve-side-static",
    "serve-back-pan",
    "mixed-front-static",
    "mixed-side-pan",
    "volley-above-static",
    "all-oblique-small",
)
"""As in sequences.py, which imports the package and so cannot be imported here."""
FACTORS = (0.75, 1.25)
MOVE = 0.15
"""Of a head or a shin: how far picks are moved."""
OTHER_SEEDS = (100, 200, 300)
START = 2.0
"""Seconds that a process needs before its first stage."""
PATIENCE = 10.0
"""A variant that takes so many times as long as foreseen, and a minute, is given up."""


@dataclass(frozen=True)
class Change:
    """Something to be changed and measured."""

    number: str
    change: str
    first: str
    line: int = 0
    old: str = ""
    new: str = ""
    module: str = ""
    places: tuple = ()
    """Places in the module's source, each with its new number."""
    task: dict = field(default_factory=dict)
    """More for `variant.Task`."""


@dataclass(frozen=True)
class Base:
    """A clip as it is."""

    pck: float
    pa: float
    pa_unsigned: float
    seconds: dict[str, float]
    """Of every stage."""
    called: dict[str, set[str]]


class Bench:
    """The clips to run on, and the file of rows."""

    def __init__(self, words: argparse.Namespace, code: str) -> None:
        """Read the rows that are there."""
        self.words, self.code = words, code
        self.frames = words.frames or 0
        self.rows = list(read_rows(words.out))
        self.known = {row.key for row in self.rows}

    def add(self, row: Row) -> None:
        """Append a row to the file at once."""
        new = not self.words.out.is_file()
        with self.words.out.open("a", newline="") as file:
            writer = csv.writer(file)
            if new:
                writer.writerow([f.name for f in fields(Row)])
            writer.writerow(asdict(row).values())
        self.rows.append(row)
        self.known.add(row.key)

    def base(self, clip: str) -> Base:
        """The clip as it is: measured once for this code, with all stages kept."""
        file = self.words.work / clip / "sensitivity" / f"base-{self.code}-{self.frames}.json"
        if not file.is_file():
            print(f"{clip}: as it is ...", flush=True)
            found = self.run(clip, Change("base", "", "all"), None)
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(json.dumps(found))
        found = json.loads(file.read_text())
        if "pck" not in found:
            file.unlink()
            raise SystemExit(f"{clip} cannot be run as it is: {found['fault']}")
        called = {module: set(names) for module, names in found["called"].items()}
        return Base(*scores_of(found), found["seconds"], called)

    def run(self, clip: str, change: Change, limit: float | None) -> dict:
        """Scores and seconds, or the fault, of one clip in a process of its own."""
        words = self.words
        task = {"clip": clip, "first": change.first, "work": str(words.work),
                "mocap": str(words.mocap), "videos": str(words.videos),
                "frames": words.frames, **change.task}  # fmt: skip
        order = json.dumps({"module": change.module, "places": change.places, "task": task})
        alone = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
        env = {**os.environ, **alone, "PYTHONPATH": str(ROOT)}
        call = [sys.executable, __file__, "--order", order]
        try:
            ran = subprocess.run(
                call, env=env, capture_output=True, text=True, timeout=limit, check=False
            )
        except subprocess.TimeoutExpired:
            return {"fault": f"given up after {limit:.0f} s"}
        if ran.returncode:
            said = ran.stderr.strip().splitlines() or [f"ended with {ran.returncode}"]
            return {"fault": said[-1][:200]}
        return json.loads(ran.stdout.strip().splitlines()[-1])

    def measure(self, clip: str, base: Base, change: Change) -> Row:
        """The row of a change."""
        started = time.perf_counter()
        foreseen = foresee(base, change.first)
        found = self.run(clip, change, 60 + PATIENCE * foreseen)
        pck, pa, unsigned = scores_of(found)
        return Row(
            self.code, clip, self.frames, change.number, change.line, change.old, change.new,
            change.change, change.first, pck, pa, unsigned, 100 * (pck - base.pck), pa - base.pa,
            unsigned - base.pa_unsigned, round(time.perf_counter() - started, 1),
            found.get("fault", ""),
        )  # fmt: skip


def scores_of(found: dict) -> tuple[float, float, float]:
    """PCK, PA-MPJPE with and without signs; NaN where there is none."""
    scores = [found.get(name) for name in ("pck", "pa", "pa_unsigned")]
    pck, pa, unsigned = (float("nan") if score is None else score for score in scores)
    return pck, pa, unsigned


def foresee(base: Base, first: str) -> float:
    """Seconds that a run from this stage on should take."""
    stages = list(base.seconds)
    return START + sum(base.seconds[s] for s in stages[stages.index(first) :])


def changes_of(number: TunedNumber, first: str, factors: Iterable[float]) -> Iterator[Change]:
    """A number times each factor."""
    for factor in factors:
        new = [vary(value, factor) for value in number.values]
        yield Change(
            number.key, f"x{factor}", first, number.line, shorten(number.values), shorten(new),
            number.module, tuple(zip(number.places, new, strict=True)),
        )  # fmt: skip


def changes_of_clicks(stages: Iterable[str]) -> Iterator[Change]:
    """Picks of heads and feet moved along either axis; other clicks on the joints."""
    first = "colors" if "colors" in stages else next(iter(stages))
    for part, of in (("head", "head"), ("foot", "shin")):
        for axis, name in enumerate("xy"):
            for move in (-MOVE, MOVE):
                offset = tuple(move if a == axis else 0.0 for a in range(2))
                yield Change(
                    f"clicks:{part} {name}, of a {of}", f"{move:+}", first,
                    task={"part": part, "offset": offset},
                )  # fmt: skip
    for seed in OTHER_SEEDS:
        yield Change("clicks:other clicks on joints", f"seed +{seed}", "propagate",
                     task={"seed": seed})  # fmt: skip


def plan(bench: Bench, clips: list[str]) -> tuple[list[tuple[str, Change]], list[TunedNumber]]:
    """What is to be measured, the quick ones first, and the numbers that no clip uses."""
    words = bench.words
    trees = read_package()
    todo: list[tuple[str, Change]] = []
    unused = []
    numbers = [number for number in find_numbers(trees) if wanted(number, words)]
    if not numbers:
        raise SystemExit("No tuned number is called so; see tuned_numbers.py on their names.")
    bases = {clip: bench.base(clip) for clip in clips}
    run = {stage for base in bases.values() for stage in base.seconds}
    stages = {stage: file for stage, file in find_stages(trees).items() if stage in run}
    for number in numbers:
        first = first_stage(number.module, trees, stages)
        using = [clip for clip in clips if is_used(number, trees, bases[clip].called)]
        if first is None or not using:
            unused.append(number)
            continue
        todo += [
            (clip, change) for change in changes_of(number, first, words.factors) for clip in using
        ]
    if words.clicks:
        rendered = set(clips) & set(RENDERED)  # a real clip's marks cannot be clicked again
        todo += [
            (clip, change)
            for change in changes_of_clicks(stages)
            for clip in clips
            if clip in rendered or "seed" not in change.task
        ]
    order = list(stages)
    todo.sort(key=lambda one: -order.index(one[1].first))  # the order within a stage stays
    return todo, unused


def wanted(number: TunedNumber, words: argparse.Namespace) -> bool:
    """Whether a number was asked for."""
    if words.constants:
        return bool({number.name, number.symbol, number.key} & set(words.constants))
    return not words.package or number.module.split("/")[0] in words.package


def measure_all(bench: Bench, todo: list[tuple[str, Change]]) -> None:
    """Measure what is not in the file yet, and tell how long the rest will take."""
    bases = {clip: bench.base(clip) for clip, _ in todo}
    key = (bench.code, str(bench.frames))
    left = [
        (clip, change)
        for clip, change in todo
        if (key[0], clip, key[1], change.number, change.change) not in bench.known
    ]
    print(f"{len(left)} measurements, {len(todo) - len(left)} are there already.", flush=True)
    rest = sum(foresee(bases[clip], change.first) for clip, change in left)
    spent = foreseen = 0.0
    pool = ThreadPoolExecutor(bench.words.workers)
    jobs = {pool.submit(bench.measure, clip, bases[clip], change): (clip, change)
            for clip, change in left}  # fmt: skip
    try:
        for done, job in enumerate(as_completed(jobs), 1):
            clip, change = jobs[job]
            row = job.result()
            bench.add(row)
            due = foresee(bases[clip], change.first)
            spent, foreseen, rest = spent + row.seconds, foreseen + due, rest - due
            minutes = rest * spent / foreseen / bench.words.workers / 60
            ahead = f"(about {minutes:.0f} min left)"
            print(f"{done}/{len(left)} {describe(row)}  {ahead}", flush=True)
    finally:
        pool.shutdown(cancel_futures=True)  # one that is interrupted does not go on for hours


def describe(row: Row) -> str:
    """A line on a measurement."""
    changed = f"{row.old} -> {row.new}" if row.new else row.change
    losses = ((row.d_pck, "points"), (row.d_pa, "mm"), (row.d_pa_unsigned, "mm auto"))
    scores = " ".join(f"{value:+.2f} {unit}" for value, unit in losses if np.isfinite(value))
    return f"{row.clip:<20}{row.number} {changed}  {row.fault or scores}"


def real_clips(videos: Path) -> list[str]:
    """Real clips of which picks, keyframe marks and other marks are kept, and whose video is."""
    kept = ROOT / "annotations"
    return [
        file.stem
        for file in sorted((kept / "real").glob("*.json"))
        if (kept / file.name).is_file()
        and (kept / f"{file.stem}.picks.json").is_file()
        and (videos / f"{file.stem}.mp4").is_file()
    ]


def obey(order: str) -> None:
    """Run one clip with other numbers in the package, and print what came out."""
    told = json.loads(order)
    if told["places"]:
        vary_imports(told["module"], {tuple(place): value for place, value in told["places"]})
    from variant import Task, run_task  # imports the package, which must be varied by then

    print(json.dumps(asdict(run_task(Task(**told["task"])))))


def main() -> None:
    """Measure, or run one variant for the process that measures."""
    if sys.argv[1:2] == ["--order"]:
        obey(sys.argv[2])
        return
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--work", type=Path, default=Path("benchmarks/work"))
    parser.add_argument("--mocap", type=Path, default=DATA / "mocap")
    parser.add_argument("--videos", type=Path, default=DATA / "video")
    parser.add_argument("--frames", type=int, help="first frames of a rendered sequence to use")
    parser.add_argument("--only", nargs="*", help="names of sequences and real clips")
    parser.add_argument("--package", nargs="*", choices=FOLDERS)
    parser.add_argument("--constants", nargs="*", help="NAME, Record.field or file:name")
    parser.add_argument("--factors", nargs="*", type=float, default=FACTORS)
    parser.add_argument("--clicks", action="store_true", help="move picks, too")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("benchmarks/work/sensitivity.csv"))
    parser.add_argument("--plan", action="store_true", help="print what would be measured")
    parser.add_argument("--summary", action="store_true", help="only of the rows that are there")
    words = parser.parse_args()
    clips = [c for c in (*RENDERED, *real_clips(words.videos)) if not words.only or c in words.only]
    scoring = ast.parse((Path(__file__).parent / "variant.py").read_text(encoding="utf-8"))
    bench = Bench(words, code_digest({**read_package(), "variant.py": scoring}))
    todo, unused = plan(bench, clips)
    if words.plan:
        for clip, change in todo:
            print(f"{clip:<20}{change.first:<12}{change.number} {change.old} -> {change.new}")
    elif not words.summary:
        measure_all(bench, todo)
    asked = {(clip, change.number, change.change) for clip, change in todo}
    rows = [r for r in bench.rows if r.code == bench.code and r.frames == bench.frames]
    print_summary([r for r in rows if (r.clip, r.number, r.change) in asked], unused)


if __name__ == "__main__":
    main()
