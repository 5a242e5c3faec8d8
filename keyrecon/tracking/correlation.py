"""Correlation filters over several channels: find again what was shown on examples.

A filter h turns the channels x of a picture into a response that should be a narrow peak y on the
part and zero elsewhere. Over N examples the ridge regression

    min_h  sum_n |sum_c h_c * x_nc - y_n|^2 + lambda sum_c |h_c|^2

falls apart into one small problem for each spatial frequency w (Bolme et al., CVPR 2010, for one
channel; Kiani Galoogahi, Sim and Lucey, ICCV 2013, for several):

    H(w) = (sum_n conj(X_n(w)) X_n(w)^T + lambda I)^-1 sum_n conj(X_n(w)) Y_n(w).

Everything around the part speaks too, as far as it tends to come with it: a shoe has a leg above.
"""

from dataclasses import dataclass

import numpy as np
import scipy.fft
from jaxtyping import Complex64, Float

RIDGE = 0.02
"""lambda, as a share of the mean power of a channel at a frequency."""


@dataclass(frozen=True, eq=False)
class Filters:
    """Filters of P parts over C channels, for pictures of one size."""

    transfer: Complex64[np.ndarray, "P C h f"]
    """H, for the spatial frequencies that a real picture has."""
    size: tuple[int, int]
    """Rows and columns of the pictures."""


def spectrum(channels: Float[np.ndarray, "*n h w"]) -> Complex64[np.ndarray, "*n h f"]:
    """The spatial frequencies of every channel."""
    return scipy.fft.rfft2(channels.astype(np.float32, copy=False))


def learn_filters(
    spectra: Complex64[np.ndarray, "N C h f"], targets: Float[np.ndarray, "N P h w"]
) -> Filters:
    """Filters that turn each example into its targets."""
    count, shape = len(spectra), spectra.shape[2:]
    seen, wanted = (_by_frequency(s) for s in (spectra, spectrum(targets)))
    mirrored = np.conj(seen.transpose(0, 2, 1))
    power, common = mirrored @ seen / count, mirrored @ wanted / count
    ridge = RIDGE * float(np.trace(power, axis1=1, axis2=2).real.mean()) / power.shape[1]
    power += np.float32(ridge) * np.eye(power.shape[1], dtype=np.float32)
    transfer = np.linalg.solve(power, common).transpose(2, 1, 0)
    return Filters(transfer.reshape(*transfer.shape[:2], *shape), targets.shape[2:])


def _by_frequency(spectra: Complex64[np.ndarray, "N C h f"]) -> Complex64[np.ndarray, "F N C"]:
    """One matrix of examples and channels for each frequency."""
    return spectra.reshape(*spectra.shape[:2], -1).transpose(2, 0, 1)


def respond(filters: Filters, seen: Complex64[np.ndarray, "C h f"]) -> Float[np.ndarray, "P h w"]:
    """The response of every filter to one picture."""
    found = np.stack([(seen * part).sum(axis=0) for part in filters.transfer])
    return scipy.fft.irfft2(found, filters.size)


def peaks_at(
    places: Float[np.ndarray, "k 2"], size: tuple[int, int], spread: float
) -> Float[np.ndarray, "h w"]:
    """A target: a Gaussian of height 1 at each place (x, y), none added up."""
    y, x = np.mgrid[: size[0], : size[1]]
    squares = [(x - px) ** 2 + (y - py) ** 2 for px, py in places]
    return np.exp(-np.min(squares, axis=0) / (2 * spread**2))
