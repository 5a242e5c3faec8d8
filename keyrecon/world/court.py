"""The tennis court: what is painted on it, in metres, and what its points are called.

ITF Rules of Tennis 2024, rule 1 and appendix VIII: 23.77 m by 10.97 m, singles 8.23 m wide, service
lines 6.40 m from the net, the net 0.914 m high in the middle and 1.07 m at its posts, which stand
0.914 m outside the court. Courts are laid out to the outside of the lines, so that the middle of
a line lies half its width further in.

World axes, the same everywhere: origin on the ground at the middle of the net, x along the net to
the right as seen from the camera's half, y up the court away from the camera, z up; metres. The
court looks the same from both ends, so which half is the near one is told by the camera alone.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np
from jaxtyping import Float, Int

from keyrecon.ranges import within

HALF_LENGTH, HALF_DOUBLES, HALF_SINGLES, SERVICE = 11.885, 5.485, 4.115, 6.40
NET_MIDDLE, NET_POST, POST_BEYOND = 0.914, 1.07, 0.914
TAPE_HEIGHT = 0.055
"""Height of the white band on top of the net: the rules have 5 to 6.35 cm."""
SPACING = 0.1
"""Metres between the points that stand for a line, as long as nobody says otherwise."""


@dataclass(frozen=True)
class CourtOptions:
    """How the lines are painted."""

    line_width: Annotated[float, within(0, 0.3)] = 0.05
    """Width of all lines but the baselines, metres. Courts are laid out to the outside of the
    lines; 0 where to their middles."""
    baseline_width: Annotated[float, within(0, 0.3)] = 0.10
    """Width of the baselines, metres: up to 0.10 by the rules, and so on most courts."""


@dataclass(frozen=True, eq=False)
class CourtModel:
    """Straight white stripes in space; N points stand for them."""

    names: tuple[str, ...]
    ends: Float[np.ndarray, "L 2 3"]
    """Both ends of the middle of every stripe, metres."""
    width: Float[np.ndarray, "L"]
    """Metres."""
    empty: Float[np.ndarray, "E 2 3"]
    """Where a line would go on and does not: nothing is painted between these ends."""
    spacing: float = SPACING
    """Metres between the points that stand for a line."""

    @cached_property
    def points(self) -> Float[np.ndarray, "N 3"]:
        """Points all along the stripes, line after line."""
        return np.concatenate([_along(a, b, self.spacing) for a, b in self.ends])

    @cached_property
    def line(self) -> Int[np.ndarray, "N"]:
        """Which stripe each point stands for."""
        counts = [len(_along(a, b, self.spacing)) for a, b in self.ends]
        return np.repeat(np.arange(len(counts)), counts)

    @cached_property
    def direction(self) -> Float[np.ndarray, "N 3"]:
        """Unit vector along the stripe at each point."""
        way = self.ends[:, 1] - self.ends[:, 0]
        return (way / np.linalg.norm(way, axis=1, keepdims=True))[self.line]

    @cached_property
    def across(self) -> Float[np.ndarray, "N 3"]:
        """Half the stripe's width across it: on the ground, or up for the net's tape."""
        on_ground = np.abs(self.ends[..., 2]).max(axis=1) == 0
        turned = np.cross(self.direction, [0.0, 0.0, 1.0])
        aside = np.where(on_ground[self.line][:, None], turned, [0.0, 0.0, 1.0])
        return aside * self.width[self.line][:, None] / 2


def _along(
    start: Float[np.ndarray, "3"], end: Float[np.ndarray, "3"], spacing: float
) -> Float[np.ndarray, "n 3"]:
    count = max(2, round(float(np.linalg.norm(end - start)) / spacing))
    share = (np.arange(count) + 0.5) / count
    return start + share[:, None] * (end - start)


def tennis_court(options: CourtOptions = CourtOptions()) -> CourtModel:
    """Lines and the net's tape of a tennis court."""
    inset, deep = options.line_width / 2, options.baseline_width / 2
    doubles, singles = HALF_DOUBLES - inset, HALF_SINGLES - inset
    base, service = HALF_LENGTH - deep, SERVICE - inset
    lines = {
        "left doubles sideline": ((-doubles, -HALF_LENGTH), (-doubles, HALF_LENGTH)),
        "left singles sideline": ((-singles, -HALF_LENGTH), (-singles, HALF_LENGTH)),
        "centre service line": ((0, -SERVICE), (0, SERVICE)),
        "right singles sideline": ((singles, -HALF_LENGTH), (singles, HALF_LENGTH)),
        "right doubles sideline": ((doubles, -HALF_LENGTH), (doubles, HALF_LENGTH)),
        "near baseline": ((-HALF_DOUBLES, -base), (HALF_DOUBLES, -base)),
        "near service line": ((-HALF_SINGLES, -service), (HALF_SINGLES, -service)),
        "far service line": ((-HALF_SINGLES, service), (HALF_SINGLES, service)),
        "far baseline": ((-HALF_DOUBLES, base), (HALF_DOUBLES, base)),
    }
    ends = [[(*a, 0.0), (*b, 0.0)] for a, b in lines.values()]
    post, drop = HALF_DOUBLES + POST_BEYOND, TAPE_HEIGHT / 2
    middle = (0.0, 0.0, NET_MIDDLE - drop)
    ends += [[(side * post, 0.0, NET_POST - drop), middle] for side in (-1, 1)]
    wide = options.line_width or 0.05
    width = [(options.baseline_width or 0.1) if "baseline" in name else wide for name in lines]
    return CourtModel(
        (*lines, "net, left half", "net, right half"),
        np.array(ends, dtype=float),
        np.array([*width, TAPE_HEIGHT, TAPE_HEIGHT]),
        _empty_stretches(),
    )


def _empty_stretches() -> Float[np.ndarray, "E 2 3"]:
    """Beyond the ends of the lines: what tells a service line from a baseline."""
    gap, reach = 0.25, 1.2
    stretches = []
    for side in (-1, 1):
        for half in (HALF_SINGLES, HALF_DOUBLES):
            start, end = HALF_LENGTH + gap, HALF_LENGTH + reach
            stretches += [((half * side, start * way), (half * side, end * way)) for way in (-1, 1)]
        for way in (-1, 1):
            stretches += [
                ((side * (HALF_DOUBLES + gap), way * HALF_LENGTH),
                 (side * (HALF_DOUBLES + reach), way * HALF_LENGTH)),
                ((side * (HALF_SINGLES + gap), way * SERVICE),
                 (side * (HALF_DOUBLES - gap), way * SERVICE)),
            ]  # fmt: skip
    stretches += [
        ((0.0, way * (SERVICE + gap)), (0.0, way * (HALF_LENGTH - 0.6))) for way in (-1, 1)
    ]
    return np.array([[(*a, 0.0), (*b, 0.0)] for a, b in stretches])


POINTS: dict[str, tuple[float, float, float]] = {
    f"{end}-{side}{line}": (sign * x, way * y, 0.0)
    for end, way in (("near", -1), ("far", 1))
    for side, sign in (("left", -1), ("right", 1))
    for line, x, y in (
        ("", HALF_DOUBLES, HALF_LENGTH),
        ("-singles", HALF_SINGLES, HALF_LENGTH),
        ("-service", HALF_SINGLES, SERVICE),
    )
}
"""Points that a person can click, by name: on the lines' outer edges, where the rules measure."""
POINTS |= {f"{end}-service": (0.0, way * SERVICE, 0.0) for end, way in (("near", -1), ("far", 1))}
POINTS |= {f"{end}-mark": (0.0, way * HALF_LENGTH, 0.0) for end, way in (("near", -1), ("far", 1))}
POINTS |= {
    "net-middle": (0.0, 0.0, NET_MIDDLE),
    "net-left": (-HALF_DOUBLES - POST_BEYOND, 0.0, NET_POST),
    "net-right": (HALF_DOUBLES + POST_BEYOND, 0.0, NET_POST),
    "net-left-foot": (-HALF_DOUBLES - POST_BEYOND, 0.0, 0.0),
    "net-right-foot": (HALF_DOUBLES + POST_BEYOND, 0.0, 0.0),
}
