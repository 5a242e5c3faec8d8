"""A figure of capsules that moves like an athlete: phrases that come back, rests between them.

Edge elements are computed from the outlines without drawing: samples around each capsule,
less those that lie inside another capsule of the same colour.
"""

import numpy as np

from keyrecon.records import Edges, Track

STEP = 0.018
SHIRT, SHORTS, SKIN = 0, 1, 2
# name, parent, length, radius, colour, rest angle (0 points down, pi/2 points right)
LIMBS = (
    ("torso", None, 0.36, 0.085, SHIRT, np.pi),
    ("head", "torso", 0.13, 0.055, SKIN, np.pi),
    ("arm_a", "torso", 0.18, 0.030, SHIRT, 0.5),
    ("forearm_a", "arm_a", 0.20, 0.025, SKIN, 0.9),
    ("arm_b", "torso", 0.18, 0.030, SHIRT, -0.5),
    ("forearm_b", "arm_b", 0.20, 0.025, SKIN, -0.9),
    ("thigh_a", None, 0.25, 0.050, SHORTS, 0.2),
    ("shank_a", "thigh_a", 0.25, 0.032, SKIN, 0.0),
    ("thigh_b", None, 0.25, 0.050, SHORTS, -0.2),
    ("shank_b", "thigh_b", 0.25, 0.032, SKIN, -0.1),
)
SWING = np.array([0.2, 0.2, 1.2, 1.2, 1.2, 1.2, 0.5, 0.6, 0.5, 0.6])


def smooth_noise(count, columns, period, rng):
    """Smooth curves of unit spread; `period` samples between their knots."""
    knots = rng.normal(size=(int(count / period) + 4, columns))
    at = np.arange(count) / period
    low = at.astype(int)
    u = (at - low)[:, None]
    blend = 0.5 - 0.5 * np.cos(np.pi * u)
    return knots[low] * (1 - blend) + knots[low + 1] * blend


def athlete_angles(count, seed=0, phrases=3, phrase_length=60):
    """Limb angles (T, limbs): repeated phrases with rests between them."""
    rng = np.random.default_rng(seed)
    moves = [smooth_noise(phrase_length, len(LIMBS), 12, rng) * SWING for _ in range(phrases)]
    window = np.sin(np.linspace(0, np.pi, phrase_length))[:, None] ** 0.5
    pieces = []
    while sum(map(len, pieces)) < count:
        pieces.append(np.zeros((rng.integers(10, 40), len(LIMBS))))
        move = moves[rng.integers(phrases)] * window
        speed = rng.uniform(0.85, 1.15)
        at = np.arange(0, phrase_length - 1, speed)
        pieces.append(np.stack([np.interp(at, np.arange(phrase_length), c) for c in move.T], 1))
    angles = np.concatenate(pieces)[:count]
    return angles + 0.05 * smooth_noise(count, len(LIMBS), 15, rng)


def capsules(angles):
    """Ends (limbs, 2, 2) of all limbs for one frame; the pelvis is the origin, y down."""
    ends, at = np.zeros((len(LIMBS), 2, 2)), {}
    for row, (name, parent, length, _, _, rest) in enumerate(LIMBS):
        start = at[parent] if parent else np.zeros(2)
        angle = rest + angles[row]
        stop = start + length * np.array([np.sin(angle), np.cos(angle)])
        ends[row], at[name] = (start, stop), stop
    return ends


def outline_edges(ends, scale, origin):
    """Edge elements of the capsules, interior on the left, in px."""
    points, tangents, colors, owners = [], [], [], []
    for row, (_, _, length, radius, color, _) in enumerate(LIMBS):
        axis = (ends[row, 1] - ends[row, 0]) / length
        side = np.array([-axis[1], axis[0]])
        along = np.arange(0, length, STEP)[:, None]
        turn = np.arange(0, np.pi, STEP / radius)[:, None]
        arc = np.cos(turn) * side + np.sin(turn) * axis
        normal = np.concatenate(
            [np.tile(side, (len(along), 1)), arc, np.tile(-side, (len(along), 1)), -arc]
        )
        base = np.concatenate(
            [
                ends[row, 0] + along * axis,
                np.tile(ends[row, 1], (len(arc), 1)),
                ends[row, 1] - along * axis,
                np.tile(ends[row, 0], (len(arc), 1)),
            ]
        )
        points.append(base + radius * normal)
        # y points down: left of the tangent (1, 0) is (0, -1), up on the picture
        tangents.append(np.stack([normal[:, 1], -normal[:, 0]], axis=1))
        colors.append(np.full(len(base), color))
        owners.append(np.full(len(base), row))
    points, tangents, colors, owners = map(np.concatenate, (points, tangents, colors, owners))
    kept = np.ones(len(points), dtype=bool)
    for row, (_, _, length, radius, color, _) in enumerate(LIMBS):
        axis = (ends[row, 1] - ends[row, 0]) / length
        foot = np.clip((points - ends[row, 0]) @ axis, 0, length)[:, None]
        inside = np.linalg.norm(points - ends[row, 0] - foot * axis, axis=1) < radius - 1e-9
        kept &= ~(inside & (colors == color) & (owners != row))
    upper = points[:, 1] < 0.03
    lower = points[:, 1] > -0.03
    return Edges(
        points[kept] * scale + origin, tangents[kept], colors[kept], upper[kept], lower[kept]
    )


def moving_figure(count, seed=0, noise=0.0, scale=180.0):
    """(edges, track) of an athlete who also walks across the picture; noise in heights."""
    rng = np.random.default_rng(seed + 100)
    angles = athlete_angles(count, seed)
    where = np.array([600.0, 400.0]) + 80 * smooth_noise(count, 2, 60, rng)
    edges, head, feet = [], [], []
    for angle, origin in zip(angles, where, strict=True):
        ends = capsules(angle)
        found = outline_edges(ends, scale, origin)
        jitter = noise * scale * rng.normal(size=found.points.shape)
        edges.append(
            Edges(found.points + jitter, found.tangent, found.color, found.upper, found.lower)
        )
        head.append(ends[1].mean(0) * scale + origin)
        feet.append(ends[[7, 9], 1] * scale + origin)
    head, feet = np.array(head), np.array(feet)
    box = np.concatenate([where - scale, where + scale], axis=1)
    height = np.full(count, 0.93 * scale)
    return tuple(edges), Track(head, feet, height, box, np.ones(count))
