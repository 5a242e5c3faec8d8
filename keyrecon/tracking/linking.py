"""Link the detections of all frames into a track: the head's path, then that of both feet.

The path of the feet runs over pairs. An occluded foot is behind the other leg, so one candidate
alone makes a pair too, with the hidden foot on the shin above it. Or it was detected a moment ago,
or will be in a moment: where a strong candidate of a frame nearby lies on the player now, it is
a weak candidate of this frame too. A foot that stands therefore stays, while one in the air is soon
forgotten. Weak candidates give way to strong ones before and after them (see `smoothing`).
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, UInt8

from keyrecon.numerics.geometry import warp_points
from keyrecon.numerics.viterbi import TransitionModel, find_cheapest_track
from keyrecon.records import CameraPath
from keyrecon.segmentation.player_crops import Cropping
from keyrecon.tracking.anchors import (
    ANCHOR_FOOT_COST,
    FollowedHeads,
    anchored_states,
    with_bridge_costs,
)
from keyrecon.tracking.candidates import MIN_FOOT_SEPARATION
from keyrecon.tracking.foot_pairs import (
    FILTER_PRIOR,
    FOOT_SKIP_COST,
    MAX_PAIRS,
    foot_pairs,
    foot_pose_cost,
)
from keyrecon.tracking.smoothing import (
    fill_gaps,
    smooth_pairs,
    state_confidence,
    taken_states,
    to_reference_frame,
)

EVEN_STRENGTH, STRENGTH_SPREAD = 0.36, 0.07
"""Strength that is as likely a part as not, and how fast the log odds change with it, on rendered
players: on the floor a third of the usual strength is a foot, higher up half of it may be a racket.
Halved, others with it: at most 0.4 points, 0.4 mm on one clip."""
PROPAGATED_COST = 1.5
"""Cost of a foot that is not detected, but was nearby in time. Halved, others with it: at most 0.4
points, 0.4 mm on one clip."""
HIDDEN_FOOT_RISE = 0.07
"""A hidden foot is this far above the one that hides it, player heights: floor farther away is
higher up in the picture, and it is the shin that covers the foot. Halved, others with it: at most
0.4 points, 0.4 mm on one clip."""
MEMORY_SAMPLES = 6
"""Frames before and after that feet are propagated from, ever farther apart. Halved, others with
it: at most 0.4 points, 0.4 mm on one clip."""
MAX_GAP_SECONDS = 2.0
"""Longest time without head or feet that a path bridges: who is away for longer, came anew. Halved,
others with it: at most 0.7 points, 0.1 mm on one clip."""
MAX_PROPAGATED = 8
"""Propagated feet of a frame, at most. Halved, others with it: at most 0.7 points, 0.2 mm on one
clip."""


@dataclass(frozen=True, eq=False)
class Detections:
    """Candidates that the filters give in one frame, in pixels of its crop."""

    heads: Float[np.ndarray, "m 2"]
    head_strength: Float[np.ndarray, "m"]
    """1 is usual."""
    feet: Float[np.ndarray, "n 2"]
    foot_strength: Float[np.ndarray, "n"]
    covered: Bool[np.ndarray, "y x"]
    """Where the player covers the scene, at half the resolution of the crop."""
    looks: UInt8[np.ndarray, "2 y x"] | None = None
    """How much places look like a marked head or foot, at half the resolution (`mark_filters`);
    None where no head and feet are."""


@dataclass(frozen=True)
class FootMotionModel:
    """How feet move and occlude one another."""

    step: float
    """Usual movement from one frame to the next, px."""
    max_gap: int
    """Longest gap that is bridged, frames."""
    memory: int
    """Frames before and after that feet are propagated from."""
    occlusion_cost: float
    """Cost of a foot that is not detected and taken to be behind the other."""
    stiffness: float
    """How smooth the paths of feet are: r of `smooth_path`."""


@dataclass(frozen=True, eq=False)
class FootPairs:
    """Candidates of a frame for both feet together."""

    places: Float[np.ndarray, "s 2 2"]
    each: Float[np.ndarray, "s 2"]
    """Cost of each foot by itself."""
    cost: Float[np.ndarray, "s"]
    """Cost of both together."""


def part_costs(strength: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n"]:
    """-log of the probability that a response comes from the part."""
    return np.logaddexp(0.0, (EVEN_STRENGTH - strength) / STRENGTH_SPREAD)


def link_head(
    detections: list[Detections],
    camera: CameraPath,
    cropping: Cropping,
    marked: Float[np.ndarray, "T 1 2"],
    followed: FollowedHeads,
    model: TransitionModel,
) -> tuple[Float[np.ndarray, "T 2"], Float[np.ndarray, "T"]]:
    """The head in the picture of every frame, and its confidence; `model`: how it moves, px.

    `marked` heads, in the reference frame, are passed through; NaN where there is none. Those that
    flow leads to are candidates.
    """
    places = [cropping.to_picture(detected.heads, t) for t, detected in enumerate(detections)]
    stable = [h[:, None] for h in to_reference_frame(places, camera.to_reference)]
    costs = [part_costs(detected.head_strength) for detected in detections]
    costs = with_bridge_costs(stable, costs, marked, model.sigma)
    stable, costs = anchored_states(*followed.with_costs(stable, costs), marked)
    chosen = find_cheapest_track(costs, stable, model)
    from_reference = np.linalg.inv(camera.to_reference)
    head = fill_gaps(taken_states(stable, chosen), np.arange(len(detections)), from_reference)
    return head[:, 0], state_confidence(costs, chosen)


def link_feet(
    detections: list[Detections],
    camera: CameraPath,
    cropping: Cropping,
    head: Float[np.ndarray, "T 2"],
    height: Float[np.ndarray, "T"],
    marked: Float[np.ndarray, "T 2 2"],
    motion: FootMotionModel,
) -> tuple[Float[np.ndarray, "T 2 2"], Float[np.ndarray, "T"]]:
    """Both feet in the picture of every frame, and their confidence; `height` of the player, px.

    `marked` feet, in the reference frame, are passed through; NaN where there are none.
    """
    places = [cropping.to_picture(detected.feet, t) for t, detected in enumerate(detections)]
    from_reference = np.linalg.inv(camera.to_reference)
    stable = to_reference_frame(places, camera.to_reference)
    hidden = propagate_feet(detections, stable, from_reference, cropping, height, motion.memory)
    pairs = []
    for t, detected in enumerate(detections):
        propagated = np.full(len(hidden[t]), PROPAGATED_COST)
        cost = np.concatenate([part_costs(detected.foot_strength), propagated])
        feet = np.concatenate([stable[t], hidden[t]])
        in_picture = warp_points(from_reference[t], feet) if len(feet) else feet
        both = _pair(in_picture, cost, motion.occlusion_cost, head[t], float(height[t]))
        pairs.append(replace(both, places=warp_points(camera.to_reference[t], both.places)))
    places, costs = anchored_states([p.places for p in pairs], [p.cost for p in pairs], marked)
    fixed = np.isfinite(marked).all(axis=(1, 2))
    sure = np.full((1, 2), ANCHOR_FOOT_COST)
    alone = [sure if f else p.each for p, f in zip(pairs, fixed, strict=True)]
    model = TransitionModel(motion.step, motion.max_gap, skip_cost=FOOT_SKIP_COST)
    taken = find_cheapest_track(costs, places, model)
    each = taken_states(alone, taken)
    smooth = smooth_pairs(taken_states(places, taken), each, motion.stiffness)
    feet = warp_points(from_reference[:, None], smooth)
    return feet, state_confidence([c / 2 for c in costs], taken)


def _pair(
    feet: Float[np.ndarray, "n 2"],
    cost: Float[np.ndarray, "n"],
    occlusion_cost: float,
    head: Float[np.ndarray, "2"],
    height: float,
) -> FootPairs:
    """The best pairs of feet below a head, and their costs.

    A place alone hides another foot, at the cost `occlusion_cost`.
    """
    every = foot_pairs(len(feet))
    both, each = feet[every], cost[every]
    alone = every[:, 0] == every[:, 1]
    both[alone, 1, 1] -= HIDDEN_FOOT_RISE * height
    each[alone, 1] = occlusion_cost
    total = each.sum(axis=1) + foot_pose_cost(both, head, height, FILTER_PRIOR)
    best = np.argsort(total)[:MAX_PAIRS]
    return FootPairs(both[best], each[best], total[best])


def propagate_feet(
    detections: list[Detections],
    stable: list[Float[np.ndarray, "_ 2"]],
    from_reference: Float[np.ndarray, "T 3 3"],
    cropping: Cropping,
    height: Float[np.ndarray, "T"],
    memory: int,
) -> list[Float[np.ndarray, "_ 2"]]:
    """Strong feet of frames nearby, where the player covers them in each frame, stabilised."""
    strong = [
        places[detected.foot_strength > EVEN_STRENGTH]
        for places, detected in zip(stable, detections, strict=True)
    ]
    offsets = np.unique(np.rint(np.geomspace(1, max(1, memory), MEMORY_SAMPLES)).astype(int))
    hidden = []
    for t, detected in enumerate(detections):
        near = [t + sign * k for k in offsets for sign in (-1, 1)]
        near = [u for u in near if 0 <= u < len(detections)]
        known = np.concatenate([strong[u] for u in near]) if near else np.zeros((0, 2))
        if len(known):
            known = known[_on_player(known, detected, from_reference[t], cropping, t)]
        hidden.append(_new_places(known, stable[t], MIN_FOOT_SEPARATION * float(height[t])))
    return hidden


def _on_player(
    places: Float[np.ndarray, "m 2"],
    detected: Detections,
    from_reference: Float[np.ndarray, "3 3"],
    cropping: Cropping,
    t: int,
) -> Bool[np.ndarray, "m"]:
    """Which stabilised places the player covers in frame t."""
    spots = cropping.from_picture(warp_points(from_reference, places), t)
    x, y = np.rint((spots - 0.5) / 2).astype(int).T
    rows, columns = detected.covered.shape
    inside = (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
    return inside & detected.covered[y.clip(0, rows - 1), x.clip(0, columns - 1)]


def _new_places(
    places: Float[np.ndarray, "m 2"], known: Float[np.ndarray, "n 2"], min_distance: float
) -> Float[np.ndarray, "k 2"]:
    """The first few places that are no known ones, and not one another."""
    taken = np.concatenate([known, places])
    apart = np.linalg.norm(taken[None] - places[:, None], axis=2) > min_distance
    new: list[int] = []
    for row in np.flatnonzero(apart[:, : len(known)].all(axis=1)).tolist():
        if len(new) == MAX_PROPAGATED:
            break
        if apart[row, len(known) :][new].all():
            new.append(row)
    return places[new]
