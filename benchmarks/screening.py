"""Which few of many numbers change a result, in far fewer runs than numbers.

Numbers are changed together, each up or down by chance, and once more the other way round (a
foldover pair: every number goes both ways, and what two of them do to one another stays apart from
what they do alone). Where neither run changes the result, none of the group does, unless two
cancel; that is why every clip draws its groups and directions anew. Where one does, its group is
halved until it is known which number does it. (Group screening: Watson 1961, Technometrics 3;
sequential bifurcation: Bettonvil and Kleijnen 1997, Eur. J. Oper. Res. 96; chances that differ
from number to number decide the groups' sizes: Watson's Section 5.)
"""

import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import hypot

from tuned_numbers import TunedNumber


@dataclass(frozen=True)
class Group:
    """Numbers that are changed together."""

    numbers: tuple[TunedNumber, ...]
    ups: tuple[bool, ...]
    """Which of them go up; the others go down."""

    def mirrored(self) -> "Group":
        """Every number the other way."""
        return Group(self.numbers, tuple(not up for up in self.ups))

    def without(self, left_out: set[tuple[str, bool]]) -> "Group":
        """The others, where some numbers cannot be changed in some directions."""
        pairs = zip(self.numbers, self.ups, strict=True)
        kept = [(number, up) for number, up in pairs if (number.key, up) not in left_out]
        return Group(tuple(number for number, _ in kept), tuple(up for _, up in kept))

    def halves(self) -> tuple["Group", "Group"]:
        """The first numbers and the others, in the same directions."""
        middle = len(self.numbers) // 2
        return (
            Group(self.numbers[:middle], self.ups[:middle]),
            Group(self.numbers[middle:], self.ups[middle:]),
        )


def draw_groups(
    numbers: Sequence[TunedNumber],
    expected: Mapping[str, float],
    limit: float,
    chance: random.Random,
) -> list[Group]:
    """Groups of neighbours, as large as lets their expected changes stay below the limit.

    `expected`: by a number's key, in the limit's unit. Changes of either sign add up by squares.
    Within a group those of which most is expected come last, so that halving keeps them together.
    """
    groups: list[list[TunedNumber]] = []
    size = 0.0
    for number in numbers:
        size = hypot(size, expected[number.key])
        if not groups or size > limit:
            groups.append([])
            size = expected[number.key]
        groups[-1].append(number)
    return [draw_directions(group, expected, chance) for group in groups]


def draw_directions(
    numbers: Sequence[TunedNumber], expected: Mapping[str, float], chance: random.Random
) -> Group:
    """A group in directions that nobody chose."""
    ranked = sorted(numbers, key=lambda number: expected[number.key])
    return Group(tuple(ranked), tuple(chance.random() < 0.5 for _ in ranked))


def locate(group: Group, is_large: Callable[[Group], bool]) -> Iterator[Group]:
    """Single numbers that change the result; together, the group's are known to.

    Where the first half does not, the second must, and is not run as a whole. Nothing comes out
    where only two together do.
    """
    if len(group.numbers) == 1:
        if is_large(group):
            yield group
        return
    first, second = group.halves()
    first_large = is_large(first)
    if first_large:
        yield from locate(first, is_large)
    if not first_large or is_large(second):
        yield from locate(second, is_large)
