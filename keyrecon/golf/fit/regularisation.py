"""What is expected of coefficients, phase and root pose G without any picture (IC/2004/90, Eq. 7).

Each term is a set of rows: a residual in its standard deviations and its slope by the unknowns. In
the paper's windows phase and G are compared to their prediction from the frames before. Over a
whole swing the same knowledge reads: the phase keeps close to its first guess and to an even pace,
G hardly moves since the pelvis's path is part of the learnt motion, and the camera stands level.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from jaxtyping import Float, Int
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from keyrecon.golf.fit.parameterisation import ROOT, SplineBasis
from keyrecon.golf.records import SwingState
from keyrecon.ranges import within


@dataclass(frozen=True)
class PriorOptions:
    """Standard deviations of what is expected of a swing."""

    # Values chosen on rendered swings (benchmarks/golf.py).

    coefficients: Annotated[float, within(0.05, 20)] = 1.0
    """How far the swing may differ from the mean one, in standard deviations of the captured
    swings.

    Of every coefficient; 1 is the spread of the database.
    """
    timing: Annotated[float, within(0.004, 2)] = 0.08
    """Seconds by which the first guess of the timing is early or late."""
    rest: Annotated[float, within(0.0003, 0.1)] = 0.005
    """How far the swing may go on where the player stands still by that guess, as a share of the
    swing.

    Of the normalised time.
    """
    relax: Annotated[float, within(0.003, 1)] = 0.05
    """The same after the finish.

    Of the normalised time: many let the arms sink the way they came.
    """
    pace: Annotated[float, within(0.07, 30)] = 1.5
    """How fast the pace may change from what was guessed, swings per second squared.

    Of the change of pace, normalised time per second squared.
    """
    turn: Annotated[float, within(0.004, 1)] = 0.07
    """How far the player may turn beyond the learnt swing, radians per second.

    Of G.
    """
    shift: Annotated[float, within(0.002, 0.8)] = 0.04
    """How far the player may shift beyond the learnt swing, metres per second.

    Of G.
    """
    roll: Annotated[float, within(0.002, 0.6)] = 0.03
    """How far the camera may lean sideways, radians."""
    pitch: Annotated[float, within(0.003, 1)] = 0.06
    """How far the camera may look up or down, radians."""


NOWHERE = np.zeros(0, np.int64)


@dataclass(frozen=True, eq=False)
class Rows:
    """Residuals in standard deviations, and their slopes by the unknowns."""

    values: Float[np.ndarray, "n"]
    slopes: Float[np.ndarray, "n S"]


def coefficient_rows(
    state: SwingState, basis: SplineBasis, mean: Float[np.ndarray, "m"], spread: float
) -> Rows:
    """Coefficients close to some mean."""
    number = basis.n_coefficients
    slopes = np.zeros((number, basis.size))
    slopes[:, :number] = np.eye(number) / spread
    return Rows((state.coefficients[:number] - mean[:number]) / spread, slopes)


def phase_rows(
    state: SwingState,
    basis: SplineBasis,
    guess: Float[np.ndarray, "T"],
    options: PriorOptions,
    fps: float,
    marked: Int[np.ndarray, "n"] = NOWHERE,
) -> Rows:
    """The phase close to its guess, and at its pace, whatever the frame rate.

    A guess that comes too early is wrong by the pace of the swing at that time; that of frames in
    which a person marked a key posture is right.
    """
    frames = len(guess)
    pace = gaussian_filter1d(np.gradient(guess) * fps, options.timing * fps)
    rest = np.where(np.arange(frames) > guess.argmax(), options.relax, options.rest)
    near = np.diag(1 / ((rest + options.timing * pace) * np.sqrt(fps)))
    bend = np.diff(np.eye(frames), n=2, axis=0) * fps**2 / (options.pace * np.sqrt(fps))
    rows = np.concatenate([near, bend, np.eye(frames)[marked] / options.rest])
    return Rows(rows @ (state.phase - guess), _on_phase(basis, rows))


def root_rows(state: SwingState, basis: SplineBasis, options: PriorOptions, fps: float) -> Rows:
    """Steps of G from frame to frame: it moves like a random walk."""
    turn = state.rotation[1:] @ np.swapaxes(state.rotation[:-1], 1, 2)
    moved = np.hstack([Rotation.from_matrix(turn).as_rotvec(), np.diff(state.position, axis=0)])
    weight = np.sqrt(fps) / np.repeat([options.turn, options.shift], 3)
    step = np.diff(basis.root, axis=0)
    slopes = np.zeros((len(step), ROOT, basis.size))
    slopes[..., basis.root_columns] = np.einsum("tb,ij->tibj", step, np.diag(weight)).reshape(
        len(step), ROOT, -1
    )
    return Rows((moved * weight).ravel(), slopes.reshape(-1, basis.size))


def level_rows(state: SwingState, basis: SplineBasis, options: PriorOptions) -> Rows:
    """The player's up points up in the picture: roll is small, pitch less so."""
    frames = len(state.phase)
    up = state.rotation[:, :, 1]
    weight = np.array([1 / options.roll, 1 / options.pitch]) / np.sqrt(frames)
    # d up = turn x up: its x and z parts.
    zero = np.zeros(frames)
    turned = np.stack(
        [np.stack([zero, up[:, 2], -up[:, 1]], 1), np.stack([up[:, 1], -up[:, 0], zero], 1)], 1
    )
    slopes = np.zeros((frames, 2, basis.size))
    by_root = np.concatenate([turned * weight[:, None], np.zeros((frames, 2, 3))], axis=2)
    slopes[..., basis.root_columns] = np.einsum("tb,tij->tibj", basis.root, by_root).reshape(
        frames, 2, -1
    )
    return Rows((up[:, [0, 2]] * weight).ravel(), slopes.reshape(-1, basis.size))


def _on_phase(basis: SplineBasis, rows: Float[np.ndarray, "n T"]) -> Float[np.ndarray, "n S"]:
    slopes = np.zeros((len(rows), basis.size))
    slopes[:, basis.phase_columns] = rows @ basis.phase
    return slopes


def stack_rows(parts: list[Rows]) -> Rows:
    """All rows in one."""
    return Rows(
        np.concatenate([p.values for p in parts]), np.concatenate([p.slopes for p in parts])
    )
