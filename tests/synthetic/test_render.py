import json
from dataclasses import replace

import numpy as np
import pytest

from keyrecon.body import LSP14
from keyrecon.io.formats.picks import read_picks
from keyrecon.io.video import open_video
from keyrecon.numerics.geometry import project_perspective
from keyrecon.synthetic.cameras import CameraPlanOptions, View, plan_camera
from keyrecon.synthetic.clips import JoinOptions
from keyrecon.synthetic.court import on_court
from keyrecon.synthetic.figure import FOOT_LENGTH, PARTS, STATURE
from keyrecon.synthetic.looks import choose_look
from keyrecon.synthetic.motion import MotionOptions, play_tennis
from keyrecon.synthetic.raster import FAR, Solids, draw_solids
from keyrecon.synthetic.render import draw_frame
from keyrecon.synthetic.sequence import (
    SceneOptions,
    SynthOptions,
    click_parts,
    set_stage,
    synthesize,
)

SMALL = CameraPlanOptions(View.OBLIQUE, width=480, height=270, player_px=150.0)


@pytest.fixture(scope="module")
def points():
    return play_tennis(MotionOptions(seconds=4.0, seed=1))


@pytest.fixture(scope="module")
def stage(points):
    return set_stage(points, 50.0, SceneOptions(seed=1, camera=SMALL))


def one_solid(start, end, radii, squeeze=(1.0, 1.0)):
    return Solids(
        np.array([start], float), np.array([end], float), np.array([[1.0, 0, 0]]),
        np.array([radii]), np.array([squeeze]), np.array([False]),
    )  # fmt: skip


def test_a_ball_is_drawn_as_a_disc_of_the_right_size_and_depth():
    solid = one_solid((0, 0, 10), (0, 0.001, 10), (0.3, 0.3))
    surface = draw_solids(solid, 1000.0, np.array([100.0, 100.0]), (200, 200))
    assert (surface.solid >= 0).sum() == pytest.approx(np.pi * 30**2, rel=0.01)
    assert surface.depth[surface.depth < FAR].min() == pytest.approx(1000 - 30, abs=0.2)


def test_normals_of_a_ball_point_away_from_its_centre():
    solid = one_solid((0, 0, 10), (0, 0.001, 10), (0.3, 0.3))
    surface = draw_solids(solid, 1000.0, np.array([100.0, 100.0]), (200, 200))
    rows, columns = np.nonzero(surface.solid >= 0)
    hit = np.stack([columns + surface.left - 100, rows + surface.top - 100], axis=1) / 30
    np.testing.assert_allclose(surface.normal[:, :2], hit, atol=0.01)
    assert (surface.normal[:, 2] <= 1e-6).all()


def test_a_cone_meets_rays_where_a_fine_chain_of_balls_does():
    rng = np.random.default_rng(0)
    for _ in range(5):
        start, end = rng.uniform(-0.3, 0.3, (2, 3)) + np.array([0, 0, 8])
        solid = one_solid(start, end, (0.12, 0.05))
        surface = draw_solids(solid, 800.0, np.array([150.0, 150.0]), (300, 300))
        share = np.linspace(0, 1, 400)[:, None]
        scale = 800 / np.array([start[2], end[2]])
        pixels = np.array([start, end])[:, :2] * scale[:, None] + 150
        reference = 800 / start[2]
        path = np.column_stack([pixels, np.array([start, end])[:, 2] * reference])
        centres = path[:1] + share * (path[1:] - path[:1])
        radii = 0.12 * scale[0] + share[:, 0] * (0.05 * scale[1] - 0.12 * scale[0])
        rows, columns = np.nonzero(surface.solid >= 0)
        at = np.stack([columns + surface.left, rows + surface.top], axis=1)
        apart = ((at[:, None] - centres[None, :, :2]) ** 2).sum(axis=-1)
        slow = (centres[:, 2] - np.sqrt(np.maximum(radii**2 - apart, 0))).copy()
        slow[apart > radii**2] = np.inf
        inside = np.isfinite(slow).any(axis=1)
        assert inside.mean() > 0.98
        found = surface.depth[rows, columns][inside]
        np.testing.assert_allclose(found, slow.min(axis=1)[inside], atol=0.6)


def test_a_nearer_solid_hides_a_farther_one():
    pair = [one_solid((0, 0, z), (0, 0.001, z), (0.3, 0.3)) for z in (10, 12)]
    both = Solids(*[np.concatenate([getattr(s, f) for s in pair]) for f in Solids.__annotations__])
    surface = draw_solids(both, 1000.0, np.array([100.0, 100.0]), (200, 200))
    assert set(np.unique(surface.solid)) == {-1, 0}


@pytest.mark.parametrize(("behind", "side"), [(8.0, 1), (-30.0, -1)])
def test_the_truth_on_the_court_is_in_the_axes_of_its_nearer_half(behind, side):
    corner_of_baseline = np.array([5.485, 0.9, 0.0])
    expected = [side * 5.485, side * -11.885, 0.9]
    np.testing.assert_allclose(on_court(corner_of_baseline, np.array([0, 2, behind])), expected)


def test_the_truth_is_seen_at_its_own_pixels_by_the_stated_camera(points):
    rng = np.random.default_rng(0)
    move = plan_camera(points, 50.0, 1.78, replace(SMALL, pan=True), rng)
    local = move.to_camera(points)
    for t in (0, 60, 199):
        by_hand = (points[t] - move.center) @ move.rotation[t].T
        np.testing.assert_allclose(local[t], by_hand)
        pixels = project_perspective(by_hand, move.focal[t], move.principal)
        np.testing.assert_allclose(move.project(points)[t], pixels)


@pytest.mark.parametrize("view", View)
def test_a_static_camera_keeps_the_player_in_the_picture(points, view):
    move = plan_camera(points, 50.0, 1.78, replace(SMALL, view=view), np.random.default_rng(2))
    pixels = move.project(points)
    assert (pixels > 0).all() and (pixels < np.array(move.size)).all()


def test_a_panning_camera_follows_late_but_never_loses_the_player(points):
    options = replace(SMALL, view=View.BACK, pan=True, player_px=180.0)
    move = plan_camera(points, 50.0, 1.78, options, np.random.default_rng(2))
    middle = move.project(points).mean(axis=1)
    assert (np.abs(middle - move.principal) < np.array(move.size) * 0.4).all()
    turns = np.linalg.norm(np.diff(move.rotation, axis=0), axis=(1, 2))
    assert turns.max() < 0.02


def test_the_players_pixels_surround_the_joints(stage):
    for t in (0, 80, 150):
        frame = draw_frame(stage, t)
        cell = np.round(stage.move.project(stage.points)[t]).astype(int)
        top = LSP14.index("head_top")
        inside = np.delete(frame.parts[cell[:, 1], cell[:, 0]], top)
        assert (inside > 0).all()
        x, y = cell[top]
        assert frame.parts[y : y + 4, x - 2 : x + 3].max() > 0


def test_joints_in_view_are_told_from_hidden_ones(stage):
    frames = [draw_frame(stage, t).visible for t in range(0, 200, 20)]
    assert 0.5 < np.mean(frames) < 0.98


def test_a_pixel_of_clothing_has_the_colour_of_the_look(stage):
    frame = draw_frame(stage, 0)
    shirt = frame.picture[frame.parts == PARTS.index("shirt")].astype(float).mean(axis=0)
    wanted = np.array(stage.look.shirt)
    assert shirt @ wanted / np.linalg.norm(shirt) / np.linalg.norm(wanted) > 0.95


def test_the_same_seed_gives_the_same_pixels(points, stage):
    again = set_stage(points, 50.0, SceneOptions(seed=1, camera=SMALL))
    np.testing.assert_array_equal(draw_frame(stage, 77).picture, draw_frame(again, 77).picture)


def test_another_seed_gives_another_scene(points, stage):
    other = draw_frame(set_stage(points, 50.0, SceneOptions(seed=2, camera=SMALL)), 77).picture
    difference = np.abs(other.astype(float) - draw_frame(stage, 77).picture)
    assert (difference.max(axis=-1) > 20).mean() > 0.3


def test_clicks_land_on_the_parts_they_name(stage):
    frame = draw_frame(stage, 40)
    picks = click_parts(frame.parts, 40)
    assert {"head", "foot", "shirt", "shorts", "skin"} <= {p.part for p in picks}
    parts = {"head": ("hair", "face"), "foot": ("right_shoe", "left_shoe")}
    for pick in picks:
        around = frame.parts[int(pick.y) - 1 : int(pick.y) + 2, int(pick.x) - 1 : int(pick.x) + 2]
        allowed = [PARTS.index(p) for p in parts.get(pick.part, (pick.part,))]
        assert np.isin(around, allowed).all()


def test_some_looks_repeat_the_players_colours_in_the_scene():
    def near(a, b):
        return np.abs(np.subtract(a, b)).max() < 40

    looks = [choose_look(seed) for seed in range(40)]
    assert sum(near(k.shorts, k.court.wall) for k in looks) > 5
    assert sum(near(k.skin, k.court.inside) for k in looks if k.court.surface == "clay") >= 1
    assert sum(near(k.shoe, k.court.line) for k in looks) > 10


def test_a_written_sequence_holds_together(tmp_path):
    scene = SceneOptions(seed=2, camera=replace(SMALL, pan=True), workers=1)
    synthesize(tmp_path, (), SynthOptions(scene, JoinOptions(seconds=0.4)))
    video = open_video(tmp_path / "video.mp4")
    truth = np.load(tmp_path / "truth.npz")
    assert len(video) == 20 == len(truth["points3d"]) == len(truth["points2d"])
    assert (video.width, video.height, round(video.fps)) == (480, 270, 50)
    assert tuple(truth["joint_names"]) == LSP14.names
    camera = on_court(truth["center"], truth["center"])
    away = np.linalg.norm(truth["points3d_world"] - camera, axis=2)
    np.testing.assert_allclose(away, np.linalg.norm(truth["points3d"], axis=2))
    depth = truth["points3d"][..., 2:]
    seen = truth["points3d"][..., :2] / depth * truth["focal"][:, None, None] + truth["principal"]
    np.testing.assert_allclose(seen, truth["points2d"], atol=1e-6)
    foot = np.linalg.norm(
        truth["toes3d"]
        - truth["points3d"][:, [LSP14.index(f"{s}_ankle") for s in ("right", "left")]],
        axis=2,
    )
    np.testing.assert_allclose(foot, FOOT_LENGTH * truth["height_m"] / STATURE)
    assert truth["contact"].shape == (20, 2) and truth["contact"].any(axis=1).all()
    assert len({p.frame for p in read_picks(tmp_path / "picks.json")}) == 3
    assert json.loads((tmp_path / "scene.json").read_text())["options"]["seed"] == 2
