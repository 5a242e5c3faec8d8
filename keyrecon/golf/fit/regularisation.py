"""What is expected of alpha, mu and G before the picture is looked at (E_D of Eq. 7).

Each term is a set of rows: an error in its standard deviations and its slope by the unknowns.
In windows mu and G are compared to their prediction from the frames before, as printed. Over a
whole swing the same knowledge reads: mu keeps close to its first guess and to an even pace, G
hardly moves since the pelvis's path is part of the learnt motion, and the camera stands level.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from keyrecon.golf.fit.parameterisation import ROOT, SplineBasis
from keyrecon.golf.records import SwingState


@dataclass(frozen=True)
class PriorOptions:
    """Standard deviations of what is expected."""

    alpha: float = 1.0
    """Of every alpha; 1 is the spread of the database."""
    timing: float = 0.08
    """Seconds by which the first guess of the normalised time is early or late."""
    rest: float = 0.005
    """Of the normalised time where the player stands still by that guess."""
    relax: float = 0.05
    """Of the normalised time after the finish: many let the arms sink the way they came."""
    pace: float = 1.5
    """Of the change of pace, normalised time per second squared, from what was guessed."""
    turn: float = 0.07
    """Radians that G turns in a second beyond the learnt motion."""
    shift: float = 0.04
    """Metres that G shifts in a second beyond the learnt motion."""
    roll: float = 0.03
    """Radians by which the camera leans sideways."""
    pitch: float = 0.06
    """Radians by which the camera looks up or down."""


@dataclass(frozen=True, eq=False)
class Rows:
    """Errors in standard deviations, and their slopes by the unknowns."""

    values: Float[np.ndarray, "n"]
    slopes: Float[np.ndarray, "n S"]


def expect_alphas(state: SwingState, span: SplineBasis, mean: np.ndarray, spread: float) -> Rows:
    """alpha_i - expected alpha_i."""
    slopes = np.zeros((span.alphas, span.size))
    slopes[:, : span.alphas] = np.eye(span.alphas) / spread
    return Rows((state.alpha[: span.alphas] - mean[: span.alphas]) / spread, slopes)


def expect_times(
    state: SwingState,
    span: SplineBasis,
    guess: Float[np.ndarray, "T"],
    options: PriorOptions,
    fps: float,
) -> Rows:
    """mu close to its guess, and at its pace; weighed so that the frame rate does not matter.

    A guess that comes too early is wrong by the pace of the swing at that time.
    """
    frames = len(guess)
    pace = gaussian_filter1d(np.gradient(guess) * fps, options.timing * fps)
    rest = np.where(np.arange(frames) > guess.argmax(), options.relax, options.rest)
    near = np.diag(1 / ((rest + options.timing * pace) * np.sqrt(fps)))
    bend = np.diff(np.eye(frames), n=2, axis=0) * fps**2 / (options.pace * np.sqrt(fps))
    rows = np.concatenate([near, bend])
    return Rows(rows @ (state.mu - guess), _on_mu(span, rows))


def expect_stillness(
    state: SwingState, span: SplineBasis, options: PriorOptions, fps: float
) -> Rows:
    """G of the next frame - G, which grows like a random walk."""
    turn = state.rotation[1:] @ np.swapaxes(state.rotation[:-1], 1, 2)
    moved = np.hstack([Rotation.from_matrix(turn).as_rotvec(), np.diff(state.position, axis=0)])
    weight = np.sqrt(fps) / np.repeat([options.turn, options.shift], 3)
    step = np.diff(span.root, axis=0)
    slopes = np.zeros((len(step), ROOT, span.size))
    slopes[..., span.size - ROOT * span.root.shape[1] :] = np.einsum(
        "tb,ij->tibj", step, np.diag(weight)
    ).reshape(len(step), ROOT, -1)
    return Rows((moved * weight).ravel(), slopes.reshape(-1, span.size))


def expect_level(state: SwingState, span: SplineBasis, options: PriorOptions) -> Rows:
    """The player's up points up in the picture: roll is small, pitch less so."""
    frames = len(state.mu)
    up = state.rotation[:, :, 1]
    weight = np.array([1 / options.roll, 1 / options.pitch]) / np.sqrt(frames)
    # d up = turn x up: its x and z parts.
    zero = np.zeros(frames)
    turned = np.stack(
        [np.stack([zero, up[:, 2], -up[:, 1]], 1), np.stack([up[:, 1], -up[:, 0], zero], 1)], 1
    )
    slopes = np.zeros((frames, 2, span.size))
    by_root = np.concatenate([turned * weight[:, None], np.zeros((frames, 2, 3))], axis=2)
    slopes[..., span.size - ROOT * span.root.shape[1] :] = np.einsum(
        "tb,tij->tibj", span.root, by_root
    ).reshape(frames, 2, -1)
    return Rows((up[:, [0, 2]] * weight).ravel(), slopes.reshape(-1, span.size))


def _on_mu(span: SplineBasis, rows: Float[np.ndarray, "n T"]) -> Float[np.ndarray, "n S"]:
    slopes = np.zeros((len(rows), span.size))
    slopes[:, span.alphas : span.alphas + span.mu.shape[1]] = rows @ span.mu
    return slopes


def stack_rows(parts: list[Rows]) -> Rows:
    """All rows in one."""
    return Rows(
        np.concatenate([p.values for p in parts]), np.concatenate([p.slopes for p in parts])
    )
