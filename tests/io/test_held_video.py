"""Frames held in memory or in a file are those of the video."""

from dataclasses import replace

import numpy as np
import pytest

from keyrecon.errors import KeyreconError
from keyrecon.io.held_video import hold_frames, hold_if_small, mirror_video
from keyrecon.io.joined_video import join_videos
from keyrecon.io.video import Video, open_video
from keyrecon.io.video_writer import write_video

FRAMES, SIZE = 12, (70, 100)


@pytest.fixture(scope="module")
def video(tmp_path_factory):
    """Coloured noise of a size whose rows need padding."""
    rng = np.random.default_rng(0)
    path = tmp_path_factory.mktemp("held") / "v.mp4"
    write_video(path, (rng.integers(0, 255, (*SIZE, 3), np.uint8) for _ in range(FRAMES)), 25.0)
    return open_video(path, 1)


@pytest.fixture
def decoded(monkeypatch):
    """How many frames were decoded."""
    counts = []
    original = Video._decoded

    def spy(self, start, stop):
        for frame in original(self, start, stop):
            counts.append(start)
            yield frame

    monkeypatch.setattr(Video, "_decoded", spy)
    return counts


@pytest.mark.parametrize("bytes_in_memory", [1e9, 6e4, 0.0])
def test_held_frames_are_those_of_the_video(video, bytes_in_memory):
    held = hold_frames(video, bytes_in_memory)
    for read in (
        lambda v: v.frames(),
        lambda v: v.frames(2, 5),
        lambda v: v.grey_frames(),
        lambda v: v.chosen_frames({1, 7}, 7),
        lambda v: [v.frame(9)],
    ):
        ours, theirs = ([np.array(p) for p in read(v)] for v in (held, video))
        assert len(ours) == len(theirs)
        assert all(np.array_equal(a, b) for a, b in zip(ours, theirs, strict=True))


def test_reduced_frames_in_memory_are_those_of_the_video(video):
    pairs = zip(hold_frames(video).frames(width=40), video.frames(width=40), strict=True)
    assert all(np.array_equal(a, b) for a, b in pairs)


@pytest.mark.parametrize("bytes_in_memory", [1e9, 0.0])
def test_a_held_video_is_decoded_once(video, decoded, bytes_in_memory):
    held = hold_frames(video, bytes_in_memory)
    assert not decoded
    for _ in range(3):
        assert sum(1 for _ in held.frames()) == sum(1 for _ in held.grey_frames()) == FRAMES - 1
    assert len(decoded) == FRAMES - 1


@pytest.mark.parametrize("bytes_in_memory", [1e9, 6e4])
@pytest.mark.parametrize("some", [slice(3, 8), np.array([1, 4, 9])])
def test_parts_of_a_held_video_are_decoded_with_the_whole(video, decoded, some, bytes_in_memory):
    expected = [np.array(p) for p in video.part(some).part(slice(1, 3)).frames()]
    held = hold_frames(video, bytes_in_memory)
    parts = {"before": held.part(some)}
    assert list(held.grey_frames())
    parts["after"] = held.part(some)
    decoded.clear()
    for when, part in parts.items():
        assert np.array_equal(part.time, video.time[some])
        shown = [np.array(p) for p in part.part(slice(1, 3)).frames()]
        assert all(np.array_equal(a, b) for a, b in zip(shown, expected, strict=True))
        assert bool(decoded) == (when == "before")
        decoded.clear()


def test_a_held_video_is_held_once(video):
    held = hold_frames(video)
    assert hold_if_small(held, 0.0) is held


def test_a_video_that_cannot_be_decoded_is_said_to_be_so_each_time(video):
    broken = hold_frames(replace(video, stamps=video.stamps + 1))
    for _ in range(2):
        with pytest.raises(KeyreconError, match="cannot be decoded"):
            list(broken.frames())


def test_a_held_video_counts_as_the_same_video(video):
    held = hold_frames(video)
    assert held.fingerprint == video.fingerprint and len(held) == len(video)
    assert np.array_equal(held.time, video.time) and held.fps == video.fps


def test_files_that_were_joined_can_be_held(video):
    joined = join_videos([video, video])
    held = hold_frames(joined)
    assert held.fingerprint == joined.fingerprint and held.file_starts == joined.file_starts
    assert held.name == joined.name
    pairs = zip(held.frames(), joined.frames(), strict=True)
    assert all(np.array_equal(a, b) for a, b in pairs)


def test_a_part_of_a_mirrored_video_is_mirrored(video):
    part = mirror_video(hold_frames(video)).part(slice(3, 5))
    expected = [picture[:, ::-1] for picture in video.frames(3, 5)]
    assert all(np.array_equal(a, b) for a, b in zip(part.frames(), expected, strict=True))


def test_only_what_fits_into_memory_is_held(video):
    size = 1.5 * SIZE[0] * SIZE[1] * (FRAMES - 1)
    assert hold_if_small(video, 0.9 * size) is video
    assert hold_if_small(video, 1.1 * size).fingerprint == video.fingerprint
    assert hold_if_small(video, 1.1 * size) is not video
