"""What the model is worth: every captured swing explained by a model learnt without it.

For each number m of components the left-out swing is replaced by the closest motion that the
others and their variations span, and both are compared as joints of the same body.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from keyrecon.body import LSP14
from keyrecon.golf.records import MotionModel
from keyrecon.golf.retarget import place_turns
from keyrecon.golf.skeleton import SEGMENTS, size_body
from keyrecon.golf.train import (
    REFERENCE,
    Database,
    TrainOptions,
    learn_motion,
    motion_weights,
)
from keyrecon.metrics import mpjpe, pa_mpjpe


@dataclass(frozen=True)
class LeftOut:
    """Error of swings that the model has not seen, mean of all, for one number of components."""

    components: int
    mpjpe: float
    """mm, root-aligned."""
    pa_mpjpe: float
    """mm"""


def leave_one_out(database: Database, options: TrainOptions = TrainOptions()) -> list[LeftOut]:
    """Errors per number of components, from 0 (the mean motion); empty for a single capture."""
    if database.captured < 2:
        return []
    rows = [_leave_out(database, out, options) for out in range(database.captured)]
    least = min(len(row) for row in rows)
    errors = np.mean([row[:least] for row in rows], axis=0)
    return [LeftOut(m, float(both[0]), float(both[1])) for m, both in enumerate(errors)]


def without(database: Database, out: int) -> Database:
    """The database without one captured swing and its variations."""
    each = (len(database.vectors) - database.captured) // database.captured
    kept = np.ones(len(database.vectors), bool)
    kept[out] = False
    first = database.captured + out * each
    kept[first : first + each] = False
    return replace(database, vectors=database.vectors[kept], captured=database.captured - 1)


def _leave_out(database: Database, out: int, options: TrainOptions) -> Float[np.ndarray, "C 2"]:
    """MPJPE and PA-MPJPE of one swing, mm, for 0, 1, 2 ... components of the others."""
    model = learn_motion(without(database, out), "", options)
    truth = database.vectors[out]
    weight = motion_weights()
    axes = (model.components * weight).reshape(len(model.components), -1)
    size = (axes**2).sum(axis=1)
    alpha = axes @ ((truth - model.mean) * weight).ravel() / size
    joints = vector_joints(model, truth)
    root = [LSP14.index("right_hip"), LSP14.index("left_hip")]
    errors = []
    for m in range(len(alpha) + 1):
        motion = model.mean + np.tensordot(alpha[:m], model.components[:m], axes=1)
        ours = vector_joints(model, motion)
        errors.append((1000 * mpjpe(ours, joints, root), 1000 * pa_mpjpe(ours, joints)))
    return np.array(errors)


def vector_joints(
    model: MotionModel, motion: Float[np.ndarray, "N D"]
) -> Float[np.ndarray, "N 14 3"]:
    """Joints of the reference body in swing axes, metres."""
    turned = 3 * len(SEGMENTS)
    vectors = motion[:, :turned].reshape(-1, 3)
    turns = Rotation.from_rotvec(vectors).as_matrix().reshape(len(motion), -1, 3, 3)
    return place_turns(size_body(REFERENCE), model.centre @ turns, motion[:, turned:])[0]
