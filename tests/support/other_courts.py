"""Courts of other sports, to be painted: what passes for a tennis court and is none."""

from itertools import pairwise

import numpy as np

from keyrecon.world.court import CourtModel

TAPE = 0.055
"""Height of the white band on a net, metres."""


def _court(ground, nets, line_width=0.05):
    """Lines on the ground as pairs of (x, y), nets as pairs of (x, height), metres."""
    ends = [[(*a, 0.0), (*b, 0.0)] for a, b in ground]
    ends += [[(x0, 0.0, z0), (x1, 0.0, z1)] for (x0, z0), (x1, z1) in nets]
    width = [line_width] * len(ground) + [TAPE] * len(nets)
    names = tuple(str(number) for number in range(len(ends)))
    return CourtModel(names, np.array(ends, float), np.array(width), np.zeros((0, 2, 3)))


def _rectangle(half_width, half_length):
    corners = [(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)]
    places = [(x * half_width, y * half_length) for x, y in corners]
    return list(pairwise(places))


def _arc(middle, radius, start, end):
    turn = np.radians(np.linspace(start, end, 25))
    places = [(middle[0] + radius * np.cos(a), middle[1] + radius * np.sin(a)) for a in turn]
    return list(pairwise(places))


def pickleball_court():
    """USA Pickleball rulebook 2024, 2: 13.41 m by 6.10 m, kitchen 2.13 m, net 0.91 to 0.86 m."""
    across = [((-3.05, y), (3.05, y)) for y in (-2.13, 2.13)]
    middle = [((0, s * 2.13), (0, s * 6.705)) for s in (-1, 1)]
    net = [((s * 3.35, 0.885), (0, 0.835)) for s in (-1, 1)]
    return _court([*_rectangle(3.05, 6.705), *across, *middle], net)


def badminton_court():
    """Laws of Badminton 2023, 1: 13.40 m by 6.10 m, lines 40 mm, the net 1.524 m high."""
    sides = [((x, -6.7), (x, 6.7)) for x in (-3.05, -2.59, 2.59, 3.05)]
    across = [((-3.05, y), (3.05, y)) for y in (-6.7, -5.94, -1.98, 1.98, 5.94, 6.7)]
    middle = [((0, s * 1.98), (0, s * 6.7)) for s in (-1, 1)]
    return _court([*sides, *across, *middle], [((-3.05, 1.52), (3.05, 1.52))], 0.04)


def volleyball_court():
    """FIVB rules 2024, 1 and 2: 18 m by 9 m, attack lines 3 m, net 2.43 m high and 1 m deep."""
    across = [((-4.5, y), (4.5, y)) for y in (-3, 0, 3)]
    net = [((-4.75, z), (4.75, z)) for z in (2.4, 1.45)]
    return _court([*_rectangle(4.5, 9), *across], net)


def padel_court():
    """FIP rules 2024, 1: 20 m by 10 m, service lines 6.95 m from the net, net 0.92 to 0.88 m."""
    across = [((-5, y), (5, y)) for y in (-6.95, 6.95)]
    net = [((s * 5, 0.89), (0, 0.85)) for s in (-1, 1)]
    return _court([*_rectangle(5, 10), *across, ((0, -7.15), (0, 7.15))], net)


def basketball_court():
    """FIBA rules 2024, 2: 28 m by 15 m, keys 4.9 m by 5.8 m, arcs of 6.75 m."""
    lines = [*_rectangle(7.5, 14), ((-7.5, 0), (7.5, 0)), *_arc((0, 0), 1.8, 0, 360)]
    for s in (-1, 1):
        lines += [((x, s * 14), (x, s * 8.2)) for x in (-2.45, 2.45)]
        lines += [((-2.45, s * 8.2), (2.45, s * 8.2))]
        lines += _arc((0, s * 8.2), 1.8, 0, 360)
        lines += [((x, s * 14), (x, s * 11.01)) for x in (-6.6, 6.6)]
        end = np.degrees(np.arcsin(1.415 / 6.75))
        lines += _arc((0, s * 12.425), 6.75, -s * end, -s * (180 - end))
    return _court(lines, [])


OTHER_COURTS = {
    "pickleball": (pickleball_court(), 6.705),
    "badminton": (badminton_court(), 6.7),
    "volleyball": (volleyball_court(), 9.0),
    "padel": (padel_court(), 10.0),
    "basketball": (basketball_court(), 14.0),
}
"""Each with half its length, metres."""
