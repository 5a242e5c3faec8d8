"""BVH: the motion as a humanoid that Blender, MotionBuilder and game engines can retarget.

Metres (or body heights), Y up; the rest pose is a T-pose that faces +Z, which Blender's default
axes (-Z forward, Y up) turn to its front view; tick "Update Scene FPS" on import. How joints hang
together and turn: `formats.humanoid`.

Angles go on without jumps: each frame takes the triple that is nearest to the frame before, full
turns included. Where a joint's middle angle comes near 90 degrees, the outer two would swing
against each other; such a joint is written in another order of its axes, as the format allows.
"""

import warnings
from pathlib import Path

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from keyrecon.io.durable import write_durably
from keyrecon.io.formats.conventions import World, stand_on_floor
from keyrecon.io.formats.humanoid import Humanoid, Turns, make_humanoid
from keyrecon.records import Motion

ORDERS = ("ZXY", "XYZ", "YZX")
"""Orders of rotation channels, one for each axis in the middle; the first is that of most files,
with Y, the spin of an upright body, innermost."""
LOCK = np.radians(75)
"""Middle angle from which on another order is looked for."""


def write_bvh(path: Path, motion: Motion, world: World = None) -> str:
    """Write the motion at a constant rate; returns what was done.

    A BVH has no place for it (its readers take every word for a joint or a number, and find joints
    by their names), so it stands in a text beside the file, NAME.bvh.txt.
    Raises KeyreconError for a skeleton without the limbs, hips and neck of a person.
    """
    standing = stand_on_floor(motion, world=world)
    figure = make_humanoid(standing)
    write_durably(path, _format(figure, standing.fps))
    placed = f"Y up, x to the right of the picture, z towards the camera; {standing.placing}; "
    done = placed + standing.standing_still().timing + figure.differences(standing.units)
    beside = f"{path.name}, written by keyrecon, in {standing.units}: {done}\n"
    write_durably(path.with_name(path.name + ".txt"), beside)
    return done


def _format(figure: Humanoid, fps: float) -> str:
    """The file's text."""
    depths: list[int] = []
    lines, columns = ["HIERARCHY"], [figure.root]
    for number, joint in enumerate(figure.joints):
        depth = 0 if joint.parent < 0 else depths[joint.parent] + 1
        lines += [
            "\t" * d + "}" for d in range(max(depths[-1:], default=0), depth - 1, -1) if depths
        ]
        depths.append(depth)
        order, angles = _angles(figure.local_turn(number))
        columns.append(angles)
        channels = [f"{axis}rotation" for axis in order]
        if joint.parent < 0:
            channels = [f"{axis}position" for axis in "XYZ"] + channels
        pad = "\t" * depth
        lines += [
            f"{pad}{'ROOT' if joint.parent < 0 else 'JOINT'} {joint.name}",
            f"{pad}{{",
            # The root's place is told by its channels; readers differ in whether they add both.
            f"{pad}\tOFFSET {_numbers(0 * joint.offset if joint.parent < 0 else joint.offset)}",
            f"{pad}\tCHANNELS {len(channels)} {' '.join(channels)}",
        ]
        if joint.end is not None:
            lines += [f"{pad}\tEnd Site", f"{pad}\t{{"]
            lines += [f"{pad}\t\tOFFSET {_numbers(joint.end)}", f"{pad}\t}}"]
    lines += _closing(depths[-1], 0)
    values = np.concatenate(columns, axis=1)
    lines += ["MOTION", f"Frames: {len(values)}", f"Frame Time: {1 / fps:.10g}"]
    rounded = np.round(values, 6) + 0.0  # no zero is negative
    lines += [" ".join(np.char.mod("%.6f", row)) for row in rounded]
    return "\n".join(lines) + "\n"


def _closing(depth: int, to: int) -> list[str]:
    """Braces that close what stands between two depths of the tree."""
    return ["\t" * d + "}" for d in range(depth, to - 1, -1)]


def _numbers(values: Float[np.ndarray, "3"]) -> str:
    return " ".join(f"{v:.6f}" for v in values + 0.0)


def _angles(turns: Turns) -> tuple[str, Float[np.ndarray, "T 3"]]:
    """An order of axes, and degrees that go on from frame to frame."""
    choices = {}
    for order in ORDERS:
        with warnings.catch_warnings():
            # At gimbal lock the third angle is free and scipy takes 0: the rotation is still right.
            warnings.filterwarnings("ignore", "Gimbal lock", UserWarning)
            choices[order] = Rotation.from_matrix(turns).as_euler(order)
        if np.abs(choices[order][:, 1]).max() < LOCK:
            break
    order = min(choices, key=lambda order: float(np.abs(choices[order][:, 1]).max()))
    return order, np.degrees(_unwrap(choices[order]))


def _unwrap(first: Float[np.ndarray, "T 3"]) -> Float[np.ndarray, "T 3"]:
    """The same rotations by angles as near as can be to those of the frame before."""
    # The same rotation has a second triple of angles; it goes on where the first one turns over.
    second = first * [1, -1, 1] + np.pi
    angles = first.copy()
    for frame in range(1, len(angles)):
        before = angles[frame - 1]
        same = np.stack([first[frame], second[frame]])
        same += 2 * np.pi * np.round((before - same) / (2 * np.pi))
        angles[frame] = same[np.abs(same - before).sum(axis=1).argmin()]
    return angles
