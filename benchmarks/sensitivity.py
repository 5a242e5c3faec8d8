"""How much the result hangs on each number that somebody set.

    python benchmarks/sensitivity.py [--work DIR] [--mocap DIR] [--clips CLIP ...] [--frames N]
        [--package FOLDER ...] [--constants NAME ...] [--wide | --clicks] [--workers N] [--out CSV]
        [--plan | --summary]

Every tuned number (see tuned_numbers.py) by a quarter up and down, on rendered sequences and real
clips: change of carried PCK@0.2 (points) and of PA-MPJPE (mm), with depth signs from the person
and, for numbers of lifting, without (`auto`). Each is run as if it had been written so in the
source, through the stages that it can reach (see variant_store.py). Of hundreds of numbers few
matter, so many are changed at once (see screening.py), in three rounds:

1. on every clip every number goes up and down in a group, drawn anew for each clip;
2. a group that changes its clip by more than `MUCH_PCK` points or `MUCH_PA` mm is halved until it
   is known which number does;
3. those numbers are changed alone, up and down, on every clip.

Where all numbers of a folder by no more than a hundredth change a clip by more than these limits
(its unsteadiness: a leg is told from the other by a hair), nothing is looked for below that.
Numbers of which rows of earlier versions let expect more are in smaller groups. With `--constants`
numbers are changed alone at once, and `--wide` halves and doubles.

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
import hashlib
import json
import multiprocessing
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path

import numpy as np
from screening import Group, draw_directions, draw_groups, locate
from sensitivity_rows import (
    QUARTERS,
    SHAKEN,
    WIDE,
    Row,
    expected_sizes,
    name_change,
    print_summary,
    read_rows,
    shorten,
)
from tuned_numbers import (
    FOLDERS,
    TunedNumber,
    code_digest,
    find_numbers,
    find_stages,
    reached_from,
    read_package,
    stages_using,
)
from varied_import import vary_imports

ROOT = Path(__file__).parent.parent
DATA = ROOT.parent / "shared" / "data"
CLIPS = (
    "all-oblique-small",
    "tennis_rally",
    "serve-side-static",
    "tennis_broadcast_purple",
    "ground-oblique-pan",
    "mixed-front-static",
    "golf_faceon",
    "ground-back-static",
    "mixed-side-pan",
    "tennis_broadcast_indoor",
    "volley-above-static",
    "serve-back-pan",
    "golf_dtl_slow",
)
"""All rendered sequences, and real clips that may be looked at; of different kinds at first."""
TOGETHER = 1.0
"""Of what is much: the change that is expected of a group, at most. As large groups cost fewest
runs as are mostly found to do nothing."""
BEFORE_KEYFRAMES = ("tracking", "segmentation", "numerics")
KINDS = (BEFORE_KEYFRAMES, ("keyframes",), ("propagation",), ("lifting", "body_models"))
"""Folders whose numbers are changed together."""
MOVE = 0.15
"""Of a head or a shin: how far picks are moved."""
OTHER_SEEDS = (100, 200, 300)
PATIENCE = 5.0
"""A variant that takes so many times as long as foreseen, and a minute, is given up."""
HEAVY = ("numpy", "cv2", "scipy.interpolate", "scipy.optimize", "scipy.ndimage", "scipy.signal")
"""Imported once, not by every process."""


@dataclass(frozen=True)
class Change:
    """Something to be changed and measured on one clip."""

    clip: str
    stages: tuple[str, ...]
    """That it reaches by itself, in order."""
    numbers: tuple[TunedNumber, ...] = ()
    """Changed together ..."""
    factors: tuple[float, ...] = ()
    """... by these."""
    change: str = ""
    """'+0.15', ..., where no number is changed."""
    name: str = ""
    """Where no number is changed."""
    task: dict = field(default_factory=dict)
    """More for `variant.Task`."""

    def names(self) -> tuple[str, ...]:
        """What stands in the rows."""
        return tuple(n.key for n in self.numbers) or (self.name,)

    def changes(self) -> tuple[str, ...]:
        """How each is changed."""
        return tuple(name_change(f) for f in self.factors) or (self.change,)

    def run(self) -> str:
        """Tells it from others of the same numbers."""
        told = sorted(zip(self.names(), self.changes(), strict=True))
        return hashlib.sha256(repr(told).encode()).hexdigest()[:10]


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
        file = self.base_file(clip)
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

    def base_file(self, clip: str) -> Path:
        """Where what is known of a clip as it is is kept."""
        folder = self.words.work / clip / "sensitivity"
        return folder / f"base-{self.code}-{self.frames}.json"

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
        run = change.run()
        keys = [(self.code, change.clip, str(self.frames), name, run) for name in change.names()]
        if all(key in self.known for key in keys):
            return [self.known[key] for key in keys]
        base, started = self.base(change.clip), time.perf_counter()
        folders = {n.module.split("/")[0] for n in change.numbers}
        signs = not folders or "lifting" in folders
        held = ("keyframes",) if folders and folders <= set(BEFORE_KEYFRAMES) else ()
        limit = 60 + PATIENCE * foresee(base, change.stages)
        task = {"changed": change.stages, "unsigned": signs, "held": held, **change.task}
        new: dict[str, dict] = {}
        for number, factor in zip(change.numbers, change.factors, strict=True):
            values = zip(number.places, number.varied(factor), strict=True)
            new.setdefault(number.module, {}).update(values)
        found = self.run(change.clip, task, new, limit)
        same = found.get("pck") is None and "fault" not in found
        pck, pa, unsigned = (base.pck, base.pa, base.pa_unsigned) if same else scores_of(found)
        seconds = round(time.perf_counter() - started, 1)
        told = change.numbers or (None,)
        rows = [
            Row(
                self.code, change.clip, self.frames, name, number.line if number else 0,
                shorten(number.values) if number else "", how, " ".join(change.stages),
                len(keys) - 1, int(same), pck, pa, unsigned, 100 * (pck - base.pck), pa - base.pa,
                unsigned - base.pa_unsigned, seconds, found.get("fault", ""), run,
            )
            for name, number, how in zip(change.names(), told, change.changes(), strict=True)
        ]  # fmt: skip
        for row in rows:
            self.add(row)
        self.done += 1
        print(f"{time.perf_counter() - self.began:6.0f} s {self.done:4d} {describe(rows)}",
              flush=True)  # fmt: skip
        return rows

    def broken(self) -> set[tuple[str, str]]:
        """Numbers and changes of them with which the code cannot run."""
        return {(row.number, row.change) for row in self.rows if row.fault and not row.others}

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
    return (
        f"{row.clip:<24}{rows[-1].number}{others} {rows[-1].change}  {told}  ({row.seconds:.0f} s)"
    )


class Study:
    """The numbers asked for, and the stages of each clip that use them."""

    def __init__(self, bench: Bench, clips: list[str]) -> None:
        """Runs the clips as they are, if that was not done yet."""
        self.bench, self.clips, trees = bench, clips, read_package()
        self.factors = WIDE if bench.words.wide else QUARTERS
        self.numbers = [n for n in find_numbers(trees) if wanted(n, bench.words)]
        if not self.numbers:
            raise SystemExit("No tuned number is called so; see tuned_numbers.py on their names.")
        self.stages = find_stages(trees)
        earlier = [row for row in bench.rows if row.code != bench.code]
        self.expected = expected_sizes(earlier, self.numbers)
        reach = {stage: reached_from(file, trees) for stage, file in self.stages.items()}
        self.using = {
            clip: {n.key: stages_using(n, trees, reach, called) for n in self.numbers}
            for clip, called in ((clip, bench.base(clip).called) for clip in clips)
        }

    def users(self, number: TunedNumber) -> list[str]:
        """Clips whose code uses the number."""
        return [clip for clip in self.clips if self.using[clip][number.key]]

    def change(self, clip: str, group: Group, factors: tuple[float, float]) -> Change:
        """Numbers times the lower or the upper factor."""
        reached = {stage for n in group.numbers for stage in self.using[clip][n.key]}
        order = [*self.stages, ""]
        stages = tuple(sorted(reached, key=order.index))
        return Change(clip, stages, group.numbers, tuple(factors[up] for up in group.ups))

    def in_order(self) -> list[TunedNumber]:
        """Numbers that some clip uses, the folders in the order asked for."""
        folders = self.bench.words.package or FOLDERS
        used = [n for n in self.numbers if self.users(n)]
        return sorted(used, key=lambda n: folders.index(n.module.split("/")[0]))

    def run(self) -> None:
        """Measure all of them."""
        if self.bench.words.constants:
            self.run_alone(self.in_order())
            return
        found: dict[str, TunedNumber] = {}
        for kind in reversed(KINDS):  # the last stages take least time
            for clip in self.clips:
                found |= {number.key: number for number in self.screen(clip, kind)}
        self.run_alone(found.values())

    def screen(self, clip: str, kind: tuple[str, ...]) -> list[TunedNumber]:
        """Numbers of a kind that change a clip much."""
        drawn = [group for group in self.draw(clip) if kind_of(group.numbers[0]) == kind]
        pairs = [part for group in drawn for part in (group, group.mirrored())]
        broken = self.bench.broken()
        groups = [
            group.without({(number, up) for number, change in broken for up in (False, True)
                           if change == name_change(self.factors[up])})
            for group in pairs
        ]  # fmt: skip
        groups = [group for group in groups if group.numbers]
        self.bench.measure_all(self.change(clip, group, self.factors) for group in groups)
        large = [group for group in groups if self.is_large(clip, group)]
        located = self.bench.pool.map(
            lambda group: [*locate(group, lambda part: self.is_large(clip, part))], large
        )
        return [one.numbers[0] for found in located for one in found]

    def run_alone(self, numbers: Iterable[TunedNumber]) -> None:
        """Each up and down, on every clip that uses it."""
        self.bench.measure_all(
            self.change(clip, Group((number,), (up,)), self.factors)
            for number in numbers
            for clip in self.users(number)
            for up in (False, True)
        )

    def draw(self, clip: str) -> list[Group]:
        """All numbers that a clip uses, in groups that begin with the same stages.

        Those of which much is expected do not spoil the groups of the others.
        """
        chance = random.Random(clip)
        order = [*self.stages, ""]
        groups = []
        for kind in KINDS:
            numbers = [n for n in self.in_order() if kind_of(n) == kind and self.using[clip][n.key]]
            ranks = {n.key: self.expected[n.key] * chance.uniform(0.5, 2.0) for n in numbers}
            numbers.sort(key=lambda n: (order.index(self.using[clip][n.key][0]), ranks[n.key]))
            groups += draw_groups(numbers, self.expected, TOGETHER, chance)
        return groups

    def is_large(self, clip: str, group: Group) -> bool:
        """Whether a change is much, and more than the clip's unsteadiness."""
        size = self.bench.measure(self.change(clip, group, self.factors))[0].size
        return size > 1 and size > self.unsteadiness(clip, kind_of(group.numbers[0]))

    def unsteadiness(self, clip: str, kind: tuple[str, ...]) -> float:
        """What the smallest changes of all numbers of a kind do."""
        numbers = [
            n for n in self.numbers
            if kind_of(n) == kind and self.using[clip][n.key]
            and all(isinstance(value, float) for value in n.values)
        ]  # fmt: skip
        group = draw_directions(numbers, self.expected, random.Random(clip))
        return self.bench.measure(self.change(clip, group, SHAKEN))[0].size

    def print_plan(self) -> None:
        """Every number with the stages that it reaches, and what the first round will take."""
        for number in self.in_order():
            clips = self.users(number)
            stages = " ".join(stage or "between" for stage in self.using[clips[0]][number.key])
            expected = f"{self.expected[number.key]:.2f}"
            print(f"{number.key:<70}{shorten(number.values):<24}{len(clips):2d} clips  "
                  f"{expected}  {stages}")  # fmt: skip
        total = 0.0
        for clip in self.clips:
            groups = self.draw(clip)
            base = self.bench.base(clip)
            stages = [self.change(clip, group, self.factors).stages for group in groups]
            seconds = 2 * sum(foresee(base, own) for own in stages)
            total += seconds
            sizes = " ".join(str(len(group.numbers)) for group in groups)
            print(f"{clip}: {2 * len(groups)} runs, {seconds:.0f} s; numbers together: {sizes}")
        print(f"{total:.0f} s in all")

    def move_clicks(self) -> None:
        """Picks of heads and feet moved along either axis; other clicks on the joints."""
        for part, of in (("head", "head"), ("foot", "shin")):
            for axis, name in enumerate("xy"):
                for move in (-MOVE, MOVE):
                    offset = tuple(move if a == axis else 0.0 for a in range(2))
                    told = f"clicks:{part} {name}, of a {of}"
                    self.bench.measure_all(
                        Change(clip, (), change=f"{move:+}", name=told,
                               task={"part": part, "offset": offset})
                        for clip in self.clips
                    )  # fmt: skip
        rendered = [clip for clip in self.clips if "_" not in clip]
        for seed in OTHER_SEEDS:  # a real clip's marks cannot be made again
            self.bench.measure_all(
                Change(clip, (), change=f"seed +{seed}", name="clicks:other clicks on joints",
                       task={"seed": seed})
                for clip in rendered
            )  # fmt: skip


def headline(bench: Bench, study: Study) -> str:
    """What was measured on what."""
    file = bench.base_file(study.clips[0])
    commit = json.loads(file.read_text())["commit"]
    clips = []
    for clip in study.clips:
        base = bench.base(clip)
        solid = f", PA-MPJPE {base.pa:.1f} mm, {base.pa_unsigned:.1f} without depth signs"
        clips.append(f"- {clip}: PCK {base.pck:.1%}{solid if np.isfinite(base.pa) else ''}")
    return "\n".join([
        "# What hangs on each number that somebody set", "",
        f"Made by `python benchmarks/sensitivity.py --summary`; measured at commit {commit}.",
        "Largest changes, either way, of carried PCK@0.2 and of PA-MPJPE (with depth signs from",
        "the person and, for numbers of lifting, without) over these clips:", "",
        *clips, "",
        f"Of rendered clips the first {bench.frames} frames; of real ones nothing is known in 3D.",
        "Numbers of tracking and segmentation are measured with the keyframes as they are. Many",
        "numbers are changed at once, each up or down by chance and then the other way round, in",
        "groups drawn anew for each clip; what changes much is taken apart. 'with others': the",
        "change is that of a group. Halved or doubled, and clicks: by earlier versions, while the",
        "value is the same; '-': not measured.",
    ])  # fmt: skip


def commit_of_code() -> str:
    """The commit that is checked out."""
    call = ["git", "-C", str(ROOT), "rev-parse", "--short", "HEAD"]
    return subprocess.run(call, capture_output=True, text=True, check=False).stdout.strip()


def kind_of(number: TunedNumber) -> tuple[str, ...]:
    """Folders whose numbers are measured alike."""
    return next(kind for kind in KINDS if number.module.split("/")[0] in kind)


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
    parser.add_argument("--wide", action="store_true", help="half and double")
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
        study.print_plan()
        return
    if not words.summary:
        (study.move_clicks if words.clicks else study.run)()
    values = {n.key: shorten(n.values) for n in study.numbers}
    wide = {name_change(factor) for factor in WIDE}
    rows = [
        row
        for row in bench.rows
        if row.code == bench.code
        or row.number.startswith("clicks:")
        or (row.change in wide and row.old == values.get(row.number))
    ]
    print_summary(rows, [n for n in study.numbers if not study.users(n)], headline(bench, study))


if __name__ == "__main__":
    main()
