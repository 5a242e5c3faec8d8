"""How large marked bodies appear, by their bones alone.

Where the picture ends above the feet nothing in it shows how tall the player stands; the bones
that a person marked there do. The same likelihood that tells bone lengths (see `limb_lengths`)
tells the sizes of a few bodies against each other, with next to nothing expected of how they go
from one to the next.
"""

import numpy as np
from jaxtyping import Float

from keyrecon.lifting.limb_lengths import LengthOptions, estimate_lengths
from keyrecon.records import Annotations, JointTracks, Shots

HEAD_TO_FEET = 0.9
"""Share of stature from the head's centre to the feet (Drillis and Contini)."""
SIZE_SPREAD = 0.3
"""How far the size may stray within a knot of `LengthOptions`, as a share: a player who runs
towards the camera grows by half within a second."""
LEAST_BONES = 4
"""Bones of a body that tell its size; of fewer all may point at the camera."""


def marked_heights(
    annotations: Annotations,
    usual: float,
    n_frames: int,
    fps: float,
    shots: Shots | None = None,
) -> Float[np.ndarray, "K"]:
    """How tall each marked body would stand from head centre to mid-feet, px; NaN where too few of
    its bones are marked.

    `usual` is about how tall the player stands, px: it tells how exact clicks are.
    """
    skeleton = annotations.skeleton
    ends = np.isfinite(annotations.joints[:, skeleton.bones]).all(axis=(2, 3))
    known = ends.sum(axis=1) >= LEAST_BONES
    if not known.any():
        return np.full(len(known), np.nan)
    nothing = np.full((n_frames, len(skeleton.names), 2), np.nan)
    nowhere = np.zeros(nothing.shape[:2])
    tracks = JointTracks(nothing, nowhere, nowhere.astype(np.int64))
    free = LengthOptions(scale_spread=SIZE_SPREAD)
    size = estimate_lengths(tracks, annotations, np.full(n_frames, usual), fps, free, shots)
    return np.where(known, HEAD_TO_FEET * size.scale[annotations.frames], np.nan)
