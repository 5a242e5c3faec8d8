"""Heads and feet as they are detected and tracked, and how sure that is, against marks by eye.

    python benchmarks/standing_still.py [--only NAME ...]

Every real clip, whole and in thirds (a golfer does not leave his place, and a shot of a match may
be as short), with one body marked, the whole clip with four and ten too. What always has the
player's colours is either taken for the scene, as printed; or for unknown as well where the first
track is doubtful (`FindOptions.doubtful`), and the surer track kept. From that the track is made:

    off       frames marked by eye whose head or feet lie .15 player heights or more from the marks
    nobody    no head was found in most frames
    ms        to detect, per frame of the video, reading included
    sure      mean confidence of the track in frames that are right, and in those that are off

At the end, of all frames: how often the track is right by how sure it is.
"""

import argparse
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import real

from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.pipeline import Options, prepare
from keyrecon.records import Annotations, Track
from keyrecon.tracking.detection import FindOptions

PRINTED = replace(Options(), find=FindOptions(doubtful=0.0))
SURENESS = (0.0, 0.2, 0.4, 0.6, 0.8, 0.95, 1.01)
THIRDS = 3
OFF = 0.15
"""Player heights: a head is .13 high, a shoe .15 long."""


class Enough(Exception):
    """What follows is not needed."""


@dataclass(frozen=True, eq=False)
class Followed:
    """What was made of a task."""

    detected: Track | None = None
    tracked: Track | None = None
    seconds: float = 0.0
    """To detect."""


@dataclass(frozen=True, eq=False)
class Task:
    """A part of a clip, and the marks that are told of it."""

    name: str
    part: slice
    told: np.ndarray
    """Rows of the marks by eye."""


def list_tasks(clip: real.Clip) -> Iterator[Task]:
    """The whole clip with one, four and ten bodies, and each third with one."""
    whole = slice(0, len(clip.video))
    for name, rows in (
        ("one body", real.choose_bodies(clip, 1)),
        ("four bodies", real.choose_bodies(clip, 4)),
        ("ten bodies", np.linspace(0, len(clip.truth.frames) - 1, 10).round().astype(int)),
    ):
        yield Task(name, whole, np.unique(rows))
    ends = np.linspace(0, len(clip.video), THIRDS + 1).round().astype(int).tolist()
    for number, (first, end) in enumerate(pairwise(ends), 1):
        inside = np.flatnonzero((clip.truth.frames >= first) & (clip.truth.frames < end))
        if len(inside) > 1:
            middle = inside[[len(inside) // 2]]
            yield Task(f"third {number}", slice(first, end), middle)


def follow(clip: real.Clip, task: Task, options: Options, last: str) -> Followed:
    """What is found of the player up to the stage `last`: `find`, or `track`."""
    marks = real.take(clip, task.told, task.told)
    marks = replace(marks, frames=marks.frames - task.part.start)
    made: dict[str, tuple[Track, float]] = {}

    def keep(name: str, stage: Callable[..., Any], /, *inputs: Any, **named: Any) -> Any:
        began = time.perf_counter()
        result = stage(*inputs, **named)
        if name in ("find", "track"):
            made[name] = result, time.perf_counter() - began
        if name == last:
            raise Enough
        return result

    with suppress(Enough, KeyreconError):
        prepare(clip.video.part(task.part), (), options, keep, marks=marks)
    detected, seconds = made.get("find", (None, 0.0))
    return Followed(detected, made.get("track", (None, 0.0))[0], seconds)


def measure_off(
    track: Track | None, truth: Annotations, task: Task
) -> tuple[np.ndarray, np.ndarray]:
    """Whether head or feet are off in frames marked by eye and not told, and how sure they are."""
    inside = (truth.frames >= task.part.start) & (truth.frames < task.part.stop)
    inside[task.told] = False
    if track is None:
        return np.ones(int(inside.sum()), dtype=bool), np.zeros(int(inside.sum()))
    at = truth.frames[inside] - task.part.start
    joints = truth.joints[inside]
    head = np.linalg.norm(track.head[at] - joints[:, LSP14.index("head_top")], axis=1)
    ankles = joints[:, [LSP14.index("right_ankle"), LSP14.index("left_ankle")]]
    ways = [np.linalg.norm(track.feet[at] - a, axis=2) for a in (ankles, ankles[:, ::-1])]
    feet = np.minimum(*(way.mean(axis=1) for way in ways))
    return np.maximum(head, feet) > OFF * track.height[at], track.confidence[at]


def main() -> None:
    """Measure every clip in all forms."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", default=[])
    words = parser.parse_args()
    names = ("printed, off", "detected, off", "tracked, off")
    print(
        f"{'clip':<26}{'told':<12}{'ms':>6}" + "".join(f"{n:>15}" for n in names) + f"{'sure':>14}"
    )
    shares: list[list[float]] = []
    off_frames, sure_frames = [], []
    for name in words.only or sorted(path.stem for path in real.TRUTH.glob("*.json")):
        clip = real.load_clip(name)
        for task in list_tasks(clip):
            made = follow(clip, task, Options(), "track")
            tracks = follow(clip, task, PRINTED, "find").detected, made.detected, made.tracked
            off, sure = measure_off(made.tracked, clip.truth, task)
            shares.append([float(measure_off(t, clip.truth, task)[0].mean()) for t in tracks])
            shown = [
                "nobody" if track is None else f"{share:.0%}"
                for track, share in zip(tracks, shares[-1], strict=True)
            ]
            ms = 1000 * made.seconds / (task.part.stop - task.part.start)
            surety = "".join(
                f"{sure[k].mean():7.2f}" if k.any() else f"{'':7}" for k in (~off, off)
            )
            print(
                f"{name:<26}{task.name:<12}{ms:6.1f}" + "".join(f"{s:>15}" for s in shown) + surety
            )
            off_frames.append(off)
            sure_frames.append(sure)
    print(f"{'mean':<44}" + "".join(f"{mean:>15.1%}" for mean in np.mean(shares, axis=0)))
    off, sure = np.concatenate(off_frames), np.concatenate(sure_frames)
    for low, high in pairwise(SURENESS):
        inside = (sure >= low) & (sure < high)
        if inside.any():
            print(
                f"sure {low:.2f} to {min(high, 1):.2f}: {inside.sum()} frames, "
                f"{1 - off[inside].mean():.0%} right"
            )


if __name__ == "__main__":
    main()
