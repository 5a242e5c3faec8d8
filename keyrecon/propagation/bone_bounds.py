"""How long a bone can be in the picture, from the marks of this very video.

The longest that a bone was ever marked, relative to the player's height in that frame, bounds it,
for it was never longer than it is and was seen at length at some time. What the bound leaves out is
how much more a further frame may show: nearer limbs look longer, heights of the player are
estimated, and marks spread. The video tells this too: by how much the longest mark of a bone
exceeds the longest in all other frames, where that is no shorter than bodies have the bone: hips
seen from the side in all frames but one say nothing of how marks spread. The largest of these
excesses over all bones of the body is allowed to each, and the spread of marks is added. A bone
that was marked foreshortened only may at least be as long as bodies have it beside their other
bones.

On eight real clips .04 % of the bones marked by eye in other frames are longer than that, by 6 % at
most.
"""

import numpy as np
from jaxtyping import Bool, Complex, Float, Int

from keyrecon.body import Skeleton
from keyrecon.numerics.geometry import to_complex
from keyrecon.propagation.body_frame import PlayerMarks

ROUNDING = 0.01
"""Share by which a bone may exceed its bound: least squares bring it there not quite. A quarter
more or less, others with it: at most 1.2 points, 2.1 mm on nine clips."""
MARK_SPREAD = 0.016
"""Distance at which two eyes mark the same joint, median on 44 real frames, player heights."""
MIN_FRAMES = 2
"""Marked frames without which no excess is known: nothing is bounded then. Three, others with it:
at most 1.5 points, 2.1 mm on nine clips."""


def bound_bones(marks: PlayerMarks) -> Float[np.ndarray, "J J"]:
    """Greatest distance in the picture of joints that a bone or the trunk joins, player heights;
    infinite for all others, and where marks do not tell."""
    skeleton = marks.skeleton
    pairs = np.concatenate([skeleton.bones, _across(skeleton)])
    groups = [_alike(skeleton, pair) for pair in pairs.tolist()]
    longest, second = np.full((2, len(pairs)), np.nan)
    for row, group in enumerate(groups):
        lengths = np.append(_longest_of_frames(marks.joints, group), [np.nan, np.nan])
        longest[row], second[row] = lengths[:2]
    bounds = np.full((len(skeleton.names),) * 2, np.inf)
    if len(marks.frames) < MIN_FRAMES or np.isnan(longest).any():
        return bounds
    bones = len(skeleton.bones)
    size = float(np.median(longest[:bones] / skeleton.lengths))
    usual = size * np.append(skeleton.lengths, _usual_breadths(skeleton, pairs[bones:]))
    excess = longest / np.fmax(second, usual)
    longest[:bones] = np.maximum(longest[:bones], usual[:bones])
    one, other = pairs.T
    bounds[one, other] = bounds[other, one] = excess.max(initial=1.0) * longest + MARK_SPREAD
    return bounds


def bone_lengths(
    joints: Complex[np.ndarray, "*n J"], bones: Int[np.ndarray, "B 2"]
) -> Float[np.ndarray, "*n B"]:
    """Of every bone."""
    return np.abs(joints[..., bones[:, 1]] - joints[..., bones[:, 0]])


def stretched_ends(
    joints: Float[np.ndarray, "T J 2"],
    height: Float[np.ndarray, "T"],
    bounds: Float[np.ndarray, "J J"],
    before: Float[np.ndarray, "T J 2"] | None = None,
) -> Bool[np.ndarray, "T J"]:
    """Which joints (px) end a bone that is longer than `bounds`, and than it was `before`."""
    bones = np.argwhere(np.triu(np.isfinite(bounds)))
    longest = bounds[bones[:, 0], bones[:, 1]]
    if before is not None:
        longest = np.maximum(longest, bone_lengths(to_complex(before) / height[:, None], bones))
    lengths = bone_lengths(to_complex(joints) / height[:, None], bones)
    ends = np.zeros((len(bones), joints.shape[1]), bool)
    ends[np.arange(len(bones))[:, None], bones] = True
    return (lengths > longest * (1 + ROUNDING)) @ ends


def _across(skeleton: Skeleton) -> Int[np.ndarray, "n 2"]:
    """Mirrored joints that hang from the same one: the breadths of shoulders and hips."""
    pairs = [p for p in skeleton.mirrored if skeleton.parents[p[0]] == skeleton.parents[p[1]]]
    return np.array(pairs, int).reshape(-1, 2)


def _usual_breadths(skeleton: Skeleton, pairs: Int[np.ndarray, "n 2"]) -> list[float]:
    """Of shoulders and hips, in statures; 0 where no table has them."""
    known = {
        frozenset((breadth.left, breadth.right)): breadth.length for breadth in skeleton.breadths
    }
    return [known.get(frozenset(pair), 0.0) for pair in pairs.tolist()]


def _alike(skeleton: Skeleton, pair: list[int]) -> Int[np.ndarray, "n 2"]:
    """A bone and its mirror image."""
    return np.unique(np.sort([pair, skeleton.mirror[pair].tolist()], axis=1), axis=0)


def _longest_of_frames(
    places: Complex[np.ndarray, "K J"], group: Int[np.ndarray, "n 2"]
) -> Float[np.ndarray, "_"]:
    """The longer of some bones in each frame that has one, the longest first."""
    lengths = bone_lengths(places, group)
    lengths = np.where(np.isfinite(lengths), lengths, -1).max(axis=1)
    return np.sort(lengths[lengths >= 0])[::-1]
