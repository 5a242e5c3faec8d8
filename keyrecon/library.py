"""keyrecon as a library: the recipe with the learnt models that its options name.

`pipeline` itself reads no files; here the models are read first, so that a wrong file is told of
before minutes are spent.
"""

from pathlib import Path

from keyrecon import pipeline
from keyrecon.io.formats.model_file import (
    BUILT_IN_DEPTH_MODEL,
    BUILT_IN_SIDE_MODEL,
    read_depth_model,
    read_motion_model,
    read_side_model,
)
from keyrecon.keeping import Keep, call_stage
from keyrecon.pipeline import Models, Options
from keyrecon.progress import Progress, silent
from keyrecon.records import Annotations, JointTracks, Motion, Preparation


def reconstruct(
    preparation: Preparation,
    annotations: Annotations,
    options: Options = Options(),
    keep: Keep = call_stage,
    progress: Progress = silent,
) -> Motion:
    """Propagate the annotated joints to every frame and recover the 3D motion.

    ECCV 2004, Sections 5 and 6. Lengths are in metres where `options.lift.height` is given, else
    in body heights. Raises KeyreconError when keyframes are not annotated, or a model that the
    options name cannot be read.
    """
    models = read_models(options)
    return pipeline.reconstruct(preparation, annotations, models, options, keep, progress)


def carry_joints(
    preparation: Preparation,
    annotations: Annotations,
    options: Options = Options(),
    keep: Keep = call_stage,
    progress: Progress = silent,
) -> JointTracks:
    """The annotated joints in every frame of the video, in 2D alone."""
    models = read_models(options)
    return pipeline.carry_joints(preparation, annotations, models, options, keep, progress)


def read_models(options: Options) -> Models:
    """The models that the options ask for."""
    depth = _file_named(options.depths, BUILT_IN_DEPTH_MODEL)
    sides = _file_named(options.sides, BUILT_IN_SIDE_MODEL)
    return Models(
        None if depth is None else read_depth_model(depth),
        read_motion_model() if options.prior == "golf" else None,
        None if sides is None else read_side_model(sides),
    )


def _file_named(named: str, built_in: Path) -> Path | None:
    """The file that an option names; None for 'none'."""
    if named == "none":
        return None
    return built_in if named == "built-in" else Path(named)
