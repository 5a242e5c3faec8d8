"""What a person marks in a swing, and how it is held.

A mark is worth more than anything observed: the search passes the marked key postures, the club of
a marked frame is the marked one, tracks of joints run through the marks, and the fit is drawn to
them (`fit.fitting`); those between the frames that are fitted go along with the fit to the nearest
one. What limbs of fixed length leave between the fit and a mark, `hold_joints` and `hold_club`
close at last, fading over the frames around, so that what was marked is where it was marked.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int
from scipy.linalg import solve

from keyrecon.golf.observe.film import Film
from keyrecon.golf.observe.shaft_hypotheses import ShaftHypotheses
from keyrecon.golf.records import FittedSwing, Observations, SwingMarks
from keyrecon.numerics.geometry import signed_angles, warp_points
from keyrecon.records import SOURCES

SHAFT_SPREAD = 3.0
"""Standard deviation of a marked end of the shaft, px: as that of a marked joint."""
SURE_WEIGHT = 2.0
"""Weight of a marked shaft among those detected, player heights: more than any club is long."""
FADING = 0.15
"""Seconds over which a mark's correction fades: half a downswing."""
ANOTHER_CLUB = np.radians(15)
"""A fitted club turned so far from a marked or detected one is another one."""
CONFIRMED, CONFIRMED_DOUBT = np.radians(5), 0.1
"""A fitted club within so much of the detected one is right there, whatever a mark turns it by a
few frames away; the variance of that, as a share of what marks turn clubs by."""
SAME_MOMENT = 1e-6
"""Keeps marks in neighbouring frames apart in the equations."""


def place_marks(marks: SwingMarks, film: Film) -> SwingMarks:
    """Marks of a file's frames in the picture and by the frame numbers of a film.

    What lies outside of these frames stays away; of two marked frames that are one there, the
    later one counts. A mark between frames is one of the nearest for now (`carry_marks`).
    """
    first, last = film.file_range
    inside = (marks.frames >= first) & (marks.frames <= last)
    frames = marks.frames[inside]
    pictures = np.rint(film.film_index[frames]).astype(int)
    _, latest = np.unique(pictures[::-1], return_index=True)
    rows = len(pictures) - 1 - latest
    warps = film.warps[frames[rows]][:, None]
    keys = np.clip(np.nan_to_num(marks.keys), 0, len(film.film_index) - 1)
    places = np.interp(keys, np.arange(len(film.film_index)), film.film_index)
    return SwingMarks(
        pictures[rows], warp_points(warps, marks.joints[inside][rows]),
        warp_points(warps, marks.shafts[inside][rows]),
        np.where(np.isfinite(marks.keys), places, np.nan),
        film.film_index[frames[rows]] - pictures[rows],
    )  # fmt: skip


def carry_marks(marks: SwingMarks, fitted: FittedSwing) -> SwingMarks:
    """Marks between frames where they would be in the nearest one, as fast as a fit moves there.

    A hand moves by 0.1 m from frame to frame, a shaft turns by 20 degrees or more.
    """
    if marks.late is None:
        return marks
    between = marks.frames + marks.late

    def moved(points: Float[np.ndarray, "T n 2"]) -> Float[np.ndarray, "K n 2"]:
        low = np.clip(between.astype(int), 0, max(len(points) - 2, 0))
        high, share = np.minimum(low + 1, len(points) - 1), (between - low)[:, None, None]
        there: Float[np.ndarray, "K n 2"] = (1 - share) * points[low] + share * points[high]
        return points[marks.frames] - there

    return replace(
        marks, joints=marks.joints + moved(fitted.motion.points2d),
        shafts=marks.shafts + moved(fitted.club2d), late=None,
    )  # fmt: skip


def join_marks(first: SwingMarks, second: SwingMarks) -> SwingMarks:
    """All that either tells; where both tell, the first counts."""
    frames = np.union1d(first.frames, second.frames)
    joints, shafts = np.full((len(frames), 14, 2), np.nan), np.full((len(frames), 2, 2), np.nan)
    for marks in (second, first):
        rows = np.searchsorted(frames, marks.frames)
        for held, marked in ((joints, marks.joints), (shafts, marks.shafts)):
            held[rows] = np.where(np.isfinite(marked), marked, held[rows])
    keys = np.where(np.isfinite(first.keys), first.keys, second.keys)
    return SwingMarks(frames, joints, shafts, keys)


def hold_keys(keys: Float[np.ndarray, "4"], marks: SwingMarks) -> Float[np.ndarray, "4"]:
    """Key postures of which the marked ones are where they were marked, the others in order."""
    marked = np.isfinite(marks.keys)
    held = np.where(marked, marks.keys, keys)
    for k in np.flatnonzero(~marked).tolist():
        before, after = np.flatnonzero(marked[:k]), np.flatnonzero(marked[k:])
        low = held[before[-1]] + k - before[-1] if len(before) else -np.inf
        high = held[k + after[0]] - after[0] if len(after) else np.inf
        held[k] = np.clip(held[k], low, high)
    return held


def hold_shafts(shafts: list[ShaftHypotheses], marks: SwingMarks) -> list[ShaftHypotheses]:
    """What may be the club: in a frame with a marked shaft nothing else."""
    held = list(shafts)
    for t, ends in zip(marks.frames.tolist(), marks.shafts, strict=True):
        if np.isfinite(ends).all():
            held[t] = ShaftHypotheses(ends[None], np.array([SURE_WEIGHT]), np.array([True]))
    return held


def unrefuted_shafts(
    earlier: FittedSwing, observations: Observations, marks: SwingMarks
) -> SwingMarks:
    """The club that was detected for an earlier fit without the marks, as shafts that may be true.

    A person marks where a fit is wrong, and leaves what is right; detections near in time to a
    marked shaft that the fit missed may be wrong as it is, and stay away. All in the file's frames.
    """
    club, time = observations.club, earlier.motion.time
    rows = np.flatnonzero(np.isfinite(marks.shafts).all(axis=(1, 2)))
    turns = _turns(earlier.club2d[marks.frames[rows]], marks.shafts[rows])
    missed = time[marks.frames[rows[np.abs(turns) > ANOTHER_CLUB]]]
    near = (np.abs(time[:, None] - missed) < FADING).any(axis=1)
    frames = np.flatnonzero(np.isfinite(club).all(axis=(1, 2)) & ~near)
    unknown = SwingMarks.of_joints(frames, np.full((len(frames), 14, 2), np.nan))
    return replace(unknown, shafts=club[frames])


def add_shafts(
    shafts: list[ShaftHypotheses], earlier: SwingMarks, height: float
) -> list[ShaftHypotheses]:
    """What may be the club, and besides it `earlier` detections, which weigh what they are long."""
    added = list(shafts)
    for t, ends in zip(earlier.frames.tolist(), earlier.shafts, strict=True):
        weight = float(np.linalg.norm(ends[1] - ends[0])) / height
        now = shafts[t]
        added[t] = ShaftHypotheses(
            np.concatenate([now.ends, ends[None]]), np.append(now.weight, weight),
            np.append(now.tip, False),
        )  # fmt: skip
    return added


def hold_observations(observations: Observations) -> Observations:
    """The observations with the club and the key postures where they were marked."""
    marks = observations.marks
    rows = np.flatnonzero(np.isfinite(marks.shafts).all(axis=(1, 2)))
    frames = marks.frames[rows]
    club, spread, along = (
        part.copy()
        for part in (observations.club, observations.club_spread, observations.club_along)
    )
    club[frames], spread[frames], along[frames] = marks.shafts[rows], SHAFT_SPREAD, SHAFT_SPREAD
    return replace(
        observations, club=club, club_spread=spread, club_along=along,
        keys=hold_keys(observations.keys, marks),
    )  # fmt: skip


def correct_tracks(
    joints: Float[np.ndarray, "T 14 2"], marks: SwingMarks, clicked: int | None
) -> Float[np.ndarray, "T 14 2"]:
    """Tracks through the marks: a tracker drifts evenly from the click to a mark, and on from it.

    A mark in the `clicked` frame says that the click was beside the joint; None stands for one
    outside of these frames, where it tells nothing of them. Where a track was given up before a
    mark, it stays as it was.
    """
    held, every = joints.copy(), np.arange(len(joints))
    for j in range(joints.shape[1]):
        drift = marks.joints[:, j] - joints[marks.frames, j]
        known = np.isfinite(drift).all(axis=1)
        frames, off = marks.frames[known], drift[known]
        if clicked is not None and clicked not in frames:
            frames, off = np.append(frames, clicked), np.append(off, np.zeros((1, 2)), axis=0)
        if len(frames):
            order = np.argsort(frames)
            drifts = [np.interp(every, frames[order], c) for c in off[order].T]
            held[:, j] += np.stack(drifts, axis=1)
    return held


def hold_joints(fitted: FittedSwing, marks: SwingMarks, focal: float) -> FittedSwing:
    """The swing with its marked joints where they were marked, in the file's frames and px.

    A joint moves across its line of sight, around the marks as a random function of time that is
    once differentiable (a Gaussian process; Matern 3/2) most probably would.
    """
    if not len(marks.frames):
        return fitted
    motion = fitted.motion
    flat, space = motion.points2d.copy(), motion.points3d.copy()
    confidence, source = motion.confidence.copy(), motion.source.copy()
    for j in range(flat.shape[1]):
        rows = np.flatnonzero(np.isfinite(marks.joints[:, j]).all(axis=1))
        if not len(rows):
            continue
        frames = marks.frames[rows]
        off = marks.joints[rows, j] - motion.points2d[frames, j]
        moved = _spread_in_time(off, frames, motion.time)
        flat[:, j] += moved
        space[:, j, :2] += moved * space[:, j, 2:] / focal
        confidence[frames, j], source[frames, j] = 1.0, SOURCES.index("annotated")
    held = replace(
        motion, points2d=flat, points3d=space, confidence=confidence, source=source,
        keyframes=np.union1d(motion.keyframes, marks.frames),
    )  # fmt: skip
    return replace(fitted, motion=held)


def hold_club(
    fitted: FittedSwing, marks: SwingMarks, detected: Float[np.ndarray, "T 2 2"], focal: float
) -> FittedSwing:
    """The swing with its club where it was marked, in the file's frames and px.

    As joints do, the hands shift; the shaft turns and stretches about them, since what is off aside
    in one frame of a fast club would be off along it a few frames later. Where the club was
    `detected` as it was fitted, it hardly turns.
    """
    rows = np.flatnonzero(np.isfinite(marks.shafts).all(axis=(1, 2)))
    if not len(rows):
        return fitted
    ends, frames = fitted.club2d, marks.frames[rows]
    way, marked, time = ends[:, 1] - ends[:, 0], marks.shafts[rows], fitted.motion.time
    length, angle = np.linalg.norm(way, axis=1), np.arctan2(way[:, 1], way[:, 0])
    aim = np.linalg.norm(marked[:, 1] - marked[:, 0], axis=1)
    off = np.column_stack([marked[:, 0] - ends[frames, 0], aim - length[frames]])
    moved = _spread_in_time(off, frames, time)
    confirmed = np.setdiff1d(np.flatnonzero(np.abs(_turns(ends, detected)) < CONFIRMED), frames)
    turn = np.concatenate([_turns(ends[frames], marked), np.zeros(len(confirmed))])
    doubt = np.repeat([SAME_MOMENT, CONFIRMED_DOUBT], [len(frames), len(confirmed)])
    turned = _spread_in_time(turn[:, None], np.concatenate([frames, confirmed]), time, doubt)
    length, angle = np.maximum(length + moved[:, 2], 0.0), angle + turned[:, 0]
    hands = ends[:, 0] + moved[:, :2]
    head = hands + length[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    held, space = np.stack([hands, head], axis=1), fitted.club.copy()
    space[..., :2] += (held - ends) * space[..., 2:] / focal
    return replace(fitted, club=space, club2d=held)


def _turns(
    first: Float[np.ndarray, "n 2 2"], second: Float[np.ndarray, "n 2 2"]
) -> Float[np.ndarray, "n"]:
    """By how much shafts are turned from one to the other, rad."""
    return signed_angles(first[:, 1] - first[:, 0], second[:, 1] - second[:, 0])


def _spread_in_time(
    off: Float[np.ndarray, "n d"],
    frames: Int[np.ndarray, "n"],
    time: Float[np.ndarray, "T"],
    doubt: Float[np.ndarray, "n"] | float = SAME_MOMENT,
) -> Float[np.ndarray, "T d"]:
    """Offsets at some frames in all frames; `doubt` is their variance, as a share of offsets'."""

    def alike(one: np.ndarray, other: np.ndarray) -> np.ndarray:
        apart = np.sqrt(3) * np.abs(one[:, None] - other) / FADING
        return (1 + apart) * np.exp(-apart)

    at = time[frames]
    weights = solve(alike(at, at) + doubt * np.eye(len(at)), off, assume_a="pos")
    spread: Float[np.ndarray, "T d"] = alike(time, at) @ weights
    return spread
