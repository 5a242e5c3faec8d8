"""Poses drawn on pictures."""

from dataclasses import replace

import numpy as np
import pytest
from report_material import make_material, on_court, on_ground

from keyrecon.body import LSP14
from keyrecon.io.video import open_video
from keyrecon.progress import silent
from keyrecon.report.drawing import (
    LEFT,
    RIGHT,
    bone_sides,
    draw_brackets,
    draw_pose,
    drawn_bones,
    head_bone,
    trunk_outline,
)
from keyrecon.report.overlay import GROUND, PAPER, OverlayOptions, overlay_frames, write_overlay

GREY = np.full((240, 240, 3), 120, np.uint8)


def cross():
    """Both shins cross at (120, 120); all other joints are unknown."""
    points = np.full((14, 2), np.nan)
    for name, place in (
        ("left_knee", (60, 60)),
        ("left_ankle", (180, 180)),
        ("right_knee", (180, 60)),
        ("right_ankle", (60, 180)),
    ):
        points[LSP14.index(name)] = place
    return points


def test_the_nearer_limb_is_drawn_over_the_farther_one():
    depth = np.zeros(14)
    right = [LSP14.index("right_knee"), LSP14.index("right_ankle")]
    depth[right] = 1.0
    assert tuple(draw_pose(GREY, cross(), LSP14, depth)[120, 120]) == LEFT
    depth[right] = -1.0
    assert tuple(draw_pose(GREY, cross(), LSP14, depth)[120, 120]) == RIGHT


def test_a_pose_without_known_joints_leaves_the_picture_alone():
    drawn = draw_pose(GREY, np.full((14, 2), np.nan), LSP14)
    assert (drawn == GREY).all()


def test_drawing_does_not_alter_the_picture_it_is_given():
    before = GREY.copy()
    draw_pose(GREY, cross(), LSP14)
    assert (before == GREY).all()


def test_joints_far_outside_the_picture_are_no_trouble():
    draw_pose(GREY, cross() * 1e6, LSP14)


def test_marks_of_a_person_look_unlike_joints_that_were_filled_in():
    pictures = [
        draw_pose(GREY, cross(), LSP14, source=np.full(14, kind), height=200.0) for kind in range(3)
    ]
    knee = tuple(int(part) for part in cross()[LSP14.index("left_knee")])
    assert tuple(pictures[0][knee]) == tuple(pictures[1][knee]) == LEFT
    assert tuple(pictures[2][knee]) != LEFT
    assert (pictures[0] != pictures[1]).any()


def test_bones_are_thicker_on_a_larger_player():
    def inked(height):
        return (draw_pose(GREY, cross(), LSP14, height=height) != GREY).any(axis=2).sum()

    assert inked(800.0) > 2 * inked(200.0)


def test_limbs_have_sides_and_the_trunk_has_none():
    sides = {
        (LSP14.names[a], LSP14.names[b]): side
        for (a, b), side in zip(drawn_bones(LSP14), bone_sides(LSP14), strict=True)
    }
    assert sides["left_hip", "left_knee"] == 0
    assert sides["right_elbow", "right_wrist"] == 1
    assert sides["neck", "left_hip"] == sides["left_hip", "right_hip"] == 2


def test_trunk_and_head_are_found_in_the_skeleton():
    assert [LSP14.names[joint] for joint in trunk_outline(LSP14)] == [
        "left_shoulder",
        "right_shoulder",
        "right_hip",
        "left_hip",
    ]
    assert [LSP14.names[joint] for joint in head_bone(LSP14)] == ["neck", "head_top"]


def test_the_overlay_has_every_frame_of_the_video_with_the_player_drawn(tmp_path):
    material = make_material(tmp_path, 12)
    path = tmp_path / "overlay.mp4"
    write_overlay(path, material.video, material.motion)
    overlay = open_video(path)
    assert len(overlay) == len(material.video)
    assert (overlay.width, overlay.height) == (material.video.width, material.video.height)
    assert overlay.fps == material.video.fps


def test_an_overlay_can_show_one_half_of_the_body_or_nothing(tmp_path):
    material = make_material(tmp_path, 12)

    def drawn(skeleton):
        return next(
            overlay_frames(
                material.video, material.motion, silent, OverlayOptions(skeleton=skeleton)
            )
        )

    bare = drawn("none")
    changed = {part: (drawn(part) != bare).any(axis=2) for part in ("all", "upper", "lower")}
    assert changed["all"].sum() > changed["upper"].sum() > 0
    assert changed["lower"].any()
    rows = {part: np.flatnonzero(mask.any(axis=1)).mean() for part, mask in changed.items()}
    assert rows["upper"] < rows["lower"]


def test_a_golf_club_is_drawn_where_it_is(tmp_path):
    material = make_material(tmp_path, 12)
    club = np.full((len(material.motion.time), 2, 2), np.nan)
    club[0] = (20, 20), (60, 20)

    def drawn(club):
        return overlay_frames(material.video, material.motion, silent, club=club)

    bare, held = drawn(None), drawn(club)
    changed = (next(held) != next(bare)).any(axis=2)
    assert changed[18:23, 25:55].all(axis=1).any()
    assert not changed[30:].any()
    assert (next(held) == next(bare)).all()


@pytest.mark.parametrize("view", ["camera", "right"])
def test_no_golfer_is_drawn_where_none_was_fitted(tmp_path, view):
    material = make_material(tmp_path, 12)
    confidence = np.ones_like(material.motion.confidence)
    confidence[1] = 0
    club = np.tile([[20.0, 20.0], [60.0, 20.0]], (len(confidence), 1, 1))

    def drawn(skeleton):
        motion = replace(material.motion, confidence=confidence)
        options = OverlayOptions(view=(view,), skeleton=skeleton, court=False)
        nobody = np.full_like(club, np.nan)
        held = nobody if skeleton == "none" else club
        return [*overlay_frames(material.video, motion, silent, options, (0, 2), club=held)]

    whole, bare = drawn("all"), drawn("none")
    assert [(one != other).any() for one, other in zip(whole, bare, strict=True)] == [
        True,
        False,
        True,
    ]


def test_the_figure_from_elsewhere_stands_on_its_floor(tmp_path):
    material = make_material(tmp_path, 12)
    options = OverlayOptions(view=("right",), size=200)
    pane = next(overlay_frames(material.video, material.motion, silent, options))
    ground = (pane[:, -1] == GROUND).all(axis=1)
    assert 0 < ground.sum() < 40
    figure = ((pane != PAPER) & (pane != GROUND)).any(axis=2)[:170]
    assert figure.any()


def test_court_way_and_standing_feet_are_drawn_where_the_court_is_known(tmp_path):
    material = on_court(make_material(tmp_path))
    world, camera = material.court

    def frame(number, **chosen):
        options = OverlayOptions(skeleton="none", **chosen)
        shown = overlay_frames(
            material.video, material.motion, silent, options, (number, number), material.court
        )
        return next(shown).astype(int)

    plain, drawn = frame(20, court=False), frame(20)
    beside = world.points[20, LSP14.index("right_ankle")] * [1, 1, 0] + [0.16, 0, 0]
    for place in ([0, -11.8, 0], world.root[20] * [1, 1, 0], beside):
        x, y = camera.project(20, np.array([place]))[0].round().astype(int)
        near = slice(y - 3, y + 4), slice(x - 3, x + 4)
        assert np.abs(drawn[near] - plain[near]).max() > 40
    assert np.abs(frame(6) - frame(6, court=False)).max() > 40  # no way, but the court


@pytest.mark.parametrize("view", ["above", "right"])
def test_court_and_way_are_drawn_from_elsewhere_too(tmp_path, view):
    material = on_court(make_material(tmp_path))

    def frame(**chosen):
        options = OverlayOptions(skeleton="none", view=(view,), size=400, **chosen)
        shown = overlay_frames(
            material.video, material.motion, silent, options, (20, 20), material.court
        )
        return next(shown).astype(int)

    drawn, plain = frame(), frame(court=False)
    changed = (np.abs(drawn - plain).max(axis=2) > 20)[:380]
    assert changed[200 if view == "above" else 372 :].any()
    if view == "above":  # the baseline lies two metres before the player, 50 px a metre
        root = material.court[0].root[20]
        row = round(200 - 50 * (-11.835 - root[1]))
        assert changed[row - 2 : row + 3].any(axis=0).all()


def test_no_court_is_drawn_where_there_is_none(tmp_path):
    material = on_ground(make_material(tmp_path))
    world, camera = material.court

    def frame(**chosen):
        options = OverlayOptions(skeleton="none", **chosen)
        shown = overlay_frames(
            material.video, material.motion, silent, options, (20, 20), material.court
        )
        return next(shown).astype(int)

    plain, drawn = frame(court=False), frame()
    line, way = camera.project(20, np.array([[4.0, -11.8, 0], world.root[20] * [1, 1, 0]]))
    for (x, y), changed in ((line.round().astype(int), False), (way.round().astype(int), True)):
        near = slice(y - 3, y + 4), slice(x - 3, x + 4)
        assert (np.abs(drawn[near] - plain[near]).max() > 40) == changed


def test_brackets_and_an_arrow_point_out_a_player_and_leave_what_is_in_the_box_alone():
    drawn = draw_brackets(GREY, np.array([60.0, 40.0, 180.0, 240.0]), np.array([120.0, 90.0]))
    changed = (drawn != GREY).any(axis=2)
    assert changed[40, 60] and changed[40, 180] and changed[238, 60]
    assert changed[66, 120]
    assert not changed[80:220, 80:160].any()
