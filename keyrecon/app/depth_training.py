"""From motion-capture files to a depth model: what `keyrecon depths` does."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float

from keyrecon.body_models.depth_model import DepthModel
from keyrecon.body_models.depth_training import DepthTrainingOptions, train_depth_model
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.mocap import find_captures, read_capture
from keyrecon.io.formats.model_file import write_depth_model
from keyrecon.io.option_tables import check_options
from keyrecon.progress import Progress, silent
from keyrecon.synthetic.motion import MotionOptions, play_tennis

TRIM = 0.3
"""Seconds dropped at either end of a capture: many begin or end in a calibration pose."""
RATE = 50.0
"""Poses per second: captures at other rates are thinned, so that each second weighs the same."""
PLAYED = 6
"""Sequences of the built-in tennis that are learnt from besides."""


def learn(
    paths: Sequence[Path],
    out: Path,
    options: DepthTrainingOptions,
    progress: Progress = silent,
) -> str:
    """Learn a depth model from captures and the built-in tennis, write it, tell what it is."""
    check_options(options)
    model = learn_from_files(paths, options, progress)
    write_depth_model(out, model)
    return f"Wrote {out}: {model.provenance}."


def learn_from_files(
    paths: Sequence[Path],
    options: DepthTrainingOptions = DepthTrainingOptions(),
    progress: Progress = silent,
) -> DepthModel:
    """A depth model of the captures in files and folders, and of the built-in tennis."""
    captures, provenance = gather_captures(paths)
    return train_depth_model(captures, RATE, provenance, options, progress)


def gather_captures(paths: Sequence[Path]) -> tuple[list[Float[np.ndarray, "_ 14 3"]], str]:
    """Joints of the captures in files and folders and of the built-in tennis, `RATE` poses a
    second, and what they are."""
    files = find_captures(paths)
    captures = [read_poses(file) for file in files]
    captures += [play_tennis(MotionOptions(fps=RATE, seed=seed)) for seed in range(PLAYED)]
    names = ", ".join(file.stem for file in files)
    return captures, f"learnt from {len(files)} captures ({names}) and the built-in tennis"


def read_poses(file: Path) -> Float[np.ndarray, "_ 14 3"]:
    """Joints of a capture, `RATE` poses a second."""
    capture = read_capture(file)
    last = len(capture.joints) / capture.fps - TRIM
    times = np.arange(TRIM, last, 1 / RATE)
    if not len(times):
        raise KeyreconError(
            f"{file} lasts {len(capture.joints) / capture.fps:.2g} s, too short to drop {TRIM} s "
            "at either end; leave it out."
        )
    rows = np.minimum(np.round(times * capture.fps).astype(int), len(capture.joints) - 1)
    return capture.joints[rows]
