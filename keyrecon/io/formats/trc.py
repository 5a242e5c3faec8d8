"""TRC: joints as OpenSim markers, tab-separated text at a constant rate."""

from pathlib import Path

import numpy as np

from keyrecon.io.durable import write_durably
from keyrecon.io.formats.conventions import at_constant_rate
from keyrecon.records import Motion


def write_trc(path: Path, motion: Motion) -> None:
    """Write joints with Y up (x right, z towards the camera), in metres or body heights.

    A motion at a variable rate is resampled, since the format knows one rate.
    """
    points = at_constant_rate(motion)
    frames, joints = points.shape[:2]
    rate, units = f"{motion.fps:.10g}", motion.units.replace(" ", "_")
    numbers = range(1, joints + 1)
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame"
        "\tOrigNumFrames",
        f"{rate}\t{rate}\t{frames}\t{joints}\t{units}\t{rate}\t1\t{frames}",
        "Frame#\tTime\t" + "\t\t\t".join(motion.skeleton.names) + "\t\t",
        "\t\t" + "\t".join(f"X{n}\tY{n}\tZ{n}" for n in numbers),
        "",
    ]
    for frame, row in enumerate(points.reshape(frames, -1)):
        values = "\t".join(np.char.mod("%.6f", row))
        lines.append(f"{frame + 1}\t{frame / motion.fps:.8f}\t{values}")
    write_durably(path, "\n".join(lines) + "\n")
