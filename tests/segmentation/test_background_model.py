import cv2
import numpy as np
import pytest
from drawn_player import HEIGHT, draw_player, scene

from keyrecon.io.video import open_video
from keyrecon.io.video_writer import write_video
from keyrecon.records import CameraPath, Colors, Track
from keyrecon.segmentation.background_model import (
    BackgroundOptions,
    build_background,
    median_background,
)
from keyrecon.segmentation.color_model import color_bins, to_lab
from keyrecon.segmentation.foreground_model import ForegroundModel


def scene_with_limb(shift, rng):
    """A floor with a line across, and a limb in front of its middle."""
    picture = np.full((60, 80, 3), (150, 90, 60), np.uint8)
    picture[40:43] = 230
    bare = picture.copy()
    cv2.line(picture, (30 + 2 * shift, 10), (45 + 2 * shift, 55), (190, 130, 100 + 2 * shift), 6)
    noise = rng.normal(0, 1.0, picture.shape)
    return (picture + noise).round().astype(np.uint8), bare


def test_what_shows_between_moving_limbs_completes_the_background():
    rng = np.random.default_rng(0)
    views = [scene_with_limb(int(s), rng) for s in rng.integers(-8, 9, 40)]
    free = np.ones((60, 80), bool)
    free[5:58, 15:65] = False  # the player never leaves
    paths = np.tile(np.eye(3), (40, 1, 1))
    observations = [to_lab(v) for v, _ in views]
    background = median_background(observations, [free] * 40, paths, 1.0, inpaint=True)
    off = np.abs(background.color.astype(int) - to_lab(views[0][1]).astype(int)).max(axis=2)
    assert background.known[~free].mean() > 0.9
    assert np.percentile(off[background.known], 99) <= 6


def test_what_the_player_always_covers_stays_unknown():
    rng = np.random.default_rng(0)
    picture = rng.integers(0, 255, (40, 40, 40, 3), np.uint8)
    picture[:, :, :10] = 120
    free = np.zeros((40, 40), bool)
    free[:, :10] = True
    paths = np.tile(np.eye(3), (40, 1, 1))
    observations = [to_lab(p) for p in picture]
    background = median_background(observations, [free] * 40, paths, 1.0, inpaint=True)
    assert background.known[:, :10].all()
    assert not background.known[:, 12:].any()


def test_a_leg_that_the_track_lacks_does_not_become_background(tmp_path):
    count, stride = 40, 0.25 * HEIGHT
    head = np.tile([120.0, 60.0], (count, 1))
    head[28:, 0] = 260.0

    def frames():
        for x, y in head:
            picture = scene()
            draw_player(picture, x, y, stride)
            yield picture[:180, :360]

    write_video(tmp_path / "stands.mp4", frames(), 30.0, crf=18)
    right = head + np.array([stride, HEIGHT])
    tall = np.full(count, HEIGHT)
    track = Track(head, np.stack([right, right], 1), tall, np.zeros((count, 4)), np.ones(count))
    still = CameraPath(np.tile(np.eye(3), (count, 1, 1)), np.ones(count))
    background = build_background(open_video(tmp_path / "stands.mp4"), still, track)
    left = tuple((head[0] + np.array([-stride, HEIGHT])).round().astype(int)[::-1])
    off = background.color[left].astype(int) - to_lab(scene())[left]
    assert not background.known[left] or np.abs(off).max() < 12


DARK = (62, 64, 70)


def film_in_the_dark(path, aside=0.0):
    """A player in dark clothes in a dark room who keeps the place, slowly going away; the track has
    the player `aside` of there, px."""
    count = 40
    nearness = np.linspace(1.0, 0.8, count)
    head = np.stack([160 + 2 * np.sin(np.arange(count)), 160 - 110 * nearness], axis=1)
    feet = head[:, None] + nearness[:, None, None] * [[-8, 110], [8, 110]]

    def frames():
        room = np.full((180, 320, 3), 75, np.uint8)
        room[::12] = 85
        for (x, y), pair, near in zip(head, feet, nearness, strict=True):
            picture = room.copy()
            hips = round(x), round(y + 50 * near)
            corner = round(x - 11 * near), round(y)
            cv2.rectangle(picture, corner, (round(x + 11 * near), hips[1]), DARK, -1)
            for foot in pair.round().astype(int):
                cv2.line(picture, hips, foot.tolist(), DARK, 8)
            yield picture

    write_video(path, frames(), 30.0, crf=18)
    shift = np.array([aside, 0.0])
    measures = 110 * nearness, np.zeros((count, 4)), np.ones(count)
    track = Track(head + shift, feet + shift, *measures)
    still = CameraPath(np.tile(np.eye(3), (count, 1, 1)), np.ones(count))
    return open_video(path), still, track


def test_a_player_in_dark_clothes_who_keeps_his_place_does_not_become_background(tmp_path):
    background = build_background(*film_in_the_dark(tmp_path / "dark.mp4"))
    assert not background.known[90:110, 156:165].any()


def test_where_the_scene_is_seen_a_track_that_is_off_hides_nothing_of_it(tmp_path):
    histogram = np.zeros(2**14)
    histogram[color_bins(to_lab(np.full((1, 1, 3), DARK, np.uint8)))] = 1.0
    room = np.full(2**14, 2.0**-14)
    dark = Colors(("clothes",), histogram[None], room, 110.0)
    video = film_in_the_dark(tmp_path / "dark.mp4", aside=40.0)
    beside = np.s_[90:110, 196:205]
    assert not build_background(*video).known[beside].any()
    assert build_background(*video, dark).known[beside].all()


def test_the_spread_is_the_distance_from_the_lower_quartile_to_the_median_as_a_deviation():
    lightness = [90, 92, 94, 96, 100, 100, 110, 120, 130]  # lower quartile 94
    pictures = [np.full((4, 4, 3), value, np.uint8) for value in lightness]
    free, paths = [np.ones((4, 4), bool)] * 9, np.tile(np.eye(3), (9, 1, 1))
    background = median_background(pictures, free, paths, 1.0)
    assert (background.color == 100).all()
    assert background.spread == pytest.approx(6 / 0.6745)


def test_the_spread_of_normal_noise_is_its_deviation():
    noise = np.random.default_rng(0).normal(120, 6, (400, 20, 20, 1)).repeat(3, axis=3)
    pictures = list(noise.round().astype(np.uint8))
    free, paths = [np.ones((20, 20), bool)] * 400, np.tile(np.eye(3), (400, 1, 1))
    spread = median_background(pictures, free, paths, 1.0).spread
    assert np.median(spread) == pytest.approx(6, rel=0.05)


def carried_film(file, count, size=(320, 180)):
    """A camera is carried along: what is far goes by at 1 px per frame, the ground at 4. It follows
    a player of 100 px who stays in the picture's middle and swings his legs."""
    columns, rows = size
    x = np.arange(columns)
    noise = np.random.default_rng(0).normal(0, 3, (rows, columns, 3))

    def frames():
        for t in range(count):
            picture = np.empty((rows, columns, 3))
            picture[:90] = (100 + 60 * np.sin((x + t) / 50))[None, :, None]
            picture[90:] = (130 + 60 * np.sin((x + 4 * t) / 180))[None, :, None]
            picture += noise
            swing = round(14 * np.sin(t / 5))
            cv2.rectangle(picture, (150, 40), (170, 90), (40, 40, 40), -1)
            for foot in (160 - swing, 160 + swing):
                cv2.line(picture, (160, 88), (foot, 140), (40, 40, 40), 9)
            yield picture.clip(0, 255).astype(np.uint8)

    write_video(file, frames(), 30.0, crf=12)
    return open_video(file)


def test_a_player_is_told_from_a_scene_that_a_carried_camera_shows_from_ever_other_places(tmp_path):
    count = 300
    video = carried_film(tmp_path / "carried.mp4", count)
    path = np.tile(np.eye(3), (count, 1, 1))
    path[:, 0, 2] = np.arange(count)
    camera = CameraPath(path, np.ones(count))
    swing = np.round(14 * np.sin(np.arange(count) / 5))
    head = np.tile([160.0, 42.0], (count, 1))
    feet = np.stack([np.stack([160 + s * swing, np.full(count, 140.0)], 1) for s in (-1, 1)], 1)
    tall = np.full(count, 98.0)
    track = Track(head, feet, tall, np.zeros((count, 4)), np.ones(count))
    background = build_background(video, camera, track)
    model = ForegroundModel(background, camera)
    legs, ground = [], []
    for t, picture in enumerate(video.frames()):
        foreground = model.foreground(to_lab(picture), t, np.eye(3))[100:135]
        legs.append(foreground[picture[100:135, :, 0] < 55].mean())
        ground.append(foreground[:, :100].mean())
    assert np.mean(legs) > 0.6
    assert np.mean(ground) < 0.2
    surer = build_background(video, camera, track, options=BackgroundOptions(sure=12.0))
    assert surer.sure == 12.0 and {part.sure for part in surer.later} == {12.0}
    parts = (ForegroundModel(b, camera) for b in (background, surer))
    picture = to_lab(video.frame(150))
    one, other = (p.foreground(picture, 150, np.eye(3)).mean() for p in parts)
    assert other < 0.5 * one


def test_one_background_does_for_a_camera_that_only_turns(tmp_path):
    count = 200

    def frames():
        for t in range(count):
            yield scene()[:180, t : t + 240]

    write_video(tmp_path / "turns.mp4", frames(), 30.0, crf=18)
    path = np.tile(np.eye(3), (count, 1, 1))
    path[:, 0, 2] = np.arange(count)
    nowhere = np.tile([-500.0, 0.0], (count, 1))
    track = Track(
        nowhere, np.stack([nowhere] * 2, 1), np.full(count, 100.0), np.zeros((count, 4)),
        np.ones(count),
    )  # fmt: skip
    camera = CameraPath(path, np.ones(count))
    assert not build_background(open_video(tmp_path / "turns.mp4"), camera, track).later
