"""How much the result hangs on each number that somebody set.

    python benchmarks/sensitivity.py [--work DIR] [--mocap DIR] [--videos DIR] [--frames N]
        [--only CLIP ...] [--package FOLDER ...] [--constants NAME ...] [--clicks] [--workers N]
        [--out CSV] [--plan | --summary]

Every tuned number (see tuned_numbers.py) by +-25 % on the rendered sequences and on the real clips
whose marks are kept: change of carried PCK@0.2 (points) and of PA-MPJPE (mm). Each is run as if it
had been written so in the source, in a process of its own, from the first stage that it can
affect; what comes before is taken from the clip's store. `--clicks` moves the picked heads and
feet by 0.15 of a head or a shin, and repeats the clips with other clicks on the joints: the
size of a change that tells nothing. Rows are appended to the CSV as they are measured;
started again, rows of the same code are not measured again. A whole run over everything takes
days of one core: choose clips, folders and `--frames`.
"""

import argparse
import csv
import json
import os
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path

import numpy as np
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
NOTHING = 0.05
"""Points of PCK and mm of PA-MPJPE that are no change."""
MUCH_PCK, MUCH_PA = 2.0, 3.0
"""Points and mm from which on a number matters much."""
START = 2.0
"""Seconds that a process needs before its first stage."""
PATIENCE = 10.0
"""A variant that takes so many times as long as foreseen, and a minute, is given up."""


@dataclass(frozen=True)
class Row:
    """One measurement, as it stands in the CSV."""

    code: str
    """Version of the package's code (`code_digest`)."""
    clip: str
    frames: int
    """Used of the clip; 0 for all."""
    number: str
    """file:name of a number, 'clicks:...' or 'base'."""
    line: int
    old: str
    new: str
    change: str
    """'x0.75', 'x1.25', '+0.15', ..."""
    first: str
    """First stage that was run."""
    pck: float
    """0-1"""
    pa: float
    """mm; NaN where nothing is known in 3D."""
    d_pck: float
    """Points against the base."""
    d_pa: float
    """mm against the base."""
    seconds: float
    fault: str
    """Last line of what was said when it failed."""

    @property
    def key(self) -> tuple[str, ...]:
        """Tells it from all other measurements."""
        return self.code, self.clip, str(self.frames), self.number, self.change


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
        pa = float("nan") if found["pa"] is None else found["pa"]
        called = {module: set(names) for module, names in found["called"].items()}
        return Base(found["pck"], pa, found["seconds"], called)

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
        pck = found.get("pck", float("nan"))
        pa = found.get("pa")
        pa = float("nan") if pa is None else pa
        return Row(
            self.code, clip, self.frames, change.number, change.line, change.old, change.new,
            change.change, change.first, pck, pa, 100 * (pck - base.pck), pa - base.pa,
            round(time.perf_counter() - started, 1), found.get("fault", ""),
        )  # fmt: skip


def foresee(base: Base, first: str) -> float:
    """Seconds that a run from this stage on should take."""
    stages = list(base.seconds)
    return START + sum(base.seconds[s] for s in stages[stages.index(first) :])


def read_rows(file: Path) -> Iterator[Row]:
    """The rows of a CSV; none where there is no file."""
    kinds = {f.name: f.type for f in fields(Row)}
    if file.is_file():
        with file.open(newline="") as lines:
            for line in csv.DictReader(lines):
                yield Row(**{name: kinds[name](value) for name, value in line.items()})


def changes_of(number: TunedNumber, first: str) -> Iterator[Change]:
    """A number by a quarter less and more."""
    for factor in FACTORS:
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


def shorten(values: Iterable[float]) -> str:
    """Numbers as text, the first four of many."""
    texts = [f"{value:.4g}" for value in values]
    return " ".join(texts[:4]) + (" ..." if len(texts) > 4 else "")


def plan(bench: Bench, clips: list[str]) -> tuple[list[tuple[str, Change]], list[TunedNumber]]:
    """What is to be measured, the quick ones first, and the numbers that no clip uses."""
    words = bench.words
    trees = read_package()
    stages = find_stages(trees)
    bases = {clip: bench.base(clip) for clip in clips}
    todo: list[tuple[str, Change]] = []
    unused = []
    for number in find_numbers(trees):
        if not wanted(number, words):
            continue
        first = first_stage(number.module, trees, stages)
        using = [clip for clip in clips if is_used(number, trees, bases[clip].called)]
        if first is None or not using:
            unused.append(number)
            continue
        todo += [(clip, change) for change in changes_of(number, first) for clip in using]
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
    with ThreadPoolExecutor(bench.words.workers) as pool:
        jobs = {
            pool.submit(bench.measure, clip, bases[clip], change): (clip, change)
            for clip, change in left
        }
        for done, job in enumerate(as_completed(jobs), 1):
            clip, change = jobs[job]
            row = job.result()
            bench.add(row)
            due = foresee(bases[clip], change.first)
            spent, foreseen, rest = spent + row.seconds, foreseen + due, rest - due
            minutes = rest * spent / foreseen / bench.words.workers / 60
            told = row.fault or f"{row.d_pck:+7.2f} points {row.d_pa:+7.2f} mm"
            print(
                f"{done}/{len(left)} {clip:<20}{row.number} {row.old} -> {row.new}"
                f"{change.change if not row.new else ''}  {told}  (about {minutes:.0f} min left)",
                flush=True,
            )


@dataclass(frozen=True)
class Effect:
    """What one number does, over both directions and all clips."""

    number: str
    line: int
    old: str
    worst_pck: float
    """Lowest mean change over the clips of either direction, points."""
    worst_pa: float
    """Highest, mm."""
    best_pck: float
    best_pa: float
    lowest_pck: float
    """Lowest change of a single clip."""
    highest_pa: float
    largest: float
    """Largest absolute change in any row, points or mm."""
    faults: tuple[str, ...]
    complete: bool
    """Whether both directions were measured."""


def summarise(rows: Iterable[Row]) -> list[Effect]:
    """The effect of every number in the rows."""
    of: dict[str, list[Row]] = defaultdict(list)
    for row in rows:
        of[row.number].append(row)
    return [effect_of(number, group) for number, group in of.items()]


def effect_of(number: str, rows: list[Row]) -> Effect:
    """The effect of the number that these rows vary."""
    by: dict[str, list[Row]] = defaultdict(list)
    for row in rows:
        if not row.fault:
            by[row.change].append(row)
    means = [(mean(r.d_pck for r in group), mean(r.d_pa for r in group)) for group in by.values()]
    pcks, pas = ([m[i] for m in means if np.isfinite(m[i])] or [0.0] for i in (0, 1))
    single_pck = [r.d_pck for g in by.values() for r in g] or [0.0]
    single_pa = [r.d_pa for g in by.values() for r in g if np.isfinite(r.d_pa)] or [0.0]
    return Effect(
        number, rows[-1].line, rows[-1].old, min(pcks), max(pas), max(pcks), min(pas),
        min(single_pck), max(single_pa), max(map(abs, (*single_pck, *single_pa))),
        tuple(sorted({f"{r.change}: {r.fault}" for r in rows if r.fault})),
        len({r.change for r in rows}) > 1,
    )  # fmt: skip


def mean(values: Iterable[float]) -> float:
    """Mean of those that are known; NaN where none is."""
    found = [value for value in values if np.isfinite(value)]
    return float(np.mean(found)) if found else float("nan")


def print_summary(rows: list[Row], unused: list[TunedNumber]) -> None:
    """What matters, what does nothing, what cannot be varied."""
    effects = summarise(rows)
    clicks = [e for e in effects if e.number.startswith("clicks:")]
    numbers = [e for e in effects if not e.number.startswith("clicks:")]
    much = [e for e in numbers if e.worst_pa > MUCH_PA or e.worst_pck < -MUCH_PCK]
    single = [e for e in numbers if e not in much
              and (e.highest_pa > MUCH_PA or e.lowest_pck < -MUCH_PCK)]  # fmt: skip
    better = [e for e in numbers if e.best_pa < -MUCH_PA / 2 or e.best_pck > MUCH_PCK / 2]
    nothing = [e for e in numbers if e.largest < NOTHING and not e.faults and e.complete]
    title = f"{'':<62}{'value':>10}{'PCK':>8}{'PA':>8}{'PCK':>8}{'PA':>8}"
    for text, group in (
        (f"+-25 % costs more than {MUCH_PA:g} mm or {MUCH_PCK:g} points on the mean", much),
        ("the same on one clip, not on the mean", single),
        ("+-25 % gains on the mean more than half of that (best direction)", better),
        ("clicks", clicks),
    ):
        print(f"\n{text}: {len(group)}\n{title}   (mean; worst clip)")
        for e in sorted(group, key=lambda e: -e.worst_pa):
            pck, pa = (e.best_pck, e.best_pa) if group is better else (e.worst_pck, e.worst_pa)
            where = e.number.replace(":", f":{e.line}:", 1) if e.line else e.number
            print(
                f"{where:<62}{e.old:>10}{pck:8.2f}{pa:8.2f}{e.lowest_pck:8.2f}{e.highest_pa:8.2f}"
            )
    print(f"\nchange nothing (all under {NOTHING:g} points and mm): {len(nothing)}")
    for e in nothing:
        print(f"  {e.number.replace(':', f':{e.line}:', 1)} = {e.old}")
    print(f"\nin no code that these clips run: {len(unused)}")
    for number in unused:
        print(f"  {number.module}:{number.line}:{number.name} = {shorten(number.values)}")
    print("\ncannot be varied so:")
    for e in numbers:
        for fault in e.faults:
            print(f"  {e.number.replace(':', f':{e.line}:', 1)} {fault}")


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

    print(json.dumps(run_task(Task(**told["task"]))))


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
    parser.add_argument("--clicks", action="store_true", help="move picks, too")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("benchmarks/work/sensitivity.csv"))
    parser.add_argument("--plan", action="store_true", help="print what would be measured")
    parser.add_argument("--summary", action="store_true", help="only of the rows that are there")
    words = parser.parse_args()
    clips = [c for c in (*RENDERED, *real_clips(words.videos)) if not words.only or c in words.only]
    bench = Bench(words, code_digest(read_package()))
    todo, unused = plan(bench, clips)
    if words.plan:
        for clip, change in todo:
            print(f"{clip:<20}{change.first:<12}{change.number} {change.old} -> {change.new}")
    elif not words.summary:
        measure_all(bench, todo)
    asked = {(clip, change.number) for clip, change in todo}
    rows = [r for r in bench.rows if r.code == bench.code and r.frames == bench.frames]
    print_summary([r for r in rows if (r.clip, r.number) in asked], unused)


if __name__ == "__main__":
    main()
