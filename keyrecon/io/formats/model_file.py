"""Models learnt from captures, on disk: one compressed npz in single precision, no pickle.

Three kinds: depth models (`keyrecon depths`), side models (`keyrecon sides`) and swing priors
(`keyrecon golf train`), whose version is that of segments and motion vectors. Single precision is
.01 degrees.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np

from keyrecon.body_models.depth_model import DEPTH_MODEL_VERSION, DepthModel
from keyrecon.body_models.side_model import SIDE_MODEL_VERSION, SideModel
from keyrecon.errors import KeyreconError
from keyrecon.golf.prior.skeleton import SEGMENTS
from keyrecon.golf.prior.training import SWING_PRIOR_VERSION
from keyrecon.golf.records import MotionModel
from keyrecon.io.durable import make_folder, replacing
from keyrecon.reading import check_numbers, read_arrays, reading

TURN_ERROR = 1e-4
"""Of a rotation in single precision, many times over."""
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
    make_folder(path.parent)
    single = {name: values.astype(np.float32) for name, values in arrays.items()}
    described = {"version": np.array(version), "provenance": np.array(provenance)}
    with replacing(path) as file:
        np.savez_compressed(file, **described, **single)  # type: ignore[arg-type]  # as in storage.py


def read_model(
    path: Path, kind: ModelKind, names: Sequence[str]
) -> tuple[str, dict[str, np.ndarray]]:
    """Provenance and arrays; raises KeyreconError for files of another kind or version."""
    with reading(path, f"a {kind.name}", f"make one with: {kind.command}"):
        stored = read_arrays(path)
        version, provenance = int(stored["version"]), str(stored["provenance"])
        arrays = {
            name: check_numbers(name, stored[name]).astype(np.float64)
            for name in (names if version == kind.version else ())
        }
    if version != kind.version:
        raise KeyreconError(
            f"{path} is a {kind.name} of version {version} and this program needs {kind.version}; "
            f"make it again with: {kind.command}"
        )
    return provenance, arrays


BUILT_IN_DEPTH_MODEL = PACKAGE / "body_models" / "depths.npz"
"""The model that ships with the package; `depths.md` beside it says how it was made."""

_DEPTH_MODEL = ModelKind("depth model", "keyrecon depths", DEPTH_MODEL_VERSION)


def write_depth_model(path: Path, model: DepthModel) -> None:
    """Write a model; the folder is made if need be."""
    _write_perceptron(path, model)


def read_depth_model(path: Path = BUILT_IN_DEPTH_MODEL) -> DepthModel:
    """Read a model; raises KeyreconError for another kind of file, or one of another version."""
    return _read_perceptron(path, _DEPTH_MODEL, DepthModel, 4)


BUILT_IN_SIDE_MODEL = PACKAGE / "body_models" / "sides.npz"
"""The model that ships with the package; `sides.md` beside it says how it was made."""

_SIDE_MODEL = ModelKind("side model", "keyrecon sides", SIDE_MODEL_VERSION)


def write_side_model(path: Path, model: SideModel) -> None:
    """Write a model; the folder is made if need be."""
    _write_perceptron(path, model)


def read_side_model(path: Path = BUILT_IN_SIDE_MODEL) -> SideModel:
    """Read a model; raises KeyreconError for another kind of file, or one of another version."""
    return _read_perceptron(path, _SIDE_MODEL, SideModel, 3)


PerceptronModel = TypeVar("PerceptronModel", DepthModel, SideModel)


def _layer_names(layers: int) -> list[str]:
    """Names of the arrays in the file: weights of every layer, then biases."""
    return [f"{kind}{layer}" for kind in ("weights", "biases") for layer in range(layers)]


def _write_perceptron(path: Path, model: DepthModel | SideModel) -> None:
    layers = [*model.weights, *model.biases]
    names = _layer_names(len(model.weights))
    write_model(path, model.version, model.provenance, dict(zip(names, layers, strict=True)))


def _read_perceptron(
    path: Path, kind: ModelKind, model: type[PerceptronModel], layers: int
) -> PerceptronModel:
    names = _layer_names(layers)
    provenance, arrays = read_model(path, kind, names)
    values = tuple(arrays[name] for name in names)
    try:
        return model(values[:layers], values[layers:], provenance)
    except KeyreconError as fault:
        raise KeyreconError(f"{path} is not a {kind.name}: {fault}") from fault


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
    with reading(path, f"a {_SWING_PRIOR.name}", f"make one with: {_SWING_PRIOR.command}"):
        _check_motion_model(**arrays)
        return MotionModel(version=SWING_PRIOR_VERSION, provenance=provenance, **arrays)


def _check_motion_model(
    centre: np.ndarray,
    mean: np.ndarray,
    components: np.ndarray,
    keys: np.ndarray,
    explained: np.ndarray,
) -> None:
    """Raise ValueError for arrays that do not fit each other, or the body of a swing."""
    parts = len(SEGMENTS)
    if centre.shape != (parts, 3, 3) or mean.ndim != 2 or mean.shape[1] != 3 * parts + 3:
        raise ValueError(f"it is not of {parts} segments")
    if len(mean) < 2 or not len(components) or components.shape[1:] != mean.shape:
        raise ValueError("its components do not fit its mean")
    if keys.shape != (4,) or (np.diff(keys) <= 0).any() or explained.shape != components.shape[:1]:
        raise ValueError("it needs four key postures, and what each component explains")
    turned = centre @ centre.transpose(0, 2, 1)
    if np.abs(turned - np.eye(3)).max() > TURN_ERROR or (np.linalg.det(centre) < 0).any():
        raise ValueError("its mean turns are no rotations")
