"""How large marked bodies appear, by their bones alone.

Where the picture ends above the feet nothing in it shows how tall the player stands; the bones
that a person marked there do. The same likelihood that tells bone lengths (see `limb_lengths`)
tells the sizes of a few bodies against each other, with next to nothing expected of how they go
from one to the next.
"""

from dataclasses import replace

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


APART_SECONDS, OTHER_SHOT_SECONDS = 1.0, 5.0
"""Bodies farther apart than the first, or in different shots, may have any size: they are taken to
be so far apart. What lies between them would only take time."""


def marked_heights(
    annotations: Annotations, usual: float, fps: float, shots: Shots
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
    apart = np.minimum(np.diff(annotations.frames), round(APART_SECONDS * fps))
    cut = np.diff(shots.number[annotations.frames]) > 0
    apart = np.where(cut, round(OTHER_SHOT_SECONDS * fps), apart)
    retimed = replace(annotations, frames=np.append(0, np.cumsum(apart)))
    count = int(retimed.frames[-1]) + 1
    nothing = np.full((count, len(skeleton.names), 2), np.nan)
    nowhere = np.zeros(nothing.shape[:2])
    tracks = JointTracks(nothing, nowhere)
    free = LengthOptions(scale_spread=SIZE_SPREAD)
    size = estimate_lengths(tracks, retimed, np.full(count, usual), fps, free)
    return np.where(known, HEAD_TO_FEET * size.scale[retimed.frames], np.nan)
