"""Joints tracked through the video: head, knees and ankles (CVPR 2005, Section 4.2).

Every clicked one of them that is visible is tracked by its appearance, forwards and backwards from
the clicked frame. Three things that appearance cannot tell follow from what is known of legs.
Along the line of the feet, the farther leg is behind the nearer one: it is not tracked. Where
the left and the right one come to lie at the same place, a tracker cannot but hold on to the nearer
one: the one that had moved less before counts as hidden from then on. And a knee that slips along
the thigh changes the length of the shank.

The leading foot stands where it is through the whole swing. A track that climbs from it has slid up
the leg. Down the line it is the farther one, so where it is not tracked it counts as where it was
clicked.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8

from keyrecon.body import LSP14
from keyrecon.golf.clicks import ClickedPose
from keyrecon.golf.observe.appearance_tracker import AppearanceOptions, PointTrack, track_patch
from keyrecon.golf.observe.foreground import Foreground
from keyrecon.io.frame_reader import side_by_side
from keyrecon.progress import Progress, silent

TRACK_SPREAD = {"head_top": 0.02, "knee": 0.02, "ankle": 0.018}
"""Standard deviation of a tracked joint, player heights: cloth slides over knees."""
IN_LINE = 0.12
"""Feet closer than this across the picture stand in line, player heights."""
SHANK_LENGTHS = (0.6, 1.25)
"""Least and greatest length of the shank, in lengths of the clicked one."""
HIDDEN_SPREAD = 0.04
"""The same of a joint that was clicked behind something."""
CLICK_SPREAD = 0.015
"""The same of any other click."""
REPEATED_CLICK = 3.0
"""By so many times a click's deviation a foot is known that is not tracked and stays where it was
clicked: it is one click in all frames of a swing, of which some nine count as independent. Known in
the clicked frame alone, as it was, the leading foot came to lie .1 to .2 trunk lengths off through
a whole real swing down the line, and its knee with it: joints of that swing within a fifth of the
trunk rose from .89 to .96; of the three others down the line they were .97, .97 and .95 and got
.96, .97 and .94 (.045 player heights instead of three times a hidden click's .12: the same, and
clubs of the first .87 instead of .91)."""
TURN_SPREAD = 0.08
"""Standard deviation that a turn of one radian adds to the top of the head, player heights."""
HIGHEST_CLIMB = 0.1
"""The leading foot's rise in the picture at most, player heights: of ten marked swings it moves by
.09 at most, its camera's movement included, of one whose shank had become part of the scene its
track rose by .45, as sure of itself as ever."""
LARGEST_HEAD_SPREAD = 0.08
"""The same of a head's top at most, however it has turned and however unsure its track is: on two
real swings tracks of up to .22 were right within .04 after the hit, where the fitted head hung .17
to .25 trunk lengths below the marked one. Joints of three swings seen from the front within a fifth
of the trunk rose from .94, .93 and .88 to .96, .94 and .89 (.97, .95 and .89 with .055). It is
more than what counts as known where a fit is doubted (`plausibility.TRACK_SPREAD`), so such a head
alone makes no doubt."""
LOST_HEAD = 0.3
"""Confidence up to which that does not hold: the head is lost. On ten real swings it is .31 and
more wherever a head is marked, and right within .1 player heights; on a rendered swing whose head
is lost it is .26 at first, .4 heights off, and 0 from there on."""
LEAST_TRUST = 0.1
"""Confidence of a track that has lost all: ten times as far off as one that has lost nothing."""
SAME_PLACE = 0.035
"""Left and right closer than this are one and the same picture, player heights."""
SECONDS_BEFORE = 0.3
"""Time before they meet over which their movement is compared, seconds."""

Joints = Float[np.ndarray, "T 14 2"]


@dataclass(frozen=True, eq=False)
class TrackedJoints:
    """Joints in px of the video."""

    joints: Joints
    """NaN where unknown."""
    spread: Float[np.ndarray, "T 14"]
    """Standard deviations; infinite where unknown."""


def track_joints(
    pictures: Sequence[UInt8[np.ndarray, "h w 3"]],
    foreground: Foreground,
    pose: ClickedPose,
    fps: float,
    options: AppearanceOptions = AppearanceOptions(),
    progress: Progress = silent,
) -> TrackedJoints:
    """Tracks of the clicked joints; others are known in the clicked frame alone.

    `pictures` are in Lab and as small as the masks of `foreground`.
    """
    joints = np.full((len(pictures), len(LSP14.names), 2), np.nan)
    spread = np.full(joints.shape[:2], np.inf)
    names = [n for n in pose.joints.names if n in LSP14.names]
    behind = {*pose.hidden, *_farther_leg(pose)}
    tracked = [n for n in names if _kind(n) in TRACK_SPREAD and n not in behind]

    def track(name: str) -> PointTrack:
        start = pose.head if name == "head_top" else pose.place(name)
        return _track_both_ways(pictures, foreground, start, pose.frame, fps, options)

    tracks = side_by_side(track, progress(tracked, "Tracking joints", len(tracked)))
    for name, trail in zip(tracked, tracks, strict=True):
        index = LSP14.index(name)
        joints[:, index] = trail.places
        if name == "head_top":
            joints[:, index] += _turned(pose.place(name) - pose.head, trail.turns)
            off = head_spread(trail)
        else:
            trust = _lasting_trust(trail.confidence, pose.frame)
            off = TRACK_SPREAD[_kind(name)] / np.maximum(trust, LEAST_TRUST)
        spread[:, index] = off * foreground.height
    for name in set(names) - set(tracked):
        index = LSP14.index(name)
        joints[pose.frame, index] = pose.place(name)
        base = HIDDEN_SPREAD if name in pose.hidden else CLICK_SPREAD
        spread[pose.frame, index] = base * foreground.height
    for pair in LSP14.mirrored:
        _hide_dragged(joints, pair, pose.frame, foreground.height, fps)
    leading = "right" if pose.left_handed else "left"
    drop_climbing_foot(joints, leading, pose.frame, foreground.height)
    for side in ("left", "right"):
        drop_slid_knees(joints, side, pose.frame)
    hold_leading_foot(joints, spread, leading, pose.frame)
    return TrackedJoints(joints, np.where(np.isfinite(joints[..., 0]), spread, np.inf))


def head_spread(head: PointTrack) -> Float[np.ndarray, "T"]:
    """Standard deviation of the top of a tracked head, player heights."""
    base = TRACK_SPREAD["head_top"] + TURN_SPREAD * np.abs(head.turns)
    spread = base / np.maximum(head.confidence, LEAST_TRUST)
    lost = head.confidence <= LOST_HEAD
    return np.where(lost, spread, np.minimum(spread, LARGEST_HEAD_SPREAD))


def _lasting_trust(confidence: Float[np.ndarray, "T"], clicked: int) -> Float[np.ndarray, "T"]:
    """The least confidence of a track from the clicked frame on, either way.

    A tracker learns what it holds on to, so one that has slipped is soon sure again: an ankle had
    slid off a shoe by a fifth of the trunk for most of a real swing (16 of its 35 marks). A head
    that is blurred in the downswing is found again, so it is trusted frame by frame: of one real
    swing in four variants joints within a fifth of the trunk rose from .89, .90, .86 and .88 to
    .91, .92, .91 and .91; five variants of others had .95, .92, .89, .92 and .96 and got .94, .95,
    .86, .92 and .95: where the head was lost for good, its track says so too late.
    """
    on = np.minimum.accumulate(confidence[clicked:])
    back = np.minimum.accumulate(confidence[clicked::-1])[::-1]
    return np.concatenate([back[:-1], on])


def _kind(name: str) -> str:
    return name.removeprefix("left_").removeprefix("right_")


def _farther_leg(pose: ClickedPose) -> tuple[str, ...]:
    """The leg behind the other one, if any: the nearer foot stands lower in the picture."""
    apart = pose.place("right_ankle") - pose.place("left_ankle")
    if abs(apart[0]) > IN_LINE * pose.height:
        return ()
    side = "left" if apart[1] > 0 else "right"
    return f"{side}_knee", f"{side}_ankle"


def drop_slid_knees(joints: Joints, side: str, clicked: int) -> None:
    """Forget knees where the shank has an impossible length; an unseen foot stays where it was."""
    knee, ankle = LSP14.index(f"{side}_knee"), LSP14.index(f"{side}_ankle")
    foot = _last_known(joints[:, ankle], clicked)
    length = np.linalg.norm(joints[:, knee] - foot, axis=1)
    share = length / length[clicked]
    joints[(share < SHANK_LENGTHS[0]) | (share > SHANK_LENGTHS[1]), knee] = np.nan


def drop_climbing_foot(joints: Joints, side: str, clicked: int, height: float) -> None:
    """Forget the foot on the side of the target once its track climbs up the leg.

    Who walks away from the camera lifts both feet in the picture, and counts as standing.
    """
    leading = LSP14.index(f"{side}_ankle")
    rise = joints[clicked, :, 1] - joints[..., 1]
    together = np.fmax(rise[:, LSP14.mirror[leading]], 0.0)
    climbed = rise[:, leading] - together > HIGHEST_CLIMB * height
    for way in (1, -1):
        order = np.arange(len(joints))[clicked::way]
        gone = np.maximum.accumulate(climbed[order])
        joints[order[gone], leading] = np.nan


def hold_leading_foot(
    joints: Joints, spread: Float[np.ndarray, "T 14"], side: str, clicked: int
) -> None:
    """The foot on the side of the target stays where it was clicked where it is not tracked.

    As far as the other foot has moved since, it may have moved too: who was clicked before the
    address steps into it with both. Where the other one is not known, nothing is held.
    """
    leading = LSP14.index(f"{side}_ankle")
    other = LSP14.mirror[leading]
    moved = np.linalg.norm(joints[:, other] - joints[clicked, other], axis=1)
    held = np.isnan(joints[:, leading]).any(axis=1) & np.isfinite(moved)
    joints[held, leading] = joints[clicked, leading]
    spread[held, leading] = np.hypot(REPEATED_CLICK * spread[clicked, leading], moved[held])


def _last_known(places: Float[np.ndarray, "T 2"], clicked: int) -> Float[np.ndarray, "T 2"]:
    """Places of a joint, where unknown the last known one on the way from the clicked frame."""
    frames = np.arange(len(places))
    known = np.isfinite(places).all(axis=1)
    after = np.maximum.accumulate(np.where(known & (frames >= clicked), frames, clicked))
    before = np.minimum.accumulate(np.where(known & (frames <= clicked), frames, clicked)[::-1])
    held: Float[np.ndarray, "T 2"] = places[np.where(frames > clicked, after, before[::-1])]
    return held


def _track_both_ways(
    pictures: Sequence[UInt8[np.ndarray, "h w 3"]],
    foreground: Foreground,
    start: Float[np.ndarray, "2"],
    frame: int,
    fps: float,
    options: AppearanceOptions,
) -> PointTrack:
    """A track through all frames from the clicked one, in px of the video."""
    shrink = foreground.shrink
    shift = (shrink - 1) / 2
    parts, height = [], foreground.height * shrink
    for way in (slice(frame, None), slice(frame, None if frame else 0, -1)):
        few = list(pictures[way]) or [pictures[frame]]
        weights = list(foreground.likely[way]) or [foreground.likely[frame]]
        parts.append(track_patch(few, weights, start * shrink + shift, height, fps, options))
    on, back = parts
    return PointTrack(
        (np.concatenate([back.places[:0:-1], on.places]) - shift) / shrink,
        np.concatenate([back.turns[:0:-1], on.turns]),
        np.concatenate([back.confidence[:0:-1], on.confidence]),
    )


def _turned(
    offset: Float[np.ndarray, "2"], turns: Float[np.ndarray, "T"]
) -> Float[np.ndarray, "T 2"]:
    """A vector turned by several angles."""
    c, s = np.cos(turns), np.sin(turns)
    return np.stack([c * offset[0] - s * offset[1], s * offset[0] + c * offset[1]], axis=1)


def _hide_dragged(
    joints: Joints, pair: tuple[int, int], clicked: int, height: float, fps: float
) -> None:
    """Forget the one of two joints that held on to the other when they met."""
    left, right = (joints[:, j] for j in pair)
    apart = np.linalg.norm(left - right, axis=1)
    if not apart[clicked] > SAME_PLACE * height:
        return
    for way in (1, -1):
        order = np.arange(len(joints))[clicked::way]
        met = np.flatnonzero(apart[order] < SAME_PLACE * height)
        if not len(met):
            continue
        before = order[max(0, met[0] - round(SECONDS_BEFORE * fps)) : met[0] + 1]
        moved = [np.linalg.norm(side[before[-1]] - side[before[0]]) for side in (left, right)]
        joints[order[met[0] :], pair[int(np.argmin(moved))]] = np.nan
