"""Light that changes, over scenes whose light is known, and videos read as if it had not."""

import av
import cv2
import numpy as np
import pytest

from keyrecon.io.evening import even_exposure
from keyrecon.io.frame_reader import read_grey, read_small
from keyrecon.io.held_video import hold_frames, with_exposure
from keyrecon.io.stages import StageStore
from keyrecon.io.steady_video import steady_video
from keyrecon.io.video import open_video
from keyrecon.io.video_writer import write_video
from keyrecon.tracking.camera_motion import estimate_camera_motion
from keyrecon.tracking.exposure import ExposureMeter

SIZE, FRAMES = (320, 180), 48
EACH = np.arange(FRAMES)
FLICKER = 1 + 0.1 * np.sin(2.1 * EACH)
CLOUD = 2.0 ** (EACH / FRAMES - 0.6)


@pytest.fixture(scope="module")
def scene():
    rng = np.random.default_rng(4)
    noise = cv2.GaussianBlur(rng.integers(0, 255, (400, 900, 3)).astype(np.float32), (0, 0), 3)
    return cv2.normalize(noise, None, 40, 150, cv2.NORM_MINMAX).astype(np.uint8)


def film(scene, light, path, speed=0.0):
    """A camera that turns, and somebody dark who walks through the picture."""

    def picture(t):
        left = round(speed * t)
        shown = scene[100 : 100 + SIZE[1], 100 + left : 100 + left + SIZE[0]].copy()
        cv2.rectangle(shown, (4 * t, 60), (4 * t + 50, 170), (30, 60, 40), -1)
        return np.clip(np.rint(shown * light[t]), 0, 255).astype(np.uint8)

    write_video(path, (picture(t) for t in EACH), 25.0, crf=8)
    return open_video(path)


@pytest.mark.parametrize("light", [FLICKER, CLOUD, FLICKER * CLOUD])
@pytest.mark.parametrize("speed", [0.0, 4.0])
def test_changes_of_the_light_are_measured_to_two_percent(scene, light, speed, tmp_path):
    video = film(scene, light, tmp_path / "lit.mp4", speed)
    found = estimate_camera_motion(video).exposure
    factor = found / light
    assert np.abs(factor / np.median(factor) - 1).max() < 0.02


@pytest.mark.parametrize("speed", [0.0, 4.0])
def test_who_walks_by_and_a_camera_that_turns_are_no_change_of_the_light(scene, speed, tmp_path):
    video = film(scene, np.ones(FRAMES), tmp_path / "even.mp4", speed)
    assert estimate_camera_motion(video).exposure is None


def test_a_camera_is_followed_through_changes_of_the_light(scene, tmp_path):
    video = film(scene, FLICKER * CLOUD, tmp_path / "lit.mp4", 4.0)
    off = np.abs(np.diff(estimate_camera_motion(video).to_reference[:, 0, 2]) - 4)
    assert np.median(off) < 0.05
    assert off.max() < 0.4  # a tenth of a step; whole steps are lost where light is taken to stay


def test_frames_are_read_as_if_the_light_had_stayed(scene, tmp_path):
    lit = film(scene, CLOUD, tmp_path / "lit.mp4")
    even = film(scene, np.ones(FRAMES), tmp_path / "even.mp4")
    video = with_exposure(lit, CLOUD)
    readers = {
        "small": lambda one: read_small(one, 160),
        "grey": lambda one: read_grey(one, 160),
        "some": lambda one: read_small(one, 320, {3, 40}),
        "one": lambda one: [one.frame(40)],
        "part": lambda one: one.part(slice(30, 44)).frames(),
    }
    for name, read in readers.items():
        wanted = np.stack([*read(even)]).astype(float)
        for source in (video, hold_frames(video)):
            shown = np.stack([*read(source)])
            assert np.abs(shown - wanted).mean() < 2.5, name
        assert np.abs(np.stack([*read(lit)]) - wanted).mean() > 8, name
        filmed = np.stack([*read(with_exposure(video, None))])
        assert (filmed == np.stack([*read(lit)])).all(), name


def test_stages_know_a_video_by_its_exposure(scene, tmp_path):
    video = film(scene, CLOUD, tmp_path / "lit.mp4")
    key = StageStore(tmp_path)._key
    assert key(video) == key(with_exposure(video, None))
    assert (
        len({key(video), key(with_exposure(video, CLOUD)), key(with_exposure(video, FLICKER))}) == 3
    )


def test_black_stays_black():
    stored = np.array([[16, 66, 116]], np.uint8)
    assert even_exposure(stored, 0.5, black=16).tolist() == [[16, 116, 216]]
    assert even_exposure(stored, 2.0).tolist() == [[8, 33, 58]]


STILL = np.eye(3)


def meter(pictures, black=0):
    measured = ExposureMeter(black)
    for picture in pictures:
        measured.add(np.clip(np.rint(picture), 0, 255).astype(np.uint8), STILL)
    return measured


def test_a_dark_shot_is_brightened():
    texture = np.random.default_rng(0).uniform(10, 75, (90, 160)).repeat(4, 0).repeat(4, 1)
    assert 0.3 < np.median(meter([texture] * 5).exposure()) < 0.6


def test_who_is_lit_before_a_dark_wall_stays_below_white():
    picture = np.full((360, 640), 24.0)
    picture[100:300, 300:360] = 170
    lit = 170 / meter([picture] * 5).factors()
    assert lit.max() < 200


def test_black_bars_beside_a_picture_do_not_make_it_dark():
    """Upright film in a wide picture."""
    picture = np.zeros((360, 640))
    picture[:, 220:420] = np.random.default_rng(0).uniform(60, 200, (360, 200))
    assert meter([picture] * 5).exposure() is None


def test_light_is_measured_between_black_bars():
    texture = np.random.default_rng(0).uniform(60, 200, (36, 20)).repeat(10, 0).repeat(10, 1)
    picture = np.zeros((360, 640))
    picture[:, 220:420] = texture
    found = meter([picture] * 10 + [0.6 * picture] * 6).factors()
    assert found[-1] / found[0] == pytest.approx(0.6, rel=0.03)


@pytest.mark.parametrize("stored", ["yuv420p", "yuvj420p", "yuv420p10le", "yuva420p", "gray"])
def test_it_is_known_how_black_is_stored(tmp_path, stored):
    rgb = np.zeros((64, 96, 3), np.uint8)
    rgb[:, 48:] = 255
    path = tmp_path / "black.mkv"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264" if "yuvj" in stored else "ffv1", rate=25)
        stream.width, stream.height, stream.pix_fmt = 96, 64, stored
        for _ in range(3):
            frame = av.VideoFrame.from_ndarray(rgb, format="rgb24").reformat(format=stored)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    video = open_video(path)
    assert abs(int(next(video.grey_frames()).min()) - video.black) <= 1


def test_a_steadied_video_is_known_by_the_light_it_was_evened_by(scene, tmp_path):
    video = hold_frames(film(scene, CLOUD, tmp_path / "lit.mp4"))
    lights = (None, CLOUD, FLICKER)
    steadied = [
        steady_video(with_exposure(video, light), EACH, video.time, None, SIZE) for light in lights
    ]
    assert len({one.fingerprint for one in steadied}) == 3
