"""Follow one half of the body through the video: propose, choose, settle."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float, Int

from keyrecon.matching.candidates import Candidates, borrow_limbs, carry_figures, fit_similar, join_candidates
from keyrecon.matching.choose import choose_limbs
from keyrecon.matching.correspondence import ElementIndex
from keyrecon.matching.fit import Figures
from keyrecon.matching.judge import judge_figures
from keyrecon.matching.flow import Flow
from keyrecon.matching.limbs import LimbFlow, place_samples, predict_joints
from keyrecon.matching.puppet import Puppets
from keyrecon.matching.settle import FOLLOW, Proposal, settle_joints

BLOCK = 1024
"""Figures whose next step is predicted at a time, to bound memory."""


@dataclass(frozen=True, eq=False)
class Scene:
    """What both halves of the body look at."""

    index: ElementIndex
    flow: Flow
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
    limbs = place_samples(scene.flow, puppets)
    ranked = np.argsort(start.distance, axis=1, kind="stable")[:, :similar]
    similar = fit_similar(puppets, scene.index, ranked, start.shift)
    candidates = join_candidates(
        similar,
        borrow_limbs(puppets, scene.index, similar),
        *(carry_figures(puppets, scene.index, limbs, ranked[:, 0], step) for step in (1, -1)),
    )
    expected = _expect(puppets, limbs, candidates)
    chosen, which = choose_limbs(puppets, candidates, expected, start.distance)
    chosen[:, half.given] = start.given
    proposal = Proposal(chosen, ranked[:, 0])
    joints = settle_joints(puppets, scene.index, limbs, proposal, scene.fps, rounds)
    confidence = _confidence(puppets, scene.index, proposal, joints)
    return Followed(joints, confidence, which)


def _expect(
    puppets: Puppets, limbs: LimbFlow, candidates: Candidates
) -> Complex[np.ndarray, "T S J"]:
    """Where every proposal's joints are in the next frame, by the flow."""
    count, states, _ = candidates.joints.shape
    flat = candidates.joints.reshape(count * states, -1)
    frames = np.repeat(np.arange(count), states)
    expected = np.full_like(flat, np.nan)
    there = np.flatnonzero(np.isfinite(flat).all(axis=1))
    for at in range(0, len(there), BLOCK):
        part = there[at : at + BLOCK]
        expected[part] = predict_joints(limbs, puppets, frames[part], flat[part])
    return expected.reshape(candidates.joints.shape)


def _confidence(
    puppets: Puppets,
    index: ElementIndex,
    proposal: Proposal,
    joints: Complex[np.ndarray, "T J"],
) -> Float[np.ndarray, "T J"]:
    """Share of the outline found around a joint, less where the proposal lay elsewhere."""
    every = np.arange(len(joints))
    figures = Figures(every, np.full(len(every), puppets.average), joints)
    fit = 1 - judge_figures(puppets, index, figures)
    near = np.zeros((len(puppets.half.bones), joints.shape[1]))
    near[np.arange(len(near))[:, None], puppets.half.bones] = 1
    around = fit @ near / np.maximum(near.sum(axis=0), 1)
    return around * np.exp(-0.5 * (np.abs(joints - proposal.joints) / FOLLOW) ** 2)
