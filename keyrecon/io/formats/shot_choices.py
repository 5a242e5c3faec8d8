"""shots.json: {"use": [3], "skip": [2]}.

Numbers of shots, the first is 1, of which a person said on the page that they show the player, or
do not. The next choice of keyframes takes them over into the options of the project.
"""

import json
from dataclasses import dataclass
from pathlib import Path

from keyrecon.io.durable import write_durably
from keyrecon.reading import parse_json, read_text, reading, whole


@dataclass(frozen=True)
class ShotChoices:
    """What a person said of shots, by their numbers from 1 on."""

    use: tuple[int, ...] = ()
    skip: tuple[int, ...] = ()

    def with_choice(self, number: int, used: bool | None) -> "ShotChoices":
        """The same with one more choice; None takes back what was said of the shot."""
        use, skip = {*self.use} - {number}, {*self.skip} - {number}
        if used is not None:
            (use if used else skip).add(number)
        return ShotChoices(tuple(sorted(use)), tuple(sorted(skip)))


def read_shot_choices(path: Path) -> ShotChoices:
    """Read choices; raises KeyreconError for a file that does not hold them."""
    with reading(path, "a choice of shots", "delete it and choose again"):
        content = parse_json(read_text(path))
        use, skip = (tuple(whole(number) for number in content[name]) for name in ("use", "skip"))
        if {*use} & {*skip}:
            raise ValueError("a shot cannot be used and left out")
        return ShotChoices(use, skip)


def write_shot_choices(path: Path, choices: ShotChoices) -> None:
    """Write choices durably."""
    write_durably(path, json.dumps({"use": choices.use, "skip": choices.skip}) + "\n")
