"""golf_marks.json: corrections of a golf fit, one JSON object in its project folder.

    {"keyrecon_golf_marks": 1, "size": [800, 720],
     "keys": {"start": 31, "top": 84, "hit": 101},
     "frames": [
       {"frame": 84, "joints": {"left_wrist": [402, 180], "left_elbow": [431, 236]},
        "shaft": [[405, 176], [552, 141]]},
       {"frame": 101, "joints": {}, "shaft": [[371, 402], [365, 598]]}]}

`golf fit` reads it as evidence that holds: marked joints to within 5 px, marked instants exactly,
and a swing that contradicts them is not tried. `size` is width and height of the pictures that were
marked; px and frame numbers are those of the project's video. `joints` are any of the Leeds
skeleton, the player's own left and right; `shaft` is the club from between the hands to its head.
`keys` are any of start (the upswing begins), top, hit and finish, in frames, not rounded. All
parts may be empty or left out.
"""

import json
from pathlib import Path

import numpy as np

from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.golf.records import KEY_POSTURES, NO_MARKS, SwingMarks
from keyrecon.io.durable import write_durably
from keyrecon.reading import parse_json, read_text, reading, real, whole

__all__ = ["KEY_POSTURES", "SwingMarks", "golf_marks_text", "read_golf_marks", "write_golf_marks"]
FORMAT = 1
"""Version of the file."""


def read_golf_marks(path: Path, n_frames: int, size: tuple[int, int]) -> SwingMarks:
    """The marks of a video of so many frames of a size; none where there is no such file.

    Raises KeyreconError with what is wrong in the file and what helps.
    """
    if not path.exists():
        return NO_MARKS
    remedy = 'it is a JSON object with "keyrecon_golf_marks", "size", "keys" and "frames"'
    with reading(path, "a file of golf marks", remedy):
        content = parse_json(read_text(path))
        if content["keyrecon_golf_marks"] != FORMAT:
            raise KeyreconError(
                f"{path} is a file of marks of version {content['keyrecon_golf_marks']}; this "
                f"keyrecon reads {FORMAT}."
            )
        width, height = (whole(n) for n in content["size"])
        if (width, height) != size:
            raise KeyreconError(
                f"{path}: the marks were made on pictures of {width} x {height} px, but this "
                f"video has {size[0]} x {size[1]}; mark again in this video."
            )
        rows = {whole(row["frame"]): row for row in content.get("frames", ())}
        frames = sorted(rows)
        _check_frames([*frames, *content.get("keys", {}).values()], n_frames, path)
        joints = np.full((len(frames), len(LSP14.names), 2), np.nan)
        shafts = np.full((len(frames), 2, 2), np.nan)
        for k, frame in enumerate(frames):
            for name, place in rows[frame].get("joints", {}).items():
                joints[k, _joint(name, path)] = _point(place, size, path)
            if (ends := rows[frame].get("shaft")) is not None:
                hands, head = ends
                shafts[k] = _point(hands, size, path), _point(head, size, path)
        keys = _keys(content.get("keys", {}), path)
        return SwingMarks(np.array(frames, np.int64), joints, shafts, keys)


def write_golf_marks(path: Path, marks: SwingMarks, size: tuple[int, int]) -> None:
    """Write marks; `size` is that of the video's pictures."""
    write_durably(path, golf_marks_text(marks, size))


def golf_marks_text(marks: SwingMarks, size: tuple[int, int]) -> str:
    """Marks as their file has them, one frame to a line."""
    rows = []
    for frame, joints, ends in zip(marks.frames.tolist(), marks.joints, marks.shafts, strict=True):
        named = zip(LSP14.names, joints, strict=True)
        row: dict[str, object] = {
            "frame": frame,
            "joints": {name: place.tolist() for name, place in named if np.isfinite(place).all()},
        }
        if np.isfinite(ends).all():
            row["shaft"] = ends.tolist()
        rows.append(json.dumps(row))
    named_keys = zip(KEY_POSTURES, marks.keys.tolist(), strict=True)
    keys = {name: key for name, key in named_keys if np.isfinite(key)}
    body = ",\n    ".join(rows)
    return (
        f'{{\n  "keyrecon_golf_marks": {FORMAT},\n  "size": {json.dumps(list(size))},\n'
        f'  "keys": {json.dumps(keys)},\n  "frames": [\n    {body}\n  ]\n}}\n'
    )


def _check_frames(frames: list, n_frames: int, path: Path) -> None:
    for frame in frames:
        if not 0 <= real(frame) <= n_frames - 1:
            raise KeyreconError(
                f"{path} marks frame {frame}, but the video has frames 0 to {n_frames - 1}."
            )


def _joint(name: str, path: Path) -> int:
    if name not in LSP14.names:
        raise KeyreconError(
            f"{path} marks '{name[:40]}', which is no joint; use {', '.join(LSP14.names)}."
        )
    return LSP14.index(name)


def _point(place: list, size: tuple[int, int], path: Path) -> tuple[float, float]:
    x, y = (real(number) for number in place)
    if not (abs(x - size[0] / 2) <= size[0] and abs(y - size[1] / 2) <= size[1]):
        raise KeyreconError(f"{path}: the mark at ({x:g}, {y:g}) is far outside of the picture.")
    return x, y


def _keys(named: dict, path: Path) -> np.ndarray:
    if strange := sorted(set(named) - set(KEY_POSTURES)):
        raise KeyreconError(
            f"{path} marks '{strange[0][:40]}', which is no key posture; use "
            f"{', '.join(KEY_POSTURES)}."
        )
    keys = np.array([real(named[name]) if name in named else np.nan for name in KEY_POSTURES])
    if (np.diff(keys[np.isfinite(keys)]) <= 0).any():
        raise KeyreconError(f"{path}: start, top, hit and finish must be marked in this order.")
    return keys
