"""A video of two points with a close-up, a replay and black between: from the file to exports."""

import multiprocessing
import os
import shutil
import signal
import time
from dataclasses import replace
from threading import Thread

import cv2
import numpy as np
import pytest
from command_line import keyrecon

from keyrecon.io.formats.c3d import read_points
from keyrecon.io.formats.coco import write_coco
from keyrecon.io.formats.keyframes import keyframes_from_json
from keyrecon.io.formats.motion_file import read_motion
from keyrecon.io.formats.picks import read_picks
from keyrecon.io.stages import StageStore
from keyrecon.io.video import open_video
from keyrecon.io.video_writer import write_video
from keyrecon.io.workers import open_workers
from keyrecon.io.workspace import Workspace
from keyrecon.keeping import call_stage
from keyrecon.library import reconstruct
from keyrecon.metrics import pa_mpjpe, read_truth
from keyrecon.pipeline import Options, prepare, with_height
from keyrecon.progress import silent
from keyrecon.propagation.propagation import PropagateOptions
from keyrecon.shots.groups import propagate_in_groups
from keyrecon.synthetic.cameras import CameraPlanOptions
from keyrecon.synthetic.clips import JoinOptions
from keyrecon.synthetic.marks import MarkOptions, mark_from_truth
from keyrecon.synthetic.sequence import SceneOptions, SynthOptions, synthesize

SIZE, FPS = (480, 270), 30.0
LENGTH, STARTS = 45, (20, 70)
"""Frames of each point, and where the points begin in what was rendered."""
CLOSE_UP, BLACK, REPLAY = 20, 16, 30
FIRST_OF_SECOND = LENGTH + CLOSE_UP + BLACK + REPLAY
FRAMES = FIRST_OF_SECOND + LENGTH
BUDGET = 0.1
POINTS = slice(0, LENGTH), slice(FIRST_OF_SECOND, FRAMES)


def closer(picture):
    return cv2.resize(picture[60:128, 180:300], SIZE, interpolation=cv2.INTER_LINEAR)


def in_file(values):
    """Truths of the rendered frames, by frames of the joined file; 0 elsewhere."""
    spread = np.zeros((FRAMES, *values.shape[1:]), values.dtype)
    for part, first in zip(POINTS, STARTS, strict=True):
        spread[part] = values[first : first + LENGTH]
    return spread


def clicks_within(folder, first):
    """Those of one point, whose frames count from its start."""
    return [
        replace(pick, frame=pick.frame - first)
        for pick in read_picks(folder / "picks.json")
        if first <= pick.frame < first + LENGTH
    ]


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """(project, motion, what the commands said, truth of the rendered, its folder)."""
    folder = tmp_path_factory.mktemp("match")
    camera = CameraPlanOptions(width=SIZE[0], height=SIZE[1], player_px=150.0)
    scene = SceneOptions(seed=2, camera=camera, workers=1)
    length = JoinOptions(seconds=(STARTS[1] + LENGTH) / FPS, fps=FPS)
    synthesize(folder, (), SynthOptions(scene, length))
    pictures = list(open_video(folder / "video.mp4").frames())
    joined = [
        *pictures[STARTS[0] : STARTS[0] + LENGTH],
        *map(closer, pictures[30 : 30 + CLOSE_UP]),
        *[pictures[30 + n // 2] for n in range(REPLAY)],
        *[np.full_like(pictures[0], 14)] * BLACK,
        *pictures[STARTS[1] : STARTS[1] + LENGTH],
    ]
    write_video(folder / "match.mp4", joined, FPS)
    made = folder / "project"
    assert keyrecon("new", folder / "match.mp4", "--project", made) == 0
    Workspace(made).add_picks(clicks_within(folder, STARTS[0]))
    assert keyrecon("keyframes", made, "--budget", BUDGET) == 0
    truth = read_truth(folder / "truth.npz")
    asked = keyframes_from_json((made / "keyframes.json").read_text())
    marks = mark_from_truth(
        asked,
        *(in_file(truth[name]) for name in ("points2d", "points3d", "visible")),
        MarkOptions(noise=1.0),
    )
    write_coco(folder / "marks.json", marks, SIZE)
    assert keyrecon("import", made, folder / "marks.json") == 0
    assert keyrecon("run", made, "--height", f"{float(truth['height_m']):.2f}") == 0
    return made, read_motion(made / "motion.npz"), truth, folder


def test_keyframes_are_asked_for_in_points_alone_by_the_frames_of_the_file(solved):
    made = solved[0]
    asked = keyframes_from_json((made / "keyframes.json").read_text())
    for half in (asked.upper, asked.lower):
        inside = [part.start <= t < part.stop for t in half.frames for part in POINTS]
        assert sum(inside) == len(half.frames)
        assert len(half.nearest) == FRAMES


def test_there_is_a_motion_in_the_points_and_nothing_anywhere_else(solved):
    motion = solved[1]
    assert motion.stretches == POINTS
    assert motion.cuts.tolist() == list(np.cumsum([LENGTH, CLOSE_UP, REPLAY, BLACK]))
    elsewhere = ~motion.known
    for name in ("points3d", "points2d", "points2d_propagated", "scale", "expected_error"):
        assert np.isnan(getattr(motion, name)[elsewhere]).all(), name
    assert (motion.confidence[elsewhere] == 0).all()


def test_points_are_as_good_as_when_each_is_run_by_itself(solved):
    _, motion, truth, folder = solved
    height, errors = float(truth["height_m"]), []
    for part, first in zip(POINTS, STARTS, strict=True):
        video = open_video(folder / "video.mp4", first, first + LENGTH)
        options = with_height(Options(), height)
        options = replace(options, keyframes=replace(options.keyframes, budget=BUDGET))
        preparation = prepare(video, clicks_within(folder, first), options)
        own = {name: truth[name][first : first + LENGTH] for name in truth if truth[name].ndim > 1}
        marks = mark_from_truth(
            preparation.keyframes,
            *(own[name] for name in ("points2d", "points3d", "visible")),
            MarkOptions(noise=1.0),
        )
        alone = reconstruct(preparation, marks, options)
        found = motion.points3d[part], alone.points3d
        errors.append([pa_mpjpe(points, own["points3d"]) for points in found])
    together, apart = np.mean(errors, axis=0)
    assert together < apart + 0.003


def test_groups_carried_by_processes_of_this_machine_are_the_same_to_the_digit(
    solved, tmp_path, monkeypatch
):
    _, _, truth, folder = solved
    monkeypatch.setattr("keyrecon.io.workers.core_count", lambda: 2)
    options = replace(Options(), keyframes=replace(Options().keyframes, budget=BUDGET))
    preparation = prepare(
        open_video(folder / "video.mp4"), read_picks(folder / "picks.json"), options
    )
    points = (truth[name] for name in ("points2d", "points3d", "visible"))
    marks = mark_from_truth(preparation.keyframes, *points, MarkOptions(noise=1.0))

    def carry(keep):
        given = preparation, marks, None, None, PropagateOptions()
        return propagate_in_groups(*given, keep, silent, most=60)

    with open_workers(None) as workers:
        others = multiprocessing.active_children()
        beside = carry(StageStore(tmp_path, workers=workers))
        assert len({*multiprocessing.active_children()} - {*others}) == 2
    alone = carry(call_stage)
    assert len([*tmp_path.glob("propagate@*.npz")]) == 2
    for name in ("joints", "confidence", "elsewhere"):
        np.testing.assert_array_equal(getattr(beside, name), getattr(alone, name))
    off = np.linalg.norm(alone.joints - truth["points2d"], axis=2)
    assert np.median(off) < 0.02 * np.median(preparation.track.height)


def test_exports_hold_nothing_where_nobody_is(solved, tmp_path):
    made, motion, _, _ = solved
    files = [tmp_path / f"match.{suffix}" for suffix in ("trc", "c3d", "csv", "json", "bvh", "glb")]
    assert keyrecon("export", made, *files) == 0
    trc = (tmp_path / "match.trc").read_text().splitlines()[6:]
    empty = np.array([not "".join(line.split("\t")[2:]) for line in trc])
    np.testing.assert_array_equal(empty, ~motion.known)
    markers, _ = read_points(tmp_path / "match.c3d")
    for points in markers.values():
        np.testing.assert_array_equal(np.isnan(points).all(axis=1), ~motion.known)
    bvh = (tmp_path / "match.bvh").read_text().splitlines()[-FRAMES:]
    assert len(set(bvh[LENGTH - 1 : FIRST_OF_SECOND])) == 1
    assert "nan" not in "".join(bvh).lower()


def test_the_overlay_draws_nobody_where_nobody_is(solved, tmp_path):
    made = solved[0]
    assert keyrecon("export", made, tmp_path / "overlay.mp4") == 0
    drawn = list(open_video(tmp_path / "overlay.mp4").frames())
    plain = list(open_video(solved[3] / "match.mp4").frames())
    changed = [
        (np.abs(a.astype(int) - b)[:200].max(axis=2) > 80).mean()
        for a, b in zip(drawn, plain, strict=True)
    ]
    assert min(changed[0], changed[FIRST_OF_SECOND]) > 0.003
    assert max(changed[LENGTH:FIRST_OF_SECOND]) < 0.0003


def test_the_report_tells_the_shots(solved):
    report = (solved[0] / "report.html").read_text()
    assert "5 shots, 2 usable" in report
    assert "slow motion" in report


def test_a_shot_that_was_left_out_can_be_asked_for_by_its_number(solved, tmp_path):
    made = tmp_path / "project"
    assert keyrecon("new", solved[3] / "match.mp4", "--project", made) == 0
    shutil.copytree(solved[0] / "cache", made / "cache", dirs_exist_ok=True)
    shutil.copy(solved[0] / "picks.json", made)
    assert keyrecon("keyframes", made, "--shots.use", "3", "--budget", BUDGET) == 0
    asked = keyframes_from_json((made / "keyframes.json").read_text())
    replay = slice(LENGTH + CLOSE_UP, LENGTH + CLOSE_UP + REPLAY)
    assert asked.upper.represented[replay].any()


def kill_a_busy_worker(address, cache):
    """End the process of a worker while it follows the player in a shot."""
    from distributed import Client

    with Client(address, set_as_default=False) as client:
        process = client.run(os.getpid)
        while not list(cache.glob("find@*")):
            time.sleep(0.01)
        while not (busy := [worker for worker, tasks in client.processing().items() if tasks]):
            time.sleep(0.01)
        os.kill(process[busy[0]], signal.SIGKILL)


def test_workers_of_a_cluster_make_the_same_to_the_digit_though_one_is_lost(solved, tmp_path):
    distributed = pytest.importorskip("distributed", reason="pip install 'keyrecon[cluster]'")
    here, made = solved[0], tmp_path / "project"
    assert keyrecon("new", solved[3] / "match.mp4", "--project", made) == 0
    for name in ("project.toml", "picks.json", "keyframes.json", "annotations.json"):
        shutil.copy(here / name, made)
    text = (made / "project.toml").read_text()
    (made / "project.toml").write_text(text.replace("../match.mp4", str(solved[3] / "match.mp4")))
    with distributed.LocalCluster(2, threads_per_worker=1, dashboard_address=None) as cluster:
        address = cluster.scheduler_address
        killing = Thread(target=kill_a_busy_worker, args=(address, made / "cache"))
        killing.start()
        assert keyrecon("run", made, "--workers", address) == 0
        killing.join()
    assert (made / "motion.npz").read_bytes() == (here / "motion.npz").read_bytes()
    local, elsewhere = (
        {file.name: file.read_bytes() for file in (project / "cache").iterdir()}
        for project in (here, made)
    )
    assert local == elsewhere
