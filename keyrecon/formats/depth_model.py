"""Depth models on disk: one compressed npz, no pickle, in single precision."""

from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from keyrecon.errors import KeyreconError
from keyrecon.lifting.depths import VERSION, DepthModel

BUILT_IN = Path(__file__).parent.parent / "lifting" / "depths.npz"
"""The model that ships with the package; `depths.md` beside it says how it was made."""


def write_depth_model(path: Path, model: DepthModel) -> None:
    """Write a model; the folder is made if need be."""
    path.parent.mkdir(parents=True, exist_ok=True)
    coefficients, provenance = model.coefficients.astype(np.float32), np.array(model.provenance)
    with path.open("wb") as file:
        np.savez_compressed(
            file, version=model.version, provenance=provenance, coefficients=coefficients
        )


def read_depth_model(path: Path = BUILT_IN) -> DepthModel:
    """Read a model; raises KeyreconError for another kind of file, or one of another version."""
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            version, provenance = int(stored["version"]), str(stored["provenance"])
            coefficients = stored["coefficients"].astype(np.float64)
    except (OSError, ValueError, KeyError, TypeError, EOFError, BadZipFile) as fault:
        why = fault.strerror if isinstance(fault, OSError) and fault.strerror else "another format"
        raise KeyreconError(
            f"{path} is not a depth model ({why}); make one with: keyrecon depths"
        ) from fault
    if version != VERSION:
        raise KeyreconError(
            f"{path} is a depth model of version {version} and this program needs {VERSION}; "
            "make it again with: keyrecon depths"
        )
    return DepthModel(coefficients, provenance, version)
