"""What was learnt from captures, on disk: one compressed npz in single precision, no pickle."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple
from zipfile import BadZipFile

import numpy as np

from keyrecon.errors import KeyreconError


class Kind(NamedTuple):
    """A kind of file: what to call it, what makes it, and its version in this program."""

    name: str
    command: str
    version: int


def write_learnt(
    path: Path, version: int, provenance: str, arrays: Mapping[str, np.ndarray]
) -> None:
    """Write arrays and where they come from; the folder is made if need be."""
    path.parent.mkdir(parents=True, exist_ok=True)
    single = {name: values.astype(np.float32) for name, values in arrays.items()}
    with path.open("wb") as file:
        np.savez_compressed(file, version=version, provenance=np.array(provenance), **single)


def read_learnt(path: Path, kind: Kind, names: Sequence[str]) -> tuple[str, dict[str, np.ndarray]]:
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
