"""Which tracklets of a track are surely the player's: those linked to a marked or clicked head.

A path through candidates pays for a jump once and is then as sure of somebody else as of the
player; where the player has left the picture, or has not come yet, there is nobody else to follow.
So a track is cut into tracklets where the head moves farther than anybody does, and these are
linked where a person could have come from the end of one to the beginning of the next (Huang, Wu
and Nevatia, ECCV 2008). A tracklet that no chain of links joins to a mark or click may be that of
anybody.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.numerics.geometry import warp_points
from keyrecon.records import CameraPath, Shots, Track
from keyrecon.tracking.linking import MAX_GAP_SECONDS

MAX_STEP_SECONDS, MAX_STEP = 0.12, 0.9
"""Nobody's head moves farther in that time, player heights: 13 m/s. A sprinter reaches 12. Who was
slower before and after moves less far (`reach`)."""
MAX_ACCELERATION = 6.0
"""Of a body, player heights per second squared: it falls with 5.5, and sprinters start with 5."""
OWN_SPEED_SECONDS = 0.2
"""The speed at an end of a tracklet is the median over so long. It decides only what is linked."""
ON_TRACK = 0.25
"""A head that was told lies on the track within this, player heights: a head is .13 high, and a
track that is right lies within .1. In 23 tracks of nine real clips nobody is said to jump with .15
to .3; one that went over to who passed beside, .7 in a tenth of a second, is cut with all of
these."""


def linked_to_player(
    track: Track,
    camera: CameraPath,
    known_frames: Int[np.ndarray, "n"],
    known_heads: Float[np.ndarray, "n 2"],
    fps: float,
) -> Bool[np.ndarray, "T"]:
    """Frames of a shot in whose tracklet a person marked or clicked the head, or joined to one.

    All frames where no `known_heads` are given, or none of them lies on the track.
    """
    off = np.linalg.norm(track.head[known_frames] - known_heads, axis=-1)
    on_track = known_frames[off < ON_TRACK * track.height[known_frames]]
    linked = np.ones(len(track.head), dtype=bool)
    if not len(on_track):
        return linked
    seen = track.confidence > 0
    seen[on_track] = True
    path = _SeenPath.of(track, camera, np.flatnonzero(seen), fps)
    tracklets = path.tracklets()
    rows = np.searchsorted(path.frames, on_track)
    known = [bool(((first <= rows) & (rows <= last)).any()) for first, last in tracklets]
    for number, is_joined in enumerate(_joined(path, tracklets, known)):
        if not is_joined:  # nor is what lies between it and those before and after
            start = path.frames[tracklets[number - 1][1]] + 1 if number else 0
            end = path.frames[tracklets[number + 1][0]] if number + 1 < len(tracklets) else None
            linked[start:end] = False
    return linked


def find_jumps(track: Track, camera: CameraPath, shots: Shots, fps: float) -> list[int]:
    """Frames to which the head moves farther than anybody does, the camera's motion apart and in
    one shot; of several close together the first."""
    jumps: list[int] = []
    for shot in shots.parts:
        frames = shot.start + np.flatnonzero(track.confidence[shot] > 0)
        path = _SeenPath.of(track, camera, frames, fps)
        for first, _ in path.tracklets()[1:]:
            frame = int(frames[first])
            if not jumps or frame - jumps[-1] > 2 * MAX_STEP_SECONDS * fps:
                jumps.append(frame)
    return jumps


@dataclass(frozen=True, eq=False)
class _SeenPath:
    """The head in the frames in which it was seen."""

    frames: Int[np.ndarray, "n"]
    time: Float[np.ndarray, "n"]
    head: Float[np.ndarray, "n 2"]
    """px"""
    height: Float[np.ndarray, "n"]
    to_reference: Float[np.ndarray, "n 3 3"]
    speed: Float[np.ndarray, "n"]
    """From the frame before, player heights per second."""

    @classmethod
    def of(
        cls, track: Track, camera: CameraPath, frames: Int[np.ndarray, "n"], fps: float
    ) -> "_SeenPath":
        time, speed = frames / fps, np.zeros(len(frames))
        parts = track.head[frames], track.height[frames], camera.to_reference[frames]
        path = cls(frames, time, *parts, speed)
        rows = np.arange(1, len(frames))
        speed[1:] = path.moved(rows - 1, rows) / np.diff(time)
        return path

    def moved(self, before: Int[np.ndarray, "*m"], after: Int[np.ndarray, "*m"]) -> np.ndarray:
        """How far the head moves between rows, the camera's motion apart, player heights."""
        change = np.linalg.inv(self.to_reference[after]) @ self.to_reference[before]
        way = self.head[after] - warp_points(change, self.head[before])
        return np.asarray(np.linalg.norm(way, axis=-1) / self.height[after])

    def reach(self, before: Int[np.ndarray, "*m"], after: Int[np.ndarray, "*m"]) -> np.ndarray:
        """How far a person may have moved between rows who has the speed of both, the track being
        off by no more than `ON_TRACK` at either."""
        between = self.time[after] - self.time[before]
        own = np.array([self._own_speed(int(row), -1) for row in np.ravel(before)])
        own += [self._own_speed(int(row), 1) for row in np.ravel(after)]
        led = 2 * ON_TRACK + own.reshape(between.shape) / 2 * between
        led += MAX_ACCELERATION * between**2 / 4
        return np.minimum(MAX_STEP / MAX_STEP_SECONDS * np.maximum(between, MAX_STEP_SECONDS), led)

    def _own_speed(self, row: int, side: int) -> float:
        """Speed before a row, or after it."""
        bounds = sorted((self.time[row], self.time[row] + side * OWN_SPEED_SECONDS))
        first, end = np.searchsorted(self.time, bounds, side="right")
        own = self.speed[first:end]
        return float(np.median(own)) if len(own) else 0.0

    def tracklets(self) -> list[tuple[int, int]]:
        """First and last row of each; another begins with the largest step of a move too far."""
        rows = np.arange(len(self.frames))
        earliest = np.searchsorted(self.time, self.time - MAX_STEP_SECONDS - 1e-6)
        before = np.maximum(np.minimum(earliest, rows - 1), 0)
        step = self.speed * np.diff(self.time, prepend=0)
        moved = self.moved(before, rows)
        far = np.flatnonzero(moved > 2 * ON_TRACK)  # nobody's reach is less, and few move as far
        far = far[moved[far] > self.reach(before[far], far)]
        breaks = {int(before[row] + 1 + step[before[row] + 1 : row + 1].argmax()) for row in far}
        return [(first, end - 1) for first, end in pairwise([0, *sorted(breaks), len(rows)])]


def _joined(path: _SeenPath, tracklets: list[tuple[int, int]], known: list[bool]) -> list[bool]:
    """Which tracklets a chain of links joins to one in which the player is `known`."""
    joined, waiting = list(known), [number for number, is_known in enumerate(known) if is_known]
    while waiting:
        one = waiting.pop()
        for other, is_joined in enumerate(joined):
            first, second = tracklets[min(one, other)], tracklets[max(one, other)]
            if not is_joined and _is_linked(path, first[1], second[0]):
                joined[other] = True
                waiting.append(other)
    return joined


def _is_linked(path: _SeenPath, last: int, first: int) -> bool:
    """Whether a person could have come from the last row of a tracklet to the first of another."""
    if path.time[first] - path.time[last] > MAX_GAP_SECONDS:
        return False
    before, after = np.array([last]), np.array([first])
    return bool(path.moved(before, after)[0] <= path.reach(before, after)[0])
