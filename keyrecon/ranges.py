"""The values that an option can have, beside its type: `reach: Annotated[int, within(1, 100)]`.

A range is wide: it holds what someone may try in earnest, and keeps out what would only end in a
division by zero, hours of work or a motion of NaN. `io.option_tables` holds options against it.
"""

from msgspec import Meta


def within(least: int | float, most: int | float) -> Meta:
    """Values from `least` to `most`, both included; never NaN."""
    return Meta(ge=least, le=most)


SHORTEST, TALLEST = 0.5, 2.6
"""Of people, metres."""
BODY_HEIGHTS = within(SHORTEST, TALLEST)
FIELDS_OF_VIEW = within(3, 150)
"""Of cameras, across the width of the picture, degrees."""
SEEDS = within(0, 2**32 - 1)
"""What NumPy's generators take."""
