"""The annotator's help on a small project, as the server asks for it."""

import json
from dataclasses import replace

import numpy as np
import pytest
from drawn_player import HEIGHT, corners, film, heads, picks
from numbered_pictures import read_number

from keyrecon.annotate.assist.answers import make_assistant
from keyrecon.annotate.assist.preview import cut_strip
from keyrecon.app import keyframing, project
from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.picks import write_picks
from keyrecon.io.video import open_video
from keyrecon.io.workspace import Workspace
from keyrecon.pipeline import Options
from keyrecon.progress import silent
from keyrecon.records import Annotations

COUNT = 60
AT = {  # px from the head as `drawn_player` draws the player
    "head_top": (0, -6), "neck": (0, 8), "right_shoulder": (-10, 11), "left_shoulder": (10, 11),
    "right_elbow": (-14, 25), "left_elbow": (14, 25), "right_wrist": (-17, 38),
    "left_wrist": (17, 38), "right_hip": (-6, 38), "left_hip": (6, 38), "right_knee": (-9, 61),
    "left_knee": (9, 61), "right_ankle": (-12, 84), "left_ankle": (12, 84),
}  # fmt: skip
OFFSETS = np.array([AT[name] for name in LSP14.names], dtype=float)
HEADS = heads(COUNT) - corners(COUNT, False)
JOINTS = HEADS[:, None] + OFFSETS


@pytest.fixture(scope="module")
def untouched(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rally")
    film(folder / "player.mp4", COUNT)
    project.start(folder / "player.mp4", folder / "project")
    return Workspace(folder / "project")


@pytest.fixture(scope="module")
def prepared(untouched):
    """(help, keyframes) of a project whose keyframes were chosen."""
    untouched.add_picks(picks(COUNT))
    keyframing.find_keyframes(untouched, Options(), keyframing.KeyframeSettings(budget=0.1), silent)
    return make_assistant(Workspace(untouched.folder))


def annotated(*frames):
    """The truth on some frames, with signs for the forearms."""
    frames = np.array(frames, dtype=np.int64)
    nearer = np.zeros((len(frames), 13), dtype=np.int64)
    return Annotations(LSP14, frames, JOINTS[frames], np.ones((len(frames), 14), bool), nearer)


def marked(frame):
    return {n: [*map(float, JOINTS[frame, j]), 2.0] for j, n in enumerate(LSP14.names)}


def plain(answer):
    """What the page reads; fails where JSON cannot say it."""
    return json.loads(json.dumps(answer, allow_nan=False))


def test_before_the_automatic_part_there_is_nothing_to_say(untouched):
    helper = make_assistant(Workspace(untouched.folder))
    assert helper.keyframes({}) == helper.suggestion(annotated(), 3) == {}
    assert helper.pose(annotated(), 3, marked(3), {}) == {}
    assert helper.checks(annotated(3)) is None  # which is not that nothing looks wrong
    assert helper.next_frames(annotated(3), frozenset()) == []


def test_each_keyframe_tells_where_the_player_is_and_what_it_stands_for(prepared):
    answer = plain(prepared.keyframes({7: "upper"}))
    assert answer["height_px"] == pytest.approx(HEIGHT, rel=0.06)
    assert answer["frames"]["7"]["why"].startswith("You added it.")
    for frame, row in answer["frames"].items():
        x0, y0, x1, y1 = row["box"]
        x, y = HEADS[int(frame)]
        assert x0 < x < x1
        assert y0 < y < y1
        assert row["why"]
    assert sum(row["stands_for"] for row in answer["frames"].values()) >= COUNT


def test_the_ghost_of_a_frame_is_where_the_player_is(prepared):
    assert prepared.suggestion(annotated(), 30) == {}
    answer = plain(prepared.suggestion(annotated(5, 20, 50), 35))
    off = [np.hypot(*(np.array(answer["joints"][n][:2]) - p[:2])) for n, p in marked(35).items()]
    assert max(off) < 0.08 * HEIGHT
    assert set(answer["from"]) <= {5, 20, 50}
    assert all(0 <= confidence <= 1 for *_, confidence in answer["joints"].values())


def test_a_pose_follows_the_marks_and_keeps_the_signs_that_were_given(prepared):
    answer = plain(prepared.pose(annotated(5, 20), 35, marked(35), {"left_wrist": 1}))
    assert set(answer["points3d"]) == set(LSP14.names)
    assert answer["predicted"] == []
    assert answer["limbs"]["left_wrist"] == {"sign": 1, "certainty": 1.0, "given": True}
    assert answer["alternatives"][0]["points3d"] == answer["points3d"]
    assert all(other["nearer"]["left_wrist"] == 1 for other in answer["alternatives"])


def test_joints_not_marked_yet_are_foreseen_in_space_too(prepared):
    few = {name: marked(35)[name] for name in ("neck", "head_top")}
    answer = plain(prepared.pose(annotated(5, 20), 35, few, {}))
    assert set(answer["points3d"]) == set(LSP14.names)
    assert set(answer["predicted"]) == set(LSP14.names) - set(few)


def test_a_limb_that_is_too_long_is_told_with_the_pose(prepared):
    marks = marked(35)
    marks["left_wrist"] = [marks["left_elbow"][0] + 40, marks["left_elbow"][1], 2.0]
    answer = prepared.pose(annotated(5, 20), 35, marks, {})
    assert list(answer["stretched"]) == ["left_wrist"]
    assert answer["stretched"]["left_wrist"] > 2


def test_true_marks_are_not_suspected_and_a_forgotten_joint_is(prepared):
    annotations = annotated(5, 20, 35, 50)
    assert plain(prepared.checks(annotations)) == []
    annotations.joints[1, LSP14.index("left_knee")] = np.nan
    (answer,) = plain(prepared.checks(annotations))
    assert (answer["frame"], answer["joint"], answer["kind"]) == (20, "left_knee", "missing")
    assert prepared.checks(replace(annotations, absent=((20, "left_knee"),))) == []


def test_help_comes_while_the_first_frames_are_being_marked(prepared):
    annotations = annotated(5, 20)
    order = np.argsort(LSP14.is_lower, kind="stable")
    for count in (1, 4, 6, 11):
        annotations.joints[1] = JOINTS[20]
        annotations.joints[1, order[count:]] = np.nan
        named = {LSP14.names[j]: marked(20)[LSP14.names[j]] for j in order[:count]}
        assert prepared.pose(annotations, 20, named, {})["points3d"]
        assert 20 in {answer["frame"] for answer in prepared.checks(annotations)}
        assert prepared.suggestion(annotations, 40)["joints"]


def test_without_a_result_nothing_is_suggested(prepared):
    assert prepared.next_frames(annotated(5, 20), frozenset()) == []


def test_picks_find_head_and_feet_on_the_frames_asked_for(prepared):
    answer = plain(prepared.preview(picks(COUNT), (40, 10)))
    assert [row["frame"] for row in answer["frames"]] == [10, 40]
    assert answer["confidence"] > 0.9
    for row in answer["frames"]:
        head = HEADS[row["frame"]]
        assert np.linalg.norm(np.array(row["head"]) - head) < 0.05 * HEIGHT
        middle = np.mean(row["feet"], axis=0)
        assert np.linalg.norm(middle - head - (0, HEIGHT)) < 0.06 * HEIGHT


def test_what_looks_like_a_part_is_tinted_and_the_scene_is_not(prepared):
    layer = prepared.backprojection(picks(COUNT), 30, "shirt")
    x, y = HEADS[30].round().astype(int)
    assert layer[y + 15 : y + 30, x - 5 : x + 5, 3].min() > 150
    assert np.median(layer[..., 3]) < 10
    with pytest.raises(KeyreconError, match=r"Nothing was picked as hat; there are head, foot"):
        prepared.backprojection(picks(COUNT), 30, "hat")


def test_the_last_preparation_helps_on_while_the_picks_are_changed(prepared, untouched):
    before = prepared.keyframes({})
    text = untouched.picks_file.read_text()
    untouched.add_picks(picks(COUNT)[:1])
    untouched.picks_file.write_text(text.replace('"shirt"', '"vest"'))
    assert prepared.keyframes({}) == before
    untouched.picks_file.write_text(text)


def test_picks_in_another_order_are_the_same_picks(prepared, untouched):
    before = untouched.picks()
    write_picks(untouched.picks_file, before[::-1])
    assert make_assistant(Workspace(untouched.folder)).keyframes({}) == prepared.keyframes({})
    write_picks(untouched.picks_file, before)


def test_help_comes_back_with_results_that_were_deleted_and_made_again(prepared, untouched):
    cache, aside = untouched.stages.folder, untouched.folder / "aside"
    cache.rename(aside)
    help_ = make_assistant(Workspace(untouched.folder))
    assert help_.keyframes({}) == {}
    cache.mkdir()
    for file in aside.glob("*.npz"):
        file.rename(cache / file.name)
    assert help_.keyframes({})["frames"]


def test_a_strip_shows_the_frames_it_says(write_numbered):
    video = open_video(write_numbered("strip.mp4", [12 * n for n in range(90)]))
    strip = cut_strip(video, (17, 71))
    assert {17, 71} <= set(strip.numbers)
    assert [read_number(picture) for picture in strip.pictures] == list(strip.numbers)
    assert len(strip) == len(strip.pictures) == len(list(strip.grey_frames()))
    with pytest.raises(KeyreconError, match="Frame 90 is outside"):
        cut_strip(video, (90,))
