import cv2
import numpy as np
import pytest

from keyrecon.errors import KeyreconError
from keyrecon.golf.observe.club import choose_shafts, track_club
from keyrecon.golf.observe.foreground import FrameForeground
from keyrecon.golf.observe.line_segments import (
    LineSegments,
    detect_line_segments,
    drop_static_segments,
)
from keyrecon.golf.observe.shaft_hypotheses import ShaftHypotheses, propose_shafts

HEIGHT = 200.0
SHOULDERS = np.array([100.0, 80.0])
HANDS = np.array([140.0, 150.0])


def draw(angle, shade=30, thickness=2, ground=120, length=100):
    """A player with an outstretched arm and a club, and the mask of both."""
    picture = np.full((300, 320), ground, np.uint8)
    mask = np.zeros_like(picture)
    head = HANDS + length * np.array([np.cos(angle), np.sin(angle)])
    club = [tuple(np.round(p * 16).astype(int).tolist()) for p in (HANDS, head)]
    for target, value in ((picture, shade), (mask, 255)):
        cv2.line(target, *club, value, thickness, cv2.LINE_AA, 4)
        cv2.rectangle(target, (80, 60), (120, 240), int(min(255, value + 40)), -1)
        cv2.line(target, (110, 90), (140, 150), int(min(255, value + 40)), 10)
    return (
        picture,
        FrameForeground(
            0, mask, np.ones(mask.shape, bool), 1.0, HEIGHT, np.zeros(mask.shape, np.uint8)
        ),
        head,
    )


def direction(ends):
    way = ends[..., 1, :] - ends[..., 0, :]
    return np.degrees(np.arctan2(way[..., 1], way[..., 0]))


@pytest.mark.parametrize("shade", [30, 210])
@pytest.mark.parametrize("degrees", [-60, 10, 50])
def test_a_dark_or_bright_shaft_is_found_from_the_hands_to_the_head(shade, degrees):
    picture, foreground, head = draw(np.radians(degrees), shade)
    segments = detect_line_segments(picture, foreground)
    best = propose_shafts(segments, foreground, foreground.player(), SHOULDERS).ends[0]
    assert abs(direction(best) - degrees) < 1.5
    turn = np.exp(-1j * np.radians(degrees)) * complex(*best[0] - HANDS)
    assert 0 <= turn.real < 0.08 * HEIGHT  # the fist hides where it begins
    assert abs(turn.imag) < 1
    assert np.linalg.norm(best[1] - head) < 8


def test_a_shaft_that_differs_from_the_scene_in_colour_only_is_found_in_the_foreground():
    _, foreground, _ = draw(np.radians(20))
    plain = np.full((300, 320), 120, np.uint8)
    segments = detect_line_segments(plain, foreground)
    best = propose_shafts(segments, foreground, foreground.player(), SHOULDERS).ends[0]
    assert abs(direction(best) - 20) < 2


def test_a_rope_in_the_scene_is_no_club():
    rope = LineSegments(np.array([[[10.0, 200.0], [300.0, 202.0]]]), np.array([290.0]))
    heads = [HANDS + np.array([t, 90.0]) for t in range(20)]
    club = [LineSegments(np.array([[HANDS, head]]), np.array([90.0])) for head in heads]
    both = [
        LineSegments(np.concatenate([rope.ends, c.ends]), np.array([290.0, 90.0])) for c in club
    ]  # fmt: skip
    left = drop_static_segments(both, HEIGHT)
    assert all(np.array_equal(b.ends, c.ends) for b, c in zip(left[3:-3], club[3:-3], strict=True))


def swinging(frames=60, fps=60.0, seed=0):
    """A club that turns by 200 degrees with growing speed, and hypotheses about it.

    Every third frame in the middle shows no club, and every frame something else.
    """
    rng = np.random.default_rng(seed)
    time = np.linspace(0, 1, frames)
    angle = np.radians(90 - 200 * time**2)
    hands = HANDS + 60 * np.stack([time, -(time**2)], axis=1)
    true = np.stack([hands, hands + 100 * np.stack([np.cos(angle), np.sin(angle)], 1)], axis=1)
    shafts = []
    for t in range(frames):
        false = rng.uniform(40, 260, (2, 2, 2))
        hidden = 25 < t < 35 and t % 3 == 0
        right = true[t][None] + rng.normal(0, 1, (1, 2, 2))
        ends = false if hidden else np.concatenate([right, false])
        weight = np.full(len(ends), 0.2)
        weight[0] = 0.1 if hidden else 0.4
        shafts.append(ShaftHypotheses(ends, weight, np.ones(len(ends), bool)))
    return true, shafts, fps


def test_the_club_is_tracked_through_frames_that_do_not_show_it():
    true, shafts, fps = swinging()
    club = track_club(shafts, HEIGHT, fps)
    wrong = np.abs((direction(club.ends) - direction(true) + 180) % 360 - 180)
    assert (wrong < 5).mean() > 0.95
    assert club.detected.mean() > 0.85


def test_hypotheses_that_jump_about_are_not_the_club():
    _, shafts, fps = swinging()
    for t in (10, 20, 45):
        far = shafts[t].ends[:1] + np.array([80.0, -60.0])
        shafts[t] = ShaftHypotheses(far, np.array([0.4]), np.ones(1, bool))
    club = track_club(shafts, HEIGHT, fps)
    assert not club.detected[[10, 20, 45]].any()


@pytest.mark.parametrize("gap", [60, 90])
def test_a_club_that_is_unseen_for_long_is_found_before_and_after(gap):
    ends = np.array([HANDS, HANDS + np.array([0.0, 100.0])])[None]
    seen = ShaftHypotheses(ends, np.array([0.4]), np.array([True]))
    crumb = ShaftHypotheses(ends, np.array([0.1]), np.array([True]))
    taken = choose_shafts([seen] * 40 + [crumb] * gap + [seen] * 30, HEIGHT, 60.0)
    assert (taken >= 0).tolist() == [True] * 40 + [False] * gap + [True] * 30


def test_a_video_without_a_club_says_so():
    nothing = ShaftHypotheses(np.zeros((0, 2, 2)), np.zeros(0), np.zeros(0, bool))
    with pytest.raises(KeyreconError, match="club was seen in only 0 of 30 frames"):
        track_club([nothing] * 30, HEIGHT, 30.0)


def test_crumbs_far_from_the_way_of_the_club_are_not_the_club():
    frames, turn = 30, np.linspace(0.0, 2.0, 30)
    ends = HANDS + np.stack([np.zeros((30, 2)), 100 * np.stack([np.cos(turn), np.sin(turn)], 1)], 1)
    sure = [ShaftHypotheses(e[None], np.array([0.4]), np.array([True])) for e in ends]
    level = np.array([[HANDS, HANDS - (100.0, 0.0)]])
    for t in range(12, 18):  # where the shaft is lost before the player's shirt
        sure[t] = ShaftHypotheses(level, np.array([0.1]), np.array([True]))
    club = track_club(sure, HEIGHT, 60.0)
    assert not club.detected[12:18].any() and club.detected.sum() == frames - 6
    assert np.abs(direction(club.ends) - np.degrees(turn)).max() < 5
