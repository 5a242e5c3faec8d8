"""How arguments that several commands share are shown in the help."""

from pathlib import Path
from typing import Annotated

from tyro.conf import FlagCreatePairsOff, Positional, arg

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
