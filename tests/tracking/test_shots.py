"""Cuts are found to the frame, and nothing else is taken for one."""

from functools import cache

import cv2
import numpy as np
import pytest

from keyrecon.io.stages import StageStore
from keyrecon.io.video import open_video
from keyrecon.io.video_writer import write_video
from keyrecon.io.workers import open_workers
from keyrecon.parallel_map import one_by_one
from keyrecon.tracking import camera_motion
from keyrecon.tracking.camera_motion import estimate_camera_motion
from keyrecon.tracking.shots import FLASH_FRAMES, CutDetector

SIZE = 320, 180


@cache
def scene(seed):
    """A place, larger than the picture."""
    noise = np.random.default_rng(seed).integers(0, 255, (500, 900)).astype(np.float32)
    smooth = cv2.GaussianBlur(noise, (0, 0), 6)
    return cv2.normalize(smooth, None, 20, 235, cv2.NORM_MINMAX).astype(np.uint8)


def view(place, shift=0.0, zoom=1.0):
    matrix = np.array([[1 / zoom, 0, 200 + shift], [0, 1 / zoom, 100]], float)
    return cv2.warpAffine(place, matrix, SIZE, flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)


def cuts_of(pictures, fps=25.0):
    detector = CutDetector.at_rate(fps)
    assert list(detector.watch(pictures)) == pictures
    return detector.cuts


def test_a_cut_is_found_to_the_frame_whatever_the_lengths_of_the_shots():
    lengths = (30, 7, 4, 25, 12)
    pictures = [
        view(scene(seed), shift)
        for seed, length in enumerate(lengths)
        for shift in np.linspace(0, 40, length)
    ]
    assert cuts_of(pictures) == np.cumsum(lengths)[:-1].tolist()


@pytest.mark.parametrize(
    "pictures",
    [
        [view(scene(0), shift) for shift in np.linspace(0, 300, 20)],
        [view(scene(0), 0.0, zoom) for zoom in np.geomspace(1, 2, 20)],
        [cv2.convertScaleAbs(view(scene(0)), alpha=a) for a in np.linspace(1, 0.4, 20)],
        [np.full(SIZE[::-1], 90, np.uint8)] * 20,
    ],
    ids=["pan", "zoom", "exposure", "nothing"],
)
def test_what_lasts_is_one_shot(pictures):
    assert cuts_of(pictures) == []


def close_up(t):
    """Somebody who fills half of the picture moves to the left while what is behind moves right."""
    picture = view(scene(0), -20 * t)
    near = view(scene(1), 24 * t)
    half = np.zeros(SIZE[::-1], bool)
    half[30:, 60:220] = True
    return np.where(half, near, picture)


def test_a_close_up_of_somebody_who_moves_against_what_is_behind_is_one_shot():
    pictures = [close_up(t) for t in range(12)]
    assert cuts_of(pictures) == []
    strange = [view(scene(2), 3 * t) for t in range(12)]
    assert cuts_of(pictures + strange) == [12]


def test_a_flash_is_no_cut():
    pictures = [view(scene(0))] * 30
    pictures[12 : 12 + FLASH_FRAMES] = [view(scene(1))] * FLASH_FRAMES
    assert cuts_of(pictures) == []


def test_black_between_two_views_of_one_place_is_a_shot_of_its_own():
    pictures = [view(scene(0))] * 10 + [np.full(SIZE[::-1], 12, np.uint8)] * 8
    assert cuts_of(pictures + [view(scene(0))] * 10) == [10, 18]


def dissolve(length, before, after, fps=25.0):
    """One moving shot that dissolves into another; the first pans by 12 px a second."""
    one = [view(scene(0), 12 / fps * t) for t in range(before + length)]
    other = [view(scene(1), 30 - 6 / fps * t) for t in range(after + length)]
    share = np.clip((np.arange(before + length + after) - before + 1) / (length + 1), 0, 1)
    return [
        cv2.addWeighted(one[min(t, before + length - 1)], 1 - w, other[max(0, t - before)], w, 0)
        for t, w in enumerate(share)
    ]


@pytest.mark.parametrize(
    ("length", "fps"), [(12, 25.0), (30, 25.0), (50, 25.0), (100, 60.0), (300, 240.0)]
)
def test_a_dissolve_between_moving_shots_is_taken_out_of_both(length, fps):
    detector, around = CutDetector.at_rate(fps), max(80, length)
    list(detector.watch(dissolve(length, around, around, fps)))
    first, end = detector.cuts
    assert detector.dissolves == [first]
    assert first <= around + length // 3
    assert end >= around + length - length // 3
    assert end - first <= 2 * length + 8


def test_somebody_before_the_lens_for_a_moment_is_no_cut_however_many_frames_that_is():
    pictures = [view(scene(0))] * 100
    pictures[40:50] = [view(scene(1))] * 10
    assert cuts_of(pictures, fps=240.0) == []
    assert cuts_of(pictures, fps=25.0) == [40, 50]


@pytest.mark.parametrize(("before", "length", "after"), [(2, 5, 3), (3, 6, 2), (1, 8, 2)])
def test_a_dissolve_that_is_all_of_a_video_leaves_no_frame_without_a_camera(
    before, length, after, tmp_path
):
    write_video(
        tmp_path / "short.mp4",
        (np.repeat(one[..., None], 3, axis=2) for one in dissolve(length, before, after)),
        25.0,
    )
    video = open_video(tmp_path / "short.mp4")
    assert len(estimate_camera_motion(video).to_reference) == len(video)


def test_pictures_at_hand_give_the_same_motion_as_decoding_every_shot_again(monkeypatch, tmp_path):
    views = [view(scene(k), shift=3 * t) for k in range(3) for t in range(40)]
    write_video(tmp_path / "cuts.mp4", (np.repeat(v[..., None], 3, axis=2) for v in views), 25.0)
    video, decoded, read = open_video(tmp_path / "cuts.mp4"), [], camera_motion._read_reduced
    monkeypatch.setattr(
        camera_motion,
        "_read_reduced",
        lambda shot, *more: decoded.append(len(shot)) or read(shot, *more),
    )
    elsewhere = estimate_camera_motion(video, parallel_map=one_by_one)
    assert decoded == [120, 40, 40, 40]
    decoded.clear()
    here = estimate_camera_motion(video)
    assert decoded == [120]
    assert here.cuts == elsewhere.cuts == (40, 80)
    assert np.ptp(here.to_reference[80:, 0, 2]) > 50
    assert (here.to_reference == elsewhere.to_reference).all()
    assert (here.confidence == elsewhere.confidence).all()


def test_shots_are_handed_to_workers_as_what_can_be_sent(tmp_path):
    views = [view(scene(k), shift=3 * t) for k in range(2) for t in range(20)]
    write_video(tmp_path / "cut.mp4", (np.repeat(v[..., None], 3, axis=2) for v in views), 25.0)
    video = open_video(tmp_path / "cut.mp4")
    with open_workers("1") as workers:
        store = StageStore(tmp_path / "cache", workers=workers)
        elsewhere = estimate_camera_motion(video, parallel_map=store.parallel_map)
    assert (elsewhere.to_reference == estimate_camera_motion(video).to_reference).all()
