"""Key poses vote, where they look alike in the picture, for the depths confirmed there."""

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

_MOST_ALIKE = 24
"""Key poses that are asked per frame; those further away weigh nothing."""


@dataclass(frozen=True, eq=False)
class ExemplarPrior:
    """Key poses that vote for depths where they look alike."""

    vectors: Float[np.ndarray, "K B 3"]
    """Bone vectors of the key poses, statures."""
    frames: Int[np.ndarray, "K"]
    """Row of each key pose among the frames; others vote too."""
    confidence: Float[np.ndarray, "K B"]
    """0-1: how sure the sign of each bone is."""
    guide: Float[np.ndarray, "T B"]
    """Depth of the slerped key poses in each frame, statures."""
    skeleton: Skeleton

    def cost(
        self, bones: tuple[int, ...], shown: ForeshortenedBones, options: DepthSignOptions
    ) -> Float[np.ndarray, "T S"]:
        """Cost of each sign vector of a group of bones in each frame, nats."""
        members = list(bones)
        alike, apart = self._most_alike(members, shown, options)
        states = sign_states(len(bones))
        depth = (states * shown.depth[:, None, members])[:, :, None]  # (T, S, 1, g)
        wanted = self.vectors[:, members, 2][alike][:, None]  # (T, 1, n, g)
        spread = options.alike**2 + shown.doubt[:, members] ** 2
        confidence = self.confidence[:, members][alike][:, None]
        off = (confidence * (depth - wanted) ** 2 / (2 * spread[:, None, None])).sum(-1)
        likelihood = np.exp(-apart[:, None] - off).sum(-1)
        cost = -options.votes * np.log(likelihood + np.exp(-options.reach))
        return cost + self._confirmed(members, shown, options)

    def guided(
        self, bones: tuple[int, ...], shown: ForeshortenedBones, options: DepthSignOptions
    ) -> Float[np.ndarray, "T S"]:
        """Cost of leaving the slerped key poses, nats."""
        depth, doubt = sign_depths(bones, shown)
        off = (depth - self.guide[:, None, list(bones)]) ** 2
        off = off / (2 * (options.alike**2 + doubt[:, None] ** 2))
        return options.guide * np.minimum(off.sum(-1), options.reach)

    def _most_alike(
        self, bones: list[int], shown: ForeshortenedBones, options: DepthSignOptions
    ) -> tuple[Int[np.ndarray, "T n"], Float[np.ndarray, "T n"]]:
        """The key poses in which a group and the trunk look most like each frame's."""
        context = sorted({*bones, *anatomy_of(self.skeleton).trunk})
        flat = shown.flat[:, context].reshape(len(shown.flat), -1)
        keys = self.vectors[:, context, :2].reshape(len(self.vectors), -1)
        apart = (flat**2).sum(-1)[:, None] + (keys**2).sum(-1) - 2 * flat @ keys.T
        most = min(_MOST_ALIKE, len(keys))
        alike = np.argpartition(apart, most - 1, axis=1)[:, :most]
        near = np.maximum(np.take_along_axis(apart, alike, axis=1), 0.0)
        return alike, near / (2 * options.alike**2)

    def _confirmed(
        self, bones: list[int], shown: ForeshortenedBones, options: DepthSignOptions
    ) -> Float[np.ndarray, "T S"]:
        """Cost of contradicting a keyframe at its own frame."""
        states = sign_states(len(bones))
        cost = np.zeros((len(shown.flat), len(states)))
        for row, frame in enumerate(self.frames):
            if 0 <= frame < len(cost):
                wanted = self.vectors[row, bones, 2]
                wrong = self.confidence[row, bones] * (states * wanted < 0)
                deep = np.minimum(np.abs(shown.depth[frame, bones]) / options.alike, 1.0)
                cost[frame] = options.confirmed * (wrong * deep).sum(-1)
        return cost
