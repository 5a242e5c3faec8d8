"""How like the marked player real shots look: shots of the same player, and of somebody else.

Run: python benchmarks/shot_likeness.py OUT CLIP [CLIP ...]

Each clip in turn is cut into three shots with black between, and followed by the beginnings of the
other clips; a person marks one body in it. Printed is the likeness by which shots are sorted
(`keyrecon/tracking/shot_sorting.py`), of the shots without the mark: from `ShotOptions.alike` on a
shot shows the player, from `UNLIKE` on perhaps the player. 'nobody': no head and feet were found.
"""

import argparse
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import real
from made_match import Piece, first_frames, join

from keyrecon.io.video import open_video
from keyrecon.pipeline import Options, prepare
from keyrecon.records import PLAYER
from keyrecon.tracking.shot_sorting import PlayerDetection, likeness_to_told

THIRDS = 3
BLACK, OTHER = 20, 90
"""Frames between shots, and of another clip at most."""


class Found(Exception):
    """All shots were looked at; what follows is not needed."""


class Detections:
    """A `Keep` that keeps what was found in each shot, by its first frame."""

    def __init__(self) -> None:
        """Nothing yet."""
        self.found: dict[int, PlayerDetection] = {}

    def __call__(self, name: str, stage: Callable[..., Any], /, *inputs: Any, **named: Any) -> Any:
        """The result of a stage; ends with the first that comes after the shots were sorted."""
        stage_name, of_shot, first = name.partition("@")
        if stage_name == "background":
            raise Found
        result = stage(*inputs, **named)
        if of_shot and stage_name == "find":
            self.found[int(first)] = result
        return result


def thirds(clip: real.Clip) -> list[Piece]:
    """A clip in three shots with black between."""
    ends = np.linspace(0, len(clip.video), THIRDS + 1).round().astype(int)
    pieces: list[Piece] = []
    for first, end in pairwise(ends.tolist()):
        pieces += [Piece("black", BLACK)] if pieces else []
        pieces.append(Piece(PLAYER, end - first, clip.video.path, first))
    return pieces


def measure(clip: real.Clip, others: Sequence[real.Clip], out: Path) -> None:
    """Print the likeness of the clip's own shots and of the others."""
    pieces = thirds(clip)
    for other in others:
        length = min(OTHER, len(other.video))
        pieces += [Piece("black", BLACK), Piece(other.name, length, other.video.path)]
    file = out / f"{clip.name}.mp4"
    join(pieces, file, (clip.video.width, clip.video.height), clip.video.fps)
    body = real.choose_bodies(clip, 1)
    marks = real.take(clip, body, body)
    starts = first_frames(pieces)
    own = [number for number, piece in enumerate(pieces) if piece.shows == PLAYER]
    inside = max(n for n in own if pieces[n].first <= marks.frames[0])
    frames = marks.frames - pieces[inside].first + starts[inside]
    keep = Detections()
    with suppress(Found):
        prepare(open_video(file), (), Options(), keep, marks=replace(marks, frames=frames))
    detections = [keep.found[start] for start in starts]
    told = np.arange(len(pieces)) == inside
    likeness = likeness_to_told(detections, told)
    print(clip.name)
    for piece, seen, like, marked in zip(pieces, detections, likeness, told, strict=True):
        if not marked and piece.source is not None:
            print(f"  {piece.shows:<26}{'nobody' if seen.track is None else f'{like:5.2f}'}")


def main() -> None:
    """Measure every clip among the others."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("clips", nargs="+", help="names of real clips")
    words = parser.parse_args()
    words.out.mkdir(parents=True, exist_ok=True)
    clips = [real.load_clip(name) for name in words.clips]
    for clip in clips:
        measure(clip, [other for other in clips if other is not clip], words.out)


if __name__ == "__main__":
    main()
