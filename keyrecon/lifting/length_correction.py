"""Bone lengths corrected by how bodies are seen to move.

`limb_lengths.py` takes each bone for itself: how often it looks how long. A bone that never lies in
the picture's plane, such as all of an upright body filmed from above, then has no length of its own
in the picture. What is learnt from captures (`DepthModel.length_errors`) sees the whole pose: legs
that look short while hips and arms say that the camera looks down are long legs. Every frame tells
a little, as a regression that is drawn towards no error; the mean of a video tells more, and once
corrected the rest is asked for again.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from keyrecon.body import standing_length
from keyrecon.body_models.depth_model import DepthModel, length_errors
from keyrecon.lifting.limb_lengths import BodySize
from keyrecon.numerics.bone_directions import bone_vectors
from keyrecon.records import Shots


def correct_lengths(
    size: BodySize,
    joints: Float[np.ndarray, "T J 2"],
    model: DepthModel,
    fps: float,
    rounds: int,
    shots: Shots,
) -> BodySize:
    """Lengths at which the model finds bones neither too long nor too short, after some rounds.

    `joints` in px; NaN is not asked. The body is as tall as before: where all bones look too long,
    the picture's scale is larger.
    """
    vectors = bone_vectors(joints, size.skeleton)
    for _ in range(rounds):
        factor = np.exp(_mean_errors(size, vectors, model, fps, shots))
        lengths = size.lengths * factor
        grown = standing_length(lengths, size.skeleton)
        grown /= standing_length(size.lengths, size.skeleton)
        size = replace(
            size,
            lengths=lengths / grown,
            breadths=size.breadths / grown,
            scale=size.scale * grown,
        )
    return size


def _mean_errors(
    size: BodySize,
    vectors: Float[np.ndarray, "T B 2"],
    model: DepthModel,
    fps: float,
    shots: Shots,
) -> Float[np.ndarray, "B"]:
    """Log of how much too long bones look in the mean of the frames that tell, 0 where none does.

    `vectors` in px.
    """
    errors = shots.in_each(
        lambda part: length_errors(model, part, size.lengths, size.skeleton, fps),
        vectors / size.scale[:, None, None],
    )
    return np.nansum(errors, axis=0) / np.maximum(np.isfinite(errors).sum(axis=0), 1)
