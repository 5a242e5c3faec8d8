"""How a long stage tells how far it is: it iterates through a `Progress`.

The command line passes one that draws a bar; the library's default stays silent.
"""

from collections.abc import Iterable, Iterator
from typing import Protocol, TypeVar, runtime_checkable

Item = TypeVar("Item")


@runtime_checkable
class Progress(Protocol):
    """Hands on the items of a long loop and shows how many are done."""

    def __call__(
        self, items: Iterable[Item], description: str, total: int | None = None
    ) -> Iterator[Item]:
        """Iterate over `items`; `total` where they have no length."""
        ...


def silent(
    items: Iterable[Item],
    description: str,
    total: int | None = None,
) -> Iterator[Item]:
    """Show nothing."""
    return iter(items)
