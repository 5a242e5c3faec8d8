"""Poses of an athlete who repeats some strokes, and their pose distances."""

import numpy as np
from scipy.ndimage import uniform_filter1d

from keyrecon.records import PoseDistances


def comparison_of(upper, lower=None, visibility_score=None, row=None):
    """A comparison from poses (M, dimensions), all frames compared unless `row` tells."""
    lower = upper if lower is None else lower
    matrices = [
        np.minimum(0.12, np.linalg.norm(p[:, None] - p[None], axis=-1)).astype(np.float32)
        for p in (upper, lower)
    ]
    row = np.arange(len(upper)) if row is None else row
    step = [m[row[:-1], row[1:]] for m in matrices]
    return PoseDistances(
        upper=matrices[0],
        lower=matrices[1],
        frames=np.flatnonzero(np.diff(row, prepend=-1)),
        row=row,
        exemplar_distance=np.zeros((2, len(row)), dtype=np.float32),
        consecutive_distance=np.stack(step),
        visibility_score=np.ones(len(row)) if visibility_score is None else visibility_score,
        seen=np.ones((2, len(row))),
    )


def sporting_poses(count=400, seed=0, dimensions=3):
    """Strokes that come back, with rests between them."""
    rng = np.random.default_rng(seed)
    stroke = uniform_filter1d(rng.normal(size=(40, dimensions)), 9, axis=0) * 0.1
    parts = [np.zeros((1, dimensions))]
    while sum(map(len, parts)) < count:
        rest = np.tile(stroke[:1], (rng.integers(10, 30), 1))
        parts += [rest, stroke + rng.normal(size=dimensions) * 0.004]
    return np.concatenate(parts)[:count] + 0.001 * rng.normal(size=(count, dimensions))
