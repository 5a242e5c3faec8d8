"""Points of tennis as a plan: who goes where, which foot steps when, which pose comes when.

A rally stroke is a split step, a run to the ball, the stroke and side steps back; every fifth
shot is a serve. Feet only move in steps, and a step waits for the one before it.
"""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from keyrecon.synthetic.strokes import BACKHAND, FOREHAND, HOP, LANDED, READY, SERVE, vary

FOOT_SIDES = np.array([1.0, -1.0])
"""Right and left foot, to the right of the middle."""


@dataclass(frozen=True)
class Step:
    """One step of one foot."""

    lift: float
    land: float
    place: tuple[float, float]
    """Where it lands: right, forward; metres in the world."""
    heading: float
    """Degrees to the right of the net."""


@dataclass
class Plan:
    """What happens when: grows while the points are played, then is read once."""

    time: float = 0.0
    place: np.ndarray = field(default_factory=lambda: np.zeros(2))
    moves: list[tuple[float, float, np.ndarray]] = field(default_factory=list)
    """Start, end and way of each change of place."""
    poses: list[tuple[float, np.ndarray]] = field(default_factory=list)
    steps: tuple[list[Step], list[Step]] = field(
        default_factory=lambda: (
            [Step(-1.0, -0.5, (0.2, 0.0), 12.0)],
            [Step(-1.0, -0.5, (-0.2, 0.0), -12.0)],
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
        self.steps[foot].append(Step(lift, max(land, lift + 0.12), (*place,), heading))


def plan_points(seconds: float, rng: np.random.Generator) -> Plan:
    """Play until the time is over."""
    plan = Plan()
    plan.poses.append((-1.0, READY.numbers()))
    shot = 0
    while plan.time < seconds:
        if shot % 5 == 0:
            _serve(plan, rng)
        else:
            _rally(plan, rng, forehand=bool(rng.random() < 0.55))
        shot += 1
    return plan


def ease(share: np.ndarray | float) -> np.ndarray | float:
    """Minimum-jerk course from 0 to 1 (Flash and Hogan 1985)."""
    s = np.clip(share, 0, 1)
    return s**3 * (10 - 15 * s + 6 * s**2)


def _rally(plan: Plan, rng: np.random.Generator, forehand: bool) -> None:
    """Split step, run to the ball, stroke, shuffle back."""
    start = plan.time + rng.uniform(0.1, 0.5)
    _split_step(plan, start, rng)
    side = 1.0 if forehand else -1.0
    way = np.array([side * rng.uniform(0.7, 2.4), rng.uniform(-0.5, 0.6)]) - plan.place * [0.6, 0.8]
    duration = 0.35 + np.linalg.norm(way) / 2.5
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


def _serve(plan: Plan, rng: np.random.Generator) -> None:
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


def _split_step(plan: Plan, start: float, rng: np.random.Generator) -> None:
    """A small hop on the spot that lands wide and deep."""
    plan.poses.append((start - 0.08, READY.numbers()))
    plan.poses.append((start + 0.12, HOP.numbers()))
    plan.poses.append((start + 0.31, LANDED.numbers()))
    for foot, side in enumerate(FOOT_SIDES):
        place = np.add(plan.place, (side * rng.uniform(0.24, 0.3), 0.0))
        plan.step(foot, start, start + rng.uniform(0.22, 0.26), place, side * 15.0)


def _run(plan: Plan, span: tuple[float, float], way: np.ndarray, stance: tuple) -> None:
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


def _shuffle(plan: Plan, start: float, way: np.ndarray) -> float:
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
