"""Key poses of tennis: ready stance, forehand, two-handed backhand and serve of a right-hander.

A pose says how pelvis and shoulders are turned, how the trunk leans, how deep the knees are bent
and where both wrists are. Wrists are given from the middle of the shoulder line in the axes of
the shoulders (right, up, forward), so a turn of the trunk takes the arms along, and poses
stay few. Times count from contact. Angles and timing follow the phases of the strokes as
described by Elliott, "Biomechanics and tennis", Br. J. Sports Med. 40 (2006).

Points of tennis as a plan: who goes where, which foot steps when, which pose comes when.

A rally stroke is a split step, a run to the ball, the stroke and side steps back; every fifth
shot is a serve. Feet only move in steps, and a step waits for the one before it.
"""

from dataclasses import astuple, dataclass, field

import numpy as np
from jaxtyping import Float

Place = tuple[float, float, float]


@dataclass(frozen=True)
class Pose:
    """One key pose; metres belong to a player of 1.75 m."""

    pelvis: float = 0.0
    """Turn of the pelvis to the right of the net, degrees."""
    shoulders: float = 0.0
    """Turn of the shoulders to the right of the net, degrees."""
    pitch: float = 17.0
    """Forward lean of the trunk, degrees."""
    roll: float = 0.0
    """Lean of the trunk to the right, degrees."""
    drop: float = 0.09
    """How far the pelvis is below standing straight."""
    right: float = 0.0
    """Weight shifted to the right of the middle of the stance."""
    ahead: float = 0.0
    """Weight shifted forward."""
    racket: Place = (0.10, -0.27, 0.37)
    """Wrist of the racket hand."""
    racket_elbow: Place = (0.8, -0.7, -0.3)
    """Where that elbow points."""
    free: Place = (-0.05, -0.24, 0.41)
    """Wrist of the other hand."""
    free_elbow: Place = (-0.8, -0.7, -0.3)

    def numbers(self) -> Float[np.ndarray, "C"]:
        """The pose as one vector: four angles, then lengths."""
        return np.hstack(astuple(self))


CHANNELS = len(Pose().numbers())
READY = Pose()
HOP = Pose(drop=-0.02)
LANDED = Pose(drop=0.17, pitch=21.0)

Stroke = tuple[tuple[float, Pose], ...]

FOREHAND: Stroke = (
    (-0.75, Pose(42.0, 66.0, 14.0, 0.0, 0.10, 0.05, 0.0, (0.22, -0.15, 0.36), (0.8, -0.6, -0.2),
                 (0.05, -0.12, 0.40), (-0.7, -0.7, 0.0))),
    (-0.42, Pose(58.0, 94.0, 12.0, 4.0, 0.17, 0.10, -0.04, (0.60, 0.08, -0.12), (0.6, -0.5, -0.6),
                 (0.12, -0.08, 0.47), (-0.5, -0.8, 0.1))),
    (-0.14, Pose(40.0, 72.0, 12.0, 5.0, 0.19, 0.08, 0.0, (0.60, -0.30, -0.22), (0.4, -0.6, -0.6),
                 (-0.25, -0.10, 0.43), (-0.7, -0.7, 0.0))),
    (0.0, Pose(6.0, 16.0, 13.0, 2.0, 0.13, 0.02, 0.06, (0.52, -0.26, 0.36), (0.6, -0.7, -0.3),
               (-0.36, -0.12, 0.25), (-0.8, -0.6, -0.2))),
    (0.13, Pose(-14.0, -20.0, 12.0, -2.0, 0.09, -0.02, 0.09, (0.14, 0.02, 0.49), (0.7, -0.7, 0.1),
                (-0.30, -0.06, 0.22), (-0.8, -0.6, -0.2))),
    (0.40, Pose(-34.0, -58.0, 11.0, -3.0, 0.09, -0.05, 0.10, (-0.26, 0.08, 0.22), (0.3, -0.4, 0.8),
                (-0.22, -0.12, 0.25), (-0.8, -0.6, -0.2))),
)  # fmt: skip

BACKHAND: Stroke = (
    (-0.75, Pose(-42.0, -62.0, 15.0, 0.0, 0.10, -0.05, 0.0, (-0.10, -0.22, 0.34), (0.7, -0.7, 0.0),
                 (-0.18, -0.18, 0.36), (-0.8, -0.6, -0.3))),
    (-0.42, Pose(-62.0, -102.0, 14.0, -3.0, 0.17, -0.10, -0.04, (-0.28, -0.18, 0.20),
                 (0.5, -0.8, 0.3), (-0.35, -0.12, 0.18), (-0.7, -0.5, -0.5))),
    (-0.15, Pose(-48.0, -78.0, 15.0, -4.0, 0.20, -0.06, 0.0, (-0.28, -0.37, 0.22),
                 (0.5, -0.8, 0.3), (-0.36, -0.34, 0.20), (-0.7, -0.4, -0.6))),
    (0.0, Pose(-16.0, -16.0, 16.0, -2.0, 0.14, 0.0, 0.07, (-0.04, -0.30, 0.44), (0.7, -0.7, 0.0),
               (-0.11, -0.27, 0.46), (-0.8, -0.6, -0.2))),
    (0.14, Pose(10.0, 24.0, 13.0, 1.0, 0.09, 0.03, 0.10, (0.18, -0.02, 0.45), (0.8, -0.5, 0.1),
                (0.11, 0.01, 0.47), (-0.6, -0.8, 0.1))),
    (0.40, Pose(36.0, 60.0, 11.0, 2.0, 0.09, 0.05, 0.10, (0.32, 0.13, 0.14), (0.9, -0.2, 0.4),
                (0.22, 0.15, 0.22), (-0.1, -0.6, 0.8))),
)  # fmt: skip

SERVE: Stroke = (
    (-2.7, Pose(58.0, 66.0, 8.0, 0.0, 0.03, 0.0, 0.0, (0.12, -0.30, 0.38), (0.8, -0.7, -0.3),
                (0.02, -0.28, 0.42), (-0.8, -0.7, -0.3))),
    (-1.9, Pose(60.0, 70.0, 12.0, 0.0, 0.05, 0.0, 0.06, (0.16, -0.46, 0.26), (0.8, -0.5, -0.5),
                (0.02, -0.44, 0.30), (-0.8, -0.5, -0.5))),
    (-1.35, Pose(64.0, 82.0, 6.0, 2.0, 0.07, 0.0, -0.05, (0.56, -0.34, -0.10), (0.4, -0.5, -0.7),
                 (-0.18, 0.00, 0.50), (-0.6, -0.8, 0.0))),
    (-0.95, Pose(68.0, 92.0, -2.0, 6.0, 0.13, 0.0, 0.0, (0.58, -0.02, -0.20), (0.5, -0.4, -0.8),
                 (-0.20, 0.48, 0.26), (-0.8, -0.2, 0.6))),
    (-0.52, Pose(70.0, 96.0, -10.0, 10.0, 0.24, 0.0, 0.10, (0.50, 0.22, -0.10), (0.7, -0.4, -0.6),
                 (-0.16, 0.54, 0.18), (-0.8, -0.2, 0.6))),
    (-0.17, Pose(42.0, 54.0, -6.0, -4.0, 0.02, 0.0, 0.20, (0.36, 0.14, -0.28), (0.8, 0.5, 0.2),
                 (-0.16, 0.24, 0.34), (-0.8, -0.5, 0.2))),
    (0.0, Pose(12.0, 4.0, 6.0, -16.0, -0.10, 0.0, 0.27, (0.32, 0.52, 0.18), (0.7, 0.3, 0.6),
               (-0.14, -0.18, 0.24), (-0.8, -0.6, 0.0))),
    (0.17, Pose(-12.0, -38.0, 26.0, -12.0, 0.02, 0.0, 0.32, (0.02, -0.04, 0.52), (0.8, -0.2, 0.5),
                (-0.20, -0.24, 0.20), (-0.8, -0.5, -0.3))),
    (0.42, Pose(-30.0, -64.0, 38.0, -4.0, 0.16, 0.0, 0.34, (-0.34, -0.40, 0.24), (0.5, -0.2, 0.8),
                (-0.22, -0.24, 0.12), (-0.8, -0.4, -0.5))),
)  # fmt: skip


def vary(stroke: Stroke, rng: np.random.Generator) -> list[tuple[float, np.ndarray]]:
    """The same stroke played again: a little slower or faster, larger or smaller, elsewhere."""
    tempo, size = rng.normal(1.0, 0.05), rng.normal(1.0, 0.06)
    offset = rng.normal(0, 1, CHANNELS) * _VARIATION
    varied = []
    for time, pose in stroke:
        numbers = pose.numbers() + offset + 0.35 * rng.normal(0, 1, CHANNELS) * _VARIATION
        numbers[:2] *= size
        varied.append((time * tempo, numbers))
    return varied


_VARIATION = np.array(
    [3.0, 3.0, 2.0, 2.0, 0.015, 0.015, 0.015, *[0.022] * 3, *[0.06] * 3, *[0.022] * 3, *[0.06] * 3]
)
"""Spread from stroke to stroke of one player, in the units of a pose's numbers."""


FOOT_SIDES = np.array([1.0, -1.0])
"""Right and left foot, to the right of the middle."""


@dataclass(frozen=True)
class FootStep:
    """One step of one foot."""

    lift: float
    land: float
    place: tuple[float, float]
    """Where it lands: right, forward; metres in the world."""
    heading: float
    """Degrees to the right of the net."""


@dataclass
class PointPlan:
    """What happens when: grows while the points are played, then is read once."""

    time: float = 0.0
    place: np.ndarray = field(default_factory=lambda: np.zeros(2))
    moves: list[tuple[float, float, np.ndarray]] = field(default_factory=list)
    """Start, end and way of each change of place."""
    poses: list[tuple[float, np.ndarray]] = field(default_factory=list)
    steps: tuple[list[FootStep], list[FootStep]] = field(
        default_factory=lambda: (
            [FootStep(-1.0, -0.5, (0.2, 0.0), 12.0)],
            [FootStep(-1.0, -0.5, (-0.2, 0.0), -12.0)],
        )
    )

    def base(self, times: Float[np.ndarray, "*t"]) -> Float[np.ndarray, "*t 2"]:
        """Where the player is between the feet: right, forward."""
        place = np.zeros((*np.shape(times), 2))
        for start, end, way in self.moves:
            place += ease((times - start) / (end - start))[..., None] * way
        return place

    def step(self, foot: int, lift: float, land: float, place: np.ndarray, heading: float) -> None:
        """Let a foot step; a step that would start before the last one landed waits for it."""
        lift = max(lift, self.steps[foot][-1].land + 0.02)
        self.steps[foot].append(FootStep(lift, max(land, lift + 0.12), (*place,), heading))


def plan_points(seconds: float, rng: np.random.Generator) -> PointPlan:
    """Play until the time is over."""
    plan = PointPlan()
    plan.poses.append((-1.0, READY.numbers()))
    shot = 0
    while plan.time < seconds:
        if shot % 5 == 0:
            _serve(plan, rng)
        else:
            _rally(plan, rng, forehand=bool(rng.random() < 0.55))
        shot += 1
    return plan


def ease(share: np.ndarray | float) -> np.ndarray:
    """Minimum-jerk course from 0 to 1 (Flash and Hogan 1985)."""
    s = np.clip(share, 0, 1)
    return np.asarray(s**3 * (10 - 15 * s + 6 * s**2))


def _rally(plan: PointPlan, rng: np.random.Generator, forehand: bool) -> None:
    """Split step, run to the ball, stroke, shuffle back."""
    start = plan.time + rng.uniform(0.1, 0.5)
    _split_step(plan, start, rng)
    side = 1.0 if forehand else -1.0
    way = np.array([side * rng.uniform(0.7, 2.4), rng.uniform(-0.5, 0.6)]) - plan.place * [0.6, 0.8]
    duration = 0.35 + float(np.linalg.norm(way)) / 2.5
    arrive = start + 0.34 + duration
    stance = _STANCES["forehand" if forehand else "backhand"]
    _run(plan, (start + 0.34, arrive), way, stance)
    contact = arrive + rng.uniform(0.34, 0.42)
    stroke = vary(FOREHAND if forehand else BACKHAND, rng)
    plan.poses += [(contact + t, numbers) for t, numbers in stroke]
    plan.poses.append((contact + 0.95, READY.numbers()))
    home = np.array([rng.normal(0, 0.25), rng.normal(0, 0.15)]) - plan.place
    begin = contact + 0.42
    plan.time = _shuffle(plan, begin, home)


def _serve(plan: PointPlan, rng: np.random.Generator) -> None:
    """Serve from the place where the player is, and land in the court."""
    stroke = vary(SERVE, rng)
    contact = plan.time + 0.6 - stroke[0][0]
    for foot, (offset, heading) in enumerate(_STANCES["serve"]):
        lift = plan.time + 0.02 + 0.28 * foot
        plan.step(foot, lift, lift + 0.26, plan.place + offset, heading)
    plan.poses += [(contact + t, numbers) for t, numbers in stroke]
    plan.step(0, contact - 0.14, contact + 0.34, np.add(plan.place, (0.22, 0.42)), 10.0)
    plan.step(1, contact - 0.1, contact + 0.16, np.add(plan.place, (-0.12, 0.45)), 25.0)
    plan.poses.append((contact + 1.0, READY.numbers()))
    plan.moves.append((contact - 0.35, contact + 0.4, np.array([0.02, 0.1])))
    plan.place = np.add(plan.place, (0.02, 0.1))
    plan.time = _shuffle(plan, contact + 0.5, -plan.place + rng.normal(0, 0.15, 2))


_STANCES = {  # (right, forward) from the middle and heading, of the right and the left foot
    "forehand": ((np.array([0.28, -0.14]), 62.0), (np.array([-0.22, 0.22]), 30.0)),
    "backhand": ((np.array([0.16, 0.26]), -34.0), (np.array([-0.28, -0.14]), -66.0)),
    "serve": ((np.array([0.10, -0.22]), 80.0), (np.array([-0.06, 0.22]), 42.0)),
}


def _split_step(plan: PointPlan, start: float, rng: np.random.Generator) -> None:
    """A small hop on the spot that lands wide and deep."""
    plan.poses.append((start - 0.08, READY.numbers()))
    plan.poses.append((start + 0.12, HOP.numbers()))
    plan.poses.append((start + 0.31, LANDED.numbers()))
    for foot, side in enumerate(FOOT_SIDES):
        place = np.add(plan.place, (side * rng.uniform(0.24, 0.3), 0.0))
        plan.step(foot, start, start + rng.uniform(0.22, 0.26), place, side * 15.0)


def _run(plan: PointPlan, span: tuple[float, float], way: np.ndarray, stance: tuple) -> None:
    """Run along a way and end in a stance; at least one step per foot."""
    start, arrive = span
    plan.moves.append((start - 0.08, arrive + 0.1, way))
    target = plan.place + way
    plan.place = target
    count = max(2, round((arrive - start) / 0.23))
    gap = (arrive - start) / count
    heading = np.degrees(np.arctan2(way[0], max(way[1], 0.0) + 0.5 * abs(way[0])))
    last = 0 if way[0] < 0 else 1  # the foot on the far side closes the stance
    for index in range(count):
        foot = (last + count - 1 - index) % 2
        land = start + (index + 1) * gap
        lift = land - max(0.2, min(0.34, 1.25 * gap))
        if index >= count - 2:
            offset, turn = stance[foot]
            plan.step(foot, lift, land, target + offset, turn)
            continue
        across = np.array([way[1], -way[0]]) / np.linalg.norm(way)
        place = plan.base(np.array(land + 0.6 * gap)) + 0.09 * FOOT_SIDES[foot] * across
        plan.step(foot, lift, land, place, heading)


def _shuffle(plan: PointPlan, start: float, way: np.ndarray) -> float:
    """Side steps to another place without crossing the feet; returns when ready again."""
    pairs = max(1, int(np.ceil(np.linalg.norm(way) / 0.42)))
    gap = 0.2
    end = start + 2 * pairs * gap
    plan.moves.append((start, end + 0.1, way))
    plan.place = plan.place + way
    leading = 0 if way[0] > 0 else 1
    for index in range(2 * pairs):
        foot = (leading + index) % 2
        lift = start + index * gap
        place = plan.base(np.array(start + (index - index % 2 + 2) * gap + 0.05))
        place = np.add(place, (0.18 * FOOT_SIDES[foot], 0.0))
        plan.step(foot, lift, lift + 0.18, place, 12.0 * FOOT_SIDES[foot])
    return end + 0.1
