import threading
import time

import numpy as np
import pytest
from numbered_pictures import read_number

from keyrecon import KeyreconError
from keyrecon.io.frame_reader import read_grey, read_small, reduce_picture, shrinking, side_by_side
from keyrecon.io.video import open_video
from keyrecon.numerics.geometry import warp_points

TICKS = list(range(0, 40 * 12, 12))


@pytest.fixture(scope="module")
def video(write_numbered):
    return open_video(write_numbered("read.mp4", TICKS, {"bf": "3", "g": "12"}))


def test_results_come_in_order_however_long_each_takes():
    def work(number):
        time.sleep(0.01 * (number % 3))
        return number

    assert list(side_by_side(work, range(20), threads=4)) == list(range(20))


def test_a_fault_in_the_work_reaches_who_asked_for_it():
    def work(number):
        if number == 5:
            raise KeyreconError("frame 5 is broken")
        return number

    with pytest.raises(KeyreconError, match="frame 5 is broken"):
        list(side_by_side(work, range(20)))


def test_who_stops_listening_leaves_no_thread_behind(video):
    before = threading.active_count()
    pictures = read_small(video, 64)
    next(pictures)
    pictures.close()
    assert threading.active_count() == before


def test_a_fault_while_reading_reaches_who_asked_for_it(video, monkeypatch):
    def broken(self):
        yield np.zeros((64, 128), np.uint8)
        raise KeyreconError("the file ends early")

    monkeypatch.setattr(type(video), "grey_frames", broken)
    with pytest.raises(KeyreconError, match="ends early"):
        list(read_grey(video, 64))


def test_wanted_frames_are_those_and_in_order(video):
    shown = [read_number(p) for p in read_small(video, 128, {31, 4, 17})]
    assert shown == [4, 17, 31]


def test_brightness_is_read_frame_by_frame(video):
    grey = list(read_grey(video, 128))
    assert len(grey) == len(video)
    assert [read_number(p) for p in grey] == list(range(len(video)))


@pytest.mark.parametrize("width", [64, 40, 23])
def test_a_reduced_picture_shows_a_spot_where_the_mapping_says(width):
    picture = np.zeros((96, 128, 3), np.uint8)
    picture[40:48, 80:88] = 255
    small = reduce_picture(picture, width)[..., 0].astype(float)
    rows, columns = np.indices(small.shape)
    found = np.array([(small * columns).sum(), (small * rows).sum()]) / small.sum()
    expected = warp_points(shrinking(width / 128), np.array([[83.5, 43.5]]))[0]
    assert np.allclose(found, expected, atol=0.15)
