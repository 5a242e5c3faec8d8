"""What the command line shows while it works: progress bars on stderr."""

import sys
import time
from collections.abc import Iterable, Iterator, Sized
from typing import TypeVar

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

Item = TypeVar("Item")
PLAIN_SECONDS = 10.0
"""Without a terminal, one line of progress at most this often."""


def show(items: Iterable[Item], description: str, total: int | None = None) -> Iterator[Item]:
    """Iterate with a bar on a terminal, with a line now and then elsewhere."""
    total = total if total is not None else _length(items)
    if sys.stderr.isatty():
        yield from _bar(items, description, total)
    else:
        yield from _lines(items, description, total)


def _length(items: Iterable[Item]) -> int | None:
    return len(items) if isinstance(items, Sized) else None


def _bar(items: Iterable[Item], description: str, total: int | None) -> Iterator[Item]:
    columns = (
        TextColumn("{task.description:<28}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True)) as progress:
        yield from progress.track(items, total=total, description=description)


def _lines(items: Iterable[Item], description: str, total: int | None) -> Iterator[Item]:
    started = reported = time.monotonic()
    done = 0
    for done, item in enumerate(items, 1):
        yield item
        if time.monotonic() - reported > PLAIN_SECONDS:
            reported = time.monotonic()
            sys.stderr.write(f"{description}: {done}{f' of {total}' if total else ''}\n")
    if time.monotonic() - started > 1:
        sys.stderr.write(f"{description}: done ({done}, {time.monotonic() - started:.1f} s)\n")
