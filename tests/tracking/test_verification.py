"""Films of a drawn player: alone, cut above the ankles, and with another one passing."""

import tracemalloc
from dataclasses import replace

import cv2
import numpy as np
import pytest
from drawn_player import HEIGHT, SHIRT, SIZE, corners, draw_player, heads, picks, scene

from keyrecon.io.video import open_video
from keyrecon.io.video_writer import write_video
from keyrecon.records import Background, CameraPath, Shots, Track, TrackAnchors
from keyrecon.segmentation.background_model import build_background
from keyrecon.segmentation.color_model import learn_colors
from keyrecon.tracking import verification as verification_module
from keyrecon.tracking.scale import player_boxes
from keyrecon.tracking.tracklets import find_jumps
from keyrecon.tracking.verification import (
    _matched_filter,
    find_meetings,
    hidden_shares,
    verify_track,
)

COUNT = 60
HEAD = heads(COUNT) - corners(COUNT, False)
OTHER = np.stack([np.linspace(300, 20, COUNT), np.full(COUNT, 60.0)], axis=1)
"""Head of another player who walks past from right to left."""
ONE_SHOT = Shots.between((), COUNT)
CAMERA = CameraPath(np.tile(np.eye(3), (COUNT, 1, 1)), np.ones(COUNT))


def track_along(head, rows=SIZE[0]):
    """A track of that head, with feet where the picture has them, or just above its lower edge."""
    feet = head[:, None] + np.array([(-12.0, HEIGHT), (12.0, HEIGHT)])
    feet[..., 1] = np.minimum(feet[..., 1], rows - 6)
    height = np.full(len(head), np.median(feet[..., 1] - head[:, None, 1]))
    return Track(head, feet, height, player_boxes(head, feet, height), np.ones(len(head)))


@pytest.fixture
def verified(tmp_path):
    """Verify the track of the player in a film, `rows` px high, maybe with another player, with a
    shadow of the colours of the clothes, or with both feet marked in one frame."""

    def verify(rows=SIZE[0], other=None, recolored=False, shadow=False, marked=False):
        def pictures():
            for number in range(COUNT):
                picture = scene()
                x, y = corners(COUNT, False)[number].astype(int)
                if other is not None:
                    alone = scene()
                    draw_player(alone, *(other[number] + (x, y)))
                    drawn = (alone != picture).any(axis=2)
                    picture[drawn] = 255 - alone[drawn] if recolored else alone[drawn]
                draw_player(picture, *heads(COUNT)[number])
                if shadow:
                    foot = np.rint(heads(COUNT)[number] + (12, HEIGHT)).astype(int)
                    cv2.line(picture, foot.tolist(), np.add(foot, (20, 60)).tolist(), SHIRT, 7)
                yield picture[y : y + rows, x : x + SIZE[1]]

        write_video(tmp_path / "film.mp4", pictures(), 30.0, crf=18)
        video = open_video(tmp_path / "film.mp4")
        shown = [p for p in picks(COUNT) if p.y < rows]
        colors = learn_colors(video, shown if rows == SIZE[0] else [*shown, *_shins(rows)])
        track = track_along(HEAD, rows)
        background = build_background(video, CAMERA, track)
        anchors = marks(track, [5]) if marked else TrackAnchors.none()
        return verify_track(video, track, CAMERA, background, colors, anchors), track

    return verify


def marks(track, frames):
    """Head and feet marked where the track has them."""
    every, unknown = np.ones(len(frames), dtype=bool), np.full(len(frames), np.nan)
    places, nowhere = (track.head[frames], track.feet[frames]), np.full((len(frames), 2), np.nan)
    return TrackAnchors(np.array(frames), *places, every, unknown, ~every, nowhere, unknown)


def _shins(rows):
    """Where a person clicks for feet that are not in the picture."""
    foot = next(p for p in picks(COUNT) if p.part == "foot")
    return [type(foot)(0, "foot", foot.x + dx, rows - 4.0) for dx in (2.0, 20.0)]


def test_feet_in_the_picture_and_nobody_else(verified):
    verification, track = verified()
    assert not verification.truncated.any()
    assert find_meetings(verification, track, 30.0) == []


def test_feet_that_the_lower_edge_cuts_off_are_told(verified):
    assert verified(rows=130)[0].truncated.mean() > 0.6


def test_feet_just_above_the_lower_edge_are_in_the_picture(verified):
    assert verified(rows=152)[0].truncated.mean() < 0.1


def test_a_shadow_on_the_ground_cuts_no_feet_off_that_were_marked_as_high_above_the_edge(verified):
    assert verified(rows=158, shadow=True)[0].truncated.mean() > 0.6
    assert not verified(rows=158, shadow=True, marked=True)[0].truncated.any()


def test_feet_that_the_edge_cuts_off_elsewhere_are_told_though_some_were_marked(verified):
    verification = verified(rows=130, marked=True)[0]
    about_then = np.abs(verification.frames - 5) <= 0.25 * 30
    assert not verification.truncated[about_then].any()  # a person saw them there
    assert verification.truncated[~about_then].mean() > 0.6


def test_another_player_in_the_same_clothes_is_told_where_the_two_meet(verified):
    verification, track = verified(other=OTHER)
    closest = np.linalg.norm(HEAD - OTHER, axis=1).argmin()
    meetings = find_meetings(verification, track, 30.0)
    assert any(first - 10 <= closest <= last + 10 for first, last in meetings)


def test_a_player_in_other_clothes_is_nobody_to_be_taken_for(verified):
    verification, track = verified(other=OTHER, recolored=True)
    assert find_meetings(verification, track, 30.0) == []


def test_a_track_that_hops_to_somebody_else_is_told_with_the_frame():
    hopped = np.where(np.arange(COUNT)[:, None] < 40, HEAD, HEAD + np.array([1.5 * HEIGHT, 0]))
    (jump,) = find_jumps(track_along(hopped), CAMERA, ONE_SHOT, 30.0)
    assert 40 <= jump <= 44
    assert find_jumps(track_along(hopped), CAMERA, Shots.between((40,), COUNT), 30.0) == []
    assert find_jumps(track_along(HEAD), CAMERA, ONE_SHOT, 30.0) == []


def test_where_nobody_is_seen_nothing_jumps():
    lost, frames = (
        np.where(np.arange(COUNT)[:, None] < 40, HEAD + 3 * HEIGHT, HEAD),
        np.arange(COUNT),
    )
    track = replace(track_along(lost), confidence=(frames >= 40).astype(float))
    assert find_jumps(track, CAMERA, ONE_SHOT, 30.0) == []


def test_who_is_seen_again_farther_away_than_anybody_gets_has_jumped():
    gone = np.isin(np.arange(COUNT), range(35, 45))
    hopped = np.where(np.arange(COUNT)[:, None] < 40, HEAD, HEAD + np.array([4.0 * HEIGHT, 0]))
    track = replace(track_along(hopped), confidence=1.0 - gone)
    assert find_jumps(track, CAMERA, ONE_SHOT, 30.0) == [45]


def test_a_camera_that_turns_makes_no_jump():
    turned = np.tile(np.eye(3), (COUNT, 1, 1))
    turned[:, 0, 2] = 40.0 * np.arange(COUNT)
    track = track_along(HEAD - turned[:, :2, 2])
    assert find_jumps(track, CameraPath(turned, np.ones(COUNT)), ONE_SHOT, 30.0) == []
    assert find_jumps(track, CAMERA, ONE_SHOT, 30.0)


def test_a_camera_that_begins_to_turn_makes_no_jump():
    turned = np.tile(np.eye(3), (COUNT, 1, 1))
    turned[:, 0, 2] = 40.0 * np.maximum(np.arange(COUNT) - 30, 0)
    track = track_along(HEAD - turned[:, :2, 2])
    assert find_jumps(track, CameraPath(turned, np.ones(COUNT)), ONE_SHOT, 30.0) == []


def test_memory_of_looking_for_jumps_grows_with_the_length_and_not_with_its_square():
    count = 4000
    camera = CameraPath(np.tile(np.eye(3), (count, 1, 1)), np.ones(count))
    track = track_along(np.tile(HEAD[:1], (count, 1)))
    tracemalloc.start()
    assert find_jumps(track, camera, Shots.between((), count), 30.0) == []
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 2000 * count


def test_a_long_shot_is_looked_at_part_by_part(verified, monkeypatch):
    monkeypatch.setattr(verification_module, "MOST_VIEWS", 5)
    verification, track = verified(other=OTHER)
    assert len(verification.frames) == len(verification.truncated) == len(verification.distractor)
    closest = np.linalg.norm(HEAD - OTHER, axis=1).argmin()
    meetings = find_meetings(verification, track, 30.0)
    assert any(first - 10 <= closest <= last + 10 for first, last in meetings)


def test_a_player_behind_a_panel_is_hidden_and_one_beside_it_is_not():
    head = np.array([[50.0, 20.0], [150.0, 20.0]])
    overlay = np.zeros((60, 120), bool)
    overlay[20:30, 60:90] = True  # of pictures half as large
    plain = np.zeros((10, 10, 3), np.uint8)
    background = Background(plain, np.zeros((10, 10)), plain[..., 0] == 0, np.eye(3), overlay, 0.5)
    shares = hidden_shares(track_along(head, rows=400), background)
    assert shares[0] == 0
    assert shares[1] == pytest.approx(20 / HEIGHT, abs=0.1)


def test_a_template_responds_as_its_products_place_by_place_add_up_to():
    rng = np.random.default_rng(0)
    above, below, aside = margins = 3, 7, 2
    parts = rng.random((2, 9, 14)).astype(np.float32)
    template = rng.normal(size=(2, above + below + 1, 2 * aside + 1)).astype(np.float32)
    around = np.pad(parts, ((0, 0), (above, below), (aside, aside)))
    windows = np.lib.stride_tricks.sliding_window_view(around, template.shape)[0]
    expected = (windows * template).sum(axis=(2, 3, 4))
    np.testing.assert_allclose(_matched_filter(parts, template, margins), expected, atol=1e-4)
