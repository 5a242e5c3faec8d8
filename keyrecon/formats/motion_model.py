"""Motion models of a golf swing on disk (see `learnt`); single precision is .01 degrees.

The version is that of segments and motion vectors.
"""

from pathlib import Path

from keyrecon.formats.learnt import Kind, read_learnt, write_learnt
from keyrecon.golf.records import MotionModel
from keyrecon.golf.train import VERSION

BUILT_IN = Path(__file__).parent.parent / "golf" / "prior.npz"
"""The model that ships with the package; `prior.md` beside it says how it was made."""

_KIND = Kind("swing prior", "keyrecon golf train", VERSION)
_ARRAYS = ("centre", "mean", "components", "keys", "explained")


def write_motion_model(path: Path, model: MotionModel) -> None:
    """Write a model; the folder is made if need be."""
    arrays = {name: getattr(model, name) for name in _ARRAYS}
    write_learnt(path, model.version, model.provenance, arrays)


def read_motion_model(path: Path = BUILT_IN) -> MotionModel:
    """Read a model; raises KeyreconError for another kind of file, or one of another version."""
    provenance, arrays = read_learnt(path, _KIND, _ARRAYS)
    return MotionModel(version=VERSION, provenance=provenance, **arrays)
