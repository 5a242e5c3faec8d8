"""A drawn golfer who never leaves the spot, before a scene with a horizon."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from keyrecon.errors import KeyreconError
from keyrecon.golf.clicks import GolfClicks, clicked_pose
from keyrecon.golf.observation import find_whole
from keyrecon.golf.observe.foreground import has_outline, separate_player
from keyrecon.golf.observe.player_cutter import ClickedFigure
from keyrecon.io.video import open_video
from keyrecon.io.video_writer import write_video
from keyrecon.segmentation.color_model import to_lab

SIZE = (240, 200)
FRAMES = 24


def arm_at(t):
    angle = 1.2 - 2.6 * max(0, t - 6) / (FRAMES - 6)
    return (round(120 + 62 * np.cos(angle)), round(82 + 62 * np.sin(angle)))


def picture(t):
    """Sky, grass, a player in white and red, and a dark arm that goes up after a while."""
    rng = np.random.default_rng(3)
    drawn = np.zeros((SIZE[1], SIZE[0], 3), np.float32)
    drawn[:90], drawn[90:] = (150, 180, 210), (90, 140, 70)
    drawn += cv2.GaussianBlur(rng.normal(0, 40, drawn.shape).astype(np.float32), (0, 0), 2)
    drawn = np.clip(drawn, 0, 255).astype(np.uint8)
    figure(drawn, t, (200, 40, 50), (235, 235, 235), (60, 40, 30))
    return drawn


def figure(target, t, shirt, trousers, skin):
    cv2.line(target, (120, 75), (112, 118), shirt, 26)
    for foot in ((100, 180), (126, 180)):
        cv2.line(target, (112, 124), foot, trousers, 12)
    cv2.circle(target, (122, 48), 11, skin, -1)
    cv2.line(target, (120, 82), arm_at(t), skin, 9)


def true_mask(t):
    mask = np.zeros((SIZE[1], SIZE[0]), np.uint8)
    figure(mask, t, 1, 1, 1)
    return mask > 0


def clicks(**moved):
    joints = {
        "head_top": (122.0, 38.0), "neck": (120.0, 64.0), "root": (112.0, 120.0),
        "right_knee": (106.0, 150.0), "left_knee": (119.0, 150.0),
        "right_ankle": (101.0, 178.0), "left_ankle": (125.0, 178.0),
    }  # fmt: skip
    return clicked_pose(GolfClicks(0, SIZE, joints | moved))


@pytest.fixture(scope="module")
def video(tmp_path_factory):
    path = tmp_path_factory.mktemp("golf") / "v.mp4"
    write_video(path, (picture(t) for t in range(FRAMES)), 30.0, 18)
    return open_video(path)


def test_a_player_who_never_leaves_the_spot_is_told_from_the_scene(video):
    foreground = separate_player(video, clicks())
    for t in (0, 12, 20):
        mask, true = foreground.frame(t).mask() > 0, true_mask(t)
        assert (mask & true).sum() > 0.9 * true.sum()
        assert (mask & ~true).sum() < 0.12 * true.sum()


def test_what_is_thinner_than_a_limb_is_no_part_of_the_body(video):
    foreground = separate_player(video, clicks())
    likely = foreground.likely.copy()
    cv2.line(likely[5], (180, 20), (230, 190), 255, 2)
    body = replace(foreground, likely=likely).frame(5).body()
    assert not body[:, 185:].any()
    assert (body & true_mask(5)).sum() > 0.85 * true_mask(5).sum()


def test_people_beside_the_player_are_not_the_player(video):
    foreground = separate_player(video, clicks())
    likely = foreground.likely.copy()
    cv2.rectangle(likely[3], (12, 20), (70, 190), 255, -1)  # larger than he is
    cv2.rectangle(likely[3], (160, 60), (175, 185), 255, -1)  # near
    player, true = replace(foreground, likely=likely).frame(3).player(), true_mask(3)
    assert not player[:, :75].any() and not player[100:, 155:].any()
    assert (player & true).sum() > 0.85 * true.sum()


def test_clicks_on_nothing_say_so(video):
    joints = clicks().joints
    heights = zip(joints.names, joints.places[:, 1].tolist(), strict=True)
    off = {name: (20.0 + 4 * i, y) for i, (name, y) in enumerate(heights)}
    with pytest.raises(KeyreconError, match="no player stands out"):
        separate_player(video, clicks(**off))


def test_the_same_clicks_cut_out_the_same_player_again(video):
    once, again = (separate_player(video, clicks()) for _ in range(2))
    assert all((once.frame(t).mask() == again.frame(t).mask()).all() for t in range(FRAMES))


def test_a_mask_that_lost_half_of_the_player_counts_for_nothing():
    player = np.zeros((60, 30), bool)
    player[5:55, 10:20] = True
    legs = player.copy()
    legs[:30] = False
    assert find_whole([player, player, legs, player]).tolist() == [True, True, False, True]


def test_the_player_is_where_he_stood_and_the_colours_are_the_same():
    here, true = picture(0), true_mask(0)
    figure_of_clicks = ClickedFigure.of(to_lab(here), true, 150.0)
    core = figure_of_clicks.stays(to_lab(here))
    trunk = np.zeros_like(true)
    trunk[80:110, 108:124] = True
    assert core[trunk].mean() > 0.9 and not (core & ~true).any()
    gone = here.copy()
    gone[:115] = picture(0)[:115, ::-1]  # scenery where the trunk was
    assert not figure_of_clicks.stays(to_lab(gone))[trunk & ~true[:, ::-1]].any()


def test_what_has_come_has_an_outline_and_where_it_was_the_scene_goes_on():
    before = picture(0)
    after = before.copy()
    cv2.circle(after, (200, 40), 14, (150, 30, 30), -1)  # comes before the sky
    after[60:110, 20:40] = picture(1)[60:110, 20:40]
    before[60:110, 20:40] = (60, 40, 30)  # leaves sky and grass behind
    differs = (before != after).any(axis=2)
    came = has_outline(differs, after, before)
    assert came[40, 200] and not came[80, 30]
    np.testing.assert_array_equal(has_outline(differs, before, after), differs & ~came)
