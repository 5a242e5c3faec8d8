"""What results were made from, so that a page can tell whether a person changed anything since.

A digest of a person's input is kept beside the results in the project's cache. It is of what the
files say, not of their bytes: a file that is written anew with the same marks changes nothing.
"""

import hashlib
import json
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from keyrecon.errors import KeyreconError
from keyrecon.io.durable import write_durably
from keyrecon.io.option_tables import OptionRecord, changed_options, flat_options
from keyrecon.io.project_file import read_project
from keyrecon.io.workspace import GOLF, Workspace
from keyrecon.reading import parse_json, read_text

CLICK_PARTS = ("frame", "size", "joints", "hidden", "left_handed", "stature", "focal", "principal")
"""Keys of golf_clicks.json that count."""


@dataclass(frozen=True)
class RunNotes:
    """What is kept of the run that made the motion."""

    evidence: str
    """`motion_digest` of what it was made from."""
    doubts: tuple[str, ...]
    """What spoke against the track, line by line."""
    advice: tuple[str, ...] = ()
    """What would make the motion better, line by line."""
    camera: str | None = None
    """`camera_digest` of the camera that the report knows, empty for none; None in older notes."""


def marks_digest(workspace: Workspace) -> str:
    """A digest of all joints that a person marked: what older versions noted of a run."""
    return _digest([_parts_of(workspace.annotations_file, ("annotations",))])


def motion_digest(workspace: Workspace, options: OptionRecord, defaults: OptionRecord) -> str:
    """A digest of all input to a run: marks, keyframes, picks, frames of videos, and the options
    that are not the defaults, with the lens that a run would take.

    The path of a video and the order of clicks do not count.
    """
    (picks,) = _parts_of(workspace.picks_file, ("picks",))
    videos = [{n: v for n, v in table.items() if n != "path"} for table in workspace.videos]
    changed = changed_options(options, defaults)
    return _digest(
        [
            _parts_of(workspace.annotations_file, ("annotations",)),
            _parts_of(workspace.keyframes_file, ("upper", "lower")),
            sorted(_digest([pick]) for pick in picks) if isinstance(picks, list) else [],
            videos,
            {name: float(v) if type(v) is int else v for name, v in changed.items()},
        ]
    )


def camera_digest(workspace: Workspace) -> str:
    """A digest of the camera; empty where there is none."""
    try:
        return hashlib.sha256(workspace.camera_file.read_bytes()).hexdigest()
    except OSError:
        return ""


def golf_digest(workspace: Workspace) -> str:
    """A digest of all input to a golf fit: clicks, marks, annotations, and the options kept."""
    options = _golf_options(workspace)
    return _digest(
        [
            _parts_of(workspace.golf_clicks_file, CLICK_PARTS),
            _parts_of(workspace.golf_marks_file, ("keys", "frames")),
            _parts_of(workspace.annotations_file, ("annotations",)),
            *([options] if options else []),
        ]
    )


def _golf_options(workspace: Workspace) -> dict[str, Any]:
    """By dotted names; that no slow motion is searched for among them, as the film plays at its own
    speed. Another speed is told once and for all."""
    try:
        project = read_project(workspace.project_file)
    except KeyreconError:  # who reads the file says what is wrong with it
        return {}
    options = flat_options(project.get("options", {}).get(GOLF, {}))
    return options | ({"slow_motion": 1} if project["video"].get("slow_motion") == 1 else {})


def note_run(workspace: Workspace, notes: RunNotes) -> None:
    """Keep what the motion was made from, what spoke against its track, what would better it."""
    write_durably(_run_file(workspace), json.dumps(asdict(notes)))


def read_run(workspace: Workspace) -> RunNotes | None:
    """What was kept of the run; None for the motion of a golf fit or of an older version."""
    try:
        noted = dict(parse_json(read_text(_run_file(workspace))))
        advice = noted.get("advice", ())  # older versions kept none
        doubts, helps = (tuple(map(str, lines)) for lines in (noted["doubts"], advice))
        return RunNotes(str(noted["evidence"]), doubts, helps, noted.get("camera"))
    except (OSError, ValueError, TypeError, KeyError):  # there is none, or it is torn
        return None


def forget_run(workspace: Workspace) -> None:
    """Drop what was kept of the run, whose motion gives place to another."""
    _run_file(workspace).unlink(missing_ok=True)


def note_fitted(workspace: Workspace, digest: str) -> None:
    """Keep what the last golf fit was made from."""
    _fitted_file(workspace).parent.mkdir(exist_ok=True)
    write_durably(_fitted_file(workspace), digest)


def is_fitted(workspace: Workspace) -> bool:
    """Whether the last golf fit was made from the present input."""
    noted = _fitted_file(workspace)
    return noted.is_file() and noted.read_bytes() == golf_digest(workspace).encode()


def motion_stamp(workspace: Workspace) -> int:
    """When the motion was written; 0 while there is none."""
    return _stamp(workspace.motion_file)


def note_exports(workspace: Workspace, files: Iterable[Path], motion: int) -> None:
    """Keep that files in the project show the motion of this stamp, whatever replaced it since."""
    with workspace.exclusive():
        rows = {_name(workspace, file): [str(_stamp(file)), str(motion)] for file in files}
        noted = json.dumps(_read_exports(workspace) | rows)
        _exports_file(workspace).parent.mkdir(exist_ok=True)
        write_durably(_exports_file(workspace), noted)


def current_exports(workspace: Workspace) -> list[Path]:
    """Files of an export or of a golf fit that show the motion there is.

    Where nothing was noted of one as it is, an export is told by its time. A fit writes its files
    before its motion: they show it unless a run is known to have made another.
    """
    noted, motion = _read_exports(workspace), motion_stamp(workspace)
    exported = {file: _stamp(file) >= motion for file in workspace.exported_files()}
    fitted = dict.fromkeys(workspace.golf_results(), read_run(workspace) is None)

    def is_current(file: Path, is_likely: bool) -> bool:
        known = noted.get(_name(workspace, file))
        if isinstance(known, list) and known[:1] == [str(_stamp(file))]:
            return known[1:] == [str(motion)]
        return is_likely

    return [file for file, is_likely in (exported | fitted).items() if is_current(file, is_likely)]


def note_files(workspace: Workspace) -> tuple[Path, Path]:
    """Where it is kept what the motion, and the last golf fit, were made from."""
    return _run_file(workspace), _fitted_file(workspace)


def _run_file(workspace: Workspace) -> Path:
    return workspace.folder / "cache" / "run.json"


def _exports_file(workspace: Workspace) -> Path:
    return workspace.folder / "cache" / "exports.json"


def _name(workspace: Workspace, file: Path) -> str:
    return file.relative_to(workspace.folder).as_posix()


def _read_exports(workspace: Workspace) -> dict[str, Any]:
    """By name in the project, the stamps of a file and of the motion that it shows."""
    try:
        noted = parse_json(read_text(_exports_file(workspace)))
    except (OSError, ValueError):  # there is none, or it is torn
        return {}
    return noted if isinstance(noted, dict) else {}


def _stamp(file: Path) -> int:
    return file.stat().st_mtime_ns if file.is_file() else 0


def _fitted_file(workspace: Workspace) -> Path:
    return workspace.folder / "cache" / "golf_fitted"


def _digest(facts: list[Any]) -> str:
    return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()


def _parts_of(file: Path, names: Sequence[str]) -> list[Any]:
    """What a JSON file says under some names; None for each where there is no such file."""
    content = {}
    if file.is_file():
        with suppress(ValueError):  # who reads the file says what is wrong with it
            content = parse_json(read_text(file))
    table = content if isinstance(content, dict) else {}
    return [table.get(name) or None for name in names]
