"""From motion-capture files to a side model: what `keyrecon sides` does."""

from collections.abc import Sequence
from pathlib import Path

from keyrecon.app.depth_training import RATE, gather_captures
from keyrecon.body_models.side_model import SideModel
from keyrecon.body_models.side_training import SideTrainingOptions, train_side_model
from keyrecon.io.formats.model_file import write_side_model
from keyrecon.io.option_tables import check_options
from keyrecon.progress import Progress, silent


def learn(
    paths: Sequence[Path],
    out: Path,
    options: SideTrainingOptions,
    progress: Progress = silent,
) -> str:
    """Learn a side model from captures and the built-in tennis, write it, tell what it is."""
    check_options(options)
    model = learn_from_files(paths, options, progress)
    write_side_model(out, model)
    return f"Wrote {out}: {model.provenance}."


def learn_from_files(
    paths: Sequence[Path],
    options: SideTrainingOptions = SideTrainingOptions(),
    progress: Progress = silent,
) -> SideModel:
    """A side model of the captures in files and folders, and of the built-in tennis."""
    captures, provenance = gather_captures(paths)
    return train_side_model(captures, RATE, provenance, options, progress)
