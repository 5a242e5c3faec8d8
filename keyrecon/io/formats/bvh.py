"""BVH: a tree of joints with offsets, then one line of channels per frame.

Angles are degrees, rotations intrinsic in the order in which the channels stand, columns in the
order of the hierarchy. Position channels, at the root or elsewhere, take the place of the
offset, as in MotionBuilder and Blender. The format knows neither unit nor axes;
`formats.rigs` finds both from the figure's size and posture.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from keyrecon.io.formats.rigs import MAX_RATE, MIN_RATE, CapturedFigure
from keyrecon.reading import check_numbers, reading


@dataclass
class _ReadNode:
    """A joint while the hierarchy is read."""

    name: str
    parent: int
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    channels: list[str] = field(default_factory=list)


def read_bvh(path: Path) -> CapturedFigure:
    """Read a BVH file and put its figure in place; raises KeyreconError for a broken file."""
    with reading(path, "a whole BVH file", "export it again from its source"):
        words = path.read_text(encoding="utf-8", errors="replace").split()
        nodes, start = _read_hierarchy(words)
        values, seconds = _read_motion(words, start, sum(len(n.channels) for n in nodes))
        positions, rotations = place_joints(nodes, values)
        return CapturedFigure(
            names=tuple(n.name for n in nodes),
            parents=tuple(n.parent for n in nodes),
            positions=check_numbers("a position", positions),
            rotations=check_numbers("a rotation", rotations),
            fps=round(1 / seconds, 3),
        )


def _read_hierarchy(words: list[str]) -> tuple[list[_ReadNode], int]:
    """Joints in file order, and the index of the word behind MOTION."""
    if not words or words[0].upper() != "HIERARCHY":
        raise ValueError("it does not begin with HIERARCHY")
    nodes: list[_ReadNode] = []
    open_nodes: list[int] = []
    i = 1
    while (word := words[i].upper()) != "MOTION":
        if word == "{":
            open_nodes.append(len(nodes) - 1)
            i += 1
        elif word == "}":
            open_nodes.pop()
            i += 1
        elif word in ("ROOT", "JOINT", "END"):
            parent = open_nodes[-1] if open_nodes else -1
            name = f"{nodes[parent].name} end" if word == "END" else words[i + 1]
            nodes.append(_ReadNode(name, parent))
            i += 2
        else:
            i = _read_property(nodes[-1], words, i)
    if open_nodes:
        raise ValueError(f"the joint {nodes[open_nodes[-1]].name} is not closed")
    return nodes, i + 1


def _read_property(node: _ReadNode, words: list[str], i: int) -> int:
    """Give `node` the offset or the channels that begin at word `i`; the word behind them."""
    if words[i].upper() == "OFFSET":
        x, y, z = map(float, words[i + 1 : i + 4])
        node.offset = (x, y, z)
        return i + 4
    if words[i].upper() == "CHANNELS":
        end = i + 2 + int(words[i + 1])
        node.channels = [_channel(word) for word in words[i + 2 : end]]
        if end < i + 2 or len(set(node.channels)) < len(node.channels):
            line = " ".join(words[i : max(end, i + 2)])
            raise ValueError(f"the joint {node.name} cannot have '{line}'")
        return end
    raise ValueError(f"'{words[i]}' in the hierarchy is not understood")


def _channel(word: str) -> str:
    """'Xposition' or 'Zrotation' as ('Xp', 'Zr')."""
    channel = word[:1].upper() + word[1:2].lower()
    if channel not in ("Xp", "Yp", "Zp", "Xr", "Yr", "Zr"):
        raise ValueError(f"channel '{word}' is not known")
    return channel


def _read_motion(
    words: list[str], start: int, width: int
) -> tuple[Float[np.ndarray, "T C"], float]:
    head = words[start : start + 5]
    if [w.lower().rstrip(":") for w in (head[0], head[2], head[3])] != ["frames", "frame", "time"]:
        raise ValueError("'Frames:' and 'Frame Time:' are missing behind MOTION")
    count, seconds = int(head[1]), float(head[4])
    values = np.array(words[start + 5 :], dtype=np.float64)
    if values.size != count * width:
        raise ValueError(
            f"{values.size} numbers for {count} frames of {width} channels; "
            f"{count * width} are expected"
        )
    if count < 1 or not np.isfinite(values).all():
        raise ValueError("no frames, or numbers that are not finite")
    if not 1 / MAX_RATE <= seconds <= 1 / MIN_RATE:
        raise ValueError(f"a frame cannot take {seconds:g} s")
    return values.reshape(count, width), seconds


def place_joints(
    nodes: list[_ReadNode], values: Float[np.ndarray, "T C"]
) -> tuple[Float[np.ndarray, "T N 3"], Float[np.ndarray, "T N 3 3"]]:
    """Forward kinematics: positions and rotations of every joint, all frames at once."""
    frames = len(values)
    positions = np.empty((frames, len(nodes), 3))
    rotations = np.empty((frames, len(nodes), 3, 3))
    column = 0
    for j, node in enumerate(nodes):
        channels = values[:, column : column + len(node.channels)]
        column += len(node.channels)
        shift = np.tile(np.array(node.offset), (frames, 1))
        for k, channel in enumerate(node.channels):
            if channel[1] == "p":
                shift[:, "XYZ".index(channel[0])] = channels[:, k]
        turns = [k for k, channel in enumerate(node.channels) if channel[1] == "r"]
        local = np.broadcast_to(np.eye(3), (frames, 3, 3))
        if turns:
            order = "".join(node.channels[k][0] for k in turns)
            local = Rotation.from_euler(order, channels[:, turns], degrees=True).as_matrix()
        if node.parent < 0:
            positions[:, j], rotations[:, j] = shift, local
        else:
            above = rotations[:, node.parent]
            positions[:, j] = positions[:, node.parent] + np.einsum("tij,tj->ti", above, shift)
            rotations[:, j] = above @ local
    return positions, rotations
