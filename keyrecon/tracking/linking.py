"""The track from what the filters saw: the head's path, then that of both feet.

The path of the feet runs over pairs. A foot that cannot be seen is behind the other leg, so one
candidate alone makes a pair too, with the hidden foot on the shin above it. Or it was seen a moment
ago, or will be in a moment: where a sure candidate of a frame nearby lies on the player now, it is
a weak candidate of this frame too. A foot that stands therefore stays, while one in the air is soon
forgotten. What was guessed gives way to what was seen before and after it (see `smooth`).
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from keyrecon.numerics.geometry import warp_points
from keyrecon.numerics.viterbi import TransitionModel, find_cheapest_track
from keyrecon.records import CameraPath
from keyrecon.segmentation.player_crops import Cropping
from keyrecon.tracking.foot_pairs import FILTER_PRIOR, foot_pairs, foot_pose_cost
from keyrecon.tracking.smoothing import (
    fill_gaps,
    smooth_pairs,
    state_confidence,
    taken_states,
    to_reference_frame,
)

EVEN, DOUBT = 0.36, 0.07
"""Strength that is as likely a part as not, and how fast the odds change with it, on rendered
players: on the floor a third of the usual strength is a foot, higher up half of it may be a
racket."""
HIDDEN = 1.5
"""Cost of a foot that is not seen, but was nearby in time."""
FARTHER_UP = 0.07
"""A hidden foot is this far above the one that hides it, player heights: floor farther away is
higher up in the picture, and it is the shin that covers the foot."""
APART = 0.07
"""Two candidates nearer to one another are one foot, player heights."""
APPEARANCE_WEIGHT = 6
"""Frames looked up before and after for hidden feet."""
REMEMBERED = 8
"""Remembered feet of a frame, at most."""
PAIRS = 30
"""Pairs of feet kept, per frame."""


@dataclass(frozen=True, eq=False)
class Detections:
    """What the filters saw in one frame, in pixels of its crop."""

    heads: Float[np.ndarray, "m 2"]
    head_strength: Float[np.ndarray, "m"]
    """1 is usual."""
    feet: Float[np.ndarray, "n 2"]
    foot_strength: Float[np.ndarray, "n"]
    covered: Bool[np.ndarray, "y x"]
    """Where the player covers the scene, at half the resolution of the crop."""


@dataclass(frozen=True)
class FootMotionModel:
    """How feet move and hide."""

    step: float
    """Usual movement from one frame to the next, px."""
    memory: int
    """Frames before and after in which a hidden foot is looked up."""
    behind: float
    """Cost of a foot that is not seen and taken to be behind the other."""
    stiffness: float
    """How smooth the paths of feet are, see `smooth`."""


@dataclass(frozen=True, eq=False)
class FootPairs:
    """What a frame offers for both feet."""

    places: Float[np.ndarray, "s 2 2"]
    each: Float[np.ndarray, "s 2"]
    """Cost of each foot by itself."""
    cost: Float[np.ndarray, "s"]
    """Cost of both together."""


def part_costs(strength: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n"]:
    """-log of the probability that a response comes from the part."""
    return np.logaddexp(0.0, (EVEN - strength) / DOUBT)


def link_head(
    seen: list[Detections], camera: CameraPath, cropping: Cropping, sigma: float
) -> tuple[Float[np.ndarray, "T 2"], Float[np.ndarray, "T"]]:
    """The head in the picture of every frame, and its confidence; `sigma` is its usual step, px."""
    places = [cropping.to_picture(s.heads, t) for t, s in enumerate(seen)]
    stable = [h[:, None] for h in to_reference_frame(places, camera.to_reference)]
    costs = [part_costs(s.head_strength) for s in seen]
    chosen = find_cheapest_track(costs, stable, TransitionModel(sigma))
    back = np.linalg.inv(camera.to_reference)
    head = fill_gaps(taken_states(stable, chosen), np.arange(len(seen)), back)[:, 0]
    return head, state_confidence(costs, chosen)


def link_feet(
    seen: list[Detections],
    camera: CameraPath,
    cropping: Cropping,
    head: Float[np.ndarray, "T 2"],
    gait: FootMotionModel,
) -> tuple[Float[np.ndarray, "T 2 2"], Float[np.ndarray, "T"]]:
    """Both feet in the picture of every frame, and their confidence."""
    places = [cropping.to_picture(s.feet, t) for t, s in enumerate(seen)]
    back = np.linalg.inv(camera.to_reference)
    stable = to_reference_frame(places, camera.to_reference)
    hidden = carry_feet_forward(seen, stable, back, cropping, gait.memory)
    pairs = []
    for t, look in enumerate(seen):
        own = np.concatenate([part_costs(look.foot_strength), np.full(len(hidden[t]), HIDDEN)])
        feet = np.concatenate([stable[t], hidden[t]])
        in_picture = warp_points(back[t], feet) if len(feet) else feet
        body = head[t], float(cropping.track.height[t])
        both = _pair(in_picture, own, gait.behind, body)
        pairs.append(replace(both, places=warp_points(camera.to_reference[t], both.places)))
    costs, places = [p.cost for p in pairs], [p.places for p in pairs]
    taken = find_cheapest_track(
        costs, places, TransitionModel(gait.step, max_gap=12, skip_cost=7.0)
    )
    each = taken_states([p.each for p in pairs], taken)
    smooth = smooth_pairs(taken_states(places, taken), each, gait.stiffness)
    return warp_points(back[:, None], smooth), state_confidence([c / 2 for c in costs], taken)


def _pair(
    feet: Float[np.ndarray, "n 2"],
    cost: Float[np.ndarray, "n"],
    behind: float,
    body: tuple[Float[np.ndarray, "2"], float],
) -> FootPairs:
    """The best pairs of feet below a head and of a height, and their costs.

    A place alone hides another foot, at the cost `behind`.
    """
    head, height = body
    every = foot_pairs(len(feet))
    both, each = feet[every], cost[every]
    alone = every[:, 0] == every[:, 1]
    both[alone, 1, 1] -= FARTHER_UP * height
    each[alone, 1] = behind
    total = each.sum(axis=1) + foot_pose_cost(both, head, height, FILTER_PRIOR)
    best = np.argsort(total)[:PAIRS]
    return FootPairs(both[best], each[best], total[best])


def carry_feet_forward(
    seen: list[Detections],
    stable: list[Float[np.ndarray, "_ 2"]],
    from_reference: Float[np.ndarray, "T 3 3"],
    cropping: Cropping,
    memory: int,
) -> list[Float[np.ndarray, "_ 2"]]:
    """Stabilised places of sure feet of frames nearby that the player covers in each frame."""
    sure = [s[look.foot_strength > EVEN] for s, look in zip(stable, seen, strict=True)]
    offsets = np.unique(np.rint(np.geomspace(1, max(1, memory), APPEARANCE_WEIGHT)).astype(int))
    hidden = []
    for t, look in enumerate(seen):
        near = [t + side * k for k in offsets for side in (-1, 1) if 0 <= t + side * k < len(seen)]
        known = np.concatenate([sure[u] for u in near]) if near else np.zeros((0, 2))
        if len(known):
            known = known[_on_player(known, look, from_reference[t], cropping, t)]
        hidden.append(_new_places(known, stable[t], APART * float(cropping.track.height[t])))
    return hidden


def _on_player(
    places: Float[np.ndarray, "m 2"],
    look: Detections,
    from_reference: Float[np.ndarray, "3 3"],
    cropping: Cropping,
    t: int,
) -> Bool[np.ndarray, "m"]:
    """Which stabilised places the player covers in frame t."""
    spots = cropping.from_picture(warp_points(from_reference, places), t)
    x, y = np.rint((spots - 0.5) / 2).astype(int).T
    rows, columns = look.covered.shape
    inside = (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
    return inside & look.covered[y.clip(0, rows - 1), x.clip(0, columns - 1)]


def _new_places(
    places: Float[np.ndarray, "m 2"], known: Float[np.ndarray, "n 2"], least: float
) -> Float[np.ndarray, "k 2"]:
    """The first few places that are no known ones, and not one another."""
    taken, count = known, len(known)
    for place in places:
        if len(taken) == count + REMEMBERED:
            break
        if not len(taken) or np.linalg.norm(taken - place, axis=1).min() > least:
            taken = np.concatenate([taken, place[None]])
    return taken[count:]
