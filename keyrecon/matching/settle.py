"""Settle all frames at once: edges, bone shape and smooth motion in one least squares.

Every frame sees its edges, through the most similar annotated figure and through the average
outline; three frames in a row are tied by a small acceleration; the chosen proposals are followed
unless all of that speaks against them; annotated frames are held. Matches and robust weights are
renewed in each round.

Optical flow along the limbs was tried as a further tie between neighbours and made arms worse: it
sees the still background beside a thin fast arm. Contours and smoothness place them better.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Int

from keyrecon.matching.blocks import in_blocks
from keyrecon.matching.chain import link_frames, solve_chain
from keyrecon.matching.correspondence import ElementIndex
from keyrecon.matching.fit import Figures, Step, keep_shape, see_edges
from keyrecon.matching.puppet import Puppets
from keyrecon.matching.rows import Normals, observe_joints

REACHES = (0.05, 0.04, 0.03)
"""Farthest match in the first, second and later rounds, player heights."""
LOOSE = Step(reach=0.0, length=0.03, swing=0.10)
"""How firmly bones keep the shape of the chosen proposal."""
FOLLOW = 0.06
"""Distance at which a chosen proposal loses most of its pull, player heights."""
CALM = 0.002
"""Spread of the second difference of a joint at the root, player heights at 50 frames/s; it
doubles with every bone outwards. Strokes of the tennis motion capture lie at half of this for
the trunk and the same for the wrist."""
HELD, MARKED = 1e5, 1e6
"""Weights of joints that are known: by the other half of the body, and by a person."""


@dataclass(frozen=True, eq=False)
class Proposal:
    """Where the joints of every frame may be before they are settled."""

    joints: Complex[np.ndarray, "T J"]
    similar: Int[np.ndarray, "T"]
    """Most similar puppet of every frame."""


def settle_joints(
    puppets: Puppets,
    index: ElementIndex,
    proposal: Proposal,
    fps: float,
    rounds: int,
) -> Complex[np.ndarray, "T J"]:
    """Joints of all frames; those given by the other half stay where the proposal has them."""
    half, every = puppets.half, np.arange(len(proposal.similar))
    average = np.full(len(every), puppets.average)
    calm = CALM * 2.0**half.depth * (50 / fps) ** 2
    joints = proposal.joints
    for turn in range(rounds):
        reach = REACHES[min(turn, len(REACHES) - 1)]
        alone = keep_shape(puppets, joints, proposal.joints, LOOSE)
        alone = alone + _hold(puppets, proposal, joints)
        for which in (proposal.similar, average):
            figures = Figures(every, which, joints)
            alone = alone + _see_all(puppets, index, figures, reach)
        joints = solve_chain(link_frames(alone, calm))
    return joints


def _see_all(puppets: Puppets, index: ElementIndex, figures: Figures, reach: float) -> Normals:
    """The edges of all frames."""

    def see(part: slice) -> tuple[np.ndarray, np.ndarray]:
        seen = see_edges(puppets, index, figures.take(part), reach)
        return seen.matrix, seen.right

    return Normals(*in_blocks(see, len(figures.frames)))


def _hold(puppets: Puppets, proposal: Proposal, joints: Complex[np.ndarray, "T J"]) -> Normals:
    """Follow the proposal, and hold what is known."""
    poses = puppets.poses
    away = (np.abs(joints - proposal.joints) / FOLLOW) ** 2
    weight = 1 / (FOLLOW * (1 + away)) ** 2
    weight[:, puppets.half.given] = HELD
    target = proposal.joints.copy()
    target[poses.frames] = np.where(poses.known, poses.joints, target[poses.frames])
    weight[poses.frames] = np.where(poses.known, MARKED, weight[poses.frames])
    return observe_joints(target, weight)
