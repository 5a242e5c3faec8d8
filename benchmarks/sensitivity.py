"""How much the result hangs on each number that somebody set.

    python benchmarks/sensitivity.py [--work DIR] [--mocap DIR] [--clips CLIP ...] [--frames N]
        [--package FOLDER ...] [--constants NAME ...] [--clicks] [--workers N] [--out CSV]
        [--plan | --summary]

Every tuned number (see tuned_numbers.py) on rendered sequences and real clips: change of carried
PCK@0.2 (points) and of PA-MPJPE (mm), with depth signs from the person and, for numbers of lifting,
without (`auto`). Each is run as if it had been written so in the source, through the stages that it
can reach (see variant_store.py). To spend the time where it tells something,

1. numbers are halved, and doubled, some at once; a group that changes a clip by more than
   `SMALL_PCK` or `SMALL_PA` is split, until it is known which number does;
2. those are measured by +-25 %, one by one, on every clip.

For numbers of tracking and segmentation the keyframes stay as they are: which frames are marked
moves PA-MPJPE by millimetres, and would hide what those numbers do.

`--clicks` instead moves the picked or marked heads and feet by 0.15 of a head or a shin, and
repeats the clips with other clicks on the joints: the size of a change that tells nothing. A
rendered sequence begins with its picks, or with a marked body where its name is followed by
"-body". Rows are appended to the CSV as they are measured; started again, rows of the same code are
not measured again. `--summary` prints the table that is kept as benchmarks/sensitivity.md.
"""

import argparse
import ast
import csv
import json
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path

import numpy as np
from sensitivity_rows import SMALL_PA, SMALL_PCK, Row, print_summary, read_rows, shorten
from tuned_numbers import (
    FOLDERS,
    TunedNumber,
    code_digest,
    find_numbers,
    find_stages,
    read_package,
    stages_using,
    vary,
)
from varied_import import vary_imports

ROOT = Path(__file__).parent.parent
DATA = ROOT.parent / "shared" / "data"
CLIPS = ("all-oblique-small", "ground-oblique-pan-body", "tennis_broadcast_purple")
"""Seen from above and small, from picks; a moving camera, from a marked body; a real one."""
WIDE = (0.5, 2.0)
FACTORS = (0.75, 1.25)
BEFORE_KEYFRAMES = ("tracking", "segmentation")
MOVE = 0.15
"""Of a head or a shin: how far picks are moved."""
OTHER_SEEDS = (100, 200, 300)
PATIENCE = 10.0
"""A variant that takes so many times as long as foreseen, and two minutes, is given up."""
HEAVY = ("numpy", "cv2", "scipy.interpolate", "scipy.optimize", "scipy.ndimage", "scipy.signal")
"""Imported once, not by every process."""


@dataclass(frozen=True)
class Change:
    """Something to be changed and measured on one clip."""

    clip: str
    change: str
    """'x0.5', '+0.15', ..."""
    stages: tuple[str, ...]
    """That it reaches by itself, in order."""
    numbers: tuple[TunedNumber, ...] = ()
    """Changed together ..."""
    factor: float = 1.0
    """... by this."""
    name: str = ""
    """Where no number is changed."""
    task: dict = field(default_factory=dict)
    """More for `variant.Task`."""

    def names(self) -> tuple[str, ...]:
        """What stands in the rows."""
        return tuple(n.key for n in self.numbers) or (self.name,)


@dataclass(frozen=True)
class Base:
    """A clip as it is."""

    pck: float
    pa: float
    pa_unsigned: float
    seconds: dict[str, float]
    """Of every stage."""
    called: dict[str, dict[str, set[str]]]


class Bench:
    """The clips to run on, and the file of rows."""

    def __init__(self, words: argparse.Namespace, code: str) -> None:
        """Read the rows that are there."""
        self.words, self.code, self.frames = words, code, words.frames
        self.rows = list(read_rows(words.out))
        self.known = {row.key: row for row in self.rows}
        self.began, self.done = time.perf_counter(), 0
        self.pool = ThreadPoolExecutor(words.workers)
        self.processes = multiprocessing.get_context("forkserver")
        self.processes.set_forkserver_preload(list(HEAVY))

    def add(self, row: Row) -> None:
        """Append a row to the file at once."""
        new = not self.words.out.is_file()
        with self.words.out.open("a", newline="") as file:
            writer = csv.writer(file)
            if new:
                writer.writerow([f.name for f in fields(Row)])
            writer.writerow(asdict(row).values())
        self.rows.append(row)
        self.known[row.key] = row

    def base(self, clip: str) -> Base:
        """The clip as it is: measured once for this code, with all stages kept."""
        folder = self.words.work / clip / "sensitivity"
        file = folder / f"base-{self.code}-{self.frames}.json"
        if not file.is_file():
            print(f"{clip}: as it is ...", flush=True)
            found = self.run(clip, {"changed": None}, {}, None)
            if "fault" in found:
                raise SystemExit(f"{clip} cannot be run as it is: {found['fault']}")
            file.write_text(json.dumps({**found, "commit": commit_of_code()}))
        found = json.loads(file.read_text())
        called = {
            stage: {module: set(names) for module, names in modules.items()}
            for stage, modules in found["called"].items()
        }
        return Base(*scores_of(found), found["seconds"], called)

    def run(self, clip: str, more: dict, new: dict, limit: float | None) -> dict:
        """Scores and seconds, or the fault, of one clip in a process of its own."""
        words = self.words
        task = {"clip": clip, "work": str(words.work), "mocap": str(words.mocap),
                "frames": self.frames, **more}  # fmt: skip
        ours, theirs = self.processes.Pipe(duplex=False)
        process = self.processes.Process(target=obey, args=(theirs, task, new))
        process.start()
        theirs.close()
        try:
            if not ours.poll(limit):
                return {"fault": f"given up after {limit:.0f} s"}
            return ours.recv()
        except EOFError:
            return {"fault": "the process ended without a word"}
        finally:
            process.kill()
            process.join()

    def measure(self, change: Change) -> list[Row]:
        """The rows of a change, one for each number in it; those of the file where they are."""
        keys = [(self.code, change.clip, str(self.frames), name, change.change)
                for name in change.names()]  # fmt: skip
        if all(key in self.known and self.known[key].others < len(keys) for key in keys):
            return [self.known[key] for key in keys]
        base, started = self.base(change.clip), time.perf_counter()
        folders = {n.module.split("/")[0] for n in change.numbers}
        signs = not folders or "lifting" in folders
        held = ("keyframes",) if folders and folders <= set(BEFORE_KEYFRAMES) else ()
        limit = 120 + PATIENCE * foresee(base, change.stages)
        task = {"changed": change.stages, "unsigned": signs, "held": held, **change.task}
        new: dict[str, dict] = {}
        for number in change.numbers:
            values = [vary(value, change.factor) for value in number.values]
            new.setdefault(number.module, {}).update(zip(number.places, values, strict=True))
        found = self.run(change.clip, task, new, limit)
        same = found.get("pck") is None and "fault" not in found
        pck, pa, unsigned = (base.pck, base.pa, base.pa_unsigned) if same else scores_of(found)
        seconds = round(time.perf_counter() - started, 1)
        told = change.numbers or (None,)
        rows = [
            Row(
                self.code, change.clip, self.frames, name, number.line if number else 0,
                shorten(number.values) if number else "", change.change, " ".join(change.stages),
                len(keys) - 1, int(same), pck, pa, unsigned, 100 * (pck - base.pck), pa - base.pa,
                unsigned - base.pa_unsigned, seconds, found.get("fault", ""),
            )
            for name, number in zip(change.names(), told, strict=True)
        ]  # fmt: skip
        for row in rows:
            self.add(row)
        self.done += 1
        print(f"{time.perf_counter() - self.began:6.0f} s {self.done:4d} {describe(rows)}",
              flush=True)  # fmt: skip
        return rows

    def measure_all(self, changes: Iterable[Change]) -> list[list[Row]]:
        """The rows of many changes."""
        return list(self.pool.map(self.measure, changes))


def obey(answer: object, task: dict, new: dict) -> None:
    """Run one clip with other numbers in the package, and send what came out."""
    os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    sys.path.insert(0, str(ROOT))
    if new:
        vary_imports(new)
    try:
        from variant import Task, run_task  # imports the package, which must be varied by then

        answer.send(asdict(run_task(Task(**task))))
    except BaseException as fault:  # whatever a wrong number breaks is a result
        answer.send({"fault": f"{type(fault).__name__}: {fault}".splitlines()[0][:200]})
        raise


def scores_of(found: dict) -> tuple[float, float, float]:
    """PCK, PA-MPJPE with and without signs; NaN where there is none."""
    scores = [found.get(name) for name in ("pck", "pa", "pa_unsigned")]
    pck, pa, unsigned = (float("nan") if score is None else score for score in scores)
    return pck, pa, unsigned


def foresee(base: Base, stages: tuple[str, ...]) -> float:
    """Seconds that a run from the first of the stages on should take."""
    all_stages = list(base.seconds)
    first = next((all_stages.index(s) for s in stages if s in all_stages), 0)
    return sum(base.seconds[s] for s in all_stages[first:])


def describe(rows: list[Row]) -> str:
    """A line on a measurement."""
    row = rows[0]
    losses = ((row.d_pck, "points"), (row.d_pa, "mm"), (row.d_pa_unsigned, "mm auto"))
    scores = " ".join(f"{value:+.2f} {unit}" for value, unit in losses if np.isfinite(value))
    others = f" and {row.others} others" if row.others else ""
    told = row.fault or ("same" if row.same else scores)
    return f"{row.clip:<24}{row.number}{others} {row.change}  {told}  ({row.seconds:.0f} s)"


class Study:
    """The numbers asked for, and the stages of each clip that use them."""

    def __init__(self, bench: Bench, clips: list[str]) -> None:
        """Runs the clips as they are, if that was not done yet."""
        self.bench, self.clips, trees = bench, clips, read_package()
        self.numbers = [n for n in find_numbers(trees) if wanted(n, bench.words)]
        if not self.numbers:
            raise SystemExit("No tuned number is called so; see tuned_numbers.py on their names.")
        self.stages = find_stages(trees)
        self.using = {
            clip: {
                n.key: stages_using(n, trees, self.stages, bench.base(clip).called)
                for n in self.numbers
            }
            for clip in clips
        }

    def users(self, number: TunedNumber) -> list[str]:
        """Clips whose code uses the number."""
        return [clip for clip in self.clips if self.using[clip][number.key]]

    def change(self, clip: str, factor: float, *numbers: TunedNumber) -> Change:
        """Numbers times a factor."""
        reached = {stage for n in numbers for stage in self.using[clip][n.key]}
        order = [*self.stages, ""]
        stages = tuple(sorted(reached, key=order.index))
        return Change(clip, f"x{factor:g}", stages, numbers, factor)

    def in_order(self) -> list[TunedNumber]:
        """Numbers that some clip uses, the folders in the order asked for."""
        folders = self.bench.words.package or FOLDERS
        used = [n for n in self.numbers if self.users(n)]
        return sorted(used, key=lambda n: folders.index(n.module.split("/")[0]))

    def run(self) -> None:
        """Measure all of them."""
        for folder in self.bench.words.package or FOLDERS:
            numbers = [n for n in self.in_order() if n.module.split("/")[0] == folder]
            self.run_some(numbers)

    def run_some(self, numbers: list[TunedNumber]) -> None:
        """Halve and double them in groups, and look closely at those that this changes."""
        much: set[str] = set()
        for clip in self.clips:
            for factor in WIDE:
                little = [n for n in numbers if clip in self.users(n) and n.key not in much]
                much |= {n.key for n in self.split(clip, factor, little)}
        for number in numbers:
            if number.key in much:
                self.bench.measure_all(
                    self.change(clip, factor, number)
                    for clip in self.users(number)
                    for factor in FACTORS
                )

    def split(self, clip: str, factor: float, numbers: list[TunedNumber]) -> Iterator[TunedNumber]:
        """Numbers that change the clip, found by changing many at once."""
        together = self.bench.words.together
        by_stages: dict[tuple[str, ...], list[TunedNumber]] = {}
        for number in numbers:
            by_stages.setdefault(self.using[clip][number.key][:1], []).append(number)
        for group in by_stages.values():
            for start in range(0, len(group), together):
                yield from self._halve(clip, factor, group[start : start + together])

    def _halve(self, clip: str, factor: float, group: list[TunedNumber]) -> Iterator[TunedNumber]:
        rows = self.bench.measure(self.change(clip, factor, *group))
        if not all(row.is_small for row in rows):
            if len(group) == 1:
                yield group[0]
            else:
                middle = len(group) // 2
                yield from self._halve(clip, factor, group[:middle])
                yield from self._halve(clip, factor, group[middle:])

    def move_clicks(self) -> None:
        """Picks of heads and feet moved along either axis; other clicks on the joints."""
        for part, of in (("head", "head"), ("foot", "shin")):
            for axis, name in enumerate("xy"):
                for move in (-MOVE, MOVE):
                    offset = tuple(move if a == axis else 0.0 for a in range(2))
                    told = f"clicks:{part} {name}, of a {of}"
                    self.bench.measure_all(
                        Change(clip, f"{move:+}", (), name=told,
                               task={"part": part, "offset": offset})
                        for clip in self.clips
                    )  # fmt: skip
        rendered = [clip for clip in self.clips if "_" not in clip]
        for seed in OTHER_SEEDS:  # a real clip's marks cannot be made again
            self.bench.measure_all(
                Change(clip, f"seed +{seed}", (), name="clicks:other clicks on joints",
                       task={"seed": seed})
                for clip in rendered
            )  # fmt: skip


def headline(bench: Bench, study: Study) -> str:
    """What was measured on what."""
    commits = {}
    for file in bench.words.work.glob("*/sensitivity/base-*.json"):
        commits[file.stem.split("-")[1]] = json.loads(file.read_text()).get("commit", "?")
    used = dict.fromkeys(commits.get(row.code, "?") for row in bench.rows)
    clips = []
    for clip in study.clips:
        base = bench.base(clip)
        solid = f", PA-MPJPE {base.pa:.1f} mm, {base.pa_unsigned:.1f} without depth signs"
        clips.append(f"- {clip}: PCK {base.pck:.1%}{solid if np.isfinite(base.pa) else ''}")
    return "\n".join([
        "# What hangs on each number that somebody set", "",
        "Made by `python benchmarks/sensitivity.py --summary`; measured at commits",
        f"{', '.join(used)} (a number's rows count while its value is the same). Largest changes,",
        "either way, of carried PCK@0.2 and of PA-MPJPE (with depth signs from the person and, for",
        "numbers of lifting, without) over these clips:", "",
        *clips, "",
        f"Of rendered clips the first {bench.frames} frames. Numbers of tracking and segmentation",
        "are measured with the keyframes as they are. '-': not measured; a quarter more or less",
        f"where halving or doubling changes over {SMALL_PCK:g} points or {SMALL_PA:g} mm.",
    ])  # fmt: skip


def commit_of_code() -> str:
    """The commit that is checked out."""
    call = ["git", "-C", str(ROOT), "rev-parse", "--short", "HEAD"]
    return subprocess.run(call, capture_output=True, text=True, check=False).stdout.strip()


def wanted(number: TunedNumber, words: argparse.Namespace) -> bool:
    """Whether a number was asked for."""
    if words.constants:
        return bool({number.name, number.symbol, number.key} & set(words.constants))
    return not words.package or number.module.split("/")[0] in words.package


def main() -> None:
    """Measure, or tell what would be measured or was."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--work", type=Path, default=Path("benchmarks/work"))
    parser.add_argument("--mocap", type=Path, default=DATA / "mocap")
    parser.add_argument("--clips", nargs="*", default=CLIPS)
    parser.add_argument("--frames", type=int, default=300, help="of rendered sequences; 0: all")
    parser.add_argument("--package", nargs="*", choices=FOLDERS)
    parser.add_argument("--constants", nargs="*", help="NAME, Record.field or file:name")
    parser.add_argument("--clicks", action="store_true", help="move clicks, and no number")
    parser.add_argument("--together", type=int, default=5, help="numbers varied at once")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("benchmarks/work/sensitivity.csv"))
    parser.add_argument("--plan", action="store_true", help="print what would be measured")
    parser.add_argument("--summary", action="store_true", help="only of the rows that are there")
    words = parser.parse_args()
    sources = [Path(__file__).parent / f"{name}.py" for name in ("variant", "variant_store")]
    scoring = {file.name: ast.parse(file.read_text(encoding="utf-8")) for file in sources}
    bench = Bench(words, code_digest({**read_package(), **scoring}))
    study = Study(bench, list(words.clips))
    if words.plan:
        for number in study.in_order():
            using = {clip: study.using[clip][number.key] for clip in study.users(number)}
            stages = " ".join(stage or "between" for stage in next(iter(using.values())))
            print(f"{number.key:<70}{shorten(number.values):<24}{len(using)} clips  {stages}")
        return
    if not words.summary:
        (study.move_clicks if words.clicks else study.run)()
    values = {n.key: shorten(n.values) for n in study.numbers}
    rows = [
        row
        for row in bench.rows
        if row.number.startswith("clicks:") or row.old == values.get(row.number)
    ]
    print_summary(rows, [n for n in study.numbers if not study.users(n)], headline(bench, study))


if __name__ == "__main__":
    main()
