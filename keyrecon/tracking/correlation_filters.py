"""Correlation filters over several channels, trained on frames in which a track is right.

A filter h turns the channels x of a picture into a response that should be a narrow peak y on the
part and zero elsewhere. Over N examples the ridge regression

    min_h  sum_n |sum_c h_c * x_nc - y_n|^2 + lambda sum_c |h_c|^2

falls apart into one small problem for each spatial frequency w (Bolme et al., CVPR 2010, for one
channel; Kiani Galoogahi, Sim and Lucey, ICCV 2013, for several):

    H(w) = (sum_n conj(X_n(w)) X_n(w)^T + lambda I)^-1 sum_n conj(X_n(w)) Y_n(w).

The surroundings of a part count as far as they tend to come with it: a shoe has a leg above and the
court beneath. A rough track takes a racket, a line or the other leg for a shoe now and then, so the
filters are trained on frames that show both feet clearly: apart, and as far below the head as those
of a standing player. Frames in which nothing was seen, where the track is bridged, teach nothing.
"""

from dataclasses import dataclass

import numpy as np
import scipy.fft
from jaxtyping import Bool, Complex64, Float, Int

from keyrecon.records import Track
from keyrecon.segmentation.player_crops import Channels, Cropping, Crops

RIDGE = 0.02
"""lambda, as a share of the mean power of a channel at a frequency. Halved, others with it: at most
0.4 points, 0.6 mm on one clip."""
STANDING_MIN, STANDING_MAX = 0.85, 1.15
"""A foot of a clear frame is this far below the head, player heights: a racket seldom is. Halved,
others with it: at most 0.4 points, 0.6 mm on one clip."""
MIN_FEET_DISTANCE = 0.09
"""Feet nearer to one another may be one foot taken twice, or one that hides the other, player
heights. Halved, others with it: at most 0.4 points, 0.6 mm on one clip."""
MIN_EXAMPLES = 12
"""Fewer clear frames are not enough to train on; then all in which the player was seen count.
Halved, others with it: at most 0.4 points, 0.6 mm on one clip."""
PEAK_SPREAD = 0.027
"""Standard deviation of the peak that a filter should respond with, player heights. Halved, others
with it: at most 0.4 points, 0.6 mm on one clip."""
MIN_RESPONSE = 1e-3
"""Filters that respond with less have no use and are not scaled up. Halved, others with it: at most
0.4 points, 0.6 mm on one clip."""


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


def solve_filters(
    spectra: Complex64[np.ndarray, "N C h f"], targets: Float[np.ndarray, "N P h w"]
) -> Filters:
    """Filters that turn each example into its targets."""
    count, shape = len(spectra), spectra.shape[2:]
    examples, wanted = (_by_frequency(s) for s in (spectra, spectrum(targets)))
    conjugate = np.conj(examples.transpose(0, 2, 1))
    power, cross_power = conjugate @ examples / count, conjugate @ wanted / count
    ridge = RIDGE * float(np.trace(power, axis1=1, axis2=2).real.mean()) / power.shape[1]
    power += np.float32(ridge) * np.eye(power.shape[1], dtype=np.float32)
    transfer = np.linalg.solve(power, cross_power).transpose(2, 1, 0)
    return Filters(transfer.reshape(*transfer.shape[:2], *shape), targets.shape[2:])


def _by_frequency(spectra: Complex64[np.ndarray, "N C h f"]) -> Complex64[np.ndarray, "F N C"]:
    """One matrix of examples and channels for each frequency."""
    return spectra.reshape(*spectra.shape[:2], -1).transpose(2, 0, 1)


def respond(
    filters: Filters, channels: Complex64[np.ndarray, "C h f"]
) -> Float[np.ndarray, "P h w"]:
    """The response of every filter to the spectrum of one picture."""
    response = np.stack([(channels * part).sum(axis=0) for part in filters.transfer])
    return scipy.fft.irfft2(response, filters.size)


def peaks_at(
    places: Float[np.ndarray, "k 2"], size: tuple[int, int], spread: float
) -> Float[np.ndarray, "h w"]:
    """A target: a Gaussian of height 1 at each place (x, y), none added up."""
    y, x = np.ogrid[: size[0], : size[1]]
    squares = [(x - px) ** 2 + (y - py) ** 2 for px, py in places]
    return np.exp(-np.min(squares, axis=0) / (2 * spread**2))


@dataclass(frozen=True, eq=False)
class Examples:
    """What filters are trained on: crops, and where head and feet are in them."""

    spectra: Complex64[np.ndarray, "N C h f"]
    places: Float[np.ndarray, "N 3 2"]
    """Head and both feet, px of the crop."""

    def some(self, rows: Int[np.ndarray, "n"]) -> "Examples":
        """Those of some rows."""
        return Examples(self.spectra[rows], self.places[rows])

    def joined(self, other: "Examples") -> "Examples":
        """These and others."""
        return Examples(
            np.concatenate([self.spectra, other.spectra]),
            np.concatenate([self.places, other.places]),
        )


def make_examples(
    crops: Crops,
    channels: Channels,
    cropping: Cropping,
    frames: Int[np.ndarray, "n"],
    parts: Float[np.ndarray, "n 3 2"],
) -> Examples:
    """Examples from some frames with head and feet in the picture, px."""
    numbers = frames.tolist()
    features = [channels.compute(crops.lab[t], crops.foreground[t]) for t in numbers]
    places = [cropping.from_picture(p, t) for p, t in zip(parts, numbers, strict=True)]
    return Examples(np.stack([spectrum(f) for f in features]), np.stack(places))


def train_filters(examples: Examples, size: tuple[int, int], player: float) -> Filters:
    """Filters of head and foot whose usual response is 1.

    The player is `player` px tall in the crops, which have `size` rows and columns.
    """
    spectra, places, spread = examples.spectra, examples.places, PEAK_SPREAD * player
    targets = [[peaks_at(p, size, spread) for p in (parts[:1], parts[1:])] for parts in places]
    filters = solve_filters(spectra, np.stack([np.stack(t) for t in targets]))
    usual = np.median([_strength(filters, *e) for e in zip(spectra, places, strict=True)], axis=0)
    usual = np.maximum(usual, MIN_RESPONSE).astype(np.float32)[:, None, None, None]
    return Filters(filters.transfer / usual, size)


def _strength(
    filters: Filters, channels: Complex64[np.ndarray, "C h f"], places: Float[np.ndarray, "3 2"]
) -> tuple[float, float]:
    """Response of each filter at its part."""
    response = respond(filters, channels)
    row, column = np.rint(places[:, ::-1]).astype(int).clip(0, np.array(filters.size) - 1).T
    return float(response[0, row[0], column[0]]), float(response[1, row[1:], column[1:]].max())


def clear_frames(track: Track) -> Int[np.ndarray, "n"]:
    """Frames in which a track has two feet, and both where a standing player has them."""
    below = (track.feet[..., 1] - track.head[:, None, 1]) / track.height[:, None]
    upright = ((below > STANDING_MIN) & (below < STANDING_MAX)).all(axis=1)
    return _enough(upright & _apart(track), track)


def sound_frames(track: Track) -> Int[np.ndarray, "n"]:
    """Frames in which a track has two feet."""
    return _enough(_apart(track), track)


def _apart(track: Track) -> Bool[np.ndarray, "T"]:
    """Where one foot does not stand for both."""
    apart = np.linalg.norm(track.feet[:, 0] - track.feet[:, 1], axis=1)
    return apart > MIN_FEET_DISTANCE * track.height


def _enough(good: Bool[np.ndarray, "T"], track: Track) -> Int[np.ndarray, "m"]:
    """The good frames in which the player was seen; where these are too few all seen ones, or all.

    Where nothing was seen the track lies between what was, and would teach whatever is there.
    """
    seen = track.confidence > 0
    for frames in (good & seen, seen):
        if frames.sum() >= MIN_EXAMPLES:
            return np.flatnonzero(frames)
    return np.arange(len(seen))
