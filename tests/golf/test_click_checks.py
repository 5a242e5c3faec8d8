"""Clicks of real golfers, marked by eye, hold; the same with sides exchanged are told."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from golf_truth import camera_before, even_times, observe

from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.golf.click_checks import CLICKED, check_direction, check_pose
from keyrecon.golf.clicks import GolfClicks, clicked_pose
from keyrecon.golf.fit.handedness import mirror_observations
from keyrecon.golf.fit.residuals import project
from keyrecon.golf.prior.kinematics import find_club, find_joints, place_body
from keyrecon.golf.prior.motion_model import posture_at
from keyrecon.golf.prior.skeleton import size_body
from keyrecon.golf.records import Camera, InitialJoints, SwingState
from keyrecon.io.formats.model_file import read_motion_model

REAL = Path(__file__).parents[2] / "annotations" / "real"
MODEL = read_motion_model()
FRAMES = 60


def marked(name):
    """Clicks in the first marked frame of a real swing."""
    data = json.loads((REAL / f"{name}.json").read_text())
    names = data["categories"][0]["keypoints"]
    image = min(data["images"], key=lambda i: i["frame"])
    (marks,) = [a["keypoints"] for a in data["annotations"] if a["image_id"] == image["id"]]
    places = dict(zip(names, np.array(marks, float).reshape(-1, 3)[:, :2], strict=True))
    places["root"] = (places["right_hip"] + places["left_hip"]) / 2
    joints = {name: tuple(places[name].tolist()) for name in CLICKED}
    return GolfClicks(image["frame"], (image["width"], image["height"]), joints)


def exchanged(clicks, *parts):
    """The same clicks with left and right of some parts exchanged."""
    joints = dict(clicks.joints)
    for part in parts:
        joints[f"right_{part}"], joints[f"left_{part}"] = (
            joints[f"left_{part}"], joints[f"right_{part}"],
        )  # fmt: skip
    return replace(clicks, joints=joints)


def check(clicks):
    check_pose(clicked_pose(clicks), MODEL, "clicks.json")


@pytest.mark.parametrize("name", ["golf_faceon", "golf_dtl_slow", "golf_dtl_links"])
def test_marks_by_eye_are_those_of_a_golfer(name):
    check(marked(name))


@pytest.mark.parametrize("parts", [("knee",), ("ankle",)])
def test_knees_that_do_not_go_with_their_ankles_are_told(parts):
    with pytest.raises(KeyreconError, match=r"left and right of the (knees|ankles) seem to be"):
        check(exchanged(marked("golf_faceon"), *parts))


def test_from_the_side_the_nearer_foot_tells_that_sides_are_exchanged():
    with pytest.raises(KeyreconError, match=r"left and right of (knees and|the) ankles seem to be"):
        check(exchanged(marked("golf_dtl_slow"), "knee", "ankle"))


def test_the_mirror_image_of_a_golfer_is_one_of_the_other_hand():
    clicks = marked("golf_dtl_slow")
    width = clicks.size[0]
    mirrored = {
        name.replace("right", "?").replace("left", "right").replace("?", "left"): (width - 1 - x, y)
        for name, (x, y) in clicks.joints.items()
    }
    check(replace(clicks, joints=mirrored, left_handed=True))


def test_a_click_off_the_body_is_told():
    clicks = marked("golf_faceon")
    x, y = clicks.joints["left_knee"]
    off = {**clicks.joints, "left_knee": (x + 0.3 * clicked_pose(clicks).height, y)}
    with pytest.raises(KeyreconError, match=r"no golfer stands as clicked: left_knee is \d\d%"):
        check(replace(clicks, joints=off))


CAMERA = Camera(900.0, np.array([319.5, 239.5]))


def seen_swing(azimuth, left_handed=False):
    """What is observed of the mean swing, by somebody who knows everything."""
    rotation, position = camera_before(azimuth)
    phase = even_times(FRAMES)
    state = SwingState(
        np.zeros(0), phase, np.tile(rotation, (FRAMES, 1, 1)), np.tile(position, (FRAMES, 1))
    )
    body = size_body(1.8)
    pose = place_body(body, posture_at(MODEL, phase, state.coefficients), state)
    joints = find_joints(body, pose)
    first = project(joints[0], CAMERA)[0]
    hips = first[[LSP14.index("right_hip"), LSP14.index("left_hip")]].mean(axis=0)
    places = [hips if n == "root" else first[LSP14.index(n)] for n in CLICKED]
    seen = replace(
        observe(joints, find_club(body, pose), CAMERA, 2.0), phase=phase,
        keys=np.interp(MODEL.keys, phase[9:-9], np.arange(FRAMES)[9:-9]),
        initial=InitialJoints(0, CLICKED, np.array(places)),
    )  # fmt: skip
    return replace(mirror_observations(seen, 640), left_handed=True) if left_handed else seen


def check_seen(seen):
    joints = {n: tuple(p) for n, p in zip(seen.initial.names, seen.initial.places, strict=True)}
    pose = clicked_pose(GolfClicks(0, (640, 480), joints, left_handed=seen.left_handed))
    check_direction(seen, pose, MODEL, "clicks.json")


@pytest.mark.parametrize("azimuth", [180, 200, 130, 90])
@pytest.mark.parametrize("left_handed", [False, True])
def test_a_swing_as_told_goes_the_way_it_should(azimuth, left_handed):
    check_seen(seen_swing(azimuth, left_handed))


@pytest.mark.parametrize("azimuth", [180, 200, 130])
@pytest.mark.parametrize("left_handed", [False, True])
def test_a_forgotten_hand_is_told(azimuth, left_handed):
    seen = seen_swing(azimuth, left_handed)
    with pytest.raises(KeyreconError, match="the club goes round the other way"):
        check_seen(replace(seen, left_handed=not left_handed))


def test_exchanged_sides_from_the_front_are_told_by_the_club():
    seen = seen_swing(180)
    other = tuple(
        name.replace("right", "?").replace("left", "right").replace("?", "left") for name in CLICKED
    )
    with pytest.raises(KeyreconError, match="or left and right of the clicks are exchanged"):
        check_seen(replace(seen, initial=replace(seen.initial, names=other)))


def test_a_club_that_was_not_seen_tells_nothing():
    seen = replace(seen_swing(180), left_handed=True)
    check_seen(replace(seen, club=np.full_like(seen.club, np.nan)))
