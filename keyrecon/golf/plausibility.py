"""Whether a fitted swing explains its video: what a person would see at once, as numbers.

A fit always gives a swing, also where it took a fence rail for the club or a waggle for the
upswing; its joints and angles look like any other's. So what is known of every swing is held
against the result: the order and pace of its key postures, the figure it should lie on, the club
where it was detected, the joints that a person placed.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from keyrecon.body import LSP14
from keyrecon.golf.fit.residuals import (
    SightLines,
    find_closest_points,
    place_capsules,
    sample_distance,
    sight_directions,
)
from keyrecon.golf.fit.swing_path import DOWNSWING_SECONDS, TEMPO
from keyrecon.golf.marks import ANOTHER_CLUB, carry_marks
from keyrecon.golf.observe.film import Film
from keyrecon.golf.observe.motion_timing import UNKNOWN_SHIFT, TimeShift
from keyrecon.golf.observe.swing_timing import LEAST_DETECTED
from keyrecon.golf.records import FittedSwing, Observations
from keyrecon.numerics.geometry import signed_angles

ON_FIGURE = 0.03
"""A joint this near to the player's mask lies on it, body heights: half a wrist's width."""
LEAST_ON_FIGURE = 0.88
"""Share of the joints of the swing that lie on the figure, at least: .96 to .97 in right fits of
three real swings, where masks lose a hand or a foot, .79 in a wrong one."""
HANDS_OFF_SECONDS = 0.1
"""Both hands lie off the figure for no longer: a mask loses blurred hands for a frame or two. In
right fits of five real swings they never do, by not a single frame."""
BESIDE = 0.04
"""A part of the player's figure so far from the fitted body does not belong to it, body heights: an
upper arm's breadth, more than clothes stand off."""
MOST_BESIDE = 0.04
"""Share of the figure beside the fitted body, from the start to the finish, at most: 0 to .026 in
40 right fits (five real swings, also before a shaking camera, with people drawn beside the player,
at half the size or rate, in bad light, with other clicks), .022 to .33, mostly above .05, in these
fits made wrong (turned by 30 degrees, shifted by .05 body heights, the mean swing)."""
TRACK_SPREAD, FARTHEST_TRACKED = 0.05, 0.06
"""A joint that was tracked to so many body heights is known there; of ten such joints no more than
one is farther from the fit than this: .012 to .037 in those right fits, .06 to .22 in all those
made wrong but where time alone was shifted."""
LEAST_CLUB_AGREED = 0.8
"""Share of the first detections between start and hit that the fitted club agrees with, at least:
.95 to 1 in right fits of five real swings."""
FARTHEST_CLICK = 0.1
"""Mean distance of fitted joints from those that a person placed, body heights, at most."""
FARTHEST_MARK = 0.1
"""Distance of a marked joint from the fit that was drawn to it, body heights, at most: beyond it
the mark is of another posture, or the fit of another swing."""
LEAST_SHAFT = 0.1
"""A club that seems shorter points at the camera: its angle tells nothing. Body heights."""
MOST_SHIFT, LEAST_AGREEMENT = 0.15, 0.15
"""Share of the downswing by which it may be off from what moves in the pictures, and how well it
agrees with that after the shift, as a correlation, at least. Right fits of five real swings are off
by 0 to .05 and agree by .38 to .65, at a third of the light with noise .32 and more; seven rendered
swings with their true joints by none, and .49 to .66. With the same downswings early or late by .3
of their length shifts of .21 to .37 were told, and a fit of no swing agreed by .01."""
EDGE = 1.0
"""Frames from either end of the film within which a key posture was not found but cut off."""

SHORTEST_FINISH = 1.0
"""Downswings from the hit to the finish, at least: 1.6 to 3.7 in right fits of ten real swings. In
a rendered film that ended in the follow-through .1 to .7 were found."""


@dataclass(frozen=True)
class SwingDoubt:
    """Something that a right fit does not show."""

    text: str
    """A clause: what was found and what is usual."""
    frame: int
    """Where to look, and to mark."""


def find_doubts(
    fitted: FittedSwing, observations: Observations, shift: TimeShift = UNKNOWN_SHIFT
) -> list[SwingDoubt]:
    """What speaks against a fit; nothing where it explains its video.

    The observations are those before any fit: what was detected where a fit expects it agrees. By
    `shift` its downswing is off from what moves in the pictures.
    """
    return [
        *_doubt_order(fitted),
        *_doubt_shift(fitted, shift),
        *_doubt_figure(fitted, observations),
        *_doubt_rest(fitted, observations),
        *_doubt_tracks(fitted, observations),
        *_doubt_club(fitted, observations),
        *_doubt_clicks(fitted, observations),
        *_doubt_marks(fitted, observations),
        *_doubt_shafts(fitted, observations),
    ]


def _doubt_order(fitted: FittedSwing) -> list[SwingDoubt]:
    """Key postures in order, inside of the film, at a pace that people have."""
    keys, time = fitted.keys, fitted.motion.time
    start, top, hit, finish = keys
    if not np.isfinite(keys).all() or not start < top < hit < finish:
        return [SwingDoubt("start, top, hit and finish are not in order", _frame(fitted, top))]
    doubts = []
    for name, key in (("top", top), ("hit", hit)):
        if not EDGE < key < len(time) - 1 - EDGE:
            doubts.append(SwingDoubt(f"the {name} lies at the film's end", _frame(fitted, key)))
    up, down = np.diff(np.interp([start, top, hit], np.arange(len(time)), time))
    shortest, longest = DOWNSWING_SECONDS
    if not shortest <= down <= longest:
        doubts.append(
            SwingDoubt(
                f"the downswing takes {down:.2f} s, where golfers take {shortest:g} to {longest:g} "
                "(is the video slow motion?)",
                _frame(fitted, top),
            )
        )
    elif not TEMPO[0] <= up / down <= TEMPO[1]:
        doubts.append(
            SwingDoubt(
                f"the tempo is {up / down:.1f} to 1, where golfers have {TEMPO[0]:g} to "
                f"{TEMPO[1]:g}",
                _frame(fitted, start),
            )
        )
    return doubts


def shown_keys(keys: Float[np.ndarray, "4"], film: Film) -> tuple[bool, bool, bool, bool]:
    """Which key postures, frames of the file, a film shows.

    One that begins within the upswing has its start in the first frame, and one that ends before
    the finish has it there or where hands are slow on the way. A top or hit at an end is a doubt.
    """
    start, top, hit, finish = keys.tolist()
    edge = EDGE * float(np.median(np.diff(film.file_frames)))
    ends = finish < film.file_range[1] - edge and finish - hit >= SHORTEST_FINISH * (hit - top)
    return start > film.file_range[0] + edge, True, True, ends


def _frame(fitted: FittedSwing, key: float) -> int:
    """The frame next to a key posture."""
    last = len(fitted.motion.time) - 1
    return int(np.clip(np.nan_to_num(np.round(key)), 0, last))


def _swing(fitted: FittedSwing, end: int) -> slice:
    """Frames from the start to a key posture; at least one."""
    first, last = _frame(fitted, fitted.keys[0]), _frame(fitted, fitted.keys[end])
    return slice(min(first, last), max(first, last) + 1)


def is_shifted(shift: TimeShift) -> bool:
    """Whether a fitted downswing clearly runs ahead of the pictures or behind them."""
    return shift.best >= LEAST_AGREEMENT and abs(shift.downswings) > MOST_SHIFT


def _doubt_shift(fitted: FittedSwing, shift: TimeShift) -> list[SwingDoubt]:
    """Arms and club come down when the pictures show them come down."""
    middle = _frame(fitted, float(fitted.keys[1:3].mean()))
    if shift.best < LEAST_AGREEMENT:
        return [SwingDoubt("nothing moves where the fitted arms and club come down", middle)]
    if not is_shifted(shift):
        return []
    way = "later" if shift.frames > 0 else "earlier"
    seconds = abs(shift.frames) / fitted.motion.fps
    return [SwingDoubt(f"the pictures show arms and club come down {seconds:.2f} s {way}", middle)]


def _off_figure(
    fitted: FittedSwing, observations: Observations
) -> tuple[Bool[np.ndarray, "n J"], Bool[np.ndarray, "n"]]:
    """Which joints lie off the player's mask, from the start to the finish, and in which of these
    frames there is a mask; where there is none, none lies off."""
    during = _swing(fitted, 3)
    points = fitted.motion.points2d[during]
    away = sample_distance(observations.silhouette_distance[during], points)[0]
    masked = np.array([len(samples) > 0 for samples in observations.foreground[during]])
    off = away.reshape(points.shape[:2]) >= ON_FIGURE * observations.height
    return off & masked[:, None], masked


def _doubt_figure(fitted: FittedSwing, observations: Observations) -> list[SwingDoubt]:
    """Joints lie on the player's mask, hands at every time."""
    if not len(observations.silhouette_distance):
        return []
    (off, masked), start = _off_figure(fitted, observations), _swing(fitted, 3).start
    if not masked.any():
        middle = start + len(off) // 2
        return [SwingDoubt("the player's figure is whole in no frame of the swing", middle)]
    on = 1 - off[masked].mean()
    if on < LEAST_ON_FIGURE:
        worst = start + int(off.mean(axis=1).argmax())
        return [SwingDoubt(f"only {on:.0%} of the joints lie on the player", worst)]
    wrists = [LSP14.index("right_wrist"), LSP14.index("left_wrist")]
    edges = np.diff(np.r_[0, off[:, wrists].all(axis=1), 0])
    begins, ends = np.flatnonzero(edges > 0), np.flatnonzero(edges < 0)
    seconds = (ends - begins) / fitted.motion.fps
    if not (seconds > HANDS_OFF_SECONDS).any():
        return []
    longest = int(seconds.argmax())
    middle = start + int(begins[longest] + ends[longest]) // 2
    reason = f"both hands lie off the player for {seconds[longest]:.2f} s"
    return [SwingDoubt(reason, middle)]


def _doubt_rest(fitted: FittedSwing, observations: Observations) -> list[SwingDoubt]:
    """All of the player's mask is some part of the fitted body."""
    during = _swing(fitted, 3)
    samples = observations.foreground[during]
    counts = np.array([len(points) for points in samples])
    if not counts.any():
        return []
    frame = np.repeat(np.arange(during.start, during.stop), counts)
    lines = SightLines(sight_directions(np.concatenate(samples), observations.camera), frame)
    passing = find_closest_points(lines, place_capsules(fitted.capsules, fitted.pose))
    beside = passing.distance.min(axis=1) > BESIDE * observations.stature
    if beside.mean() <= MOST_BESIDE:
        return []
    worst = int(np.bincount(frame, beside).argmax())
    return [SwingDoubt(f"{beside.mean():.0%} of the player's figure lies beside the body", worst)]


def _doubt_tracks(fitted: FittedSwing, observations: Observations) -> list[SwingDoubt]:
    """Joints that were tracked well are where they were tracked."""
    during = _swing(fitted, 3)
    tracked, spread = observations.joints[during], observations.spread[during]
    away: Float[np.ndarray, "n J"] = (
        np.linalg.norm(fitted.motion.points2d[during] - tracked, axis=2) / observations.height
    )
    known = np.isfinite(away) & (spread < TRACK_SPREAD * observations.height)
    if not known.any() or (far := float(np.percentile(away[known], 90))) <= FARTHEST_TRACKED:
        return []
    row, joint = np.unravel_index(np.where(known, away, 0).argmax(), away.shape)
    name = LSP14.names[joint]
    text = f"tracked joints are up to {far:.0%} of the body height away, {name} most"
    return [SwingDoubt(text, during.start + int(row))]


def _doubt_club(fitted: FittedSwing, observations: Observations) -> list[SwingDoubt]:
    """The club was seen on the way to the hit, where the fit has it."""
    during = _swing(fitted, 2)
    detected, expected = (
        ends[during, 1] - ends[during, 0] for ends in (observations.club, fitted.club2d)
    )
    seen = np.isfinite(detected).all(axis=1)
    if seen.mean() < LEAST_DETECTED:
        text = f"the club was detected in {seen.mean():.0%} of the frames of the swing"
        return [SwingDoubt(text, during.start)]
    angle = np.abs(signed_angles(detected, expected))
    agreed = angle[seen] < ANOTHER_CLUB
    if agreed.mean() >= LEAST_CLUB_AGREED:
        return []
    worst = during.start + int(np.where(seen, np.nan_to_num(angle), 0).argmax())
    text = f"the fitted club agrees with the detected one in {agreed.mean():.0%} of the frames"
    return [SwingDoubt(text, worst)]


def _doubt_clicks(fitted: FittedSwing, observations: Observations) -> list[SwingDoubt]:
    """The joints that a person placed are where they were placed."""
    initial, points = observations.initial, fitted.motion.points2d[observations.initial.frame]
    if not initial.names:
        return []
    hips = (points[LSP14.index("right_hip")] + points[LSP14.index("left_hip")]) / 2
    places = [hips if name == "root" else points[LSP14.index(name)] for name in initial.names]
    far = np.linalg.norm(np.array(places) - initial.places, axis=1) / observations.height
    if far.mean() <= FARTHEST_CLICK:
        return []
    worst = initial.names[int(far.argmax())]
    text = (
        f"the clicked joints are {far.mean():.0%} of the body height away, {worst} {far.max():.0%}"
    )
    return [SwingDoubt(text, initial.frame)]


def _doubt_marks(fitted: FittedSwing, observations: Observations) -> list[SwingDoubt]:
    """No mark is far from where the fit would have the joint."""
    marks = carry_marks(observations.marks, fitted)
    off = np.linalg.norm(fitted.motion.points2d[marks.frames] - marks.joints, axis=2)
    far = np.nan_to_num(off / observations.height)
    if not far.size or far.max() <= FARTHEST_MARK:
        return []
    row, joint = np.unravel_index(far.argmax(), far.shape)
    frame, name = int(marks.frames[row]), LSP14.names[joint]
    return [SwingDoubt(f"{name} was marked {far.max():.0%} of the body height away", frame)]


def _doubt_shafts(fitted: FittedSwing, observations: Observations) -> list[SwingDoubt]:
    """No marked shaft is turned far from the club of the fit."""
    marks = carry_marks(observations.marks, fitted)
    marked, expected = (
        ends[:, 1] - ends[:, 0] for ends in (marks.shafts, fitted.club2d[marks.frames])
    )
    length = np.fmin(np.linalg.norm(marked, axis=1), np.linalg.norm(expected, axis=1))
    seen = np.isfinite(marked).all(axis=1) & (length > LEAST_SHAFT * observations.height)
    angle = np.where(seen, np.nan_to_num(np.abs(signed_angles(marked, expected))), 0)
    if not angle.size or angle.max() < ANOTHER_CLUB:
        return []
    text = f"the club was marked {np.degrees(angle.max()):.0f} degrees from where the fit has it"
    return [SwingDoubt(text, int(marks.frames[angle.argmax()]))]
