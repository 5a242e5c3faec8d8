"""C3D marker trajectories, and joint centres from the marker set of the CMU database.

Markers lie on the skin, so joint centres are computed:

- hip: from the four pelvis markers with Harrington's regression (J. Biomech. 40, 2007);
- knee and elbow: the outer marker moved inwards along the joint's hinge axis by half the
  joint's width. The axis is the mean of thigh x shank (upper arm x forearm), weighted by the
  squared sine of flexion and held fixed in the segment above, so that a straight limb has one;
- ankle: the outer marker moved inwards along the knee's axis;
- wrist: midway between its two markers;
- shoulder: below its marker along the trunk by 17 % of the distance between both (Rab et al.,
  Gait & Posture 15, 2002);
- neck: midway between C7 and clavicle; crown: above the plane of the head band;
- club: the line through the markers on its shaft, from beside the hands to the last marker.

Against bones this is wrong by 1-2 cm at limbs and 2-3 cm at hips, shoulders and crown; limb
lengths vary by some per cent over a swing because skin moves. A marker that is missing for some
frames is interpolated by a shape-preserving cubic and held at the ends.

Written are joints as markers at a constant rate, for biomechanics programs: with the `c3d`
package, because it keeps files of more than 65,535 frames whole (22 minutes at 50 fps), in
millimetres and with Z up, as such programs expect, or in body heights.
"""

import io
import warnings
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.interpolate import PchipInterpolator

from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.io.durable import write_durably
from keyrecon.io.formats.conventions import World, stand_on_floor
from keyrecon.io.formats.rigs import MAX_RATE, MIN_RATE
from keyrecon.numerics.geometry import unit_vectors
from keyrecon.reading import reading
from keyrecon.records import Motion

Points = Float[np.ndarray, "T 3"]

NAMES = {
    "LFWT": "LASI", "RFWT": "RASI", "LBWT": "LPSI", "RBWT": "RPSI",
}  # fmt: skip
"""CMU's names of the pelvis markers, in those of Plug-in Gait."""

HALF_WIDTHS = {"knee": 0.055, "elbow": 0.040, "ankle": 0.042}
"""From a 14 mm marker's centre to the joint's, metres: half an adult's mean joint width
(knee 96, elbow 66, ankle 70 mm; ANSUR II, Gordon et al. 2014) and the marker's radius."""

CLUB_MARKERS = "WEP"
"""How the names of markers on a club or bat begin in the CMU database."""

NOTES_GROUP = 61
"""Number of our own group of parameters; standard ones are counted from 1."""

HEAD_BAND_TO_CROWN = 0.09
"""Height of the crown above a head band at the forehead, metres."""

_direction = partial(unit_vectors, min_length=0.0)
"""Directions between markers; NaN, unknown, where two markers are in one place."""


@dataclass(frozen=True, eq=False)
class MarkerJoints:
    """Joints from markers, in metres and the file's axes."""

    joints: Float[np.ndarray, "T 14 3"]
    toes: Float[np.ndarray, "T 2 3"]
    fps: float
    club: Float[np.ndarray, "T 2 3"] | None
    """Beside the hands, and the end of the head; None without markers on a club."""


def read_markers(path: Path) -> MarkerJoints:
    """Read a C3D file with CMU's or Plug-in Gait's markers.

    Raises KeyreconError for a file that is no C3D, that lacks markers, or without c3d.
    """
    markers, fps = read_points(path)
    named = {}
    for label, points in markers.items():
        name = label.split(":")[-1].strip().upper()
        named[NAMES.get(name, name)] = points
    needed = {
        "C7", "CLAV", "LASI", "RASI", "LPSI", "RPSI", "LFHD", "RFHD", "LBHD", "RBHD",
        *(side + name for side in "RL" for name in
          ("SHO", "UPA", "ELB", "WRA", "WRB", "THI", "KNE", "ANK", "TOE")),
    }  # fmt: skip
    absent = sorted(n for n in needed if n not in named or np.isnan(named[n]).all())
    if absent:
        raise KeyreconError(
            f"{path} has no markers {', '.join(absent)}; joint centres need the marker set of the "
            "CMU database or Plug-in Gait."
        )
    shaft = sorted(name for name in named if name.startswith(CLUB_MARKERS))
    filled = {name: fill_gaps(named[name]) for name in [*needed, *shaft]}
    toes = np.stack([filled["RTOE"], filled["LTOE"]], axis=1)
    joints = _joint_centres(filled)
    return MarkerJoints(joints, toes, fps, _find_club(joints, [filled[name] for name in shaft]))


def read_points(path: Path) -> tuple[dict[str, Points], float]:
    """Trajectories by label, metres, NaN where missing (residual below 0), and the frame rate.

    Raises KeyreconError for a file that is damaged or holds fewer frames than it tells of.
    """
    try:
        import c3d
    except ImportError as fault:
        raise KeyreconError(
            "Reading C3D needs the c3d package; install it with: pip install 'keyrecon[c3d]'"
        ) from fault
    with reading(path, "a whole C3D file", "export it again"), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of what c3d wonders about, what matters is checked here
        with path.open("rb") as file:
            reader = c3d.Reader(file)
            if not reader.point_used:
                raise ValueError("it has no markers")
            count = reader.last_frame - _first_frame(reader) + 1
            frames = [points.copy() for _, points, _ in islice(reader.read_frames(), count)]
        if count < 1 or len(frames) < count:
            raise ValueError(f"it tells of {count} frames and holds {len(frames)}")
        rate = float(reader.point_rate)
        if not MIN_RATE <= rate <= MAX_RATE:
            raise ValueError(f"it tells of {rate:g} frames per second")
        labels = [str(label).strip() for label in reader.point_labels]
        points = _metres_per_unit(reader) * np.array(frames, dtype=np.float64).transpose(1, 0, 2)
        points[points[..., 3] < 0, :3] = np.nan
        return dict(zip(labels, points[..., :3], strict=False)), rate


def _first_frame(reader: Any) -> int:
    """The number of the first frame; c3d itself counts its second word as 65535 frames each."""
    parameter = reader.get("TRIAL:ACTUAL_START_FIELD")
    if parameter is None:
        return int(reader.header.first_frame)
    low, high = (int(word) for word in parameter.uint16_array[:2])
    return low + 65536 * high


def _metres_per_unit(reader: Any) -> float:
    parameter = reader.get("POINT:UNITS")
    unit = "mm" if parameter is None else parameter.string_value.strip(" \0").lower() or "mm"
    metres = {"mm": 0.001, "cm": 0.01, "m": 1.0}.get(unit)
    if metres is None:
        raise ValueError(f"it is in '{unit}'; millimetres, centimetres or metres work")
    return metres


def fill_gaps(points: Points) -> Points:
    """Missing frames interpolated; those before the first and after the last seen are held."""
    seen = np.flatnonzero(np.isfinite(points).all(axis=1))
    if len(seen) == len(points):
        return points
    if len(seen) == 1:
        return np.repeat(points[seen], len(points), axis=0)
    frames = np.clip(np.arange(len(points)), seen[0], seen[-1])
    return PchipInterpolator(seen, points[seen])(frames)


def _joint_centres(m: dict[str, Points]) -> Float[np.ndarray, "T 14 3"]:
    """All joints of LSP14 from filled markers, metres."""
    centres = dict(zip(("right_hip", "left_hip"), _hips(m), strict=True))
    neck = (m["C7"] + m["CLAV"]) / 2
    hips = (centres["right_hip"] + centres["left_hip"]) / 2
    breadth = np.median(np.linalg.norm(m["RSHO"] - m["LSHO"], axis=1))
    for side, other, letter in (("right", "left", "R"), ("left", "right", "L")):
        hip = centres[f"{side}_hip"]
        knee, axis = _hinge(hip, m[letter + "THI"], m[letter + "KNE"], m[letter + "ANK"])
        inward = axis * np.sign(np.sum(axis * (centres[f"{other}_hip"] - hip)))
        centres[f"{side}_knee"] = knee + HALF_WIDTHS["knee"] * inward
        centres[f"{side}_ankle"] = m[letter + "ANK"] + HALF_WIDTHS["ankle"] * inward
        shoulder = m[letter + "SHO"] + 0.17 * breadth * _direction(hips - neck)
        wrist = (m[letter + "WRA"] + m[letter + "WRB"]) / 2
        elbow, axis = _hinge(shoulder, m[letter + "UPA"], m[letter + "ELB"], wrist)
        # Flexion turns the forearm forwards and up, so that upper arm x forearm points to the
        # body's right on both arms, and inwards is left of the right elbow.
        centres[f"{side}_shoulder"], centres[f"{side}_wrist"] = shoulder, wrist
        centres[f"{side}_elbow"] = elbow + HALF_WIDTHS["elbow"] * axis * (
            -1 if side == "right" else 1
        )
    band = (m["LFHD"] + m["RFHD"] + m["LBHD"] + m["RBHD"]) / 4
    up = _direction(np.cross(m["RFHD"] - m["LBHD"], m["LFHD"] - m["RBHD"]))
    centres["neck"], centres["head_top"] = neck, band + HEAD_BAND_TO_CROWN * up
    return np.stack([centres[name] for name in LSP14.names], axis=1)


def _find_club(
    joints: Float[np.ndarray, "T 14 3"], shaft: list[Points]
) -> Float[np.ndarray, "T 2 3"] | None:
    """Both ends of a club from two or more markers along it."""
    if len(shaft) < 2:
        return None
    wrists = [LSP14.index("right_wrist"), LSP14.index("left_wrist")]
    hands = joints[:, wrists].mean(axis=1)
    far = sorted(shaft, key=lambda marker: np.linalg.norm(marker - hands, axis=1).mean())
    way = _direction(far[-1] - far[0])
    beside = far[0] + way * np.sum(way * (hands - far[0]), axis=1, keepdims=True)
    return np.stack([beside, far[-1]], axis=1)


def _hips(m: dict[str, Points]) -> tuple[Points, Points]:
    """Right and left hip centre by Harrington's regression (his Table 2, in metres)."""
    front, back = (m["RASI"] + m["LASI"]) / 2, (m["RPSI"] + m["LPSI"]) / 2
    across = _direction(m["RASI"] - m["LASI"])
    up = _direction(np.cross(across, front - back))
    forward = np.cross(up, across)
    width = np.median(np.linalg.norm(m["RASI"] - m["LASI"], axis=1))
    depth = np.median(np.linalg.norm(front - back, axis=1))
    middle = front - (0.24 * depth + 0.0099) * forward - (0.30 * width + 0.0109) * up
    aside = (0.33 * width + 0.0073) * across
    return middle + aside, middle - aside


def _hinge(upper: Points, side: Points, marker: Points, lower: Points) -> tuple[Points, Points]:
    """The marker, and the joint's axis held fixed in the segment of upper, side and marker."""
    along = _direction(marker - upper)
    across = np.cross(along, side - upper)
    frame = np.stack([along, _direction(across), np.cross(along, _direction(across))], axis=2)
    turn = np.cross(along, _direction(lower - marker))
    # |turn| is the sine of flexion and its direction the axis: their product weighs by sin^2.
    local = np.einsum("tij,ti,t->j", frame, turn, np.linalg.norm(turn, axis=1))
    return marker, frame @ (local / np.linalg.norm(local))


def write_c3d(path: Path, motion: Motion, world: World = None) -> str:
    """Write joints with Z up, x right, y away from the camera; returns what was done to them.

    The same stands in the parameter KEYRECON:NOTES. Raises KeyreconError
    without the c3d package.
    """
    try:
        import c3d
    except ImportError as fault:
        raise KeyreconError(
            "Writing C3D needs the c3d package; install it with: pip install 'keyrecon[c3d]'"
        ) from fault
    standing = stand_on_floor(motion, world=world, gaps=True)
    millimetres = standing.units == "m"
    # The column behind x, y, z is the residual: 0, measured by one camera group; -1, not seen.
    rows = np.zeros((*standing.points.shape[:2], 5), dtype=np.float32)
    rows[..., :3] = standing.points[..., [0, 2, 1]] * np.array([1, -1, 1])
    rows[..., :3] *= 1000 if millimetres else 1
    rows[~standing.known] = (0, 0, 0, -1, 0)
    writer = c3d.Writer(point_rate=standing.fps, point_units="mm" if millimetres else "bh")
    writer.set_point_labels(list(motion.skeleton.names))
    writer.set_screen_axis(X="+X", Y="+Z")
    axes = "Z up, x right, y away from the camera"
    _add_notes(writer, axes, standing.placing, standing.timing)
    no_analog = np.zeros((0, 0), dtype=np.float32)
    writer.add_frames([(row, no_analog) for row in rows])
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "No analog data", UserWarning)
        writer.write(buffer)
    write_durably(path, buffer.getvalue())
    return f"{axes}; {standing.placing}; {standing.timing}"


def _add_notes(writer: Any, *notes: str) -> None:
    """Text as a parameter of our own; a line of the format holds 255 characters at most."""
    width = min(255, max(map(len, notes)))
    lines = "".join(note[:width].ljust(width) for note in notes)
    group = writer.add_group(NOTES_GROUP, "KEYRECON", "How the points were made")
    group.add_str("NOTES", "", lines, width, len(notes))
