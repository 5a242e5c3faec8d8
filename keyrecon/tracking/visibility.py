"""Whether the player is in the picture at all.

A path through candidates goes on while the player is off the picture or behind something: it has to
be somewhere. But then the strip between the head and the feet that it claims looks like the empty
scene, while a player fills it in every other frame: over half of what is usual where trunk and legs
have the court's colours, nothing where nobody is.
"""

import numpy as np
from jaxtyping import Bool, Float

from keyrecon.records import Track
from keyrecon.segmentation.player_crops import Cropping, Crops

MIN_FOREGROUND_SHARE = 0.3
"""Share of the usual foreground between head and feet below which nobody is there. Halved, others
with it: at most 1.0 points, 0.2 mm on one clip."""
HALF_BREADTH = 0.08
"""Half the breadth of the strip, player heights: that of a trunk from the side. Halved, others with
it: at most 1.0 points, 0.2 mm on one clip."""
SAMPLES_ALONG, SAMPLES_ACROSS = 24, 9
"""Places of the strip that are sampled. Halved, others with it: at most 1.0 points, 0.2 mm on one
clip."""


def is_visible(
    crops: Crops, cropping: Cropping, track: Track, detected: Bool[np.ndarray, "T"]
) -> Bool[np.ndarray, "T"]:
    """Frames in which something stands between the track's head and feet.

    What is usual is told by the frames in which head and feet were `detected` by their colours, few
    or many; by all frames where there are none.
    """
    share = _foreground_share(crops, cropping, track)
    usual = float(np.median(share[detected] if detected.any() else share))
    return share >= MIN_FOREGROUND_SHARE * usual


def _foreground_share(crops: Crops, cropping: Cropping, track: Track) -> Float[np.ndarray, "T"]:
    """Mean probability that the strip from head to mid-feet is not background."""
    scale, origin = cropping.scale[:, None], cropping.origin
    head, feet = (scale * (place - origin) for place in (track.head, track.mid_feet))
    along = np.linspace(0, 1, SAMPLES_ALONG)[None, :, None]
    spine = head[:, None] + along * (feet - head)[:, None]
    aside = np.linspace(-HALF_BREADTH, HALF_BREADTH, SAMPLES_ACROSS) * scale * track.height[:, None]
    rows, columns = cropping.size
    x = np.clip(np.rint(spine[:, :, None, 0] + aside[:, None]), 0, columns - 1).astype(int)
    y = np.clip(np.rint(spine[:, :, None, 1]), 0, rows - 1).astype(int)
    frames = np.arange(len(head))[:, None, None]
    return crops.foreground[frames, y, x].mean(axis=(1, 2)) / 255
