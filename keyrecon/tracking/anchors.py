"""Marks of a person as fixed points of the track.

In its frame a marked head or pair of feet replaces all candidates, at a cost so low that every best
path passes through it. The same marks train the filters, and show where a track that was made
without them is wrong.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.ndimage import uniform_filter1d

from keyrecon.numerics.geometry import warp_points
from keyrecon.records import CameraPath, Pick, Shots, Track, TrackAnchors

ANCHOR_COST = -60.0
"""Cost of a marked place, nats: beyond what two jumps and the skips around it could save. A quarter
more or less, others with it: at most 1.9 points, 2.4 mm on four clips."""
ANCHOR_FOOT_COST = -3.0
"""Cost of a marked foot by itself when paths are smoothed: twenty times the weight of a foot whose
response is certain. A quarter more or less, others with it: at most 1.9 points, 1.8 mm on four
clips."""
MAX_BRIDGE_COST = 8.0
"""Largest cost of a place far from the way between two marks: that of a jump; a frame without any
place costs half as much."""
FOLLOWED_COST = 1.5
"""Cost of a head that is not detected, but where flow leads from a mark: that of a propagated
foot."""
FOLLOWED_SPREAD = 0.05
"""Standard deviation of a head that flow has, player heights: half a head is .065. The same heads
are .035 off in the median with a drift of .03 to .15."""
DOUBT_SECONDS = 0.3
"""Doubt is averaged over this time: one frame of blur needs no mark. It decides only which body is
asked for next."""
LEAST_DOUBT = 0.15
"""A track that is sure of itself may be wrong all the same. It decides only which body is asked for
next."""
FAR_SECONDS = 2.0
"""Marks farther away in time than this teach nothing of a frame. It decides only which body is
asked for next."""
CONTRADICTION = 0.12
"""A head or foot that lies farther from its mark is wrong, player heights: the ankle of the other
leg is farther away in an open stance, and marks of ankles and tracks of shoes differ by .04. Three
times that."""

WAY_SECONDS = 0.2
"""A mark is held against the way from so long before it to so long after it. It decides only what
is told of marks."""
MAX_WAY_DISTANCE = (0.25, 0.45)
"""A head, a foot farther off that way is wrong, player heights: twice what strokes and serves of
eight rendered sequences have at most, .13 and .24. In marks by eye of 18 real clips (2724 triples,
.1 to .35 s apart) heads accelerate by at most 11 heights/s^2, feet by 19 in 98 of 100: .22 and .38
over this time. Who turns over is off it by more (`_turning_distance`)."""


def anchored_states(
    states: Sequence[Float[np.ndarray, "_ p 2"]],
    costs: Sequence[Float[np.ndarray, "_"]],
    marked: Float[np.ndarray, "n p 2"],
) -> tuple[list[Float[np.ndarray, "_ p 2"]], list[Float[np.ndarray, "_"]]]:
    """States and their costs, with the marked place alone where all of it is marked (not NaN)."""
    known = np.isfinite(marked).all(axis=(1, 2))
    rows = list(zip(states, costs, marked, known, strict=True))
    places = [mark[None] if fixed else state for state, _, mark, fixed in rows]
    return places, [np.array([ANCHOR_COST]) if fixed else cost for _, cost, _, fixed in rows]


def with_bridge_costs(
    states: Sequence[Float[np.ndarray, "_ p 2"]],
    costs: Sequence[Float[np.ndarray, "_"]],
    marked: Float[np.ndarray, "n p 2"],
    step: float,
) -> list[Float[np.ndarray, "_"]]:
    """Costs of states, more for those far from the straight way between the marks around them.

    Who runs keeps the speed for a while: n frames after a mark the deviation is `step` n, and of
    two marks each tells what it knows. (Independent steps deviate by `step` sqrt(n) only, and who
    ran away from the last mark was given up for whoever stood there.) Transitions alone forgive a
    jump once and for all; a head that is taken for a shoe between two marks pays in each frame.
    """
    known = np.flatnonzero(np.isfinite(marked).all(axis=(1, 2)))
    if not len(known):
        return list(costs)
    middle, spread = _bridges(marked.mean(axis=1), known, step)
    pairs = zip(states, costs, middle, spread, strict=True)
    return [
        cost
        + np.minimum(
            np.square(state.mean(axis=1) - place).sum(axis=1) / (2 * deviation**2), MAX_BRIDGE_COST
        )
        for state, cost, place, deviation in pairs
    ]


@dataclass(frozen=True, eq=False)
class FollowedHeads:
    """Where flow from marks leads a head that is not fixed, and how sure that is."""

    places: Float[np.ndarray, "n 2"]
    """In the reference frame; NaN where it leads nowhere."""
    doubt: Float[np.ndarray, "n"]
    """Probability that the head is elsewhere; NaN where it leads nowhere."""
    spread: float
    """Standard deviation of the others, px."""

    @classmethod
    def of(
        cls, anchors: TrackAnchors, numbers: Int[np.ndarray, "n"], camera: CameraPath, height: float
    ) -> "FollowedHeads":
        """Those of some frames, of a player of some px."""
        places, doubt = np.full((len(numbers), 2), np.nan), np.full(len(numbers), np.nan)
        row, entry = _shared_rows(numbers, anchors)
        led, doubt[row] = anchors.followed_head[entry], anchors.head_doubt[entry]
        places[row] = warp_points(camera.to_reference[numbers[row]], led)
        return cls(places, doubt, FOLLOWED_SPREAD * height)

    def every(self, step: int) -> "FollowedHeads":
        """Each `step`-th of the frames."""
        return FollowedHeads(self.places[::step], self.doubt[::step], self.spread)

    def with_costs(
        self, states: Sequence[Float[np.ndarray, "_ 1 2"]], costs: Sequence[Float[np.ndarray, "_"]]
    ) -> tuple[list[Float[np.ndarray, "_ 1 2"]], list[Float[np.ndarray, "_"]]]:
        """States with where flow leads among them, and costs, more for those that lie elsewhere:
        -log of the odds that flow is wrong, at most."""
        more, dearer = list(states), list(costs)
        for t in np.flatnonzero(np.isfinite(self.places).all(axis=1)).tolist():
            away = np.square(states[t][:, 0] - self.places[t]).sum(axis=1) / (2 * self.spread**2)
            doubt = max(float(self.doubt[t]), 1e-6)
            elsewhere = -np.log(doubt + (1 - doubt) * np.exp(-away))
            more[t] = np.concatenate([states[t], self.places[t][None, None]])
            dearer[t] = np.append(costs[t] + elsewhere, FOLLOWED_COST)
        return more, dearer


def _bridges(
    marked: Float[np.ndarray, "n 2"], known: Int[np.ndarray, "m"], step: float
) -> tuple[Float[np.ndarray, "n 2"], Float[np.ndarray, "n"]]:
    """Expected place in every frame, and how far from it the path may be."""
    frames = np.arange(len(marked))
    place = np.stack([np.interp(frames, known, marked[known, axis]) for axis in (0, 1)], axis=1)
    after = np.searchsorted(known, frames)
    since = np.where(after > 0, frames - known[after - 1], np.inf)
    until = np.where(after < len(known), known[np.minimum(after, len(known) - 1)] - frames, np.inf)
    precision = np.square(1 / np.maximum(since, 1)) + np.square(1 / np.maximum(until, 1))
    return place, step / np.sqrt(np.minimum(precision, 1))


def fixed_places(
    anchors: TrackAnchors, numbers: Int[np.ndarray, "n"], camera: CameraPath
) -> tuple[Float[np.ndarray, "n 1 2"], Float[np.ndarray, "n 2 2"]]:
    """Fixed heads and feet of some frames in the reference frame; NaN where there is none."""
    head, feet = np.full((len(numbers), 1, 2), np.nan), np.full((len(numbers), 2, 2), np.nan)
    row, entry = _shared_rows(numbers, anchors)
    path = camera.to_reference[numbers[row]]
    head[row, 0] = warp_points(path, anchors.head[entry])
    feet[row] = warp_points(path[:, None], anchors.feet[entry])
    return head, feet


def _shared_rows(
    numbers: Int[np.ndarray, "n"], anchors: TrackAnchors
) -> tuple[Int[np.ndarray, "m"], Int[np.ndarray, "m"]]:
    """Rows of the frames, and of the anchors, that both have."""
    _, row, entry = np.intersect1d(numbers, anchors.frames, return_indices=True)
    return row, entry


def frames_off_anchors(track: Track, anchors: TrackAnchors) -> Int[np.ndarray, "n"]:
    """Frames in which the head or a foot of a track is not where a person marked it; none of shots
    that are left out."""
    if not anchors.marked.all():
        raise ValueError("only a person's marks contradict a track")
    limit = CONTRADICTION * track.height[anchors.frames]
    head = np.linalg.norm(track.head[anchors.frames] - anchors.head, axis=-1)
    tracked = track.feet[anchors.frames]
    straight, crossed = (
        np.linalg.norm(feet - anchors.feet, axis=-1).max(axis=1)
        for feet in (tracked, tracked[:, ::-1])
    )
    # comparisons with NaN are false: what is not marked contradicts nothing
    off = (head > limit) | (np.minimum(straight, crossed) > limit)
    return anchors.frames[off & track.known[anchors.frames]]


def least_sure_frames(
    track: Track,
    marked: Int[np.ndarray, "n"],
    fps: float,
    count: int,
    time: Float[np.ndarray, "T"] | None = None,
) -> Int[np.ndarray, "m"]:
    """Frames in which a whole body, marked next, would teach most: the track is least sure there.

    A frame counts by the doubt around it and by the time to the nearest marked frame, which it
    counts as itself once it is chosen: marks teach what lies near them in time. `time` of each
    frame, seconds, may be another than the video's (`pose_seconds`).
    """
    window = max(1, round(DOUBT_SECONDS * fps))
    doubt, known = (  # what is left out is no doubt of the frames beside it
        uniform_filter1d(values, window)
        for values in ((1 - track.confidence) * track.known, track.known.astype(float))
    )
    doubt = doubt / np.maximum(known, 1 / (2 * window))
    chosen = list(marked.tolist())
    time = np.arange(len(doubt)) / fps if time is None else time
    for _ in range(count):
        apart = np.abs(time[:, None] - time[chosen]).min(axis=1, initial=FAR_SECONDS)
        value = np.where(track.known, (LEAST_DOUBT + doubt) * apart, 0.0)
        if value.max() <= 0:
            break
        chosen.append(int(value.argmax()))
    return np.array(sorted(chosen[len(marked) :]), dtype=np.int64)


def distance_to_track(track: Track, pick: Pick) -> float:
    """From a click on the head or a foot to where the track has it, player heights."""
    places = track.head[None] if pick.part == "head" else np.swapaxes(track.feet, 0, 1)
    away = np.linalg.norm(places[:, pick.frame] - (pick.x, pick.y), axis=-1).min()
    return float(away / track.height[pick.frame])


@dataclass(frozen=True)
class OutlierMark:
    """A mark far off the path of its part through the frames before and after."""

    frame: int
    part: str
    """'head' or 'feet'."""
    distance: float
    """Player heights."""
    around: tuple[int, int]
    """The frames before and after."""


def outlier_marks(
    track: Track, anchors: TrackAnchors, fps: float, shots: Shots | None = None
) -> list[OutlierMark]:
    """Marked heads and feet far off the straight path through the frames before and after.

    The mark is wrong, or the track in one of these frames.
    """
    shot = (shots or Shots.between((), len(track.height))).number
    step = max(1, round(WAY_SECONDS * fps))
    outliers: list[OutlierMark] = []
    for row in np.flatnonzero(anchors.marked):
        frame = int(anchors.frames[row])
        if not step <= frame < len(track.height) - step:
            continue
        around = (frame - step, frame + step)
        if shot[around[0]] != shot[around[1]] or not track.known[frame]:
            continue
        head = np.linalg.norm(anchors.head[row] - track.head[list(around)].mean(axis=0))
        way = track.feet[list(around)].mean(axis=0)
        feet = min(
            np.linalg.norm(anchors.feet[row] - one, axis=1).max() for one in (way, way[::-1])
        )
        turning = _turning_distance(track, frame, step)
        for part, far, most in zip(("head", "feet"), (head, feet), MAX_WAY_DISTANCE, strict=True):
            distance = float(far / track.height[frame])
            if distance > most + turning:  # not where nothing is marked, which is NaN
                outliers.append(OutlierMark(frame, part, distance, around))
    return outliers


def _turning_distance(track: Track, frame: int, step: int) -> float:
    """How far off the straight way head and feet are in the middle of it because the body turns
    over, player heights: r (1 - cos of half the turn), at a radius r of half of head to feet.

    The turn is that of the axis from feet to head from `step` frames before to as many after,
    followed without the frame itself: a mark that is wrong turns it there and back.
    """
    frames = np.delete(np.arange(frame - step, frame + step + 1), step)
    axis = track.head[frames] - track.feet[frames].mean(axis=1)
    turn = np.unwrap(np.arctan2(axis[:, 1], axis[:, 0]))
    half = min(abs(float(turn[-1] - turn[0])) / 2, np.pi)
    radius = np.median(np.linalg.norm(axis, axis=1)) / 2 / track.height[frame]
    return float(radius * (1 - np.cos(half)))
