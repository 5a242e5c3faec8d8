"""The pictures of keyframes that labelling tools read."""

import numpy as np

from keyrecon.app.keyframing import delete_other_pictures


def test_pictures_of_keyframes_that_are_asked_for_no_more_go(tmp_path):
    own = {"frame_3.png", "frame_00000a.png", "frame_000003.jpg", "frame_0000003.png", "notes.txt"}
    for name in {"frame_000003.png", "frame_000007.png", "frame_000030.png", *own}:
        (tmp_path / name).write_text("a picture")
    delete_other_pictures(tmp_path, np.array([7, 30]))
    left = {file.name for file in tmp_path.iterdir()}
    assert left == {"frame_000007.png", "frame_000030.png", *own}
