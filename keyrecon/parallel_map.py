"""A map over independent pieces of a stage's work, which workers may do in parallel.

By default the pieces are done here, one after the other; the command line passes a map that gives
them to workers.
"""

from collections.abc import Callable, Iterable, Iterator
from typing import Any, Protocol, TypeVar, runtime_checkable

Result = TypeVar("Result")


@runtime_checkable
class ParallelMap(Protocol):
    """Calls a function of a module with many inputs; results in order."""

    def __call__(
        self, work: Callable[..., Result], inputs: Iterable[tuple[Any, ...]]
    ) -> Iterator[Result]:
        """`work(*arguments)` for each tuple of arguments, which are records and arrays."""
        ...


def one_by_one(work: Callable[..., Result], inputs: Iterable[tuple[Any, ...]]) -> Iterator[Result]:
    """Here, one after the other."""
    return (work(*arguments) for arguments in inputs)
