"""Follow one half of the body through the video: propose, choose, settle."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float, Int

from keyrecon.propagation.correspondence import ElementIndex
from keyrecon.propagation.edge_template import EdgeTemplates
from keyrecon.propagation.hypotheses import (
    fit_similar,
    join_hypotheses,
    propose_limbs,
    track_from_keyframes,
)
from keyrecon.propagation.registration import FittedFigures
from keyrecon.propagation.scoring import score_templates
from keyrecon.propagation.selection import choose_limbs
from keyrecon.propagation.trajectory_smoothing import (
    DATA_WEIGHT,
    SmoothingInput,
    smooth_trajectories,
)

BORROWED = 3
"""Limbs of other figures that are fitted on each side: as many as there may be places for one."""


@dataclass(frozen=True, eq=False)
class FrameEvidence:
    """What both halves of the body look at."""

    index: ElementIndex
    fps: float


@dataclass(frozen=True, eq=False)
class InitialHypotheses:
    """What is known of one half before it is followed."""

    shift: Complex[np.ndarray, "T K"]
    """From an annotated figure to the same figure in another frame, by head or feet."""
    distance: Float[np.ndarray, "T K"]
    """Pose distance of every frame to the annotated ones, player heights."""
    given: Complex[np.ndarray, "T G"]
    """Joints that the other half has settled."""


@dataclass(frozen=True, eq=False)
class PropagatedHalf:
    """One half of the body in every frame."""

    joints: Complex[np.ndarray, "T J"]
    confidence: Float[np.ndarray, "T J"]
    which: Int[np.ndarray, "T J"]
    """Row of the annotated figure that each joint comes from."""


def propagate_half(
    puppets: EdgeTemplates,
    scene: FrameEvidence,
    start: InitialHypotheses,
    similar: int,
    rounds: int,
) -> PropagatedHalf:
    """Joints of one half in all frames from `similar` annotated figures each."""
    half = puppets.half
    fitted = fit_similar(puppets, scene.index, start.distance, start.shift, similar)
    nearest = fitted.which[:, 0]
    with ThreadPoolExecutor(1) as beside:
        carried = beside.submit(track_from_keyframes, puppets, scene.index, nearest)
        borrowed = propose_limbs(puppets, scene.index, fitted, BORROWED)
    candidates = join_hypotheses(fitted, borrowed, carried.result())
    chosen, which = choose_limbs(puppets, candidates)
    chosen[:, half.given] = start.given
    proposal = SmoothingInput(chosen, nearest)
    joints = smooth_trajectories(puppets, scene.index, proposal, scene.fps, rounds)
    confidence = joint_confidence(puppets, scene.index, proposal, joints)
    return PropagatedHalf(joints, confidence, which)


def joint_confidence(
    puppets: EdgeTemplates,
    index: ElementIndex,
    proposal: SmoothingInput,
    joints: Complex[np.ndarray, "T J"],
) -> Float[np.ndarray, "T J"]:
    """Confidence 0-1: share of the outline found around a joint, less where the proposal lay
    elsewhere."""
    every = np.arange(len(joints))
    figures = FittedFigures(every, np.full(len(every), puppets.average), joints)
    fit = 1 - score_templates(puppets, index, figures)
    near = np.zeros((len(puppets.half.bones), joints.shape[1]))
    near[np.arange(len(near))[:, None], puppets.half.bones] = 1
    around = fit @ near / np.maximum(near.sum(axis=0), 1)
    return around * np.exp(-0.5 * (np.abs(joints - proposal.joints) / DATA_WEIGHT) ** 2)
