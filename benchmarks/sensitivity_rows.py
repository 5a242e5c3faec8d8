"""What sensitivity.py measured: its rows, and what they tell about each number."""

import csv
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from tuned_numbers import TunedNumber

NOTHING = 0.05
"""Points of PCK and mm of PA-MPJPE that are no change."""
MUCH_PCK, MUCH_PA = 2.0, 3.0
"""Points and mm from which on a number matters much."""


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
    pa_unsigned: float
    """The same without depth signs from the person."""
    d_pck: float
    """Points against the base."""
    d_pa: float
    """mm against the base."""
    d_pa_unsigned: float
    seconds: float
    fault: str
    """Last line of what was said when it failed."""

    @property
    def key(self) -> tuple[str, ...]:
        """Tells it from all other measurements."""
        return self.code, self.clip, str(self.frames), self.number, self.change


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
    """What one number does, over both directions and all clips: changes for the worse, >= 0."""

    number: str
    line: int
    old: str
    cost: tuple[float, float, float]
    """Largest loss on the mean over the clips, of either direction: points of PCK, mm of PA-MPJPE,
    mm without signs."""
    cost_one: tuple[float, float, float]
    """The same on the worst clip."""
    gain: tuple[float, float, float]
    """Largest gain on the mean."""
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
    good = [row for row in rows if not row.fault]
    losses = np.array([(-r.d_pck, r.d_pa, r.d_pa_unsigned) for r in good]).reshape(-1, 3)
    losses = np.ma.masked_invalid(losses)  # of a real clip, nothing is known in 3D
    changes = np.array([row.change for row in good])
    means = [losses[changes == change].mean(axis=0).filled(0) for change in sorted(set(changes))]
    losses, none = losses.filled(0), np.zeros(3)
    means = np.array(means).reshape(-1, 3)
    cost, cost_one, gain = (
        tuple(float(x) for x in np.max([none, *values], axis=0))
        for values in (means, losses, -means)
    )
    faults = tuple(sorted({f"{r.change}: {r.fault}" for r in rows if r.fault}))
    largest = float(np.abs(losses).max(initial=0))
    complete = len({row.change for row in rows}) > 1
    return Effect(
        number, rows[-1].line, rows[-1].old, cost, cost_one, gain, largest, faults, complete
    )


def is_much(loss: tuple[float, float, float], share: float = 1.0) -> bool:
    """Whether points or millimetres are more than a share of what counts as much."""
    pck, *errors = loss
    return pck > share * MUCH_PCK or max(errors) > share * MUCH_PA


def print_summary(rows: list[Row], unused: list[TunedNumber]) -> None:
    """What matters, what does nothing, what cannot be varied."""
    effects = summarise(rows)
    clicks = [e for e in effects if e.number.startswith("clicks:")]
    numbers = [e for e in effects if not e.number.startswith("clicks:")]
    much = [e for e in numbers if is_much(e.cost)]
    single = [e for e in numbers if not is_much(e.cost) and is_much(e.cost_one)]
    better = [e for e in numbers if is_much(e.gain, 0.5)]
    nothing = [e for e in numbers if e.largest < NOTHING and not e.faults and e.complete]
    limits = f"{MUCH_PCK:g} points or {MUCH_PA:g} mm"
    print_table(f"a quarter more or less costs more than {limits} on the mean", much)
    print_table("the same on one clip, not on the mean", single)
    print_table("a quarter more or less gains half of that on the mean", better)
    print_table("clicks", clicks)
    print(f"\nchange nothing (all under {NOTHING:g} points and mm): {len(nothing)}")
    for e in nothing:
        print(f"  {where(e)} = {e.old}")
    print(f"\nin no code that these clips run: {len(unused)}")
    for number in unused:
        print(f"  {number.module}:{number.line}:{number.name} = {shorten(number.values)}")
    print("\ncannot be varied so:")
    for e in numbers:
        for fault in e.faults:
            print(f"  {where(e)} {fault}")


def print_table(title: str, effects: list[Effect]) -> None:
    """Costs and gains, the largest cost in space first."""
    print(f"\n{title}: {len(effects)}")
    head = "".join(f"{name:>8}" for name in ("PCK", "PA", "auto"))
    print(f"{'':<62}{'value':>10} |{head} |{head} |{head}")
    print(f"{'':<62}{'':>10} |{'mean loss':>24} |{'worst clip':>24} |{'mean gain':>24}")
    for e in sorted(effects, key=lambda e: -max(e.cost[1:])):
        groups = ("".join(f"{x:8.2f}" for x in part) for part in (e.cost, e.cost_one, e.gain))
        print(f"{where(e):<62}{e.old:>10.10} |{' |'.join(groups)}")


def where(effect: Effect) -> str:
    """file:line:name."""
    return effect.number.replace(":", f":{effect.line}:", 1) if effect.line else effect.number
