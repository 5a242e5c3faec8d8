"""The picture shown for frame n is frame n."""

import cv2
import numpy as np
import pytest
from annotator import ask, new_project, open_project
from numbered_pictures import read_number
from numbered_videos import EVEN, KINDS, copy_packets, trim_with_edit_list, turn

from keyrecon import KeyreconError


def still_of(desk, frame):
    """The number that the still of a frame shows, stood as it is stored."""
    answer = ask(desk, "GET", f"/api/frame/{frame}")
    picture = cv2.imdecode(np.frombuffer(answer.content, np.uint8), cv2.IMREAD_COLOR)
    return int(read_number(np.rot90(picture, -desk.stills.video.turns)))


def shows_its_frames(folder, video, numbers):
    """Whether every still of a video shows what its frame must, whatever is asked first."""
    desk = open_project(new_project(folder, video))
    try:
        order = np.random.default_rng(2).permutation(len(numbers)).tolist()
        return {n: still_of(desk, n) for n in order} == dict(enumerate(numbers))
    finally:
        desk.close()


@pytest.mark.parametrize("kind", KINDS)
def test_every_still_of_every_kind_of_video_shows_its_frame(tmp_path, write_numbered, kind):
    ticks, options = KINDS[kind]
    video = write_numbered("v.mp4", ticks, options)
    assert shows_its_frames(tmp_path / "p", video, range(60))


def test_every_still_of_a_trimmed_or_turned_video_shows_its_frame(tmp_path, write_numbered):
    whole = write_numbered("v.mp4", EVEN, {"bf": "3", "g": "20"})
    shown = {
        "edit list": (trim_with_edit_list(whole, tmp_path / "a.mp4", 13, 20), range(13, 33)),
        "late": (copy_packets(whole, tmp_path / "b.mp4", earlier=12 * 25), range(25, 60)),
        "turned": (turn(whole, tmp_path / "c.mp4", 90), range(60)),
    }
    for kind, (video, numbers) in shown.items():
        assert shows_its_frames(tmp_path / kind, video, numbers), kind


def test_stills_asked_for_all_at_once_are_all_answered(opened):
    stills = opened().stills
    stills.prepare(range(50))
    waiting = [stills.still(frame) for frame in [*range(50), *range(49, -1, -1)]]
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
def test_a_still_that_a_loss_of_power_tore_is_made_anew(opened, tear):
    stills = opened().stills
    whole = stills.still(7).result(timeout=20)
    for file in stills.folder.iterdir():
        file.write_bytes(tear(file.read_bytes()))
    assert stills.still(7).result(timeout=20) == whole
    assert stills.still(7).done()


def test_a_still_that_nobody_waits_for_any_more_delays_no_other(opened):
    stills = opened().stills
    waiting = [stills.still(frame) for frame in range(50)]
    for picture in waiting[::2]:
        picture.cancel()
    for picture in waiting[1::2]:
        assert picture.result(timeout=20)
    assert stills.still(0).result(timeout=20)


def test_stills_may_be_kept_by_the_browser_only_under_the_name_of_this_video(opened):
    desk = opened()
    name = ask(desk, "GET", "/api/project").json()["version"]
    for query, kept in (("", False), ("?v=other", False), (f"?v={name}", True)):
        control = ask(desk, "GET", f"/api/frame/3{query}").headers["cache-control"]
        assert ("immutable" in control) == kept
        assert ("no-store" in control) != kept


def test_a_still_waits_for_no_neighbour_and_fails_with_none(opened, monkeypatch):
    desk = opened()
    frames = type(desk.stills.video).frames

    def damaged_from_9_on(video, first, stop):
        yield from frames(video, first, min(stop, 9))
        assert desk.stills.still(7).done()
        raise KeyreconError("frame 9 cannot be decoded")

    monkeypatch.setattr(type(desk.stills.video), "frames", damaged_from_9_on)
    assert desk.stills.still(7).result(timeout=20)
    with pytest.raises(KeyreconError, match="frame 9 cannot be decoded"):
        desk.stills.still(12).result(timeout=20)
    assert desk.stills.still(8).result(timeout=20)


def test_a_still_that_cannot_be_made_says_why(opened, monkeypatch):
    desk = opened()

    def broken(*_):
        raise KeyreconError("frame 7 cannot be decoded")

    monkeypatch.setattr(type(desk.stills.video), "frames", broken)
    answer = ask(desk, "GET", "/api/frame/7")
    assert (answer.status, answer.json()) == (400, {"error": "frame 7 cannot be decoded"})
