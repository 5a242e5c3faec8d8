"""What a careful person would mark on frames whose truth is known."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from jaxtyping import Bool, Float

from keyrecon.body import LSP14, Skeleton
from keyrecon.ranges import SEEDS, within
from keyrecon.records import Annotations, Keyframes


@dataclass(frozen=True)
class MarkOptions:
    """How a person marks."""

    noise: Annotated[float, within(0, 100)] = 2.0
    """Standard deviation of a click, px."""
    signs: bool = True
    """Whether the person settles which end of each limb is nearer."""
    seed: Annotated[int, SEEDS] = 0
    """Of the click noise."""


def mark_from_truth(
    keyframes: Keyframes,
    points2d: Float[np.ndarray, "T J 2"],
    points3d: Float[np.ndarray, "T J 3"],
    visible: Bool[np.ndarray, "T J"] | None = None,
    options: MarkOptions = MarkOptions(),
    skeleton: Skeleton = LSP14,
) -> Annotations:
    """Marks on the keyframes only: upper joints on upper keyframes, lower on lower ones."""
    frames = keyframes.frames
    rng = np.random.default_rng(options.seed)
    joints = points2d[frames] + rng.normal(0, options.noise, (len(frames), len(skeleton.names), 2))
    on_upper = np.isin(frames, keyframes.upper.frames)
    on_lower = np.isin(frames, keyframes.lower.frames)
    asked = np.where(skeleton.is_lower, on_lower[:, None], on_upper[:, None])
    joints[~asked] = np.nan
    parent, child = skeleton.bones.T
    depth = points3d[frames][..., 2]
    nearer = np.sign(depth[:, parent] - depth[:, child]).astype(np.int64)
    nearer[~asked[:, child] | (not options.signs)] = 0
    seen = asked if visible is None else asked & visible[frames]
    return Annotations(skeleton, frames, joints, seen, nearer)
