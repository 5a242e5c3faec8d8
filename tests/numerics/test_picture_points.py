import cv2
import numpy as np
import pytest

from keyrecon.numerics.picture_points import sample_picture, track_there_and_back


@pytest.fixture
def texture():
    noise = np.random.default_rng(3).uniform(0, 255, (60, 80))
    return cv2.GaussianBlur(noise, (0, 0), 2.0).astype(np.uint8)


def test_a_picture_sampled_at_its_pixels_is_itself(texture):
    points = np.stack(np.meshgrid(np.arange(80.0), np.arange(60.0)), axis=-1)
    np.testing.assert_array_equal(sample_picture(texture, points), texture)


def test_between_pixels_the_neighbours_are_averaged():
    picture = np.array([[0, 8], [16, 40]], np.float32)
    assert sample_picture(picture, np.array([[[0.5, 0.5]]])) == 16


def test_outside_lies_nothing_or_what_lies_on_the_rim():
    picture, outside = np.full((4, 4), 7.0, np.float32), np.array([[[-3.0, 2.0]]])
    assert sample_picture(picture, outside) == 0
    assert sample_picture(picture, outside, cv2.BORDER_REPLICATE) == 7


def test_a_shifted_texture_is_tracked_there_and_back(texture):
    shifted = np.roll(texture, (2, 3), axis=(0, 1))
    start = np.array([[30, 30], [45, 25]], np.float32)
    there, off, tracked = track_there_and_back(texture, shifted, start, 15)
    assert tracked.all()
    np.testing.assert_allclose(there, np.add(start, (3, 2)), atol=0.1)
    assert off.max() < 0.1
