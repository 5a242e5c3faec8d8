"""Depth signs: the weights of the evidence, foreshortened bones, and the signs."""

from dataclasses import dataclass, replace
from itertools import product
from typing import Annotated

import numpy as np
from jaxtyping import Float, Int

from keyrecon.ranges import within


@dataclass(frozen=True)
class DepthSignOptions:
    """What decides which end of a limb is nearer, and how much; per frame at 50 frames a second."""

    # Values chosen on rendered sequences; see benchmarks/sensitivity.py.

    annotated: Annotated[float, within(0, 200)] = 8.0
    """What it costs to contradict a depth sign that a person gave.

    In nats. A quarter more or less, others with it: at most 2.8 mm on eight clips.
    """
    joint_limits: Annotated[float, within(0, 3)] = 0.15
    """Weight of joints that would bend the wrong way.

    Per frame; errors stay alike over several frames. A quarter more or less, others with it: at
    most 2.8 mm on eight clips.
    """
    exemplars: Annotated[float, within(0, 6)] = 0.3
    """Weight of marked poses that look alike in the picture.

    Per frame. A quarter more or less, others with it: at most 2.8 mm on eight clips.
    """
    initial_motion: Annotated[float, within(0, 20)] = 1.0
    """Weight of the motion interpolated between marked poses.

    Slerped key poses, per frame. A quarter more or less, others with it: at most 2.8 mm on eight
    clips.
    """
    expected_depth: Annotated[float, within(0, 10)] = 0.7
    """Weight of what is usual in motion capture (`--depths`).

    Per frame, of the depth model's expectation. A quarter less costs 3.9 mm where nobody gave
    signs, on one of eight rendered clips of 6 s, and nothing where somebody did; no video without
    signs shows whether the model is right.
    """
    exemplar_spread: Annotated[float, within(0.004, 2)] = 0.08
    """How much poses that look alike may differ in the picture, body heights.

    Standard deviation of bone vectors. A quarter more or less, others with it: at most 2.8 mm on
    eight clips.
    """
    acceleration: Annotated[float, within(0.005, 2)] = 0.1
    """How much the depth of a bone may change its speed within 1/50 s, body heights.

    Standard deviation of the second difference of depth. A quarter more or less, others with it: at
    most 2.8 mm on eight clips.
    """
    max_jump_cost: Annotated[float, within(0, 100)] = 6.0
    """What a sudden change of depth costs at most.

    In nats. A quarter more or less, others with it: at most 2.8 mm on eight clips.
    """


def at_rate(options: DepthSignOptions, fps: float) -> DepthSignOptions:
    """The same evidence per second, and the same accelerations, at another frame rate."""
    step = 50.0 / fps
    return replace(
        options,
        joint_limits=options.joint_limits * step,
        exemplars=options.exemplars * step,
        initial_motion=options.initial_motion * step,
        expected_depth=options.expected_depth * step,
        acceleration=options.acceleration * step**2,
    )


@dataclass(frozen=True, eq=False)
class ForeshortenedBones:
    """Bones as they appear in the picture: everything but the sign of their depth."""

    in_plane: Float[np.ndarray, "T B 2"]
    """In-plane part of the bone vectors, statures."""
    depth: Float[np.ndarray, "T B"]
    """|dz|, statures."""
    depth_spread: Float[np.ndarray, "T B"]
    """Standard deviation of |dz|, statures."""
    expected_depth: Float[np.ndarray, "T B"]
    """Depth with its sign by a depth model, statures; NaN where there is none."""

    def part(self, frames: slice | Int[np.ndarray, "n"]) -> "ForeshortenedBones":
        """Some of the frames."""
        return ForeshortenedBones(
            self.in_plane[frames],
            self.depth[frames],
            self.depth_spread[frames],
            self.expected_depth[frames],
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


def sign_depths(group: tuple[int, ...], bones: ForeshortenedBones) -> Float[np.ndarray, "T S g"]:
    """Depth of a group of bones for every sign vector, statures."""
    return sign_states(len(group)) * bones.depth[:, None, list(group)]
