"""From motion-capture files to a motion model: what `keyrecon golf train` does."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from keyrecon.errors import KeyreconError
from keyrecon.golf.prior.captured_swing import make_swing
from keyrecon.golf.prior.training import (
    CrossValidation,
    TrainOptions,
    collect_swings,
    cross_validate,
    learn_motion,
)
from keyrecon.golf.records import MotionModel, Swing
from keyrecon.io.formats.mocap import find_captures, read_capture
from keyrecon.io.formats.model_file import write_motion_model
from keyrecon.io.option_tables import check_options
from keyrecon.progress import Progress, silent


def read_swing(path: Path) -> Swing:
    """One swing; raises KeyreconError for a file that is broken or holds no swing."""
    capture = read_capture(path)
    try:
        return make_swing(capture.joints, capture.toes, capture.club, capture.fps, path.stem)
    except KeyreconError as fault:
        raise KeyreconError(f"{path}: {fault}") from fault


def read_swings(paths: Iterable[Path]) -> tuple[Swing, ...]:
    """All swings of files and folders, in order of their names."""
    return tuple(read_swing(file) for file in find_captures(paths))


def train(
    paths: Sequence[Path], out: Path, options: TrainOptions, progress: Progress = silent
) -> str:
    """Learn a model from captured swings, write it, and describe what it is worth.

    Raises KeyreconError for captures, options or a place to write that cannot be, before it learns.
    """
    check_options(options)
    _check_place(out)
    swings = read_swings(paths)
    database = collect_swings(swings, options, progress)
    model = learn_motion(database, _provenance(swings, options), options)
    write_motion_model(out, model)
    lines = [_describe(swing) for swing in swings]
    lines.append("")
    lines += tabulate(model, cross_validate(database, options))
    return "\n".join([*lines, "", f"Wrote {out}: {model.provenance}."])


def _check_place(out: Path) -> None:
    """Raises KeyreconError for a file that could not be written after minutes of learning."""
    if out.suffix != ".npz" or out.is_dir():
        raise KeyreconError(f"{out} cannot hold a prior; name a .npz file with --out.")
    if not out.parent.is_dir():
        raise KeyreconError(f"There is no folder {out.parent} to write {out.name} into; make it.")


def _provenance(swings: Sequence[Swing], options: TrainOptions) -> str:
    names = ", ".join(swing.name for swing in swings)
    count = options.variation.count
    varied = f", each with {count} variations (seed {options.variation.seed})" if count else ""
    return f"learnt from {len(swings)} captured swings ({names}){varied}"


def _describe(swing: Swing) -> str:
    start, top, hit, finish = (int(k) for k in swing.keys)
    up, down = (top - start) / swing.fps, (hit - top) / swing.fps
    return (
        f"{swing.name}: upswing from frame {start}, top {top}, hit {hit}, finish {finish} of "
        f"{len(swing.joints)}; tempo {up:.2f} s up, {down:.2f} s down, {up / down:.1f} : 1"
    )


_SHOWN = (1, 2, 3, 4, 6, 8, 12, 16, 20, 30, 40, 60)


def tabulate(model: MotionModel, left_out: Sequence[CrossValidation]) -> list[str]:
    """Variance explained and error of left-out swings per number of components."""
    head = f"{'components':>10}{'variance explained':>20}"
    if left_out:
        head += f"{'left-out MPJPE, mm':>20}{'left-out PA-MPJPE, mm':>23}"
    lines = [head]
    by_count = {row.components: row for row in left_out}
    for count in [m for m in (0, *_SHOWN) if m <= len(model.components)]:
        share = model.explained[count - 1] if count else 0.0
        line = f"{count:>10}{share:>20.1%}"
        if count in by_count:
            line += f"{by_count[count].mpjpe:>20.1f}{by_count[count].pa_mpjpe:>23.1f}"
        lines.append(line)
    return lines
