"""What `keyrecon run` tells of frames without a figure."""

from dataclasses import replace

import numpy as np
from small_motion import make_motion

from keyrecon.app.running import describe_unseen
from keyrecon.records import PLAYER, Shots


def test_frames_of_usable_shots_in_which_nobody_is_seen_are_told():
    motion = make_motion(frames=60)
    points = motion.points3d.copy()
    points[:10] = points[30:45] = np.nan
    unseen = replace(motion, points3d=points)
    (line,) = describe_unseen(unseen, Shots.between((), 60))
    assert line.startswith("Nobody seen in frames 0-9, 30-44: there is no figure there.")
    (line,) = describe_unseen(unseen, Shots((0, 30, 45), 60, (PLAYER, "black", PLAYER)))
    assert line.startswith("Nobody seen in frames 0-9:")
    assert describe_unseen(motion, Shots.between((), 60)) == []
