import numpy as np
import pytest
from drawn_player import (
    HEIGHT,
    SIZE,
    corners,
    draw_player,
    film,
    heads,
    lifts,
    picks,
    scene,
)

from keyrecon.errors import KeyreconError
from keyrecon.io.frame_reader import read_small
from keyrecon.io.video import open_video
from keyrecon.io.video_writer import write_video
from keyrecon.numerics.geometry import warp_points
from keyrecon.records import CameraPath, TrackAnchors
from keyrecon.segmentation.background_model import build_background
from keyrecon.segmentation.color_model import learn_colors, to_lab
from keyrecon.segmentation.contours import find_edges
from keyrecon.segmentation.foreground_model import ForegroundModel
from keyrecon.tracking.camera_motion import estimate_camera_motion
from keyrecon.tracking.detection import FindOptions, find_player
from keyrecon.tracking.scale import standing_height, zoom
from keyrecon.tracking.tracker import TrackOptions, track_player

COUNT = 40
NO_MARKS = TrackAnchors.none()


@pytest.fixture(scope="module", params=[False, True], ids=["static", "panning"])
def found(request, tmp_path_factory):
    """(panning, video, camera, colors, track) of one filmed player."""
    video = film(tmp_path_factory.mktemp("film") / "player.mp4", COUNT, request.param)
    camera = estimate_camera_motion(video)
    colors = learn_colors(video, picks(COUNT, request.param))
    rough = find_player(video, colors, camera, NO_MARKS)
    background = build_background(video, camera, rough)
    track = track_player(video, rough, camera, background, colors, NO_MARKS)
    return request.param, video, camera, colors, track


def test_a_camera_on_a_tripod_has_the_identity_for_a_path_and_a_panning_one_its_pan(found):
    panning, _, camera, _, _ = found
    if not panning:
        assert (camera.to_reference == np.eye(3)).all()
        return
    there = corners(COUNT, panning)
    expected = there - there[COUNT // 2]
    center = np.array([160.0, 90.0])
    moved = np.array([warp_points(h, center[None])[0] for h in camera.to_reference]) - center
    assert np.abs(moved - expected).max() < 1.0


def test_head_and_feet_are_found_in_every_frame(found):
    panning, _, _, _, track = found
    truth = heads(COUNT) - corners(COUNT, panning)
    assert np.linalg.norm(track.head - truth, axis=1).max() < 0.05 * HEIGHT
    assert np.linalg.norm(track.mid_feet - truth - (0, HEIGHT), axis=1).max() < 0.06 * HEIGHT


def test_a_track_is_as_sure_as_it_looks_like_what_was_marked(found):
    panning, video, camera, colors, track = found
    background = build_background(video, camera, track)
    height, unknown, nowhere = track.height[[0]], np.full(1, np.nan), np.full((1, 2), np.nan)
    medians = {}
    for name, aside in (("player", 0.0), ("wall", -2.0 * HEIGHT / 3)):
        shift = np.array([aside, 0.0])
        anchors = TrackAnchors(
            np.array([0]), track.head[[0]] + shift, track.feet[[0]] + shift,
            np.ones(1, bool), height, np.zeros(1, bool), nowhere, unknown,
        )  # fmt: skip
        again = track_player(video, track, camera, background, colors, anchors)
        truth = heads(COUNT) - corners(COUNT, panning)
        assert np.linalg.norm(again.head - truth, axis=1)[5:].max() < 0.05 * HEIGHT
        medians[name] = float(np.median(again.confidence[5:]))
    assert medians["player"] > 0.9
    assert medians["wall"] < 0.6


def test_neither_a_racket_like_a_shoe_nor_a_lifted_foot_misleads(tmp_path):
    video = film(tmp_path / "playing.mp4", COUNT, playing=True)
    camera = CameraPath(np.tile(np.eye(3), (COUNT, 1, 1)), np.ones(COUNT))
    colors = learn_colors(video, picks(COUNT))
    rough = find_player(video, colors, camera, NO_MARKS)
    track = track_player(
        video, rough, camera, build_background(video, camera, rough), colors, NO_MARKS
    )
    head = heads(COUNT) - corners(COUNT, False)
    left = head + np.array([-12, HEIGHT])
    right = head + np.stack([np.full(COUNT, 12), HEIGHT - lifts(COUNT)], axis=1)
    for foot in (left, right):
        off = np.linalg.norm(track.feet - foot[:, None], axis=2).min(axis=1)
        assert (off < 0.1 * HEIGHT).mean() > 0.97


def test_a_player_who_never_leaves_his_place_is_not_taken_for_the_scene(tmp_path):
    x, y = heads(1)[0] - corners(1, False)[0]
    picture = scene()[30 : 30 + SIZE[0], 80 : 80 + SIZE[1]]
    draw_player(picture, x, y)
    write_video(tmp_path / "still.mp4", (picture for _ in range(COUNT)), 30.0, crf=18)
    video = open_video(tmp_path / "still.mp4")
    camera = CameraPath(np.tile(np.eye(3), (COUNT, 1, 1)), np.ones(COUNT))
    colors = learn_colors(video, picks(1))
    with pytest.raises(KeyreconError, match="found in only 0 of"):
        find_player(video, colors, camera, NO_MARKS, FindOptions(doubtful=0.0))
    track = find_player(video, colors, camera, NO_MARKS)
    assert np.linalg.norm(track.head - (x, y), axis=1).max() < 0.05 * HEIGHT
    assert np.linalg.norm(track.mid_feet - (x, y + HEIGHT), axis=1).max() < 0.06 * HEIGHT


def test_the_printed_form_keeps_the_path_through_colour_and_symmetry(found):
    _, video, camera, colors, track = found
    options = TrackOptions(method="paper")
    background = build_background(video, camera, track)
    assert track_player(video, track, camera, background, colors, NO_MARKS, options) is track


def test_a_video_too_long_for_its_pictures_to_be_kept_is_read_again(found, monkeypatch):
    _, video, camera, colors, _ = found
    kept = find_player(video, colors, camera, NO_MARKS)
    monkeypatch.setattr("keyrecon.tracking.detection.MAX_CACHE_BYTES", 0)
    again = find_player(video, colors, camera, NO_MARKS)
    assert (again.head == kept.head).all()
    assert (again.feet == kept.feet).all()


def test_the_standing_height_is_that_of_the_player(found):
    assert found[4].height == pytest.approx(HEIGHT, rel=0.06)


def test_the_box_holds_head_and_feet(found):
    track = found[4]
    for spots in (track.head, track.feet[:, 0], track.feet[:, 1]):
        assert (spots > track.box[:, :2]).all()
        assert (spots < track.box[:, 2:]).all()


def test_the_player_and_nobody_else_is_foreground(found):
    panning, video, camera, _, track = found
    scene = ForegroundModel(build_background(video, camera, track), camera)
    number = COUNT // 4
    picture = next(iter(read_small(video, video.width, {number})))
    likely = scene.foreground(to_lab(picture), number, np.eye(3))
    x, y = (heads(COUNT) - corners(COUNT, panning))[number].round().astype(int)
    assert likely[y + 15 : y + 35, x - 6 : x + 6].min() > 0.8
    assert np.median(np.delete(likely, np.s_[x - 30 : x + 30], axis=1)) < 0.05


def test_edges_lie_on_the_outline_of_the_player(found):
    panning, video, camera, colors, track = found
    background = build_background(video, camera, track)
    found_edges = find_edges(video, track, camera, background, colors)
    assert len(found_edges) == COUNT
    shirt = colors.names.index("shirt")
    head = (heads(COUNT) - corners(COUNT, panning))[COUNT // 2]
    edges = found_edges[COUNT // 2]
    outline = edges.points[edges.color == shirt] - head
    assert len(outline) > 20
    assert np.abs(outline[:, 0]).max() < 14
    assert outline[:, 1].min() > 4
    assert outline[:, 1].max() < 43
    assert np.linalg.norm(edges.tangent, axis=1) == pytest.approx(1)
    assert (edges.upper | edges.lower).all()


def test_zoom_is_the_ratio_of_focal_lengths(found):
    video = found[1]
    factor = np.linspace(1, 1.5, 10)
    center = np.array([video.width / 2, video.height / 2])
    to_first = np.tile(np.eye(3), (10, 1, 1))
    to_first[:, 0, 0] = to_first[:, 1, 1] = 1 / factor
    to_first[:, :2, 2] = center - center / factor[:, None]
    assert zoom(CameraPath(to_first, np.ones(10)), video) == pytest.approx(factor)


def test_a_crouch_does_not_change_the_standing_height():
    head = np.zeros((200, 2))
    feet = np.tile([0.0, 100.0], (200, 1))
    head[80:110, 1] = 30.0
    seen = np.ones(200, dtype=bool)
    assert standing_height(head, feet, np.ones(200), 150, seen) == pytest.approx(100)


@pytest.mark.parametrize("unseen", [slice(0, 60), slice(70, 130), slice(150, 200)])
def test_frames_that_do_not_show_the_player_tell_nothing_of_the_standing_height(unseen):
    head, feet = np.zeros((200, 2)), np.tile([0.0, 100.0], (200, 1))
    head[unseen, 0] = 800.0
    seen = np.ones(200, dtype=bool)
    seen[unseen] = False
    assert standing_height(head, feet, np.ones(200), 150, seen) == pytest.approx(100)


def test_who_leaves_and_somebody_behind_a_wall_do_not_make_the_player_larger(tmp_path):
    there, count = 60, 100
    corner = corners(1, False)[0].astype(int)

    def frames():
        for t in range(count):
            picture = scene()
            if t < there:
                draw_player(picture, *heads(count)[0])
            else:
                draw_player(picture, 360, 60)
                picture[60 + 45 :, 330:390] = scene()[60 + 45 :, 330:390]
            yield picture[corner[1] : corner[1] + SIZE[0], corner[0] : corner[0] + SIZE[1]]

    write_video(tmp_path / "leaves.mp4", frames(), 30.0, crf=18)
    video = open_video(tmp_path / "leaves.mp4")
    camera = CameraPath(np.tile(np.eye(3), (count, 1, 1)), np.ones(count))
    rough = find_player(video, learn_colors(video, picks(count)), camera, NO_MARKS)
    assert np.linalg.norm(rough.head[-1] - (280, 30)) < 0.2 * HEIGHT
    assert rough.height[:there] == pytest.approx(HEIGHT, rel=0.1)


def test_a_player_who_is_nowhere_is_reported_with_a_frame_to_pick_on(found, tmp_path):
    panning, _, camera, colors, _ = found
    empty = film(tmp_path / "empty.mp4", COUNT, panning, empty=True)
    with pytest.raises(KeyreconError, match=r"0 of 21 frames; pick .* again"):
        find_player(empty, colors, camera, NO_MARKS)
