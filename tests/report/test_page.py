"""report.html: complete, self-contained, and true to its numbers."""

import base64
import json
import re
import shutil
import subprocess
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from report_material import make_material, on_court, on_ground, renamed_video, walk, write_report

from keyrecon.annotation_budget import annotation_cost
from keyrecon.body import LSP14
from keyrecon.hyperextension import HyperextendedStretch
from keyrecon.io.video import open_video
from keyrecon.report import sections, summary
from keyrecon.report.charts import break_at_cuts, joint_chart
from keyrecon.report.headline import in_words, marked_share
from keyrecon.report.instants import KeyInstant
from keyrecon.report.markup import MOST_FRAMES, pack, sentence, thinning
from keyrecon.report.page import build_page
from keyrecon.report.pictures import LEAST_SIDE, SIDE, Windows, clip_side, cut_pictures
from keyrecon.report.sections import MATRIX_SIDE, reduce_matrix, stands_for
from keyrecon.report.views import VIEWS, pose_drawing
from keyrecon.uncertainty import player_height, uncertain_stretches

OWN = Path(__file__).parents[2] / "keyrecon" / "report"


class References(HTMLParser):
    """Everything that a page would load, and the elements it has."""

    def __init__(self, page):
        super().__init__()
        self.found, self.tags, self.ids = [], [], []
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.found += [value for name, value in attrs if name in ("src", "href", "data", "poster")]
        self.ids += [value for name, value in attrs if name == "id"]


@pytest.fixture(scope="module")
def material(tmp_path_factory):
    return make_material(tmp_path_factory.mktemp("report"), 40)


@pytest.fixture(scope="module")
def pictures(material):
    return cut_pictures(
        material.video, material.track, material.annotations, material.motion, 6, instants=[17]
    )


@pytest.fixture(scope="module")
def page(material, pictures):
    return build_page(material, pictures)


def test_the_page_refers_to_nothing_outside_itself(page):
    outside = [r for r in References(page).found if not r.startswith(("data:", "#"))]
    assert not outside
    assert "default-src 'none'" in page


def test_our_scripts_and_styles_know_no_addresses():
    for path in (*OWN.glob("*.js"), *OWN.glob("*.css")):
        source = path.read_text()
        assert not re.search(r"https?:|//[a-z]|@import|fetch\(|XMLHttpRequest|url\(", source), path


def test_a_way_on_the_court_is_told_in_numbers(material, pictures, page):
    assert 'id="court"' not in page
    told = re.sub(r"<[^>]+>", " ", build_page(on_court(material), pictures))
    for words in (
        "Distance",
        "Top speed",
        "Behind the baseline",
        "100% of the time",
        "km/h, mean of half a second",
    ):
        assert words in re.sub(r"\s+", " ", told)


def test_a_way_where_there_is_no_court_knows_no_baseline_and_never_says_court(material, pictures):
    page = build_page(on_ground(material), pictures)
    shown = re.sub(r"<(script|style)\b.*?</\1>", " ", page, flags=re.DOTALL)
    told = re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", shown))
    told = told[: told.rindex("How it was made")]
    assert "On the ground" in told and "in squares of a metre" in told and "Top speed" in told
    chart = page.split('id="chart-run"')[1].split("</script>")[0]
    labels = " ".join(re.findall(r'aria-label="([^"]*)"', shown))
    for words in ("baseline", "umpire", "opponent", "court"):
        assert words not in f"{told} {labels} {chart}".lower()


def test_the_page_shows_every_section_once(page):
    ids = References(page).ids
    for name in (
        "video",
        "keyframes",
        "occurrence",
        "distances",
        "curves",
        "figure",
        "views",
        "body",
        "sources",
        "angles",
        "making",
    ):
        assert ids.count(name) == 1
    assert len(ids) == len(set(ids))


def test_what_an_unknown_lens_costs_stands_where_it_is_told_how_far_to_trust(
    material, pictures, page
):
    assert "The lens is not known" not in page
    near = build_page(replace(material, lens="The player is <near>."), pictures)
    trust = near.split('id="accuracy"')[1].split('id="doubts"')[0]
    assert "The lens is not known.</strong> The player is &lt;near&gt;." in trust


def test_names_from_files_cannot_become_markup(material, pictures, page):
    hostile = renamed_video(material, Path("<img src=x onerror=alert(1)></title><script>.mp4"))
    wrong = build_page(hostile, pictures)
    assert References(wrong).tags == References(page).tags
    assert "<img src=x" not in wrong


def test_pictures_are_cut_for_the_strip_and_for_every_keyframe(material, pictures):
    assert len(pictures.strip) == 6
    assert set(pictures.keyframes) == set(material.annotations.frames.tolist())
    assert pictures.clip.startswith("data:video/mp4;base64,")


def test_the_small_video_of_hours_is_smaller_and_has_no_less_frames():
    assert clip_side(40) == clip_side(9000) == SIDE
    assert LEAST_SIDE < clip_side(40_000) < SIDE
    assert clip_side(1_000_000) == LEAST_SIDE


def test_the_small_video_shows_nobody_where_there_is_no_motion(material, tmp_path):
    nowhere = material.motion.points3d.copy()
    nowhere[20:] = np.nan
    motion = replace(material.motion, points3d=nowhere)
    made = cut_pictures(material.video, material.track, material.annotations, motion, 6)
    (tmp_path / "clip.mp4").write_bytes(base64.b64decode(made.clip.partition(",")[2]))
    shown = np.array([picture.std() for picture in open_video(tmp_path / "clip.mp4").frames()])
    assert len(shown) == len(motion.time)
    assert shown[:20].min() > 5 > shown[21:].max()


def test_the_page_opens_with_the_first_frame_that_shows_the_player(material, tmp_path):
    unseen = material.motion.points3d.copy()
    unseen[:7] = np.nan
    hidden = replace(material, motion=replace(material.motion, points3d=unseen))
    write_report(tmp_path / "report.html", hidden)
    assert '"first":7' in (tmp_path / "report.html").read_text().replace(" ", "")


def test_without_truth_the_report_tells_the_expected_error_and_no_accuracy(
    material, pictures, page
):
    errors = np.full(material.motion.confidence.shape, 0.03 * 90)  # 3 cm at 90 px per metre
    motion = replace(material.motion, expected_error=errors)
    blind = build_page(replace(material, truth=None, motion=motion), pictures)
    assert "PA-MPJPE" in page and "PA-MPJPE" not in blind
    assert 'id="show-truth"' not in blind
    assert "expected to be 3.0 cm off in the picture, more in depth" in blind
    assert "<dt>Expected error</dt><dd>3.0 cm<small>" in blind
    assert "Confidence" not in blind


def test_without_a_height_errors_are_shares_of_it(material, pictures):
    errors = np.full(material.motion.confidence.shape, 0.03 * 90)
    motion = replace(material.motion, expected_error=errors, units="body heights")
    assert "expected to be 3.0% of the height off" in build_page(
        replace(material, truth=None, motion=motion), pictures
    )


def test_a_reader_meets_the_motion_first_and_how_it_was_made_last(page):
    ids = References(page).ids
    order = ["clip", "video", "accuracy", "angles", "making", "keyframes", "distances"]
    assert sorted(order, key=ids.index) == order


def test_what_does_not_fit_together_is_told_before_anything_else(material, pictures, page):
    assert "Not everything fits together" not in page
    line = "The video cuts to another shot at frame 20 <b>"
    warned = build_page(replace(material, warnings=[line]), pictures)
    assert "at frame 20 &lt;b&gt;" in warned
    assert warned.index('class="warning"') < warned.index('id="clip"')


def test_frames_that_were_marked_are_counted_and_not_those_asked_for(material, pictures):
    marks = material.annotations
    joints = marks.joints.copy()
    joints[0] = np.nan  # asked for, and nothing marked
    fewer = replace(material, annotations=replace(marks, joints=joints))
    written = build_page(fewer, pictures)
    count = len(marks.frames) - 1
    assert f"<h2>{count} marked frames</h2>" in written
    assert f"<dt>Marked by a person</dt><dd>{count}<small>of 40 frames" in written


def test_marks_of_one_half_of_the_body_count_half(material):
    joints = np.full((2, 14, 2), np.nan)
    joints[0] = 1.0
    joints[1, LSP14.index("neck")] = 1.0
    marks = replace(
        material.annotations,
        frames=np.array([3, 7]),
        joints=joints,
        visible=np.isfinite(joints[..., 0]),
        nearer=np.zeros((2, 13), dtype=int),
    )
    assert marked_share(marks, 100) == pytest.approx(0.015)


def test_the_file_is_written_whole(material, tmp_path):
    write_report(tmp_path / "report.html", material)
    text = (tmp_path / "report.html").read_text()
    assert text.startswith("<!doctype html>") and text.endswith("</html>")


def test_packed_numbers_come_back_and_unknown_ones_stay_unknown():
    values = np.random.default_rng(0).normal(0, 300, (50, 3))
    values[7, 1] = np.nan
    packed = pack(values)
    whole = np.frombuffer(base64.b64decode(packed["data"]), "<i2").reshape(packed["shape"])
    assert whole[7, 1] == -32768
    known = np.isfinite(values)
    assert np.abs(whole * packed["step"] - values)[known].max() <= packed["step"]


def test_of_hours_the_report_holds_every_few_frames():
    values = np.arange(21.0).reshape(7, 3)
    packed = pack(values, 3)
    held = np.frombuffer(base64.b64decode(packed["data"]), "<i2").reshape(-1, 3)
    assert packed["every"] == 3 and packed["shape"] == [7, 3]
    np.testing.assert_allclose(held * packed["step"], values[::3], atol=packed["step"])
    assert thinning(MOST_FRAMES) == 1 and thinning(MOST_FRAMES + 1) == 2
    assert thinning(50 * 3600) == 4


def test_of_hours_a_curve_holds_every_few_frames_and_still_ends_with_every_shot(monkeypatch):
    values, cuts = np.arange(12, dtype=np.float32), np.array([5])
    places, broken = break_at_cuts(values, cuts)
    assert places.tolist() == [0, 1, 2, 3, 4, 4.5, 5, 6, 7, 8, 9, 10, 11]
    assert np.flatnonzero(np.isnan(broken)).tolist() == [5]
    monkeypatch.setattr("keyrecon.report.markup.MOST_FRAMES", 4)
    places, broken = break_at_cuts(values, cuts)
    assert places.tolist() == [0, 3, 4.5, 6, 9]
    np.testing.assert_array_equal(broken, [0, 3, np.nan, 6, 9])
    assert places.dtype == broken.dtype == np.float32


def test_a_small_video_that_came_out_too_large_is_made_coarser(material, monkeypatch):
    def clip():
        motion = material.motion
        return cut_pictures(material.video, material.track, material.annotations, motion, 6).clip

    fine = len(clip()) * 3 / 4
    monkeypatch.setattr("keyrecon.report.pictures.CLIP_BYTES", 0.6 * fine)
    monkeypatch.setattr("keyrecon.report.pictures.clip_side", lambda frames: SIDE)
    assert len(clip()) * 3 / 4 < 0.7 * fine


def test_its_small_video_lasts_as_long_with_fewer_pictures(material, tmp_path, monkeypatch):
    monkeypatch.setattr("keyrecon.report.markup.MOST_FRAMES", len(material.motion.time) // 2)
    made = cut_pictures(material.video, material.track, material.annotations, material.motion, 6)
    (tmp_path / "clip.mp4").write_bytes(base64.b64decode(made.clip.partition(",")[2]))
    clip, whole = open_video(tmp_path / "clip.mp4"), len(material.motion.time)
    assert len(clip) == -(-whole // thinning(whole)) < whole
    assert len(clip) / clip.fps == pytest.approx(whole / material.motion.fps, abs=1 / clip.fps)


def test_a_point_and_its_crop_agree():
    picture = np.zeros((200, 300, 3), np.uint8)
    picture[80:84, 120:124] = 255
    windows = Windows(np.array([[130.0, 90.0]]), np.array([60.0]))
    crop = windows.cut(0, picture, 240)
    rows, columns = np.nonzero(crop[..., 0] > 128)
    placed = windows.to_crop(0, np.array([121.5, 81.5]), 240)
    np.testing.assert_allclose([columns.mean(), rows.mean()], placed, atol=0.5)


@pytest.mark.parametrize("center", [(-500, 50), (800, 50), (0, 0), (299, 199), (150, 5000)])
def test_a_window_outside_the_picture_still_gives_a_crop(center):
    windows = Windows(np.array([center], dtype=float), np.array([77.0]))
    assert windows.cut(0, np.zeros((200, 300, 3), np.uint8), 64).shape == (64, 64, 3)


@pytest.mark.parametrize("frames", [1, 40, 900])
def test_matrices_stay_small_and_keep_the_diagonal_dark(frames):
    at = np.arange(frames)
    grey, _ = reduce_matrix(np.abs(at[:, None] - at[None]).astype(np.float32), at)
    assert len(grey) == min(frames, MATRIX_SIDE)
    assert np.diag(grey).max(initial=0) <= 2


def test_exemplars_stand_for_their_frames_in_the_matrix():
    grey, top = reduce_matrix(np.array([[0, 4.0], [4.0, 0]]), np.array([0, 0, 1]))
    np.testing.assert_array_equal(grey == 0, [[1, 1, 0], [1, 1, 0], [0, 0, 1]])
    assert top == pytest.approx(4.0)


def left_out(material, frames):
    """The material of a video of which some frames show no player."""
    halves = (
        replace(half, distance=np.where(np.isin(np.arange(40), frames), np.inf, half.distance))
        for half in (material.keyframes.upper, material.keyframes.lower)
    )
    upper, lower = halves
    return replace(material, keyframes=replace(material.keyframes, upper=upper, lower=lower))


def test_frames_without_the_player_are_alike_to_none_and_no_keyframe_stands_for_them(
    material, pictures
):
    frames = np.arange(25, 30)
    told = left_out(material, frames)
    half = told.keyframes.upper
    assert sum(stands_for(half, frame) for frame in half.frames.tolist()) == 35
    grey, _ = reduce_matrix(
        told.pose_distances.upper, told.pose_distances.row, np.isfinite(half.distance)
    )
    unknown = np.isin(np.arange(40), frames)
    np.testing.assert_array_equal(grey == 255, unknown[:, None] | unknown[None])
    for x, y in chart_lines(build_page(told, pictures))["occurrence"]:
        assert np.isnan(y[np.isin(x, frames)]).all() and np.isfinite(y[x < 25]).all()


def test_every_frame_is_stood_for_once(material):
    half = material.keyframes.upper
    assert sum(stands_for(half, frame) for frame in half.frames.tolist()) == 40
    assert stands_for(half, 1) is None


def test_half_body_marks_count_half(material):
    assert annotation_cost(material.keyframes, 40) == pytest.approx((5 + 4) / 2 / 40)


def chart_lines(page):
    """Numbers (x, y) of every line of the charts over the frames, by chart."""
    blocks = re.findall(r'id="chart-(\w+)">(.*?)</script>', page)
    return {
        name: [
            (decode(trace["x"]), decode(trace["y"]))
            for trace in json.loads(figure)["data"]
            if trace.get("mode") == "lines" and len(trace["x"])
        ]
        for name, figure in blocks
    }


def decode(values):
    """Numbers as plotly writes them: a list, or bytes."""
    if isinstance(values, dict):
        return np.frombuffer(base64.b64decode(values["bdata"]), values["dtype"]).astype(float)
    return np.array(values, float)


def test_no_line_of_a_chart_leads_from_one_shot_to_the_next(material, pictures):
    two = replace(on_court(material), motion=replace(material.motion, cuts=np.array([20])))
    lines = chart_lines(build_page(two, pictures))
    for name in ("angles", "doubt", "run", "occurrence"):
        assert lines[name]
        for x, y in lines[name]:
            assert np.isnan(y[(x > 19) & (x < 20)]).any(), name
            assert np.isfinite(y[np.isin(x, [18, 21])]).all()


def test_poses_on_a_line_are_ordered_along_it():
    place = np.array([3.0, -1.0, 7.0, 0.5, 4.0])
    order = summary.order_by_pose(np.abs(place[:, None] - place[None]))
    assert (np.diff(place[order]) > 0).all() or (np.diff(place[order]) < 0).all()


def test_a_straight_limb_has_pi_and_a_square_one_half_of_it():
    pose = walk(1)[0]
    knee, hip, ankle = (LSP14.index(f"left_{name}") for name in ("knee", "hip", "ankle"))
    column = summary.hinges(LSP14).index(knee)
    pose[0, hip], pose[0, knee], pose[0, ankle] = (0, 0, 0), (0, 1, 0), (0, 2, 0)
    assert summary.hinge_angles(pose, LSP14)[0, column] == pytest.approx(np.pi)
    pose[0, ankle] = (0, 1, 1)
    assert summary.hinge_angles(pose, LSP14)[0, column] == pytest.approx(np.pi / 2)


def test_hinges_are_elbows_and_knees():
    names = {LSP14.names[joint] for joint in summary.hinges(LSP14)}
    assert names == {"left_elbow", "right_elbow", "left_knee", "right_knee"}


def test_a_planted_foot_has_no_speed(material):
    points = material.motion.points2d.copy()
    points[:, LSP14.index("right_ankle")] = (50.0, 60.0)
    standing = replace(material.motion, points2d=points)
    assert summary.foot_speed(standing, material.track).max() == 0


def test_truth_in_another_order_and_unit_is_brought_to_the_motion(material):
    other = {
        "points3d": 1000 * material.truth["points3d"][:, ::-1],
        "points2d": material.truth["points2d"][:, ::-1],
        "joint_names": np.array(LSP14.names[::-1]),
    }
    found = summary.arrange_truth(other, LSP14)
    np.testing.assert_array_equal(found.points2d, material.truth["points2d"])
    scaled = summary.scale_truth(material.motion, found.points3d)
    own = summary.scale_truth(material.motion, material.truth["points3d"])
    np.testing.assert_allclose(scaled, own)
    assert np.nanmax(summary.error_per_frame(material.motion, found)) < 0.1


def test_joints_that_the_truth_lacks_are_unknown(material):
    few = {
        "points3d": material.truth["points3d"][:, :3],
        "points2d": material.truth["points2d"][:, :3],
        "joint_names": np.array(LSP14.names[:3]),
    }
    assert np.isnan(summary.arrange_truth(few, LSP14).points3d[:, 3:]).all()


def test_views_are_rotations_and_the_first_is_the_camera():
    for view in VIEWS.values():
        np.testing.assert_array_equal(view @ view.T, np.eye(3))
        assert np.linalg.det(view) == pytest.approx(1)
    np.testing.assert_array_equal(VIEWS["from the camera"], np.eye(3))


def test_from_above_the_head_hides_the_body():
    """What is higher (smaller y) is nearer to a camera above, and farther joints are higher up."""
    seen = np.array([[0, -2.0, 0], [0, 0, 0], [0, 0, 1.0]]) @ VIEWS["from above"].T
    assert seen[0, 2] < seen[1, 2]
    assert seen[2, 1] < seen[1, 1]


def test_a_pose_with_unknown_joints_can_be_drawn():
    pose = walk(1)[0][0]
    pose[5] = np.nan
    assert "nan" not in pose_drawing(pose, LSP14, "from above", 1.75)
    assert "<path" not in pose_drawing(np.full((14, 3), np.nan), LSP14, "from above", 1.75)


PROBE = """<script>
const faults = []; addEventListener("error", (event) => faults.push(event.message));
addEventListener("securitypolicyviolation", (event) => faults.push(event.blockedURI));
addEventListener("load", () => {
  document.querySelectorAll(".chart").forEach((chart) => chart.scrollIntoView());
  setTimeout(() => {
    const slider = document.getElementById("frame");
    slider.value = 7; slider.dispatchEvent(new Event("input"));
    document.title = JSON.stringify({faults, now: document.getElementById("now").textContent,
      wide: document.documentElement.scrollWidth - innerWidth,
      drawn: document.querySelectorAll("canvas").length});
  }, 1200);
});
</script>"""


def test_a_browser_opens_the_page_without_faults(page, tmp_path):
    browser = shutil.which("chromium") or shutil.which("google-chrome") or shutil.which("chrome")
    if browser is None:
        pytest.skip("no chromium on this machine: the page was not opened in a browser")
    path = tmp_path / "report.html"
    path.write_text(page.replace("<title>", f"{PROBE}<title>", 1))
    command = [
        browser,
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-quic",
        "--no-first-run",
        "--disable-background-networking",
        "--disable-component-update",
        "--disable-sync",
        f"--user-data-dir={tmp_path / 'profile'}",
        "--virtual-time-budget=4000",
        "--window-size=1366,768",
        "--dump-dom",
        path.as_uri(),
    ]
    try:
        found = subprocess.run(command, capture_output=True, text=True, timeout=120)
    except subprocess.TimeoutExpired:
        pytest.skip("the browser did not answer within two minutes")
    if found.returncode:
        pytest.skip(f"the browser could not start: {found.stderr[-300:]}")
    title = re.search(r"<title>(.*?)</title>", found.stdout).group(1)
    assert '"faults":[]' in title.replace("&quot;", '"')
    assert "frame 7" in title and '"drawn":5' in title.replace("&quot;", '"')
    assert int(re.search(r'wide":(-?\d+)', title.replace("&quot;", '"')).group(1)) <= 0


def test_the_report_tells_where_it_is_least_sure_and_each_line_goes_there(material, pictures):
    motion = material.motion
    errors = np.full(motion.confidence.shape, 1.0)
    errors[12:25, :6] = 0.3 * player_height(motion)[:1]
    doubtful = replace(material, motion=replace(motion, expected_error=errors))
    (stretch,) = uncertain_stretches(doubtful.motion)
    written = build_page(doubtful, pictures)
    line = stretch.in_words(in_words(stretch.error / 90, "m"))
    assert "cm; marking frame" in line
    assert f'class="goes" data-frame="{stretch.frame}">{line}<' in written
    assert 'href="#doubts"' in written
    former = build_page(replace(material, motion=replace(motion, expected_error=None)), pictures)
    assert 'id="doubts"' not in former
    assert 'href="#doubts"' not in former


def test_a_fastest_hand_that_is_uncertain_is_told_as_such(material, pictures, monkeypatch):
    monkeypatch.setattr(sections, "key_instants", lambda _: [KeyInstant(17, "right", 9.0)])
    motion = material.motion
    errors = np.full(motion.confidence.shape, 1.0)
    with_errors = replace(material, motion=replace(motion, expected_error=errors))
    assert "uncertain" not in sections.instants(with_errors, pictures)
    errors[12:25, 6:12] = 0.3 * player_height(motion)[:1]
    written = sections.instants(with_errors, pictures)
    assert "<td>arms uncertain</td>" in written
    assert "s, arms uncertain</small>" in written
    assert "mark these frames" in written


def test_the_way_across_the_picture_grows_upwards_and_the_one_down_it_downwards():
    axes = joint_chart(10, has_truth=False).layout
    assert (axes.yaxis.autorange, axes.yaxis2.autorange) != ("reversed", "reversed")
    assert axes.yaxis2.autorange == "reversed"


def test_the_report_tells_of_a_knee_that_bends_forwards(material, pictures, monkeypatch):
    backward = HyperextendedStretch(3, 9, "left", 41.0, 6)
    monkeypatch.setattr(sections, "hyperextended_stretches", lambda motion: [backward])
    for motion in (material.motion, replace(material.motion, expected_error=None)):
        written = build_page(replace(material, motion=motion), pictures)
        assert f'class="goes" data-frame="6">{backward.text}<' in written


def test_names_of_options_are_not_broken_in_two_and_nothing_else_is_touched():
    assert sentence("give --slowmo <2>, or --shots.use.") == (
        "give <code>--slowmo</code> &lt;2&gt;, or <code>--shots.use</code>."
    )
    assert sentence("frames 3--5, well-known") == "frames 3--5, well-known"
