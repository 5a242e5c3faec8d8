"""Refinement of joints by appearance and apparent limb lengths: a tree of patches.

Around every estimate lies a grid of places. A place is good where the picture looks like the
keyframe around the joint (normalised cross-correlation, the patch turned by the limb's change of
direction) and near the estimate; two places are good together where the limb between them has the
keyframe's length times the common change of scale of all limbs. The best choice for all joints of
a tree is found exactly, from the leaves to the root (Felzenszwalb and Huttenlocher, IJCV 61, 2005).
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, Int, UInt8

from keyrecon.video import Video

DETAIL = 125
"""Pixels per player height in the pictures compared: one pixel is one step of the grid."""
REACH = 7
"""Steps of the grid to each side: .056 player heights."""
PATCH = 13
"""Side of a patch, px: a tenth of a player height, wider than a forearm."""
LOOKS = 1.0
"""Weight of appearance."""
LENGTH_SPREAD = 0.12
"""Spread of the logarithm of a limb's relative length; twice that far from any keyframe."""
PLACE_SPREAD = (0.015, 0.06)
"""Least and largest spread of an estimate, player heights."""


@dataclass(frozen=True, eq=False)
class Scenery:
    """A grey picture in which the player has roughly `DETAIL` pixels."""

    grey: UInt8[np.ndarray, "h w"]
    shrink: float
    """Pixels of it per pixel of the video."""
    height: float
    """Player height, px of the video."""
    origin: Float[np.ndarray, "2"]
    """Origin of player coordinates, px of the video."""

    @staticmethod
    def width_for(video: Video, height: Float[np.ndarray, "T"]) -> int:
        """Width to reduce the video to; never enlarged."""
        return min(video.width, round(video.width * 1.25 * DETAIL / float(np.median(height))))

    def around(self, origin: Float[np.ndarray, "2"]) -> "Scenery":
        """The same with another origin."""
        return Scenery(self.grey, self.shrink, self.height, origin)

    def cut(
        self, center: Float[np.ndarray, "2"], size: int, turn: float = 0.0
    ) -> UInt8[np.ndarray, "s s"]:
        """Square of `size` px around a point in player coordinates, turned by `turn` rad."""
        scale = self.height * self.shrink / DETAIL
        middle = (self.origin + center * self.height + 0.5) * self.shrink - 0.5
        cosine, sine = scale * np.cos(turn), scale * np.sin(turn)
        matrix = np.array([[cosine, sine, 0], [-sine, cosine, 0]])
        matrix[:, 2] = middle - matrix[:, :2] @ np.full(2, (size - 1) / 2)
        return cv2.warpAffine(
            self.grey, matrix, (size, size), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REPLICATE,
        )  # fmt: skip


def crop_scenery(picture: UInt8[np.ndarray, "h w 3"], width: int, height: float) -> Scenery:
    """A reduced picture of a video `width` px wide, the player `height` px tall there."""
    grey = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
    return Scenery(grey, picture.shape[1] / width, height, np.zeros(2))


@dataclass(frozen=True, eq=False)
class Sought:
    """Joints in the keyframe and estimates in another frame, player coordinates of each."""

    model: Float[np.ndarray, "J 2"]
    estimate: Float[np.ndarray, "J 2"]
    """NaN where missing."""
    spread: Float[np.ndarray, "J"]
    represented: bool
    """Whether the keyframe shows the same pose."""


def refine_joints(
    keyframe: Scenery,
    frame: Scenery,
    sought: Sought,
    bones: Int[np.ndarray, "B 2"],
    origin: Float[np.ndarray, "2"],
) -> Float[np.ndarray, "J 2"]:
    """Joints in px of the video; NaN where the estimate is missing."""
    frame = frame.around(origin)
    there = np.isfinite(sought.estimate).all(axis=1)
    bones = bones[there[bones].all(axis=1)]
    if not there.any():
        return np.full(sought.estimate.shape, np.nan)
    offsets = _grid()
    cost = {
        int(j): _place_cost(keyframe, frame, sought, int(j), _turn(sought, bones, int(j)))
        for j in np.flatnonzero(there)
    }
    best = _best_places(cost, sought, bones, offsets)
    found = np.full(sought.estimate.shape, np.nan)
    for j, place in best.items():
        found[j] = sought.estimate[j] + offsets[place]
    return origin + found * frame.height


def _grid() -> Float[np.ndarray, "G 2"]:
    y, x = np.mgrid[-REACH : REACH + 1, -REACH : REACH + 1]
    return np.stack([x.ravel(), y.ravel()], axis=1) / DETAIL


def _turn(sought: Sought, bones: Int[np.ndarray, "B 2"], joint: int) -> float:
    """Change of direction of the limb that ends at a joint, or else of one that starts there."""
    ending = bones[bones[:, 1] == joint]
    limbs = ending if len(ending) else bones[bones[:, 0] == joint]
    if not len(limbs):
        return 0.0
    parent, child = limbs[0]
    before, now = (p[child] - p[parent] for p in (sought.model, sought.estimate))
    return float(np.arctan2(now[1], now[0]) - np.arctan2(before[1], before[0]))


def _place_cost(
    keyframe: Scenery, frame: Scenery, sought: Sought, joint: int, turn: float
) -> Float[np.ndarray, "G"]:
    """Cost of each place of the grid by looks and by distance from the estimate."""
    patch = keyframe.cut(sought.model[joint], PATCH, turn)
    around = frame.cut(sought.estimate[joint], PATCH + 2 * REACH)
    alike = cv2.matchTemplate(around, patch, cv2.TM_CCOEFF_NORMED).ravel()
    alike = np.nan_to_num(np.clip(alike, -1, 1), posinf=0, neginf=0)
    spread = np.clip(sought.spread[joint], *PLACE_SPREAD)
    return LOOKS * (1 - alike) + (_grid() ** 2).sum(axis=1) / (2 * spread**2)


def _best_places(
    cost: dict[int, Float[np.ndarray, "G"]],
    sought: Sought,
    bones: Int[np.ndarray, "B 2"],
    offsets: Float[np.ndarray, "G 2"],
) -> dict[int, int]:
    """Cheapest place of every joint, exactly; `bones` lead outwards from the roots."""
    wanted = _wanted_lengths(sought, bones)
    spread = LENGTH_SPREAD * (1 if sought.represented else 2)
    total, choice = dict(cost), {}
    for (parent, child), length in reversed(list(zip(bones.tolist(), wanted, strict=True))):
        bone = sought.estimate[child] - sought.estimate[parent]
        ends = bone + offsets[None] - offsets[:, None]
        ratio = np.log(np.maximum((ends**2).sum(axis=2), 1e-8) / length**2) / 2
        sums = total[child] + ratio**2 / (2 * spread**2)
        choice[child] = sums.argmin(axis=1)
        total[parent] = total[parent] + sums.min(axis=1)
    children = set(bones[:, 1].tolist())
    best = {joint: int(total[joint].argmin()) for joint in cost if joint not in children}
    for parent, child in bones.tolist():
        best[child] = int(choice[child][best[parent]])
    return best


def _wanted_lengths(sought: Sought, bones: Int[np.ndarray, "B 2"]) -> Float[np.ndarray, "B"]:
    """The keyframe's limb lengths times the median change of all of them."""
    if not len(bones):
        return np.zeros(0)
    before, now = (
        np.maximum(np.linalg.norm(p[bones[:, 1]] - p[bones[:, 0]], axis=1), 0.01)
        for p in (sought.model, sought.estimate)
    )
    return before * np.median(now / before)
