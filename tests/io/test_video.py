from itertools import islice

import av
import numpy as np
import pytest
from numbered_pictures import read_number
from numbered_videos import (
    EVEN,
    KINDS,
    OPEN_GOP,
    UNEVEN,
    copy_packets,
    trim_with_edit_list,
    turn,
    write_divx,
)

from keyrecon import KeyreconError
from keyrecon.io.frame_reader import read_grey, read_small
from keyrecon.io.held_video import hold_frames
from keyrecon.io.video import open_video


@pytest.mark.parametrize("kind", KINDS)
def test_the_picture_of_frame_n_is_frame_n(write_numbered, kind):
    ticks, options = KINDS[kind]
    video = open_video(write_numbered("numbered.mp4", ticks, options))
    assert len(video) == len(ticks)
    assert [read_number(p) for p in video.frames()] == list(range(len(ticks)))
    order = np.random.default_rng(0).permutation(len(ticks))[:25]
    assert [read_number(video.frame(int(n))) for n in order] == order.tolist()


def numbers(video):
    """What the pictures say, all in a row and one by one in any order."""
    in_a_row = [read_number(np.rot90(p, -video.turns)) for p in video.frames()]
    order = np.random.default_rng(0).permutation(len(video))[:25].tolist()
    single = {n: read_number(np.rot90(video.frame(n), -video.turns)) for n in order}
    assert single == {n: in_a_row[n] for n in order}
    return in_a_row


@pytest.mark.parametrize("options", [{"bf": "3", "g": "20"}, OPEN_GOP])
def test_frames_before_the_start_of_an_edit_list_do_not_count(write_numbered, tmp_path, options):
    whole = write_numbered("whole.mp4", EVEN, options)
    for first in (7, 25):
        cut = copy_packets(whole, tmp_path / f"{first}.mp4", earlier=12 * first)
        assert numbers(open_video(cut)) == list(range(first, 60))


@pytest.mark.parametrize("options", [{"bf": "3", "g": "20"}, OPEN_GOP])
def test_frames_outside_both_ends_of_an_edit_list_do_not_count(write_numbered, tmp_path, options):
    whole = write_numbered("whole.mp4", EVEN, options)
    trimmed = trim_with_edit_list(whole, tmp_path / "trimmed.mp4", 13, 20)
    assert numbers(open_video(trimmed)) == list(range(13, 33))


@pytest.mark.parametrize("suffix", ["mp4", "mkv"])
def test_a_file_cut_inside_an_open_gop_begins_with_its_first_whole_picture(
    write_numbered, tmp_path, suffix
):
    whole = write_numbered(f"whole.{suffix}", EVEN, OPEN_GOP)
    cut = copy_packets(whole, tmp_path / f"cut.{suffix}", skip_until=1)
    assert numbers(open_video(cut)) == list(range(20, 60))


@pytest.mark.parametrize("degrees", [90, 180, 270])
def test_a_file_that_says_it_is_turned_is_turned_as_players_do(write_numbered, tmp_path, degrees):
    whole = write_numbered("whole.mp4", EVEN)
    video = open_video(turn(whole, tmp_path / "turned.mp4", degrees))
    assert video.turns == -degrees // 90 % 4  # clockwise in the file, counter-clockwise here
    assert (video.width, video.height) == ((128, 64) if degrees == 180 else (64, 128))
    assert numbers(video) == list(range(60))


@pytest.mark.parametrize("degrees", [0, 90, 180, 270])
def test_a_file_that_says_it_is_mirrored_is_shown_mirrored(write_numbered, tmp_path, degrees):
    whole = write_numbered("whole.mp4", EVEN)
    video = open_video(turn(whole, tmp_path / "mirrored.mp4", degrees, mirrored=True))
    stored = open_video(whole).frame(7)
    expected = np.rot90(stored[:, ::-1], -degrees // 90)
    assert np.array_equal(video.frame(7), expected)
    assert (video.height, video.width) == expected.shape[:2]


def test_a_turn_told_by_a_tag_of_older_programs_counts(tmp_path):
    path = tmp_path / "tagged.mkv"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=25)
        stream.width, stream.height, stream.pix_fmt = 128, 64, "yuv420p"
        stream.metadata["rotate"] = "90"
        picture = np.zeros((64, 128, 3), np.uint8)
        picture[:, :20] = 255
        container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        container.mux(stream.encode())
    shown = open_video(path).frame(0)
    assert shown.shape == (128, 64, 3)
    assert shown[:10].mean() > 250 > 5 > shown[-10:].mean()


@pytest.mark.parametrize("degrees", [90, 180, 270])
def test_every_way_of_reading_shows_a_turned_file_upright(write_numbered, tmp_path, degrees):
    """In colour, in grey, reduced, chosen, ahead and held: the same upright picture."""
    video = open_video(turn(write_numbered("w.mp4", EVEN), tmp_path / "t.mp4", degrees))
    held = hold_frames(video)
    size = (video.height, video.width)
    upright = [p.mean(axis=2) for p in video.frames(0, 3)]
    readers = {
        "held": held.frames(0, 3),
        "stored": hold_frames(video, most_in_memory=0.0).frames(0, 3),
        "chosen": video.chosen_frames({0, 1, 2}, 2),
        "small": read_small(held, video.width, {0, 1, 2}),
        "grey": islice(video.grey_frames(), 3),
        "held grey": islice(held.grey_frames(), 3),
        "small grey": islice(read_grey(held, video.width), 3),
    }
    for name, pictures in readers.items():
        for picture, expected in zip(pictures, upright, strict=True):
            grey = picture if picture.ndim == 2 else picture.mean(axis=2)
            assert grey.shape == size, name
            assert np.abs(grey - expected).mean() < 20, name  # studio range, chroma
    assert next(video.frames(0, 1, width=32)).shape[:2] == (round(32 * size[0] / size[1]), 32)


def test_times_are_those_of_the_file_and_slow_motion_divides_them(write_numbered):
    path = write_numbered("uneven.mp4", UNEVEN)
    assert np.allclose(open_video(path).time, np.array(UNEVEN) / 600, atol=1e-3)
    assert np.allclose(open_video(path, slow_motion=4.0).time, np.array(UNEVEN) / 2400, atol=1e-3)
    assert open_video(path).variable_rate
    assert not open_video(write_numbered("even.mp4", EVEN)).variable_rate


@pytest.mark.parametrize("factor", [0.0, -2.0, float("nan"), float("inf")])
def test_a_slow_motion_that_cannot_be_is_refused(write_numbered, factor):
    with pytest.raises(KeyreconError, match="slow-motion factor"):
        open_video(write_numbered("short.mp4", EVEN), slow_motion=factor)


def test_a_trimmed_video_counts_from_its_first_frame(write_numbered):
    video = open_video(write_numbered("trim.mp4", EVEN), start=20, end=30)
    assert [read_number(p) for p in video.frames()] == list(range(20, 30))
    assert read_number(video.frame(3)) == 23
    assert video.time[0] == 0


def test_a_reduced_picture_shows_the_same_frame(write_numbered):
    video = open_video(write_numbered("small.mp4", EVEN))
    small = next(video.frames(7, 8, width=64))
    assert small.shape == (32, 64, 3)


def test_pictures_of_an_old_avi_come_in_the_order_in_which_they_were_filmed(tmp_path):
    video = open_video(write_divx(tmp_path / "divx.avi", 30))
    assert [read_number(p) for p in video.frames()] == list(range(30))
    assert [read_number(video.frame(n)) for n in (29, 12, 0, 13, 1)] == [29, 12, 0, 13, 1]
    assert not video.variable_rate


def test_a_missing_video_is_named(tmp_path):
    with pytest.raises(KeyreconError, match="no video at"):
        open_video(tmp_path / "none.mp4")


def test_an_empty_file_is_called_empty(tmp_path):
    (tmp_path / "empty.mp4").touch()
    with pytest.raises(KeyreconError, match="empty"):
        open_video(tmp_path / "empty.mp4")


def test_a_file_of_another_kind_is_refused(tmp_path):
    (tmp_path / "text.mp4").write_text("not a video at all" * 100)
    with pytest.raises(KeyreconError, match="cannot be read as a video"):
        open_video(tmp_path / "text.mp4")


def test_a_title_in_letters_of_an_older_code_does_not_hinder_reading(tmp_path):
    with av.open(str(tmp_path / "utf8.avi"), "w") as container:
        container.metadata["title"] = "cafe"
        stream = container.add_stream("mpeg4", rate=25)
        stream.width, stream.height, stream.pix_fmt = 32, 32, "yuv420p"
        picture = av.VideoFrame.from_ndarray(np.zeros((32, 32, 3), np.uint8), "rgb24")
        container.mux([*stream.encode(picture), *stream.encode()])
    latin1 = (tmp_path / "utf8.avi").read_bytes().replace(b"cafe", "café".encode("latin1"))
    (tmp_path / "latin1.avi").write_bytes(latin1)
    assert len(list(open_video(tmp_path / "latin1.avi").frames())) == 1


def test_sound_alone_is_not_a_video(tmp_path):
    with av.open(str(tmp_path / "sound.mp4"), "w") as container:
        stream = container.add_stream("aac", rate=8000)
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), "fltp", "mono")
        frame.sample_rate = 8000
        container.mux(stream.encode(frame))
        container.mux(stream.encode())
    with pytest.raises(KeyreconError, match="only sound"):
        open_video(tmp_path / "sound.mp4")


def test_a_file_cut_off_while_copied_is_refused_with_one_message(write_numbered, tmp_path):
    whole = write_numbered("whole.mp4", EVEN).read_bytes()
    (tmp_path / "cut.mp4").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(KeyreconError, match=r"cannot be read|cut off|damaged"):
        list(open_video(tmp_path / "cut.mp4").frames())


def test_a_file_that_ends_in_the_middle_says_how_much_of_it_is_there(write_numbered, tmp_path):
    path = tmp_path / "whole.mp4"
    source = write_numbered("whole.mp4", EVEN, {"g": "10"})
    with (
        av.open(str(source)) as stored,
        av.open(str(path), "w", options={"movflags": "faststart"}) as copy,
    ):
        stream = copy.add_stream_from_template(stored.streams.video[0])
        for packet in stored.demux(video=0):
            if packet.dts is not None:
                packet.stream = stream
                copy.mux(packet)
    content = path.read_bytes()
    assert content.index(b"moov") < content.index(b"mdat")
    cut = tmp_path / "cut.mp4"
    cut.write_bytes(content[: int(len(content) * 0.8)])
    with pytest.raises(KeyreconError, match=r"ends in the middle: (\d+) frames are there"):
        open_video(cut)
    assert len(open_video(cut, end=10)) == 10
    assert len(open_video(path)) == len(EVEN)


def test_damage_inside_a_file_names_the_frame(write_numbered, tmp_path):
    path = write_numbered("whole.mkv", EVEN, {"g": "60"})
    content = path.read_bytes()
    (tmp_path / "cut.mkv").write_bytes(content[: int(len(content) * 0.6)])
    try:
        video = open_video(tmp_path / "cut.mkv")
        assert len(video) < len(EVEN)
        shown = [read_number(p) for p in video.frames()]
        assert shown == list(range(len(shown)))
    except KeyreconError as fault:
        assert "damaged" in str(fault) or "breaks off" in str(fault)


def test_a_trim_that_does_not_fit_is_refused(write_numbered):
    with pytest.raises(KeyreconError, match="has 60 frames"):
        open_video(write_numbered("short.mp4", EVEN), start=70)


@pytest.mark.parametrize("longest", [1e9, 3], ids=["decoded through", "jumped over"])
def test_a_video_of_parts_has_their_pictures_whatever_lies_between(
    write_numbered, monkeypatch, longest
):
    whole = open_video(write_numbered("whole.mp4", EVEN, {"g": "10"}))
    monkeypatch.setattr("keyrecon.io.video.SOUGHT_SECONDS", 0.0)
    monkeypatch.setattr("keyrecon.io.video.SOUGHT_FRAMES", longest)
    frames = np.r_[3:6, 21:24, 50, 58:60]
    part = whole.part(frames)
    assert [read_number(p) for p in part.frames()] == frames.tolist()
    assert [read_number(p) for p in part.chosen_frames({1, 4, 6}, 6)] == [4, 22, 50]
    assert read_number(part.frame(7)) == 58
    np.testing.assert_allclose(part.time, whole.time[frames])
