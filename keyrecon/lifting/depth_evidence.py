"""What is known of depth signs: what speaks for them, what the picture shows, and the answer."""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from jaxtyping import Float, Int


@dataclass(frozen=True)
class DepthSignOptions:
    """What speaks for a sign, and how loudly; per frame at 50 frames a second."""

    confirmed: float = 8.0
    """Cost of contradicting the annotated sign of a bone, nats."""
    limits: float = 0.15
    """Weight of joint limits per frame; errors stay alike over several frames."""
    votes: float = 0.3
    """Weight of the key poses per frame."""
    guide: float = 1.0
    """Weight of the slerped key poses per frame."""
    usual: float = 0.7
    """Weight, per frame, of the depth that limbs usually have where they look like this."""
    alike: float = 0.08
    """Difference of shown bone vectors at which two poses look alike, statures."""
    jerk: float = 0.1
    """Second difference of depth between frames to be expected, statures."""
    reach: float = 6.0
    """Largest cost of one jump, nats."""


def at_rate(options: DepthSignOptions, fps: float) -> DepthSignOptions:
    """The same evidence per second, and the same accelerations, at another frame rate."""
    step = 50.0 / fps
    return replace(
        options,
        limits=options.limits * step,
        votes=options.votes * step,
        guide=options.guide * step,
        usual=options.usual * step,
        jerk=options.jerk * step**2,
    )


@dataclass(frozen=True, eq=False)
class ForeshortenedBones:
    """Bones as the picture shows them: everything but the sign of their depth."""

    flat: Float[np.ndarray, "T B 2"]
    """In-plane part of the bone vectors, statures."""
    depth: Float[np.ndarray, "T B"]
    """|dz|, statures."""
    doubt: Float[np.ndarray, "T B"]
    """Standard deviation of |dz|, statures."""
    usual: Float[np.ndarray, "T B"]
    """Depth, with its sign, that bones usually have that look like this, statures; NaN where
    nothing is known of that."""

    def part(self, frames: slice | Int[np.ndarray, "n"]) -> "ForeshortenedBones":
        """Some of the frames."""
        return ForeshortenedBones(
            self.flat[frames], self.depth[frames], self.doubt[frames], self.usual[frames]
        )


@dataclass(frozen=True, eq=False)
class DepthSigns:
    """Depth signs: 1 where the child end is farther from the camera (dz > 0)."""

    sign: Int[np.ndarray, "T B"]
    probability: Float[np.ndarray, "T B"]
    """0.5-1: how likely the sign is."""


def sign_states(bones: int) -> Int[np.ndarray, "S g"]:
    """All sign vectors of a group of bones."""
    return np.array(list(product((1, -1), repeat=bones)))


def sign_depths(
    bones: tuple[int, ...], shown: ForeshortenedBones
) -> tuple[Float[np.ndarray, "T S g"], Float[np.ndarray, "T g"]]:
    """Depth of a group of bones for every sign vector, and its doubt, statures."""
    states = sign_states(len(bones))
    return states * shown.depth[:, None, list(bones)], shown.doubt[:, list(bones)]
