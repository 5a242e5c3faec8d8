"""Exemplar prior: key poses that are alike in the picture tell the depths annotated there."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from keyrecon.body import Skeleton
from keyrecon.lifting.depth_evidence import (
    DepthSignOptions,
    ForeshortenedBones,
    sign_depths,
    sign_states,
)
from keyrecon.lifting.priors.anatomy import anatomy_of

_NEIGHBOURS = 24
"""Key poses that count per frame; those further away weigh nothing. A quarter more or less, others
with it: at most 2.8 mm on eight clips."""


@dataclass(frozen=True, eq=False)
class ExemplarPrior:
    """Key poses, each an exemplar of the depths of poses alike in the picture."""

    vectors: Float[np.ndarray, "K B 3"]
    """Bone vectors of the key poses, statures."""
    frames: Int[np.ndarray, "K"]
    """Row of each key pose among the frames; those of other frames count too."""
    confidence: Float[np.ndarray, "K B"]
    """0-1: how sure the sign of each bone is."""
    initial_depth: Float[np.ndarray, "T B"]
    """Depth of the initial motion in each frame, statures."""
    skeleton: Skeleton

    def cost(
        self, group: tuple[int, ...], bones: ForeshortenedBones, options: DepthSignOptions
    ) -> Float[np.ndarray, "T S"]:
        """Cost of each sign vector of a group of bones in each frame, nats."""
        members = list(group)
        neighbours, distance = self._nearest(members, bones, options)
        depth = sign_depths(group, bones)[:, :, None]  # (T, S, 1, g)
        exemplar = self.vectors[:, members, 2][neighbours][:, None]  # (T, 1, n, g)
        variance = options.exemplar_spread**2 + bones.depth_spread[:, members] ** 2
        confidence = self.confidence[:, members][neighbours][:, None]
        off = (confidence * (depth - exemplar) ** 2 / (2 * variance[:, None, None])).sum(-1)
        likelihood = np.exp(-distance[:, None] - off).sum(-1)
        cost = -options.exemplars * np.log(likelihood + np.exp(-options.max_jump_cost))
        return cost + self._contradiction_cost(members, bones, options)

    def initial_motion_cost(
        self, group: tuple[int, ...], bones: ForeshortenedBones, options: DepthSignOptions
    ) -> Float[np.ndarray, "T S"]:
        """Cost of leaving the initial motion, nats."""
        members = list(group)
        off = (sign_depths(group, bones) - self.initial_depth[:, None, members]) ** 2
        variance = options.exemplar_spread**2 + bones.depth_spread[:, None, members] ** 2
        off = off / (2 * variance)
        return options.initial_motion * np.minimum(off.sum(-1), options.max_jump_cost)

    def _nearest(
        self, group: list[int], bones: ForeshortenedBones, options: DepthSignOptions
    ) -> tuple[Int[np.ndarray, "T n"], Float[np.ndarray, "T n"]]:
        """The key poses in which a group and the trunk are most like each frame's, and how far
        they are, nats."""
        context = sorted({*group, *anatomy_of(self.skeleton).trunk})
        flat = bones.in_plane[:, context].reshape(len(bones.in_plane), -1)
        keys = self.vectors[:, context, :2].reshape(len(self.vectors), -1)
        squared = (flat**2).sum(-1)[:, None] + (keys**2).sum(-1) - 2 * flat @ keys.T
        most = min(_NEIGHBOURS, len(keys))
        nearest = np.argpartition(squared, most - 1, axis=1)[:, :most]
        distance = np.maximum(np.take_along_axis(squared, nearest, axis=1), 0.0)
        return nearest, distance / (2 * options.exemplar_spread**2)

    def _contradiction_cost(
        self, group: list[int], bones: ForeshortenedBones, options: DepthSignOptions
    ) -> Float[np.ndarray, "T S"]:
        """Cost of contradicting a keyframe at its own frame."""
        states = sign_states(len(group))
        cost = np.zeros((len(bones.in_plane), len(states)))
        for row, frame in enumerate(self.frames):
            if 0 <= frame < len(cost):
                annotated = self.vectors[row, group, 2]
                wrong = self.confidence[row, group] * (states * annotated < 0)
                depth = np.abs(bones.depth[frame, group])
                deep = np.minimum(depth / options.exemplar_spread, 1.0)
                cost[frame] = options.annotated * (wrong * deep).sum(-1)
        return cost
