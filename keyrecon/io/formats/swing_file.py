"""motion.npz of a golf fit: a motion, and besides what only swings have.

    club3d (T,2,3), club2d (T,2,2)   grip and head, metres in camera axes and px
    club_seen (T)                    where the club was detected; elsewhere it is the model's
    key_postures (4), key_posture_names     frames, not rounded: address, top, hit, finish
    key_postures_shown (4)           which of them the film shows
    vertical (3), left_handed        up in camera axes; which hand
    doubts, notes                    what speaks against the fit, and is told of the film

Any reader of motions reads it too.
"""

from pathlib import Path

import numpy as np

from keyrecon.golf.records import RecordedSwing
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
        )


def _shown(stored: np.ndarray) -> tuple[bool, bool, bool, bool]:
    address, top, hit, finish = (bool(one) for one in stored)
    return address, top, hit, finish
