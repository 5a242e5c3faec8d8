"""TRC: joints as OpenSim markers, tab-separated text at a constant rate."""

from pathlib import Path

import numpy as np

from keyrecon.io.durable import write_durably
from keyrecon.io.formats.conventions import World, stand_on_floor
from keyrecon.records import Motion


def write_trc(path: Path, motion: Motion, world: World = None, first_frame: int = 0) -> str:
    """Write joints with Y up (x right, z towards the camera), in metres or body heights.

    Cells of frames without a motion are empty, as OpenSim reads a marker that is missing. Returns
    what was done to them. The format has no comments: the same stands behind the file's
    name in the first line, which readers take as a whole. `first_frame` is the video's frame that
    comes first.
    """
    standing = stand_on_floor(motion, world=world, gaps=True)
    frames, joints = standing.points.shape[:2]
    rate, units = f"{standing.fps:.10g}", standing.units.replace(" ", "_")
    numbers = range(1, joints + 1)
    done = f"Y up; {standing.placing}; {standing.timing}"
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name} (keyrecon: {done})",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame"
        "\tOrigNumFrames",
        f"{rate}\t{rate}\t{frames}\t{joints}\t{units}\t{motion.fps:.10g}\t{first_frame + 1}"
        f"\t{len(motion.time)}",
        "Frame#\tTime\t" + "\t\t\t".join(motion.skeleton.names) + "\t\t",
        "\t\t" + "\t".join(f"X{n}\tY{n}\tZ{n}" for n in numbers),
        "",
    ]
    for frame, row in enumerate(standing.points.reshape(frames, -1)):
        known = np.isfinite(row).all()
        values = "\t".join(np.char.mod("%.6f", row) if known else [""] * len(row))
        lines.append(f"{frame + 1}\t{standing.time[frame]:.8f}\t{values}")
    write_durably(path, "\n".join(lines) + "\n")
    return done
