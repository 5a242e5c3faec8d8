"""Swings that were not captured but could have been: the database widened by plausible variation.

Two or ten swings do not span how people swing. Every variation changes one captured swing in ways
that a coach would name: how far the arms, the trunk and the pelvis turn at the top and at the
finish, how steep the arms' plane is, when the pelvis leads the arms, how the club is cocked, how
wide the stance, how deep the knees, how far the spine bends, and the player's proportions. The
spreads are those of reported differences between golfers (`VariationOptions`). Feet stay on the
floor and hands on the club (`retarget`).
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from jaxtyping import Float
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation, Slerp

from keyrecon.golf.prior.captured_swing import change_swing, retarget_swing
from keyrecon.golf.prior.skeleton import CLUB, NAMES, PARENTS, turns_from_swing
from keyrecon.golf.records import Body, Swing
from keyrecon.ranges import SEEDS, within

PELVIS, TRUNK, HEAD = (NAMES.index(name) for name in ("pelvis", "trunk", "head"))
ARMS = tuple(p for p, name in enumerate(NAMES) if "arm" in name)
UPPER_ARMS = tuple(p for p, name in enumerate(NAMES) if name.endswith("upper_arm"))
REACHING = tuple(NAMES.index(n) for n in ("right_forearm", "right_shank", "left_shank"))
Turns = Float[np.ndarray, "T P 3 3"]


@dataclass(frozen=True)
class VariationOptions:
    """How far swings differ; standard deviations."""

    count: Annotated[int, within(0, 10_000)] = 100
    """Variations of every captured swing."""
    seed: Annotated[int, SEEDS] = 0
    """Decides which."""
    turn: Annotated[float, within(0, 2)] = 0.12
    """Share by which pelvis, trunk and arms turn more or less at top and finish; a shoulder turn
    of 100 degrees varies by 10 between golfers."""
    plane: Annotated[float, within(0, 200)] = 8.0
    """Degrees by which the arms are steeper or flatter at top and finish."""
    lead: Annotated[float, within(0, 0.2)] = 0.012
    """Normalised time by which the pelvis is earlier or later than the arms."""
    pace: Annotated[float, within(0, 0.3)] = 0.015
    """Normalised time by which the middle of a phase comes early or late."""
    posture: Annotated[float, within(0, 100)] = 5.0
    """Degrees by which spine and head bend at address, and stay bent."""
    stance: Annotated[float, within(0, 2)] = 0.12
    """Share by which the feet stand wider or closer."""
    sway: Annotated[float, within(0, 0.3)] = 0.015
    """Statures by which the pelvis shifts sideways, sinks, or comes forward at top and finish."""
    cock: Annotated[float, within(0, 200)] = 10.0
    """Degrees by which the wrists cock more or less."""
    habit: Annotated[float, within(0, 100)] = 6.0
    """Degrees by which any segment is held otherwise, at each of the key postures on its own and
    throughout: what no coach names, and what captures differ in by their marker sets."""
    build: Annotated[float, within(0, 0.8)] = 0.04
    """Share by which arms, legs and trunk are longer or shorter."""


def vary_swing(
    swing: Swing, body: Body, options: VariationOptions, rng: np.random.Generator
) -> Swing:
    """One variation of a swing, made by a player of other proportions and retargeted to `body`."""
    turns, place = _retime(swing, options, rng)
    bumps = _bumps(swing, len(turns))
    _turn_further(turns, bumps, int(swing.keys[0]), options.turn * rng.normal(0, 1, 2), rng)
    _tilt(turns, UPPER_ARMS, bumps @ rng.normal(0, options.plane, 2))
    _tilt(turns, (CLUB,), bumps @ rng.normal(0, options.cock, 2))
    _add_habits(turns, swing, options.habit, rng)
    _tilt(turns, (PELVIS,), np.full(len(turns), rng.normal(0, options.posture)))
    _tilt(turns, (HEAD,), np.full(len(turns), rng.normal(0, options.posture)))
    sway = np.column_stack([bumps, np.ones(len(turns))]) @ rng.normal(0, options.sway, (3, 3))
    stance = float(np.exp(rng.normal(0, options.stance)))
    theirs = _vary_body(body, options.build, rng)
    return retarget_swing(change_swing(swing, theirs, turns, place + sway, stance), body)


def tilt_arms(swing: Swing, turns: Turns, degrees: float) -> None:
    """Make the plane of the arms steeper at top and finish."""
    _tilt(turns, UPPER_ARMS, _bumps(swing, len(turns)) @ np.full(2, degrees))


def _retime(
    swing: Swing, options: VariationOptions, rng: np.random.Generator
) -> tuple[Turns, Float[np.ndarray, "T 3"]]:
    """Turns and pelvis with another pace within the phases and another lead of the pelvis."""
    turns, place = turns_from_swing(swing)
    frames = np.arange(len(turns), dtype=float)
    phase = np.interp(frames, swing.keys, np.arange(4.0))
    whole = swing.keys[3] - swing.keys[0]
    pace = rng.normal(0, options.pace, 3)[np.minimum(phase.astype(int), 2)]
    shared = frames + whole * pace * np.sin(np.pi * (phase % 1)) ** 2
    lead = rng.normal(0, options.lead) * whole * np.sin(np.pi * phase / 3) ** 2
    for p in range(len(NAMES)):
        legs_or_pelvis = p not in (TRUNK, HEAD, CLUB) and p not in ARMS
        time = np.clip(shared + (lead if legs_or_pelvis else 0), 0, len(frames) - 1)
        turns[:, p] = Slerp(frames, Rotation.from_matrix(turns[:, p]))(time).as_matrix()
    time = np.clip(shared + lead, 0, len(frames) - 1)
    return turns, np.stack([np.interp(time, frames, c) for c in place.T], axis=1)


def _bumps(swing: Swing, frames: int) -> Float[np.ndarray, "T 2"]:
    """How close every frame is to the top and to the finish, 0-1; 0 at address and at the hit."""
    top = np.interp(np.arange(frames), swing.keys, [0, 1, 0, 0])
    finish = np.interp(np.arange(frames), swing.keys, [0, 0, 0, 1])
    return np.sin(np.pi / 2 * np.stack([top, finish], axis=1)) ** 2


def _turn_further(
    turns: Turns,
    bumps: Float[np.ndarray, "T 2"],
    address: int,
    amount: Float[np.ndarray, "2"],
    rng: np.random.Generator,
) -> None:
    """Stretch the turns from address; parts of the body share half of the amount."""
    spread = np.abs(amount).mean()
    for segments in ((PELVIS,), (TRUNK,), ARMS):
        share = 1 + bumps @ (amount + spread * rng.normal(0, 0.5, 2))
        for p in segments:
            start = turns[address, p]
            way = Rotation.from_matrix(start.T @ turns[:, p]).as_rotvec()
            turns[:, p] = start @ Rotation.from_rotvec(share[:, None] * way).as_matrix()


def _add_habits(turns: Turns, swing: Swing, spread: float, rng: np.random.Generator) -> None:
    """Turn segments a little, each otherwise, smoothly from key posture to key posture.

    The last bones of limbs that reach for a place afterwards are left alone.
    """
    at_keys = rng.normal(0, np.radians(spread / np.sqrt(2)), (5, len(NAMES), 3))
    at_keys[:, REACHING] = 0
    curve = PchipInterpolator(swing.keys, at_keys[:4] + at_keys[4])
    frames = np.clip(np.arange(len(turns)), swing.keys[0], swing.keys[3])
    habits = Rotation.from_rotvec(curve(frames).reshape(-1, 3)).as_matrix()
    turns[:] = habits.reshape(turns.shape) @ turns


def _tilt(turns: Turns, segments: tuple[int, ...], degrees: Float[np.ndarray, "T"]) -> None:
    """Turn segments about the left-right axis of their parents."""
    tilt = Rotation.from_euler("x", degrees[:, None], degrees=True).as_matrix()
    for p in segments:
        turns[:, p] = tilt @ turns[:, p]


def _vary_body(body: Body, spread: float, rng: np.random.Generator) -> Body:
    """The same stature with longer or shorter arms, legs and trunk, alike on both sides."""
    parts = {name.split("_", 1)[-1]: float(np.exp(rng.normal(0, spread))) for name in NAMES}
    factor = np.array([parts[name.split("_", 1)[-1]] for name in NAMES])
    parents = np.maximum(PARENTS, 0)
    return Body(
        body.stature, body.offsets * factor[parents, None], body.joint_segment,
        body.joint_place * factor[body.joint_segment, None], body.club,
    )  # fmt: skip
