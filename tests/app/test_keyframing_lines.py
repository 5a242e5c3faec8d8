"""What `keyrecon keyframes` tells of the keyframes and of what comes next."""

from dataclasses import replace

import numpy as np
import pytest

from keyrecon.app.keyframing import count_different, describe_gains, describe_next
from keyrecon.app.project import annotated, start
from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.coco import write_coco
from keyrecon.io.video_writer import write_video
from keyrecon.io.workspace import Workspace
from keyrecon.records import Annotations, HalfKeyframes, Keyframes, MarkGains

SIZE = 128, 96


def keyframes_of(frames, beta=0.01, coverage=None):
    gains = MarkGains(0.02, np.array(frames), np.linspace(0.2, coverage or 0.9, len(frames)), 0.116)
    half = HalfKeyframes(
        np.array(frames), np.full(40, frames[0]), np.ones(40, bool), 0.95, beta, np.zeros(40), 1,
        gains,
    )  # fmt: skip
    return Keyframes(half, half, 2, 0.95)


def bodies_on(*frames):
    count, joints = len(frames), len(LSP14.names)
    places = np.arange(joints)[None, :, None] + np.full((count, joints, 2), 20.0)
    seen, nearer = np.ones((count, joints), bool), np.zeros((count, len(LSP14.bones)), int)
    return Annotations(LSP14, np.array(frames), places, seen, nearer)


def without_wrists(marks):
    joints = marks.joints.copy()
    joints[:, [LSP14.index("right_wrist"), LSP14.index("left_wrist")]] = np.nan
    return replace(marks, joints=joints, visible=np.isfinite(joints[..., 0]))


def test_frames_that_are_marked_already_are_told_to_come_on_top_of_those_asked_for():
    """Whoever has marked what was asked for, and no more, is within the budget."""
    assert count_different(keyframes_of([3, 7]), None) == "2 different frames"
    assert count_different(keyframes_of([3]), bodies_on(5)) == "1 different frame"
    told = count_different(keyframes_of([3, 5, 7]), bodies_on(5))
    assert told == (
        "3 different frames (1 of them is marked already and comes on top of the budget, unless it "
        "stands for one that would be asked for)"
    )
    told = count_different(keyframes_of([3, 5, 7]), bodies_on(5, 7))
    assert "(2 of them are marked already and come on top of the budget, unless they" in told


def test_what_marks_bring_is_told_in_singular_and_plural():
    upper, _ = describe_gains(keyframes_of([5]))
    assert upper == (
        "Upper body, frame 5 alone will show the pose of 20% of the frames to within 2.0% of the "
        "height; one more would add 11.6%."
    )
    upper, _ = describe_gains(keyframes_of([5, 9]))
    assert "first: 5, 9 (the whole order" in upper
    assert "The first mark will show the pose of 20%" in upper
    upper, _ = describe_gains(keyframes_of([5, 9, 11, 2]))
    assert "first: 5, 9, 11, ... (the" in upper and "The first 2 marks will" in upper


def test_one_more_mark_is_told_to_be_chosen_for_less_where_the_others_stand_for_more():
    upper, _ = describe_gains(keyframes_of([5, 9], beta=0.039, coverage=0.28))
    assert upper.endswith(
        "all 2 of 28% (to within 3.9%, for which they are chosen, of 95%); one more, chosen for "
        "2.0% alone, would add 11.6%."
    )


def test_joints_that_are_marked_nowhere_are_told_before_a_run_refuses_them(tmp_path):
    write_video(tmp_path / "v.mp4", [np.zeros((96, 128, 3), np.uint8)] * 40, 25.0)
    start(tmp_path / "v.mp4", tmp_path / "p")
    workspace = Workspace(tmp_path / "p")
    asked, marks = keyframes_of([5]), without_wrists(bodies_on(5))
    told = describe_next(workspace, asked, marks)
    assert told[0].startswith("All of them are marked. No marked frame has right_wrist, left_wrist")
    assert told[1].startswith("Next: keyrecon annotate")
    assert describe_next(workspace, asked, bodies_on(5)) == [
        f"All of them are marked. Next: keyrecon run {workspace.folder}"
    ]
    write_coco(workspace.annotations_file, marks, SIZE)
    for partial in (False, True):
        with pytest.raises(KeyreconError, match="No marked frame has right_wrist, left_wrist; mar"):
            annotated(workspace, workspace.video(), asked, partial)
