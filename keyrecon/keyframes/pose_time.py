"""Time measured in pose change: a stroke takes as long as its poses differ, waiting hardly any.

A serve lasts half a second of the ten that a player prepares for it, so that a choice which counts
frames may leave it out and still cover 95 in a hundred. Measured in pose change a stroke is long.
How fast the pose changes is the pose distance of the frames just before and just after: over a
tenth of a second its rank correlation with the true speed of the joints is .80-.93 for the upper
body on four rendered sequences, over one frame .61-.83, as contours differ by their noise too.

Tried on three rendered sequences of 36 s, marked in 1.5 % of the frames: with a share of 0, .2 and
.35 of time measured so, 98.8, 98.8 and 98.6 % of the carried joints were right within .2 of the
torso, 96.6, 98.5 and 98.7 % while a wrist moves faster than 2.5 player heights per second. It has a
price where a player mostly waits: of two sequences the motion was off by 46.0 and 45.9 mm with .2,
by 39.6 and 44.4 mm with 0. On two broadcasts of small players .2 had 94.4 and 88.0 % of the joints
right, .1 had 88.0 and 83.0 %, 0 had 92.3 and 84.4 %.
"""

import numpy as np
from jaxtyping import Float, Int

from keyrecon.keyframes.coverage import TIME_UNIT
from keyrecon.records import PoseDistances

STILL_SHARE = 0.1
"""Share of the frames in which the pose does not change: what distance they have is noise. A
quarter more or less, others with it: at most 0.9 points, 1.5 mm on four clips."""
REACH_SECONDS = 0.2
"""T of Eq. 1 (`KeyframeOptions.reach`). The paper's T: 10 frames at 50 per second."""
WELL_SEEN = 0.5
"""Share of its usual outline from which a half of the body is seen well enough to count whole:
blur alone leaves more."""
FIRST_BODIES_SHARE = 0.35
"""Share of time measured in pose change where whole bodies are asked for before the keyframes."""


def elapsed_time(
    comparison: PoseDistances, half: int, reach: int, share: float
) -> Int[np.ndarray, "ends"]:
    """Time before each frame and at the end, hundredths of a frame; `half` 0 is the upper body.

    A frame takes 1 - `share`, and `share` times how many times faster than on average its pose
    changes, so that all frames together take as long as they are many. `reach` is what frames a
    gap may have that is bridged; change is measured over half of it. Where little of the half is
    seen, behind a score or beyond the picture's edge, outlines differ by what is hidden, a mark is
    mostly a guess, and time goes more slowly: half as fast where nothing is seen.
    """
    change = pose_change(comparison, half, max(1, reach // 4))
    mean = change.mean() if len(change) else 0.0
    weight = 1 - share + share * change / mean if mean > 0 else np.ones(len(change))
    seen = np.nan_to_num(comparison.seen[half])
    if share > 0 and seen.any():
        weight *= (1 + np.minimum(seen / WELL_SEEN, 1.0)) / 2
        weight *= len(weight) / weight.sum()
    return np.rint(TIME_UNIT * np.concatenate([[0.0], np.cumsum(weight)])).astype(np.int64)


def pose_seconds(comparison: PoseDistances, fps: float) -> Float[np.ndarray, "T"]:
    """Seconds up to each frame measured so, the mean of both halves of the body."""
    reach = max(1, round(REACH_SECONDS * fps))
    elapsed = np.mean(
        [elapsed_time(comparison, half, reach, FIRST_BODIES_SHARE) for half in (0, 1)], axis=0
    )
    return elapsed[:-1] / (TIME_UNIT * fps)


def pose_change(comparison: PoseDistances, half: int, lag: int) -> Float[np.ndarray, "T"]:
    """Pose distance between `lag` frames before and after each frame, less the noise of a still
    pose; player heights. Frames that a cut or others left out lie between are not compared."""
    table = comparison.upper if half == 0 else comparison.lower
    frames = np.arange(len(comparison.row))
    begins = np.flatnonzero(np.append(True, np.isnan(comparison.consecutive_distance[half])))
    run = np.searchsorted(begins, frames, side="right") - 1
    before = np.maximum(frames - lag, begins[run])
    after = np.minimum(frames + lag, np.append(begins[1:], len(frames))[run] - 1)
    row, apart = comparison.row, comparison.exemplar_distance[half]
    same = row[before] == row[after]
    distance = table[row[before], row[after]]
    distance = np.where(same, np.maximum(apart[before], apart[after]), distance).astype(float)
    # at the ends of a shot the two are nearer in time
    distance *= 2 * lag / np.maximum(after - before, 1)
    return np.maximum(distance - np.quantile(distance, STILL_SHARE), 0.0)
