from fractions import Fraction

import av
import numpy as np
import pytest

from keyrecon.io.formats.conventions import UNEVEN
from keyrecon.io.frame_times import even_out
from keyrecon.io.video import open_video

RATES = [Fraction(rate) for rate in (15, 24, 25, 30, 50, 60, 90, 120, 240)]
RATES += [Fraction(rate, 1001) for rate in (24000, 30000, 60000)]


def write_video(path, rate, frames, ticks_per_second=None):
    """Pictures at a constant rate; their times in whole ticks where a clock is given."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=rate)
        stream.width, stream.height, stream.pix_fmt = 32, 32, "yuv420p"
        base = Fraction(1, ticks_per_second) if ticks_per_second else 1 / rate
        stream.codec_context.time_base = base
        for number in frames:
            picture = av.VideoFrame.from_ndarray(np.zeros((32, 32, 3), np.uint8), format="rgb24")
            picture.pts, picture.time_base = round(number / rate / base), base
            container.mux(stream.encode(picture))
        container.mux(stream.encode())
    return path


@pytest.mark.parametrize("rate", RATES)
def test_a_container_that_rounds_times_leaves_the_rate_as_it_was_filmed(tmp_path, rate):
    video = open_video(write_video(tmp_path / "rounded.mkv", rate, range(100)))
    true = np.arange(100) / float(rate)
    assert abs(video.fps / float(rate) - 1) < 1e-3 * float(rate) / 99
    assert np.abs(video.time - true).max() < 1e-3
    assert np.ptp(np.diff(video.time)) * video.fps < UNEVEN / 100
    assert not video.variable_rate


@pytest.mark.parametrize("rate", RATES)
def test_times_that_the_container_holds_exactly_are_taken_as_they_are(tmp_path, rate):
    video = open_video(write_video(tmp_path / "exact.mp4", rate, range(100)))
    with av.open(str(video.path)) as container:
        tick = float(container.streams.video[0].time_base)
    assert (video.time == (video.stamps - video.stamps[0]) * tick).all()
    assert video.fps == 1 / float(np.median(np.diff(video.time)))
    assert video.fps == pytest.approx(float(rate), rel=1e-9)


def test_rounded_times_count_also_in_slow_motion_and_in_a_part(tmp_path):
    path = write_video(tmp_path / "slow.mkv", Fraction(30), range(100))
    slow = open_video(path, start=11, end=92, slow_motion=8.0)
    assert slow.fps == pytest.approx(240, rel=1e-3)
    assert np.allclose(slow.time, np.arange(81) / 240, atol=1e-3 / 8)


@pytest.mark.parametrize("rate", [24, 30, 60, 120, 240, 400])
@pytest.mark.parametrize("missing", [1, 2, 50, 98])
def test_where_a_frame_is_missing_times_stay_as_they_are(rate, missing):
    numbers = np.delete(np.arange(100), missing)
    for ticks_per_second in (1000, rate):
        stamps = np.round(numbers * ticks_per_second / rate).astype(int)
        assert (even_out(stamps) == stamps).all()


def test_frames_that_come_unevenly_keep_their_times():
    uneven = np.cumsum(np.random.default_rng(0).integers(30, 37, 100))
    assert (even_out(uneven) == uneven - uneven[0]).all()


def test_rounding_stays_known_in_a_container_with_a_finer_clock():
    milliseconds = np.round(np.arange(200) * 1000 / 24).astype(int)
    copied = even_out(16 * milliseconds)
    assert np.allclose(copied, 16 * np.linspace(0, milliseconds[-1], 200))
