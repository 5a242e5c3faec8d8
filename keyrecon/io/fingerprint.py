"""What tells one video file from others, wherever it has moved to."""

import hashlib
from functools import lru_cache
from pathlib import Path

import numpy as np

MEGABYTE = 1 << 20
SAMPLES = 64
"""Megabytes of a file that its fingerprint reads: all of a small one."""
SAMPLED = "64-"
"""How fingerprints begin; those of former versions were of the first and last megabyte alone."""


def fingerprint_file(path: Path) -> str:
    """Hash of a file's size and of what it holds, of a large file of samples throughout."""
    status = path.stat()
    return _fingerprint_state(path.absolute(), status.st_size, status.st_mtime_ns)


@lru_cache(maxsize=64)
def _fingerprint_state(path: Path, size: int, _changed: int) -> str:
    """That of a file as it is: every shot of a match asks for it."""
    megabytes = -(-size // MEGABYTE)
    return f"{SAMPLED}{_hash_samples(path, min(SAMPLES, max(1, megabytes)))}"


def has_fingerprint(path: Path, fingerprint: str) -> bool:
    """Whether a file is the one of a fingerprint, also of one that a former version took."""
    if fingerprint.startswith(SAMPLED):
        return fingerprint_file(path) == fingerprint
    return _hash_samples(path, 2) == fingerprint


def _hash_samples(path: Path, samples: int) -> str:
    """Hash of a file's size and of some megabytes of it, evenly from the first to the last."""
    size = path.stat().st_size
    digest = hashlib.sha256(str(size).encode())
    with path.open("rb") as file:
        for start in np.linspace(0, max(0, size - MEGABYTE), samples).astype(int).tolist():
            file.seek(start)
            digest.update(file.read(MEGABYTE))
    return digest.hexdigest()[:32]
