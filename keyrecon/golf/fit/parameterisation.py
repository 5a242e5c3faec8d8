"""The unknowns of a fit as one vector, and what each frame depends on.

S = [coefficients, phase, G] (CVPR 2005, Eq. 3). Over a few frames phase and root pose G have a
value per frame, as printed; over a whole swing they are what B-splines add to the current
estimate, which keeps their number independent of the frame rate. `SplineBasis` holds the two
bases; with identities it is the paper's form.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float
from scipy.interpolate import BSpline
from scipy.spatial.transform import Rotation

from keyrecon.golf.records import SwingState

ROOT = 6
"""Unknowns of G: turn about the three camera axes, then shift."""


@dataclass(frozen=True, eq=False)
class SplineBasis:
    """How corrections of phase and G spread over the frames."""

    n_coefficients: int
    """How many of the coefficients are unknowns."""
    phase: Float[np.ndarray, "T A"]
    root: Float[np.ndarray, "T B"]

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.n_coefficients + self.phase.shape[1] + ROOT * self.root.shape[1]

    @property
    def phase_columns(self) -> slice:
        """Where the unknowns of the phase stand."""
        return slice(self.n_coefficients, self.n_coefficients + self.phase.shape[1])

    @property
    def root_columns(self) -> slice:
        """Where the unknowns of G stand."""
        return slice(self.n_coefficients + self.phase.shape[1], self.size)

    @cached_property
    def _local(self) -> Float[np.ndarray, "T 7 Z"]:
        """What phase and G of every frame are made of, the coefficients left out."""
        frames, phases = self.phase.shape
        rows = np.zeros((frames, 1 + ROOT, self.size - self.n_coefficients))
        rows[:, 0, :phases] = self.phase
        rows[:, 1:, phases:] = np.einsum("tb,ij->tibj", self.root, np.eye(ROOT)).reshape(
            frames, ROOT, -1
        )
        return rows

    def gather(
        self, normal: Float[np.ndarray, "T L L"], slope: Float[np.ndarray, "T L"]
    ) -> tuple[Float[np.ndarray, "S S"], Float[np.ndarray, "S"]]:
        """Normal equations of frames, by coefficients, phase and G, as those of the unknowns.

        L = m + 1 + 6.
        """
        number, spread = self.n_coefficients, self._local
        flat = spread.reshape(-1, spread.shape[2])
        common = normal[:, number:, :number].reshape(len(flat), number)
        matrix = np.empty((self.size, self.size))
        matrix[:number, :number] = normal[:, :number, :number].sum(axis=0)
        matrix[number:, :number] = flat.T @ common
        matrix[:number, number:] = matrix[number:, :number].T
        local = normal[:, number:, number:] @ spread
        matrix[number:, number:] = flat.T @ local.reshape(flat.shape)
        gradient = [slope[:, :number].sum(axis=0), flat.T @ slope[:, number:].ravel()]
        return matrix, np.concatenate(gradient)


@dataclass(frozen=True)
class KnotSpacing:
    """Frames between knots of splines."""

    phase: float
    root: float


def window_basis(n_coefficients: int, frames: int) -> SplineBasis:
    """A value per frame, as in the paper's windows."""
    return SplineBasis(n_coefficients, np.eye(frames), np.eye(frames))


def constant_basis(n_coefficients: int, frames: int) -> SplineBasis:
    """Normalised times as they are, and one place of the player for all frames."""
    return SplineBasis(n_coefficients, np.zeros((frames, 0)), np.ones((frames, 1)))


def swing_basis(n_coefficients: int, frames: int, spacing: KnotSpacing) -> SplineBasis:
    """Splines over a whole swing."""
    return SplineBasis(
        n_coefficients, spline_matrix(frames, spacing.phase), spline_matrix(frames, spacing.root)
    )


def spline_matrix(frames: int, spacing: float) -> Float[np.ndarray, "T B"]:
    """Cubic B-splines with evenly spaced knots; a value per frame where frames are few."""
    pieces = max(1, round((frames - 1) / spacing))
    if pieces + 3 >= frames:
        return np.eye(frames)
    knots = np.concatenate(
        [np.zeros(3), np.linspace(0, frames - 1, pieces + 1), np.full(3, frames - 1)]
    )
    return BSpline.design_matrix(np.arange(frames, dtype=float), knots, 3).toarray()


def move_state(state: SwingState, basis: SplineBasis, step: Float[np.ndarray, "S"]) -> SwingState:
    """The state after a step; G turns about the origin of the swing axes."""
    by_root = basis.root @ step[basis.root_columns].reshape(-1, ROOT)
    coefficients = state.coefficients.copy()
    coefficients[: basis.n_coefficients] += step[: basis.n_coefficients]
    turn = Rotation.from_rotvec(by_root[:, :3]).as_matrix()
    return replace(
        state,
        coefficients=coefficients,
        phase=state.phase + basis.phase @ step[basis.phase_columns],
        rotation=turn @ state.rotation,
        position=state.position + by_root[:, 3:],
    )
