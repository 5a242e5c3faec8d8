"""motion.npz of a golf fit: a motion, and besides what only swings have.

    club3d (T,2,3), club2d (T,2,2)   grip and head, metres in camera axes and px
    club_seen (T)                    where the club was detected; elsewhere it is the model's
    key_postures (4), key_posture_names     frames, not rounded: address, top, hit, finish
    key_postures_shown (4)           which of them the film shows
    vertical (3), left_handed        up in the axes of the camera where it stands; which hand
    camera_turns (T,3,3), camera_shifts (T,3)   where the camera moved: turn @ point + shift has a
                                     point of the axes in which it stands still in those of a frame
    doubts, notes                    what speaks against the fit, and is told of the film

Any reader of motions reads it too.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from keyrecon.golf.records import CameraTurns, RecordedSwing
from keyrecon.io.formats.motion_file import read_motion, write_motion
from keyrecon.reading import check_numbers, read_arrays, reading

KEY_POSTURE_NAMES = ("address", "top", "hit", "finish")


def write_swing(path: Path, swing: RecordedSwing) -> None:
    """Write motion.npz of a swing."""
    write_motion(
        path,
        swing.motion,
        more={
            "club3d": swing.club,
            "club2d": swing.club2d,
            "club_seen": swing.club_seen,
            "key_postures": swing.keys,
            "key_posture_names": np.array(KEY_POSTURE_NAMES),
            "key_postures_shown": np.array(swing.shown),
            "vertical": swing.vertical,
            "left_handed": np.array(swing.left_handed),
            "doubts": np.array(swing.doubts, dtype=np.str_),
            "notes": np.array(swing.notes, dtype=np.str_),
            **_turns(swing.camera),
        },
    )


def read_swing(path: Path) -> RecordedSwing:
    """Read what `write_swing` wrote; raises KeyreconError for a motion that is no swing."""
    motion = read_motion(path)
    frames = len(motion.time)
    remedy = "make it with: keyrecon golf fit VIDEO --clicks FILE --out FOLDER"
    with reading(path, "the motion of a golf fit", remedy):
        data = read_arrays(path)
        for name in ("club3d", "club2d", "key_postures", "vertical"):
            check_numbers(name, data[name])
        return RecordedSwing(
            motion=motion,
            club=data["club3d"].astype(float).reshape(frames, 2, 3),
            club2d=data["club2d"].astype(float).reshape(frames, 2, 2),
            club_seen=data["club_seen"].astype(bool).reshape(frames),
            keys=data["key_postures"].astype(float).reshape(4),
            vertical=data["vertical"].astype(float).reshape(3),
            left_handed=bool(data["left_handed"]),
            doubts=tuple(str(doubt) for doubt in data["doubts"]),
            notes=tuple(str(note) for note in data.get("notes", ())),
            shown=_shown(data.get("key_postures_shown", np.ones(4, bool))),
            camera=_camera(data, frames),
        )


def _turns(camera: CameraTurns | None) -> dict[str, np.ndarray]:
    return {} if camera is None else {"camera_turns": camera.turns, "camera_shifts": camera.shifts}


def _camera(data: Mapping[str, np.ndarray], frames: int) -> CameraTurns | None:
    if "camera_turns" not in data:
        return None
    for name in ("camera_turns", "camera_shifts"):
        check_numbers(name, data[name])
    turns, shifts = data["camera_turns"].astype(float), data["camera_shifts"].astype(float)
    return CameraTurns(turns.reshape(frames, 3, 3), shifts.reshape(frames, 3))


def _shown(stored: np.ndarray) -> tuple[bool, bool, bool, bool]:
    address, top, hit, finish = (bool(one) for one in stored)
    return address, top, hit, finish
