"""Learn what a player's head and feet look like from a track that is right most of the time.

A racket, a line or the other leg passes for a shoe now and then. So frames are chosen first that
show both feet clearly: apart, and as far below the head as those of a standing player. Correlation
filters learnt from them look for everything that comes with a foot: shoe, leg above, court beneath.
"""

import numpy as np
from jaxtyping import Bool, Complex64, Float, Int

from keyrecon.records import Track
from keyrecon.tracking.correlation import Filters, learn_filters, peaks_at, respond, spectrum
from keyrecon.tracking.crops import Channels, Cropping, Crops

UPRIGHT = 0.85, 1.15
"""A foot of a clear frame is this far below the head, player heights: a racket seldom is."""
TWO_FEET = 0.09
"""Feet nearer to one another may be one foot taken twice, or one that hides the other, player
heights."""
FEWEST = 12
"""Fewer clear frames teach nothing; then all count."""
SPREAD = 0.027
"""Width of the peak that a filter should respond with, player heights."""
LEAST_RESPONSE = 1e-3
"""Filters that respond with less have learnt nothing and are not scaled up."""


def learn_parts(
    crops: Crops,
    channels: Channels,
    cropping: Cropping,
    track: Track,
    chosen: Int[np.ndarray, "n"],
) -> Filters:
    """Filters of head and foot whose usual response is 1, from chosen frames of a track."""
    frames = chosen.tolist()
    seen = [channels.see(crops.lab[t], crops.foreground[t]) for t in frames]
    spectra = np.stack([spectrum(s) for s in seen])
    parts = np.concatenate([track.head[:, None], track.feet], axis=1)
    places = np.stack([cropping.from_picture(parts[t], t) for t in frames])
    size, spread = cropping.size, SPREAD * cropping.player
    targets = [[peaks_at(p, size, spread) for p in (own[:1], own[1:])] for own in places]
    filters = learn_filters(spectra, np.stack([np.stack(t) for t in targets]))
    usual = np.median([_strength(filters, *e) for e in zip(spectra, places, strict=True)], axis=0)
    usual = np.maximum(usual, LEAST_RESPONSE).astype(np.float32)[:, None, None, None]
    return Filters(filters.transfer / usual, size)


def _strength(
    filters: Filters, seen: Complex64[np.ndarray, "C h f"], places: Float[np.ndarray, "3 2"]
) -> tuple[float, float]:
    """Response of each filter at its part."""
    response = respond(filters, seen)
    row, column = np.rint(places[:, ::-1]).astype(int).clip(0, np.array(filters.size) - 1).T
    return float(response[0, row[0], column[0]]), float(response[1, row[1:], column[1:]].max())


def clear_frames(track: Track) -> Int[np.ndarray, "n"]:
    """Frames in which a track has two feet, and both where a standing player has them."""
    below = (track.feet[..., 1] - track.head[:, None, 1]) / track.height[:, None]
    upright = ((below > UPRIGHT[0]) & (below < UPRIGHT[1])).all(axis=1)
    return _enough(np.flatnonzero(upright & _apart(track)), len(below))


def sound_frames(track: Track) -> Int[np.ndarray, "n"]:
    """Frames in which a track has two feet."""
    return _enough(np.flatnonzero(_apart(track)), len(track.head))


def _apart(track: Track) -> Bool[np.ndarray, "T"]:
    """Where one foot does not stand for both."""
    return np.linalg.norm(track.feet[:, 0] - track.feet[:, 1], axis=1) > TWO_FEET * track.height


def _enough(frames: Int[np.ndarray, "n"], count: int) -> Int[np.ndarray, "m"]:
    """The frames, or all where these are too few."""
    return frames if len(frames) >= FEWEST else np.arange(count)
