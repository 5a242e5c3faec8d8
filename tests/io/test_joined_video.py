"""Several files as one video: every frame is the one that its own file shows."""

import numpy as np
import pytest
from numbered_pictures import read_number
from numbered_videos import turn

from keyrecon.annotate.assist.preview import cut_strip
from keyrecon.errors import KeyreconError
from keyrecon.io.joined_video import join_videos
from keyrecon.io.video import open_video
from keyrecon.tracking.camera_motion import estimate_camera_motion, estimate_shot_motion

EVEN = list(range(0, 240, 12))
"""20 frames at 50 per second."""


@pytest.fixture
def joined(write_numbered):
    """Frames 4..19 of one file, all of another, and 0..9 of a third."""
    first = open_video(write_numbered("a.mp4", EVEN), start=4)
    return join_videos(
        [first, open_video(write_numbered("b.mkv", EVEN)), open_video(first.path, end=10)]
    )


NUMBERS = [*range(4, 20), *range(20), *range(10)]


def test_frames_are_those_of_the_files_in_order(joined):
    assert [read_number(p) for p in joined.frames()] == NUMBERS
    assert [read_number(p) for p in joined.frames(14, 38)] == NUMBERS[14:38]
    assert read_number(joined.frame(36)) == 0
    chosen = {3, 15, 16, 40}
    assert [read_number(p) for p in joined.chosen_frames(chosen, 40)] == [7, 19, 0, 4]
    assert len(list(joined.grey_frames())) == len(joined) == 46


def test_time_goes_on_by_a_frame_from_file_to_file(joined):
    np.testing.assert_allclose(np.diff(joined.time), 0.02)
    assert joined.time[0] == 0


def test_a_part_knows_where_files_begin_in_it(joined):
    assert joined.file_starts == (16, 36)
    part = joined.part(np.r_[10:18, 36, 40:44])
    assert part.file_starts == (6, 8)
    assert [read_number(p) for p in part.frames()] == [*range(14, 20), 0, 1, 0, 4, 5, 6, 7]
    assert joined.part(slice(16, 30)).file_starts == ()


def test_the_camera_is_cut_where_a_file_begins_however_alike_the_pictures(joined):
    assert {16, 36} <= {*estimate_camera_motion(joined).cuts}


def test_the_same_files_in_another_order_are_another_video(joined):
    first, second, _ = joined.files
    assert join_videos(joined.files).fingerprint == joined.fingerprint
    both = {join_videos(files).fingerprint for files in ([first, second], [second, first])}
    assert len(both) == 2


def test_one_file_is_itself(joined):
    assert join_videos(joined.files[:1]) is joined.files[0]


def test_files_that_do_not_fit_are_refused(write_numbered, tmp_path):
    first = open_video(write_numbered("a.mp4", EVEN))
    slower = open_video(write_numbered("b.mp4", EVEN[::2]))
    with pytest.raises(KeyreconError, match="frames per second"):
        join_videos([first, slower])
    for degrees, word in ((90, "64x128"), (180, "turned otherwise")):
        turn(first.path, tmp_path / "t.mp4", degrees)
        with pytest.raises(KeyreconError, match=word):
            join_videos([first, open_video(tmp_path / "t.mp4")])


def test_the_camera_of_some_of_its_pictures_can_be_estimated(joined):
    strip = cut_strip(joined, (2,))
    assert strip.black == 0
    assert len(estimate_shot_motion(strip).confidence) == len(strip)
