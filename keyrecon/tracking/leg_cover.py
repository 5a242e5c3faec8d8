"""What two legs leave unexplained of the player below the hips.

Ankle and toe of one shoe both look like a foot, more so than the other foot does in a lunge: they
pass for a pair, and the leg that is stretched out beside them is nobody's. A leg leads from the
hips to its foot, so what of the player's colours lies off both legs of a pair speaks against it.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from keyrecon.segmentation.player_crops import Cropping
from keyrecon.tracking.candidates import KNEE_DEVIATION

HIPS_BELOW_HEAD = 0.48
"""Player heights: hips at .530 of the stature, the middle of the head at .93 (Drillis and Contini
1966), less what who waits for a ball bends the knees. With .44 and .52 as many feet are right."""
HIP_BAND = 0.4, 0.55
"""The middle between the hips is that of the player's colours so far below the head."""
LEGS_FROM, LEGS_TO = 0.55, 1.25
"""So far below the head what the player covers are legs, player heights: from beneath the shorts'
middle to a foot of a deep lunge."""
LEGS_ASIDE = 0.8
"""And so far aside of the hips: a leg is .57 heights long with its foot, and heads lean."""
LEG_BREADTH, SHANK_LENGTH = 0.08, 0.27
"""Player heights; shanks are .246 statures long (Winter)."""
LEG_SOFTNESS = 0.08
"""From where a leg's place is surely on it to where it is surely off, player heights."""
LEAST_COLOR = 0.1
"""Places that show less of the player's colours do not count: they are most, and nothing."""
UNEXPLAINED_COST = 4.0
"""Cost of a whole shank that neither leg of a pair explains, nats; more counts no more. Frames of
the far player of tennis_broadcast_clay, marked once, whose feet are both within .15 heights of the
ankles marked by eye: 72 % with 0, 75 with 2, 88 with 4 and with 6; of five other players as many
with all four, within one frame."""


@dataclass(frozen=True, eq=False)
class LegPlaces:
    """What the player covers below the hips, player heights from the head."""

    hips: Float[np.ndarray, "2"]
    places: Float[np.ndarray, "P 2"]
    area: Float[np.ndarray, "P"]
    """Of each place, times how much of the player's colours it shows; squares of heights."""


def find_leg_places(
    player: Float[np.ndarray, "y x"],
    cropping: Cropping,
    t: int,
    head: Float[np.ndarray, "2"],
    height: float,
) -> LegPlaces:
    """From the player's colours at half the resolution of the crop of frame t; `head` and `height`
    in px of the picture."""
    rows, columns = np.nonzero(player > LEAST_COLOR)
    spots = np.stack([2 * columns + 0.5, 2 * rows + 0.5], axis=1)
    places = (cropping.to_picture(spots, t) - head) / height
    color = player[rows, columns].astype(float)
    aside, below = places.T
    hips = (below > HIP_BAND[0]) & (below < HIP_BAND[1]) & (np.abs(aside) < LEGS_ASIDE / 2)
    middle = np.average(aside[hips], weights=color[hips]) if hips.any() else 0.0
    legs = (below > LEGS_FROM) & (below < LEGS_TO) & (np.abs(aside - middle) < LEGS_ASIDE)
    cell = (2 / (float(cropping.scale[t]) * height)) ** 2
    return LegPlaces(np.array([middle, HIPS_BELOW_HEAD]), places[legs], cell * color[legs])


def unexplained_costs(
    feet: Float[np.ndarray, "n 2"], pairs: Int[np.ndarray, "s 2"], legs: LegPlaces
) -> Float[np.ndarray, "s"]:
    """Cost of what legs to both feet of each pair leave of the player, nats; `feet` in player
    heights from the head."""
    leg, way = feet - legs.hips, legs.places - legs.hips
    square = np.maximum(np.square(leg).sum(axis=1), 1e-9)
    along = np.clip(leg @ way.T / square[:, None], 0, 1)
    apart = np.linalg.norm(way - along[..., None] * leg[:, None], axis=2)
    gap = np.clip((apart - LEG_BREADTH / 2 - KNEE_DEVIATION) / LEG_SOFTNESS, 0, 1)
    left = np.minimum(gap[pairs[:, 0]], gap[pairs[:, 1]]) @ legs.area
    return UNEXPLAINED_COST * np.minimum(left / (LEG_BREADTH * SHANK_LENGTH), 1)
