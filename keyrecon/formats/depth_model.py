"""Depth models on disk (see `learnt`)."""

from pathlib import Path

from keyrecon.formats.learnt import Kind, read_learnt, write_learnt
from keyrecon.lifting.depths import VERSION, DepthModel

BUILT_IN = Path(__file__).parent.parent / "lifting" / "depths.npz"
"""The model that ships with the package; `depths.md` beside it says how it was made."""

_KIND = Kind("depth model", "keyrecon depths", VERSION)


def write_depth_model(path: Path, model: DepthModel) -> None:
    """Write a model; the folder is made if need be."""
    arrays = {"coefficients": model.coefficients}
    write_learnt(path, model.version, model.provenance, arrays)


def read_depth_model(path: Path = BUILT_IN) -> DepthModel:
    """Read a model; raises KeyreconError for another kind of file, or one of another version."""
    provenance, arrays = read_learnt(path, _KIND, ("coefficients",))
    return DepthModel(provenance=provenance, **arrays)
