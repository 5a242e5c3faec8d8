"""C3D: joints as markers at a constant rate, for biomechanics programs.

Written with the `c3d` package, because it keeps files of more than 65,535 frames whole (22
minutes at 50 fps); millimetres, as such programs expect, or body heights.
"""

import io
import warnings
from pathlib import Path

import numpy as np

from keyrecon.durable import write_durably
from keyrecon.errors import KeyreconError
from keyrecon.formats.world import at_constant_rate
from keyrecon.records import Motion


def write_c3d(path: Path, motion: Motion) -> None:
    """Write joints with Y up, x right, z towards the camera.

    A motion at a variable rate is resampled. Raises KeyreconError without the c3d package.
    """
    try:
        import c3d
    except ImportError as fault:
        raise KeyreconError(
            "Writing C3D needs the c3d package; install it with: pip install 'keyrecon[c3d]'"
        ) from fault
    points = at_constant_rate(motion)
    millimetres = motion.units == "m"
    # The column behind x, y, z is the residual: 0, measured by one camera group.
    rows = np.zeros((*points.shape[:2], 5), dtype=np.float32)
    rows[..., :3] = points * 1000 if millimetres else points
    writer = c3d.Writer(point_rate=motion.fps, point_units="mm" if millimetres else "bh")
    writer.set_point_labels(list(motion.skeleton.names))
    writer.set_screen_axis(X="+X", Y="+Y")
    no_analog = np.zeros((0, 0), dtype=np.float32)
    writer.add_frames([(row, no_analog) for row in rows])
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "No analog data", UserWarning)
        writer.write(buffer)
    write_durably(path, buffer.getvalue())
