"""What clicks on the player tell at once, before any work: what is still missing, and which of them
cannot be on the part that they were given for."""

from collections.abc import Iterable, Sequence
from itertools import groupby
from statistics import median

import numpy as np

from keyrecon.records import Pick

SIZES = (0.4, 2.5)
"""Of a player from head to feet in one frame, over the median of the other frames: a crouch halves
it, a player who comes closer doubles it. Beyond that a head or a foot was clicked elsewhere."""


def missing_parts(picks: Sequence[Pick]) -> list[str]:
    """What the program cannot do without and nobody clicked, as the options that give it."""
    counts = {part: sum(pick.part == part for pick in picks) for part in ("head", "foot")}
    missing = [] if counts["head"] else ["the head (--head X,Y)"]
    if counts["foot"] < 2:
        one = "both feet" if not counts["foot"] else "the other foot"
        missing.append(f"{one} ({' '.join(['--foot X,Y'] * (2 - counts['foot']))})")
    if len(picks) == counts["head"] + counts["foot"]:
        missing.append("a point on clothes or skin (--region shirt:X,Y)")
    return missing


def implausible_picks(picks: Iterable[Pick]) -> list[str]:
    """A line for every frame whose head and feet cannot be those of one standing player."""
    bodies = {}
    for frame, group in groupby(sorted(picks, key=lambda p: p.frame), lambda p: p.frame):
        body = list(group)
        heads, feet = ([(p.x, p.y) for p in body if p.part == part] for part in ("head", "foot"))
        if heads and feet:
            bodies[frame] = np.mean(feet, axis=0) - np.mean(heads, axis=0)
    lines = []
    for frame, (across, down) in bodies.items():
        others = [float(np.hypot(*body)) for other, body in bodies.items() if other != frame]
        size = float(np.hypot(across, down))
        if down <= 0:
            lines.append(f"Frame {frame}: the head was clicked lower than the feet; look there.")
        elif others and not SIZES[0] < size / median(others) < SIZES[1]:
            lines.append(
                f"Frame {frame}: head and feet were clicked {size:.0f} px apart, in the other "
                f"frames {median(others):.0f} px; look whether both are on the player."
            )
    return lines
