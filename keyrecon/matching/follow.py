"""Follow one half of the body through the video: propose, choose, settle."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float, Int

from keyrecon.matching.borrow import borrow_limbs
from keyrecon.matching.candidates import carry_figures, fit_similar, join_candidates
from keyrecon.matching.choose import choose_limbs
from keyrecon.matching.correspondence import ElementIndex
from keyrecon.matching.fit import Figures
from keyrecon.matching.judge import judge_figures
from keyrecon.matching.puppet import Puppets
from keyrecon.matching.settle import FOLLOW, Proposal, settle_joints

BORROWED = 3
"""Limbs of other figures that are fitted on each side: as many as there may be places for one."""


@dataclass(frozen=True, eq=False)
class Scene:
    """What both halves of the body look at."""

    index: ElementIndex
    fps: float


@dataclass(frozen=True, eq=False)
class Start:
    """What is known of one half before it is followed."""

    shift: Complex[np.ndarray, "T K"]
    """From an annotated figure to the same figure in another frame, by head or feet."""
    distance: Float[np.ndarray, "T K"]
    """Pose distance of every frame to the annotated ones, player heights."""
    given: Complex[np.ndarray, "T G"]
    """Joints that the other half has settled."""


@dataclass(frozen=True, eq=False)
class Followed:
    """One half of the body in every frame."""

    joints: Complex[np.ndarray, "T J"]
    confidence: Float[np.ndarray, "T J"]
    which: Int[np.ndarray, "T J"]
    """Row of the annotated figure that each joint comes from."""


def follow_half(
    puppets: Puppets, scene: Scene, start: Start, similar: int, rounds: int
) -> Followed:
    """Joints of one half in all frames from `similar` annotated figures each."""
    half = puppets.half
    fitted = fit_similar(puppets, scene.index, start.distance, start.shift, similar)
    nearest = fitted.which[:, 0]
    with ThreadPoolExecutor(1) as beside:
        carried = beside.submit(carry_figures, puppets, scene.index, nearest)
        borrowed = borrow_limbs(puppets, scene.index, fitted, BORROWED)
    candidates = join_candidates(fitted, borrowed, carried.result())
    chosen, which = choose_limbs(puppets, candidates)
    chosen[:, half.given] = start.given
    proposal = Proposal(chosen, nearest)
    joints = settle_joints(puppets, scene.index, proposal, scene.fps, rounds)
    confidence = judge_joints(puppets, scene.index, proposal, joints)
    return Followed(joints, confidence, which)


def judge_joints(
    puppets: Puppets,
    index: ElementIndex,
    proposal: Proposal,
    joints: Complex[np.ndarray, "T J"],
) -> Float[np.ndarray, "T J"]:
    """Confidence 0-1: share of the outline found around a joint, less where the proposal lay
    elsewhere."""
    every = np.arange(len(joints))
    figures = Figures(every, np.full(len(every), puppets.average), joints)
    fit = 1 - judge_figures(puppets, index, figures)
    near = np.zeros((len(puppets.half.bones), joints.shape[1]))
    near[np.arange(len(near))[:, None], puppets.half.bones] = 1
    around = fit @ near / np.maximum(near.sum(axis=0), 1)
    return around * np.exp(-0.5 * (np.abs(joints - proposal.joints) / FOLLOW) ** 2)
