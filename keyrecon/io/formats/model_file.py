"""Models learnt from captures, on disk: one compressed npz in single precision, no pickle.

Two kinds: depth models (`keyrecon depths`) and swing priors (`keyrecon golf train`), whose version
is that of segments and motion vectors. Single precision is .01 degrees.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple
from zipfile import BadZipFile

import numpy as np

from keyrecon.errors import KeyreconError
from keyrecon.golf.prior.training import SWING_PRIOR_VERSION
from keyrecon.golf.records import MotionModel
from keyrecon.lifting.priors.depth_model import DEPTH_MODEL_VERSION, DepthModel

PACKAGE = Path(__file__).parent.parent.parent


class ModelKind(NamedTuple):
    """A kind of file: what to call it, what makes it, and its version in this program."""

    name: str
    command: str
    version: int


def write_model(
    path: Path, version: int, provenance: str, arrays: Mapping[str, np.ndarray]
) -> None:
    """Write arrays and where they come from; the folder is made if need be."""
    path.parent.mkdir(parents=True, exist_ok=True)
    single = {name: values.astype(np.float32) for name, values in arrays.items()}
    described = {"version": np.array(version), "provenance": np.array(provenance)}
    with path.open("wb") as file:
        np.savez_compressed(file, **described, **single)  # type: ignore[arg-type]  # as in storage.py


def read_model(
    path: Path, kind: ModelKind, names: Sequence[str]
) -> tuple[str, dict[str, np.ndarray]]:
    """Provenance and arrays; raises KeyreconError for files of another kind or version."""
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            version, provenance = int(stored["version"]), str(stored["provenance"])
            arrays = {name: stored[name].astype(np.float64) for name in names}
    except (OSError, ValueError, KeyError, TypeError, EOFError, BadZipFile) as fault:
        why = fault.strerror if isinstance(fault, OSError) and fault.strerror else "another format"
        raise KeyreconError(
            f"{path} is not a {kind.name} ({why}); make one with: {kind.command}"
        ) from fault
    if version != kind.version:
        raise KeyreconError(
            f"{path} is a {kind.name} of version {version} and this program needs {kind.version}; "
            f"make it again with: {kind.command}"
        )
    return provenance, arrays


BUILT_IN_DEPTH_MODEL = PACKAGE / "lifting" / "priors" / "depths.npz"
"""The model that ships with the package; `depths.md` beside it says how it was made."""

_DEPTH_MODEL = ModelKind("depth model", "keyrecon depths", DEPTH_MODEL_VERSION)


def write_depth_model(path: Path, model: DepthModel) -> None:
    """Write a model; the folder is made if need be."""
    arrays = {"coefficients": model.coefficients}
    write_model(path, model.version, model.provenance, arrays)


def read_depth_model(path: Path = BUILT_IN_DEPTH_MODEL) -> DepthModel:
    """Read a model; raises KeyreconError for another kind of file, or one of another version."""
    provenance, arrays = read_model(path, _DEPTH_MODEL, ("coefficients",))
    return DepthModel(arrays["coefficients"], provenance)


BUILT_IN_SWING_PRIOR = PACKAGE / "golf" / "prior" / "prior.npz"
"""The model that ships with the package; `prior.md` beside it says how it was made."""

_SWING_PRIOR = ModelKind("swing prior", "keyrecon golf train", SWING_PRIOR_VERSION)
_ARRAYS = ("centre", "mean", "components", "keys", "explained")


def write_motion_model(path: Path, model: MotionModel) -> None:
    """Write a model; the folder is made if need be."""
    arrays = {name: getattr(model, name) for name in _ARRAYS}
    write_model(path, model.version, model.provenance, arrays)


def read_motion_model(path: Path = BUILT_IN_SWING_PRIOR) -> MotionModel:
    """Read a model; raises KeyreconError for another kind of file, or one of another version."""
    provenance, arrays = read_model(path, _SWING_PRIOR, _ARRAYS)
    return MotionModel(version=SWING_PRIOR_VERSION, provenance=provenance, **arrays)
