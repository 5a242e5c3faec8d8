"""Cuts are found to the frame, and nothing else is taken for one."""

from functools import cache

import cv2
import numpy as np
import pytest

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


def cuts_of(pictures):
    detector = CutDetector()
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


def test_a_flash_is_no_cut():
    pictures = [view(scene(0))] * 30
    pictures[12 : 12 + FLASH_FRAMES] = [view(scene(1))] * FLASH_FRAMES
    assert cuts_of(pictures) == []


def test_black_between_two_views_of_one_place_is_a_shot_of_its_own():
    pictures = [view(scene(0))] * 10 + [np.full(SIZE[::-1], 12, np.uint8)] * 8
    assert cuts_of(pictures + [view(scene(0))] * 10) == [10, 18]


@pytest.mark.parametrize("length", [12, 30, 50])
def test_a_dissolve_between_moving_shots_is_taken_out_of_both(length):
    before = [view(scene(0), shift) for shift in np.linspace(0, 60, 80 + length)]
    after = [view(scene(1), shift) for shift in np.linspace(30, 0, 80 + length)]
    share = np.clip((np.arange(160 + length) - 79) / (length + 1), 0, 1)
    pictures = [
        cv2.addWeighted(before[min(t, 79 + length)], 1 - w, after[max(0, t - 80)], w, 0)
        for t, w in enumerate(share)
    ]
    detector = CutDetector()
    list(detector.watch(pictures))
    first, end = detector.cuts
    assert detector.dissolves == [first]
    assert first <= 80 + length // 3
    assert end >= 80 + length - length // 3
    assert end - first <= 2 * length + 8
