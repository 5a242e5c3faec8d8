"""What sensitivity.py measured: its rows, and what they tell about each number."""

import csv
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from tuned_numbers import TunedNumber

MUCH_PCK, MUCH_PA = 2.0, 3.0
"""Points and mm from which on a number matters much."""
QUARTERS, WIDE, SHAKEN = (0.75, 1.25), (0.5, 2.0), (0.99, 1.01)
"""Factors of numbers: those that are asked for, others for what seems to do nothing, and those
that show how steady a clip is."""
LITTLE = 0.08
"""Of what is much: the change expected of a number of which nothing is known. The median of 400
changes of suspects alone, on four clips, is .14 in lifting and .10 in propagation."""


@dataclass(frozen=True)
class Row:
    """One measurement, as it stands in the CSV."""

    code: str
    """Version of the package's code (`code_digest`)."""
    clip: str
    frames: int
    """Used of a rendered clip; 0 for all."""
    number: str
    """file:name of a number, or 'clicks:...'."""
    line: int
    old: str
    change: str
    """'x0.75', 'x1.25', '+0.15', ..."""
    stages: str
    """Stages that the change reaches by itself."""
    others: int
    """Numbers that were changed along with it."""
    same: int
    """1 where no bit of any stage's result changed."""
    pck: float
    """0-1"""
    pa: float
    """mm; NaN where nothing is known in 3D."""
    pa_unsigned: float
    """The same without depth signs from the person."""
    d_pck: float
    """Points against the base."""
    d_pa: float
    """mm against the base."""
    d_pa_unsigned: float
    seconds: float
    fault: str
    """What was said when it failed."""
    run: str = ""
    """The same for all numbers that were changed together."""

    @property
    def key(self) -> tuple[str, ...]:
        """Tells it from all other measurements."""
        return self.code, self.clip, str(self.frames), self.number, self.run or self.change

    @property
    def changes(self) -> tuple[float, float, float]:
        """Against the base: points of PCK, mm of PA-MPJPE, mm without signs."""
        return self.d_pck, self.d_pa, self.d_pa_unsigned

    @property
    def size(self) -> float:
        """The largest of these, in units of what is much; endless where it failed."""
        if self.fault:
            return float("inf")
        units = np.array([MUCH_PCK, MUCH_PA, MUCH_PA])
        return float(np.nanmax(np.abs(self.changes) / units))


def read_rows(file: Path) -> Iterator[Row]:
    """The rows of a CSV; none where there is no file."""
    kinds = {f.name: f.type for f in fields(Row)}
    if file.is_file():
        with file.open(newline="") as lines:
            for line in csv.DictReader(lines):
                yield Row(**{name: kinds[name](value) for name, value in line.items()})


def name_change(factor: float) -> str:
    """How rows call a number times a factor."""
    return f"x{factor:g}"


def expected_sizes(rows: Iterable[Row], numbers: Iterable[TunedNumber]) -> dict[str, float]:
    """What is expected of a quarter, in units of what is much, by the number's key.

    The median of what was measured; a group's change is shared by its numbers, by squares. Halving
    is two quarters.
    """
    quarters = {name_change(factor) for factor in QUARTERS}
    sizes: dict[str, list[float]] = defaultdict(list)
    for row in rows:
        share = 1.0 if row.change in quarters else 0.5
        if row.change.startswith("x") and not row.fault:
            sizes[row.number].append(share * row.size / (1 + row.others) ** 0.5)
    return {number.key: float(np.median(sizes.get(number.key, LITTLE))) for number in numbers}


def shorten(values: Iterable[float]) -> str:
    """Numbers as text, the first four of many."""
    texts = [f"{value:.4g}" for value in values]
    return " ".join(texts[:4]) + (" ..." if len(texts) > 4 else "")


def decisive(rows: Iterable[Row]) -> list[Row]:
    """For each clip and direction the row that tells most: alone, else the least of its groups.

    What a group changes much tells nothing of each of its numbers.
    """
    found: dict[tuple[str, str], Row] = {}
    for row in rows:
        if row.size <= 1 or not row.others:
            known = found.get((row.clip, row.change))
            if known is None or not row.others or (known.others and row.size <= known.size):
                found[row.clip, row.change] = row
    return list(found.values())


@dataclass(frozen=True)
class Effect:
    """Largest changes over some rows, either way."""

    pck: float
    """Points."""
    pa: float
    """mm, with signs or without."""
    clips: int
    directions: tuple[str, ...]
    """Changes that were measured."""
    alone: bool
    """Whether nothing else was changed with it."""
    same: bool
    """Whether no bit changed."""
    faults: tuple[str, ...]

    @classmethod
    def of(cls, rows: list[Row]) -> "Effect":
        """The effect of one number, or of clicks, that these rows vary."""
        latest = decisive(rows)
        good = [row for row in latest if not row.fault]
        values = np.abs([row.changes for row in good]).reshape(-1, 3)
        values = np.where(np.isfinite(values), values, 0.0)  # in 3D nothing is known of real clips
        return cls(
            float(values[:, 0].max(initial=0)),
            float(values[:, 1:].max(initial=0)),
            len({row.clip for row in good}),
            tuple(sorted({row.change for row in good})),
            not any(row.others and not row.same for row in good),
            bool(good) and all(row.same for row in good),
            tuple(sorted({f"{row.change}: {row.fault}" for row in latest if row.fault})),
        )

    @property
    def is_much(self) -> bool:
        """Whether it is more than `MUCH_PCK` points or `MUCH_PA` mm."""
        return self.pck > MUCH_PCK or self.pa > MUCH_PA

    @property
    def is_nothing(self) -> bool:
        """Whether no bit changed, either way."""
        return self.same and len(self.directions) > 1 and not self.faults

    def __str__(self) -> str:
        """Points and mm."""
        if not self.clips:
            return "; ".join(self.faults) or "-"
        told = "same bits" if self.same else f"{self.pck:.1f} points, {self.pa:.1f} mm"
        notes = [] if len(self.directions) > 1 else [f"{self.directions[0]} alone"]
        notes += [] if self.alone else ["with others"]
        return told + (f" ({', '.join(notes)})" if notes else "")


def by_number(rows: Iterable[Row]) -> dict[str, list[Row]]:
    """The rows of each number."""
    found: dict[str, list[Row]] = defaultdict(list)
    for row in rows:
        found[row.number].append(row)
    return found


def print_summary(rows: list[Row], unused: list[TunedNumber], head: str) -> None:
    """The table as markdown: unsteadiness, clicks, then every number."""
    print(head)
    quarters, wide, shaken = ({name_change(f) for f in of} for of in (QUARTERS, WIDE, SHAKEN))
    print_coverage([row for row in rows if row.change in quarters])
    print_unsteadiness([row for row in rows if row.change in shaken])
    print_clicks([row for row in rows if row.number.startswith("clicks:")])
    of = by_number(row for row in rows if row.change in quarters | wide)
    effects = {
        name: tuple(Effect.of([r for r in group if r.change in of]) for of in (quarters, wide))
        for name, group in of.items()
    }
    much = [name for name, (quarter, _) in effects.items() if quarter.is_much]
    print_much(much, {name: [r for r in of[name] if r.change in quarters] for name in much})
    nothing = [name for name, (quarter, _) in effects.items() if quarter.is_nothing]
    rest = [name for name in effects if name not in much and name not in nothing]
    print_table("Less than that", rest, effects, of)
    print_table("Not a bit changes", nothing, effects, of)
    print_unresolved([row for row in rows if row.change in quarters], effects)
    print(f"\n## In no code that these clips run ({len(unused)})\n")
    for number in unused:
        print(f"- `{number.key}` = {shorten(number.values)}")


def print_coverage(rows: list[Row]) -> None:
    """Which folders' numbers were changed on which clips, and in how many runs."""
    print("\n| folder | runs | clips |\n|---|---|---|")
    for folder in sorted({row.number.split("/")[0] for row in rows}):
        own = [row for row in rows if row.number.startswith(folder + "/")]
        clips = dict.fromkeys(row.clip for row in own)
        runs = len({(row.clip, row.run) for row in own})
        print(f"| {folder} | {runs} | {len(clips)}: {', '.join(clips)} |")


def print_unsteadiness(rows: list[Row]) -> None:
    """What a hundredth changes."""
    print(
        "\n## All numbers of a folder at once by a hundredth, which changes nothing of substance\n"
    )
    print("| clip | first number | numbers | PCK, points | PA-MPJPE, mm | without signs, mm |")
    print("|---|---|---|---|---|---|")
    for row in {(r.clip, r.run): r for r in rows}.values():
        told = row.number.split("/")[0]
        print(f"| {row.clip} | {told} | {row.others + 1} | {row.fault or tell(row)} |")


def print_clicks(rows: list[Row]) -> None:
    """What other clicks change."""
    if rows:
        print("\n## Clicks\n")
        print("| what | change | clip | PCK, points | PA-MPJPE, mm | without signs, mm |")
        print("|---|---|---|---|---|---|")
    for row in rows:
        told = row.number.removeprefix("clicks:")
        print(f"| {told} | {row.change} | {row.clip} | {row.fault or tell(row)} |")


def tell(row: Row) -> str:
    """Changes as cells of a table."""
    return " | ".join(f"{c:+.1f}" if np.isfinite(c) else "" for c in row.changes)


def print_much(names: list[str], of: dict[str, list[Row]]) -> None:
    """Numbers that change a clip much, with the mean of all clips that were measured."""
    print(f"\n## A quarter changes a clip by more than {MUCH_PCK:g} points or {MUCH_PA:g} mm "
          f"({len(names)})\n")  # fmt: skip
    print("Changes of PCK in points, of PA-MPJPE with and without depth signs in mm.\n")
    print("| number | value | change | mean of clips | most | clips |")
    print("|---|---|---|---|---|---|")
    sizes = {name: max(row.size for row in decisive(of[name]) if not row.fault) for name in names}
    for name in sorted(names, key=lambda name: -sizes[name]):
        alone = [row for row in decisive(of[name]) if not row.others and not row.fault]
        for change in sorted({row.change for row in alone}):
            rows = [row for row in alone if row.change == change]
            mean = [np.array([row.changes[at] for row in rows]) for at in range(3)]
            means = " ".join(f"{np.nanmean(m):+.1f}" for m in mean if np.isfinite(m).any())
            worst = max(rows, key=lambda row: row.size)
            most = " ".join(f"{c:+.1f}" for c in worst.changes if np.isfinite(c))
            print(f"| `{name}` | {worst.old} | {change} | {means} | {most} on {worst.clip} "
                  f"| {len(rows)} |")  # fmt: skip


def print_unresolved(rows: list[Row], effects: dict[str, tuple[Effect, Effect]]) -> None:
    """Groups that change a clip much, where none of their numbers was found to."""
    runs: dict[tuple[str, str], list[Row]] = defaultdict(list)
    for row in rows:
        if row.size > 1 and row.others and not row.fault:
            runs[row.clip, row.run].append(row)
    left = [own for own in runs.values() if not any(effects[r.number][0].is_much for r in own)]
    print(f"\n## Groups that change a clip that much, and no number of theirs does ({len(left)})\n")
    print("| clip | numbers, the last of them | PCK, points | PA-MPJPE, mm | without signs, mm |")
    print("|---|---|---|---|---|")
    for own in left:
        last = own[-1]
        print(f"| {last.clip} | {len(own)}, `{last.number}` | {tell(last)} |")


def print_table(
    title: str,
    names: list[str],
    effects: dict[str, tuple[Effect, Effect]],
    rows: dict[str, list[Row]],
) -> None:
    """Numbers with what they change, the largest change first."""
    print(f"\n## {title} ({len(names)})\n")
    print("| number | value | a quarter more or less | halved or doubled | clips |")
    print("|---|---|---|---|---|")
    for name in sorted(names, key=lambda n: -effects[n][0].pa):
        quarter, wide = effects[name]
        print(f"| `{name}` | {rows[name][-1].old} | {quarter} | {wide} | {quarter.clips} |")
