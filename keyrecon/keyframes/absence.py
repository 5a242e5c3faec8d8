"""Stretches without the player: nothing to annotate, and nothing that keyframes should stand for.

A frame or two in which the player was not detected are bridged like any other gap (Eq. 1). A
stretch longer than that, in which the player has left the picture or is hidden, is taken out before
keyframes are chosen, as if the video had been cut there, and put back afterwards. So is a shot that
does not show the player at all, however short. Where the picture ends above the knees the same
goes for the lower body.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Int
from scipy.ndimage import binary_opening

from keyrecon.records import HalfKeyframes, PoseDistances, Track
from keyrecon.timeline import frames_before

MOST_STRETCHES = 8
"""Stretches that are listed one by one."""


KNEES = 0.68
"""Where a standing player has the knees, share of the way from the head's centre to the feet: .285
statures up (Drillis and Contini), and a little higher where they are bent."""


def legs_outside(track: Track, rows: int) -> Bool[np.ndarray, "T"]:
    """Frames of `rows` rows that end above the knees: there is no leg to annotate."""
    knees = track.head[:, 1] + KNEES * (track.mid_feet - track.head)[:, 1]
    # feet that were found are in the picture; those that it cuts off were put below it
    return (track.mid_feet[:, 1] >= rows) & (knees >= rows)


def without_legs(comparison: PoseDistances, outside: Bool[np.ndarray, "T"]) -> PoseDistances:
    """The same with nothing seen of the lower body in frames in which it is out of the picture."""
    seen = comparison.seen.copy()
    seen[1, outside] = np.nan
    return replace(comparison, seen=seen)


def absent_frames(comparison: PoseDistances, reach: int) -> Bool[np.ndarray, "T"]:
    """Frames of stretches longer than `reach`, and of shots, in which nothing can be annotated."""
    visible, shot = comparison.visibility_score > 0, shot_numbers(comparison)
    if not visible.any():
        return np.zeros(len(visible), dtype=bool)
    never = np.bincount(shot, visible) == 0
    return never[shot] | binary_opening(~visible, np.ones(reach + 1))


def shown_frames(
    comparison: PoseDistances, kept: Int[np.ndarray, "n"], half: int
) -> Int[np.ndarray, "m"]:
    """Those of the kept frames that show a half of the body, the upper one 0; all if none does."""
    shown = kept[np.isfinite(comparison.seen[half, kept])]
    return shown if len(shown) else kept


def shot_numbers(comparison: PoseDistances) -> Int[np.ndarray, "T"]:
    """The shot of each frame, counted from 0; frames that were taken out begin another as well."""
    cut = np.isnan(comparison.consecutive_distance).any(axis=0)
    return np.append(0, np.cumsum(cut))[: len(comparison.row)]


def format_stretches(stretches: Sequence[tuple[int, int]]) -> str:
    """The first stretches as text, such as "3-9, 20-31 and 2 more"."""
    listed = ", ".join(f"{first}-{last}" for first, last in stretches[:MOST_STRETCHES])
    more = len(stretches) - MOST_STRETCHES
    return f"{listed} and {more} more" if more > 0 else listed


def select_frames(comparison: PoseDistances, kept: Int[np.ndarray, "n"]) -> PoseDistances:
    """The distances of some of the frames, numbered anew; at least one of them is kept.

    An exemplar that is not kept is replaced by the frame most like it of those it stands for.
    """
    if len(kept) == len(comparison.row):
        return comparison
    rows, row = np.unique(comparison.row[kept], return_inverse=True)
    exemplar_distance = comparison.exemplar_distance[:, kept]
    order = np.lexsort(
        (exemplar_distance.sum(axis=0), kept != comparison.frames[comparison.row[kept]], row)
    )
    first = order[np.unique(row[order], return_index=True)[1]]
    square = np.ix_(rows, rows)
    follows = np.diff(kept) == 1
    steps = comparison.consecutive_distance[:, kept[:-1]]
    return PoseDistances(
        upper=comparison.upper[square],
        lower=comparison.lower[square],
        frames=first,
        row=row,
        exemplar_distance=exemplar_distance,
        consecutive_distance=np.where(follows, steps, steps.dtype.type(np.nan)),
        visibility_score=comparison.visibility_score[kept],
        seen=comparison.seen[:, kept],
    )


def restore_frames(half: HalfKeyframes, kept: Int[np.ndarray, "n"], frames: int) -> HalfKeyframes:
    """Keyframes of the kept frames as keyframes of all `frames`; the others stay unrepresented.

    They are given the keyframe of the last frame before them, for want of a better one, at an
    infinite distance: it does not stand for them.
    """
    distance = np.full(frames, np.inf)
    distance[kept] = half.distance
    before = frames_before(kept, frames)
    represented = np.zeros(frames, dtype=bool)
    represented[kept] = half.represented
    gains = half.gains and replace(half.gains, order=kept[half.gains.order])
    return replace(
        half,
        frames=kept[half.frames],
        gains=gains,
        nearest=kept[half.nearest][before],
        represented=represented,
        distance=distance,
    )
