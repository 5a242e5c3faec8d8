"""Acclaim ASF + AMC, the CMU motion-capture database's own format.

The ASF file holds bones: direction and length in world axes at rest, and an axis C in which the
bone's degrees of freedom are measured. A bone turns by L = C M C^-1, with M from the AMC values,
and its end lies at the parent's end + R (length * direction), R = R_parent L. Rotations are
given as rx ry rz about fixed axes in that order, M = Rz Ry Rx. Points are named by the bone
that ends there; the figure's unit is the file's own (CMU: metres = value * 0.0254 / 0.45).
CMU's files do not carry a frame rate; the database was recorded at 120 Hz, with a few trials at 60.
"""

import logging
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from keyrecon.errors import KeyreconError
from keyrecon.io.formats.rigs import MAX_RATE, MIN_RATE, CapturedFigure
from keyrecon.reading import check_numbers, reading

CMU_RATE = 120.0
"""Frames per second of the CMU database's captures; the format itself has no place for a rate, so
this is assumed, with a warning, where no comment of the file tells it."""
ROOT_CHANNELS = {"TX", "TY", "TZ", "RX", "RY", "RZ"}
RATE_WORDS = ("framerate", "frame-rate", "fps", "samples-per-second")
"""Words of comments and keyword lines under which exporters note the rate."""
logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class _Bone:
    name: str
    parent: str
    end: tuple[float, float, float]
    axis: tuple[float, float, float]
    axis_order: str
    freedoms: tuple[str, ...]


def find_asf(path: Path) -> Path:
    """The skeleton of an AMC file: the same name, or the subject's (11_01.amc -> 11.asf)."""
    stems = [path.stem, path.stem.split("_")[0]]
    for stem in stems:
        for suffix in (".asf", ".ASF"):
            if (candidate := path.with_name(stem + suffix)).is_file():
                return candidate
    others = sorted(p for p in path.parent.iterdir() if p.suffix.lower() == ".asf")
    if len(others) == 1:
        return others[0]
    raise KeyreconError(
        f"{path} has no skeleton beside it; put {stems[1]}.asf into the same folder."
    )


def read_acclaim(path: Path) -> CapturedFigure:
    """Read an AMC file with its ASF; raises KeyreconError for a broken or missing one."""
    skeleton = find_asf(path)
    pair = f"a whole ASF/AMC pair with {skeleton.name}"
    with reading(path, pair, "download both again"):
        order, degrees, bones = _read_asf(skeleton.read_text(errors="replace"))
        text = path.read_text(errors="replace")
        fps = _noted_rate(text)
        figure = _place_bones(order, degrees, bones, _read_amc(text), fps or CMU_RATE)
    if fps is None:
        logger.warning(
            "%s does not say its rate; taken as %g frames per second, CMU's.", path, CMU_RATE
        )
    return figure


def _read_asf(text: str) -> tuple[list[str], bool, list[_Bone]]:
    """Order of the root's channels, whether angles are degrees, bones with parents first."""
    lines = [line.split("#")[0] for line in text.splitlines()]
    sections: dict[str, list[str]] = {}
    name = ""
    for line in lines:
        if line.startswith(":"):
            name = line[1:].split()[0].lower()
            sections[name] = []
        elif name:
            sections[name].append(line)
    if missing := {"root", "bonedata", "hierarchy"} - sections.keys():
        raise ValueError(f"no section :{sorted(missing)[0]}")
    orders = [line.split()[1:] for line in sections["root"] if line.split()[:1] == ["order"]]
    if not orders or {word.upper() for word in orders[0]} != ROOT_CHANNELS:
        raise ValueError("no 'order' of TX TY TZ RX RY RZ in :root")
    units = " ".join(sections.get("units", [])).lower()
    blocks = re.findall(r"\bbegin\b(.*?)\bend\b", "\n".join(sections["bonedata"]), re.DOTALL)
    described = {values["name"][0]: values for values in map(_read_block, blocks)}
    bones = []
    for line in sections["hierarchy"]:
        parent, *children = line.split() or ["begin"]
        if parent in ("begin", "end"):
            continue
        bones += [_make_bone(child, parent, described[child]) for child in children]
    return [word.upper() for word in orders[0]], "rad" not in units, bones


def _read_block(block: str) -> dict[str, list[str]]:
    """Keyword to values of one bone."""
    return {words[0].lower(): words[1:] for line in block.splitlines() if (words := line.split())}


def _make_bone(name: str, parent: str, values: dict[str, list[str]]) -> _Bone:
    length = float(values["length"][0])
    x, y, z = (length * float(v) for v in values["direction"][:3])
    a, b, c = map(float, values["axis"][:3])
    freedoms = tuple(v.lower() for v in values.get("dof", []))
    return _Bone(name, parent, (x, y, z), (a, b, c), values["axis"][3].lower(), freedoms)


def _noted_rate(text: str) -> float | None:
    """Frames per second as a comment (# or :) of the file notes it; None where none does."""
    for line in text.splitlines():
        words = line.lstrip("#: ").lower().replace("=", " ").replace(":", " ").split()
        if line[:1] in ("#", ":") and len(words) > 1 and words[0] in RATE_WORDS:
            if not MIN_RATE <= (rate := float(words[1])) <= MAX_RATE:
                raise ValueError(f"it tells of {rate:g} frames per second")
            return rate
    return None


def _read_amc(text: str) -> dict[str, np.ndarray]:
    """Values of every bone over all frames, (T, number of its freedoms)."""
    values: dict[str, list[list[float]]] = {}
    count = 0
    for line in text.splitlines():
        words = line.split()
        if not words or words[0][0] in "#:":
            continue
        if len(words) == 1 and words[0].isdigit():
            count += 1
        else:
            values.setdefault(words[0], []).append([float(w) for w in words[1:]])
    if short := [name for name, rows in values.items() if len(rows) != count]:
        raise ValueError(f"{short[0]} has values in {len(values[short[0]])} of {count} frames")
    if not count:
        raise ValueError("the AMC file has no frames")
    return {name: np.array(rows) for name, rows in values.items()}


def _place_bones(
    order: list[str], degrees: bool, bones: list[_Bone], frames: dict[str, np.ndarray], fps: float
) -> CapturedFigure:
    root = frames["root"]
    count = len(root)
    names = ["root", *(bone.name for bone in bones)]
    positions = np.empty((count, len(names), 3))
    rotations = np.empty((count, len(names), 3, 3))
    positions[:, 0] = root[:, [order.index(f"T{axis}") for axis in "XYZ"]]
    turns = [i for i, word in enumerate(order) if word.startswith("R")]
    turn_order = "".join(order[i][1].lower() for i in turns)
    rotations[:, 0] = Rotation.from_euler(turn_order, root[:, turns], degrees=degrees).as_matrix()
    if len(set(names)) < len(names):
        raise ValueError("a bone stands in :hierarchy twice")
    for i, bone in enumerate(bones, start=1):
        above = names.index(bone.parent)
        if above >= i:
            raise ValueError(f"{bone.name} stands in :hierarchy before its parent {bone.parent}")
        turn = _turn(bone, frames, degrees).as_matrix()
        rotations[:, i] = rotations[:, above] @ turn
        positions[:, i] = positions[:, above] + rotations[:, i] @ np.array(bone.end)
    parents = (-1, *(names.index(bone.parent) for bone in bones))
    return CapturedFigure(
        tuple(names),
        parents,
        check_numbers("a position", positions),
        check_numbers("a rotation", rotations),
        fps,
    )


def _turn(bone: _Bone, frames: dict[str, np.ndarray], degrees: bool) -> Rotation:
    """L = C M C^-1 in every frame; the identity for a bone without freedoms."""
    axis = Rotation.from_euler(bone.axis_order, bone.axis, degrees=degrees)
    turns = [k for k, word in enumerate(bone.freedoms) if word.startswith("r")]
    if not turns or bone.name not in frames:
        return Rotation.identity(len(frames["root"]))
    order = "".join(bone.freedoms[k][1] for k in turns)
    return (
        axis * Rotation.from_euler(order, frames[bone.name][:, turns], degrees=degrees) * axis.inv()
    )
