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
NOTHING = 0.05
"""Points and mm that are no change."""
SMALL_PCK, SMALL_PA = 1.0, 1.0
"""Points and mm up to which halving or doubling says enough: less than what other clicks on the
same joints do."""
QUARTERS, WIDE = ("x0.75", "x1.25"), ("x0.5", "x2")


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

    @property
    def key(self) -> tuple[str, ...]:
        """Tells it from all other measurements."""
        return self.code, self.clip, str(self.frames), self.number, self.change

    @property
    def changes(self) -> tuple[float, float, float]:
        """Against the base: points of PCK, mm of PA-MPJPE, mm without signs."""
        return self.d_pck, self.d_pa, self.d_pa_unsigned

    @property
    def is_small(self) -> bool:
        """Whether the change is worth no closer look."""
        errors = [abs(e) for e in self.changes[1:] if np.isfinite(e)]
        small = abs(self.d_pck) <= SMALL_PCK and max(errors, default=0) <= SMALL_PA
        return small and not self.fault


def read_rows(file: Path) -> Iterator[Row]:
    """The rows of a CSV; none where there is no file."""
    kinds = {f.name: f.type for f in fields(Row)}
    if file.is_file():
        with file.open(newline="") as lines:
            for line in csv.DictReader(lines):
                yield Row(**{name: kinds[name](value) for name, value in line.items()})


def shorten(values: Iterable[float]) -> str:
    """Numbers as text, the first four of many."""
    texts = [f"{value:.4g}" for value in values]
    return " ".join(texts[:4]) + (" ..." if len(texts) > 4 else "")


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
        """The effect of one number, or of clicks, that these rows vary; the latest rows count."""
        latest = {row.key: row for row in rows}.values()
        latest = [row for row in latest if row.is_small or not row.others]  # else: by whom?
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
        """Whether nothing changes that could be told from rounding."""
        return bool(self.clips) and max(self.pck, self.pa) < NOTHING and not self.faults

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
    """The table as markdown: clicks, then every number by folder."""
    print(head)
    of = by_number(rows)
    print("\n## Clicks\n")
    print("| what | change | clip | PCK, points | PA-MPJPE, mm | without signs, mm |")
    print("|---|---|---|---|---|---|")
    for row in rows:
        if row.number.startswith("clicks:"):
            scores = " | ".join(f"{c:+.1f}" if np.isfinite(c) else "" for c in row.changes)
            told = row.number.removeprefix("clicks:")
            print(f"| {told} | {row.change} | {row.clip} | {row.fault or scores} |")
    effects = {
        name: tuple(Effect.of([r for r in group if r.change in of]) for of in (QUARTERS, WIDE))
        for name, group in of.items()
        if not name.startswith("clicks:")
    }
    much = [name for name, (quarter, _) in effects.items() if quarter.is_much]
    print_table(
        f"A quarter changes more than {MUCH_PCK:g} points or {MUCH_PA:g} mm", much, effects, of
    )
    nothing = [n for n, (q, w) in effects.items() if w.is_nothing and not q.is_much]
    rest = [name for name in effects if name not in much and name not in nothing]
    print_table("Less than that, or not measured by a quarter", rest, effects, of)
    print(f"\n## Nothing changes ({len(nothing)})\n")
    for name in nothing:
        wide = effects[name][1]
        quiet = "no bit" if wide.same else f"less than {NOTHING:g} points and mm"
        print(f"- `{name}` = {of[name][0].old}: {quiet}, {' and '.join(wide.directions)}")
    print(f"\n## In no code that these clips run ({len(unused)})\n")
    for number in unused:
        print(f"- `{number.key}` = {shorten(number.values)}")


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
    for name in sorted(names, key=lambda n: -max(e.pa for e in effects[n])):
        quarter, wide = effects[name]
        clips = len({row.clip for row in rows[name]})
        print(f"| `{name}` | {rows[name][0].old} | {quarter} | {wide} | {clips} |")
