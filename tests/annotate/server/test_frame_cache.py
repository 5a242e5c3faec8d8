"""The picture shown for frame n is frame n."""

import cv2
import numpy as np
import pytest
from annotator import ask, new_project, open_project
from numbered_pictures import read_number
from numbered_videos import EVEN, KINDS, copy_packets, trim_with_edit_list, turn

from keyrecon import KeyreconError


def number_of(session, frame):
    """The number that the picture of a frame shows, turned as it is stored."""
    answer = ask(session, "GET", f"/api/frame/{frame}")
    picture = cv2.imdecode(np.frombuffer(answer.content, np.uint8), cv2.IMREAD_COLOR)
    return int(read_number(np.rot90(picture, -session.frames.video.turns)))


def shows_its_frames(folder, video, numbers):
    """Whether every picture of a video is that of its frame, whatever is requested first."""
    session = open_project(new_project(folder, video))
    try:
        order = np.random.default_rng(2).permutation(len(numbers)).tolist()
        return {n: number_of(session, n) for n in order} == dict(enumerate(numbers))
    finally:
        session.close()


@pytest.mark.parametrize("kind", KINDS)
def test_every_frame_of_every_kind_of_video_shows_its_frame(tmp_path, write_numbered, kind):
    ticks, options = KINDS[kind]
    video = write_numbered("v.mp4", ticks, options)
    assert shows_its_frames(tmp_path / "p", video, range(60))


def test_every_frame_of_a_trimmed_or_turned_video_shows_its_frame(tmp_path, write_numbered):
    whole = write_numbered("v.mp4", EVEN, {"bf": "3", "g": "20"})
    shown = {
        "edit list": (trim_with_edit_list(whole, tmp_path / "a.mp4", 13, 20), range(13, 33)),
        "late": (copy_packets(whole, tmp_path / "b.mp4", earlier=12 * 25), range(25, 60)),
        "turned": (turn(whole, tmp_path / "c.mp4", 90), range(60)),
    }
    for kind, (video, numbers) in shown.items():
        assert shows_its_frames(tmp_path / kind, video, numbers), kind


def test_frames_requested_all_at_once_are_all_answered(opened):
    frames = opened().frames
    frames.prepare(range(50))
    waiting = [frames.jpeg(frame) for frame in [*range(50), *range(49, -1, -1)]]
    for frame, picture in zip([*range(50), *range(49, -1, -1)], waiting, strict=True):
        data = np.frombuffer(picture.result(timeout=20), np.uint8)
        assert read_number(cv2.imdecode(data, cv2.IMREAD_COLOR)) == frame


@pytest.mark.parametrize(
    "tear",
    [
        lambda data: b"",
        lambda data: data[: len(data) // 2],
        lambda data: bytes(len(data)),
        lambda data: data[:300] + bytes(100) + data[400:],
    ],
    ids=["empty", "half", "zeros", "a hole"],
)
def test_a_picture_that_a_loss_of_power_tore_is_made_anew(opened, tear):
    frames = opened().frames
    whole = frames.jpeg(7).result(timeout=20)
    for file in frames.folder.glob("0*.jpg"):  # neighbours are still being written
        file.write_bytes(tear(file.read_bytes()))
    assert frames.jpeg(7).result(timeout=20) == whole
    assert frames.jpeg(7).done()


def test_a_frame_that_nobody_waits_for_any_more_delays_no_other(opened):
    frames = opened().frames
    waiting = [frames.jpeg(frame) for frame in range(50)]
    for picture in waiting[::2]:
        picture.cancel()
    for picture in waiting[1::2]:
        assert picture.result(timeout=20)
    assert frames.jpeg(0).result(timeout=20)


def test_frames_may_be_kept_by_the_browser_only_under_the_name_of_this_video(opened):
    session = opened()
    name = ask(session, "GET", "/api/project").json()["version"]
    for query, kept in (("", False), ("?v=other", False), (f"?v={name}", True)):
        control = ask(session, "GET", f"/api/frame/3{query}").headers["cache-control"]
        assert ("immutable" in control) == kept
        assert ("no-store" in control) != kept


def test_a_frame_waits_for_no_neighbour_and_fails_with_none(opened, monkeypatch):
    session = opened()
    frames = type(session.frames.video).frames

    def damaged_from_9_on(video, first, stop):
        yield from frames(video, first, min(stop, 9))
        assert session.frames.jpeg(7).done()
        raise KeyreconError("frame 9 cannot be decoded")

    monkeypatch.setattr(type(session.frames.video), "frames", damaged_from_9_on)
    assert session.frames.jpeg(7).result(timeout=20)
    with pytest.raises(KeyreconError, match="frame 9 cannot be decoded"):
        session.frames.jpeg(12).result(timeout=20)
    assert session.frames.jpeg(8).result(timeout=20)


def test_a_frame_that_cannot_be_made_says_why(opened, monkeypatch):
    session = opened()

    def broken(*_):
        raise KeyreconError("frame 7 cannot be decoded")

    monkeypatch.setattr(type(session.frames.video), "frames", broken)
    answer = ask(session, "GET", "/api/frame/7")
    assert (answer.status, answer.json()) == (400, {"error": "frame 7 cannot be decoded"})
