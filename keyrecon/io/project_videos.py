"""The videos of a project: where they are, and that they are still the same.

project.toml tells each by a relative path and a fingerprint, so that a folder can be moved with its
videos, and a video that was changed since is not taken for the one that was marked.
"""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from keyrecon.errors import KeyreconError, quoted
from keyrecon.io.fingerprint import has_fingerprint
from keyrecon.io.joined_video import join_videos
from keyrecon.io.video import Video, open_video

Table = dict[str, Any]
"""What project.toml tells of a video."""


def open_project_video(folder: Path, tables: Sequence[Table]) -> Video:
    """The files one after the other; looks beside the project for one that has moved."""
    return join_videos([_open(folder, table) for table in tables])


def describe_video(video: Video, file: Path, folder: Path, trim: Table) -> Table:
    """What project.toml is to tell of a video."""
    return {"path": relative_path(file, folder), "fingerprint": video.fingerprint, **trim}


def relative_path(path: Path, folder: Path) -> str:
    """`path` as seen from `folder`, with forward slashes."""
    return Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()


def which_videos(tables: Sequence[Table], file: Path) -> list[int]:
    """The numbers of the videos that are of a file; raises KeyreconError where none is."""
    if not file.is_file():
        raise KeyreconError(f"There is no video at {file}.")
    prints = {table["fingerprint"] for table in tables}
    own = {fingerprint for fingerprint in prints if has_fingerprint(file, fingerprint)}
    if numbers := [n for n, table in enumerate(tables) if table["fingerprint"] in own]:
        return numbers
    raise KeyreconError(
        f"{file} is not {'the' if len(tables) == 1 else 'a'} video of this project (its "
        "fingerprint differs); start a new project for it with: keyrecon new"
    )


def shares_frames(one: Table, other: Table) -> bool:
    """Whether two are of one file and have frames in common."""
    if one["fingerprint"] != other["fingerprint"]:
        return False
    (start, end), (begin, stop) = ((t.get("start", 0), t.get("end", np.inf)) for t in (one, other))
    return max(start, begin) < min(end, stop)


def possible_places(folder: Path, tables: Sequence[Table]) -> list[Path]:
    """Where the videos may be: as the project tells, and where they are looked for if moved."""
    recorded = [folder / table["path"] for table in tables]
    return recorded + [place / path.name for path in recorded for place in _beside(folder)]


def _open(folder: Path, table: Table) -> Video:
    path = (folder / table["path"]).resolve()
    if not path.is_file():
        path = _find(folder, table)
    elif not has_fingerprint(path, table["fingerprint"]):
        raise KeyreconError(
            f"{path} has changed since the project was made (its fingerprint differs); "
            "bring the old file back, or start a new project for the new one."
        )
    start, end, slow_motion = table.get("start", 0), table.get("end"), table.get("slow_motion", 1.0)
    return open_video(path, start, end, slow_motion, square_only=False)  # what is marked stays


def _find(folder: Path, table: Table) -> Path:
    for place in _beside(folder):
        candidate = place / Path(table["path"]).name
        if candidate.is_file() and has_fingerprint(candidate, table["fingerprint"]):
            return candidate
    raise KeyreconError(
        f"The video {table['path']} is not where the project expects it; "
        f"tell where it is now with: keyrecon relink {quoted(folder)} VIDEO"
    )


def _beside(folder: Path) -> tuple[Path, Path]:
    return folder, folder.resolve().parent
