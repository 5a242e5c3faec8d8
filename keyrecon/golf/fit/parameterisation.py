"""The unknowns of a fit as one vector, and how much of each every frame sees.

S = [alpha, mu, G] of Eq. 5. Over a few frames mu and G have a value per frame, as printed; over a
whole swing they are what B-splines add to the current estimate, which keeps their number
independent of the frame rate. `SplineBasis` holds the two bases; with identities it is the paper's
form.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.interpolate import BSpline
from scipy.spatial.transform import Rotation

from keyrecon.golf.records import SwingState

ROOT = 6
"""Unknowns of G: turn about the three camera axes, then shift."""


@dataclass(frozen=True, eq=False)
class SplineBasis:
    """How corrections of mu and G spread over the frames."""

    alphas: int
    mu: Float[np.ndarray, "T A"]
    root: Float[np.ndarray, "T B"]

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.alphas + self.mu.shape[1] + ROOT * self.root.shape[1]

    def split(
        self, step: Float[np.ndarray, "S"]
    ) -> tuple[Float[np.ndarray, "m"], Float[np.ndarray, "T"], Float[np.ndarray, "T 6"]]:
        """Corrections of alpha, of mu and of G in every frame."""
        by_root = step[self.alphas + self.mu.shape[1] :].reshape(-1, ROOT)
        by_mu = step[self.alphas : self.alphas + self.mu.shape[1]]
        return step[: self.alphas], self.mu @ by_mu, self.root @ by_root

    def frame_unknowns(self, frame: int) -> Float[np.ndarray, "L S"]:
        """What alpha, mu and G of one frame are made of; L = alphas + 1 + 6."""
        rows = np.zeros((self.alphas + 1 + ROOT, self.size))
        rows[: self.alphas, : self.alphas] = np.eye(self.alphas)
        first = self.alphas + self.mu.shape[1]
        rows[self.alphas, self.alphas : first] = self.mu[frame]
        rows[self.alphas + 1 :, first:] = np.kron(self.root[frame], np.eye(ROOT))
        return rows


def window_basis(alphas: int, frames: int) -> SplineBasis:
    """A value per frame, as in the paper's windows."""
    return SplineBasis(alphas, np.eye(frames), np.eye(frames))


def constant_basis(alphas: int, frames: int) -> SplineBasis:
    """Normalised times as they are, and one place of the player for all frames."""
    return SplineBasis(alphas, np.zeros((frames, 0)), np.ones((frames, 1)))


def swing_basis(alphas: int, frames: int, spacing: tuple[float, float]) -> SplineBasis:
    """Splines over a whole swing; `spacing` is frames between knots of mu and of G."""
    return SplineBasis(alphas, *(_splines(frames, s) for s in spacing))


def _splines(frames: int, spacing: float) -> Float[np.ndarray, "T B"]:
    """Cubic B-splines with evenly spaced knots; a value per frame where frames are few."""
    pieces = max(1, round((frames - 1) / spacing))
    if pieces + 3 >= frames:
        return np.eye(frames)
    knots = np.concatenate(
        [np.zeros(3), np.linspace(0, frames - 1, pieces + 1), np.full(3, frames - 1)]
    )
    return BSpline.design_matrix(np.arange(frames, dtype=float), knots, 3).toarray()


def move_state(state: SwingState, span: SplineBasis, step: Float[np.ndarray, "S"]) -> SwingState:
    """The state after a step; G turns about the origin of the swing axes."""
    by_alpha, by_mu, by_root = span.split(step)
    alpha = state.alpha.copy()
    alpha[: span.alphas] += by_alpha
    turn = Rotation.from_rotvec(by_root[:, :3]).as_matrix()
    return replace(
        state, alpha=alpha, mu=state.mu + by_mu, rotation=turn @ state.rotation,
        position=state.position + by_root[:, 3:],
    )  # fmt: skip
