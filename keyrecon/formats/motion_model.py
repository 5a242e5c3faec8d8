"""Motion models of a golf swing on disk: one compressed npz, no pickle.

`version` is that of segments and motion vectors; arrays are in single precision, which is a
hundredth of a degree.
"""

from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from keyrecon.errors import KeyreconError
from keyrecon.golf.records import MotionModel
from keyrecon.golf.train import VERSION

BUILT_IN = Path(__file__).parent.parent / "golf" / "prior.npz"
"""The model that ships with the package; `prior.md` beside it says how it was made."""

_ARRAYS = ("centre", "mean", "components", "keys", "explained")


def write_motion_model(path: Path, model: MotionModel) -> None:
    """Write a model; the folder is made if need be."""
    path.parent.mkdir(parents=True, exist_ok=True)
    arrays = {name: getattr(model, name).astype(np.float32) for name in _ARRAYS}
    with path.open("wb") as file:
        np.savez_compressed(
            file, version=model.version, provenance=np.array(model.provenance), **arrays
        )


def read_motion_model(path: Path = BUILT_IN) -> MotionModel:
    """Read a model; raises KeyreconError for another kind of file, or one of another version."""
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            version = int(stored["version"])
            arrays = {name: stored[name].astype(np.float64) for name in _ARRAYS}
            provenance = str(stored["provenance"])
    except (OSError, ValueError, KeyError, TypeError, EOFError, BadZipFile) as fault:
        why = fault.strerror if isinstance(fault, OSError) and fault.strerror else "another format"
        raise KeyreconError(
            f"{path} is not a swing prior ({why}); make one with: keyrecon golf train"
        ) from fault
    if version != VERSION:
        raise KeyreconError(
            f"{path} is a swing prior of version {version} and this program needs {VERSION}; "
            "make it again with: keyrecon golf train"
        )
    return MotionModel(version=version, provenance=provenance, **arrays)
