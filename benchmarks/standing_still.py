"""Heads and feet as they are first detected, where players stand still, against marks by eye.

    python benchmarks/standing_still.py [--only NAME ...]

Every real clip, whole and in thirds (a golfer does not leave his place, and a shot of a match may
be as short), with one body marked, the whole clip with four and ten too. What always has the
player's colours is either taken for the scene, as printed; or for unknown as well where the first
track is doubtful (`FindOptions.doubtful`), and the surer track kept; or always both:

    off       frames marked by eye whose head or feet lie .15 player heights or more from the marks
    nobody    no head was found in most frames
    ms        per frame of the video, reading included
"""

import argparse
import time
from collections.abc import Callable, Iterator
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

FORMS = {"printed": 0.0, "doubted": FindOptions().doubtful, "both": 1.0}
"""What is measured, and from which confidence on a track is believed in it."""
THIRDS = 3
OFF = 0.15
"""Player heights: a head is .13 high, a shoe .15 long."""


class Detected(Exception):
    """The player was detected; what follows is not needed."""


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


def detect(clip: real.Clip, task: Task, doubtful: float) -> tuple[Track | None, float]:
    """What is first found of the player, and the seconds that it took."""
    marks = real.take(clip, task.told, task.told)
    marks = replace(marks, frames=marks.frames - task.part.start)
    options = replace(Options(), find=FindOptions(doubtful=doubtful))
    found: list[tuple[Track, float]] = []

    def keep(name: str, stage: Callable[..., Any], /, *inputs: Any, **named: Any) -> Any:
        began = time.perf_counter()
        result = stage(*inputs, **named)
        if name == "find":
            found.append((result, time.perf_counter() - began))
            raise Detected
        return result

    try:
        prepare(clip.video.part(task.part), (), options, keep, marks=marks)
    except Detected:
        return found[0]
    except KeyreconError:
        pass
    return None, 0.0


def share_off(track: Track, truth: Annotations, task: Task) -> float:
    """Share of the frames marked by eye, and not told, whose head or feet are off."""
    inside = (truth.frames >= task.part.start) & (truth.frames < task.part.stop)
    inside[task.told] = False
    at = truth.frames[inside] - task.part.start
    joints = truth.joints[inside]
    head = np.linalg.norm(track.head[at] - joints[:, LSP14.index("head_top")], axis=1)
    ankles = joints[:, [LSP14.index("right_ankle"), LSP14.index("left_ankle")]]
    ways = [np.linalg.norm(track.feet[at] - a, axis=2) for a in (ankles, ankles[:, ::-1])]
    feet = np.minimum(*(way.mean(axis=1) for way in ways))
    return float((np.maximum(head, feet) > OFF * track.height[at]).mean())


def main() -> None:
    """Measure every clip in all forms."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", default=[])
    words = parser.parse_args()
    print(f"{'clip':<26}{'told':<12}" + "".join(f"{form + ', off':>14}{'ms':>6}" for form in FORMS))
    shares: list[list[float]] = []
    for name in words.only or sorted(path.stem for path in real.TRUTH.glob("*.json")):
        clip = real.load_clip(name)
        for task in list_tasks(clip):
            row, line = [], f"{name:<26}{task.name:<12}"
            for doubtful in FORMS.values():
                track, seconds = detect(clip, task, doubtful)
                row.append(1.0 if track is None else share_off(track, clip.truth, task))
                frames = task.part.stop - task.part.start
                line += f"{'nobody' if track is None else f'{row[-1]:.0%}':>14}"
                line += f"{1000 * seconds / frames:6.1f}"
            print(line, flush=True)
            shares.append(row)
    print(f"{'mean':<38}" + "".join(f"{mean:>14.1%}{'':6}" for mean in np.mean(shares, axis=0)))


if __name__ == "__main__":
    main()
