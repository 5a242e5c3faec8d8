"""How a stage hands out pieces of its work that do not hang on one another.

By default they are done here, one after the other; the command line passes one that gives them to
workers elsewhere.
"""

from collections.abc import Callable, Iterable, Iterator
from typing import Any, Protocol, TypeVar, runtime_checkable

Result = TypeVar("Result")


@runtime_checkable
class Spread(Protocol):
    """Calls a function of a module with many inputs; results in order."""

    def __call__(
        self, work: Callable[..., Result], inputs: Iterable[tuple[Any, ...]]
    ) -> Iterator[Result]:
        """`work(*arguments)` for each tuple of arguments, which are records and arrays."""
        ...


def one_by_one(work: Callable[..., Result], inputs: Iterable[tuple[Any, ...]]) -> Iterator[Result]:
    """Here, one after the other."""
    return (work(*arguments) for arguments in inputs)
