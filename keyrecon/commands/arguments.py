"""Arguments that several commands share: how the help shows them, and which were typed."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from tyro.conf import FlagCreatePairsOff, Positional, arg

from keyrecon.errors import KeyreconError
from keyrecon.ranges import SHORTEST, TALLEST

Project = Positional[Annotated[Path, arg(metavar="PROJECT")]]
VideoFile = Positional[Annotated[Path, arg(metavar="VIDEO")]]
Files = Positional[Annotated[tuple[Path, ...], arg(metavar="FILE ...", help_behavior_hint="")]]
Switch = Annotated[bool, FlagCreatePairsOff, arg(help_behavior_hint="")]
"""Off unless it is typed."""
MaybeWhole = Annotated[int | None, arg(metavar="INT", help_behavior_hint="")]
MaybeNumber = Annotated[float | None, arg(metavar="FLOAT", help_behavior_hint="")]
MaybeFile = Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="")]
"""Left out unless they are typed; what counts then stands in the help."""
MaybeWorkers = Annotated[str | None, arg(metavar="N|ADDRESS", help_behavior_hint="")]

MaybeHeight = Annotated[str | None, arg(metavar="METRES", help_behavior_hint="")]


def body_height(text: str) -> float:
    """A height in metres from 1.88, 188, 1.88m or 188cm; KeyreconError for what nobody has."""
    match = re.fullmatch(r"(\d+(?:[.,]\d+)?)\s*(m|cm)?", text.strip())
    if match:
        height = float(match[1].replace(",", "."))
        if match[2] == "cm" or (match[2] is None and height >= 100 * SHORTEST):
            height /= 100
        if SHORTEST <= height <= TALLEST:
            return height
    raise KeyreconError(
        f"--height cannot be '{text}'; it is 0.5 to 2.6 metres, or 50 to 260 centimetres, such as "
        "1.88 or 188."
    )


def typed_options(words: Sequence[str]) -> frozenset[str]:
    """Names of the options among words that were typed, with dots, as option records have them.

    What is typed counts also where a project remembers another value and this is the usual one.
    """
    flags = (word[2:].partition("=")[0] for word in words if word.startswith("--"))
    names = {flag.replace("-", "_") for flag in flags}
    return frozenset(names | {re.sub(r"(^|\.)no_", r"\1", name) for name in names})
