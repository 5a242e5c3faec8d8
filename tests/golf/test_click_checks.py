"""Clicks of real golfers, marked by eye, hold; the same with sides exchanged are told."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from golf_truth import camera_before

from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.golf.candidates import least_cost
from keyrecon.golf.click_checks import CLICKED, HandCosts, check_hand, check_pose
from keyrecon.golf.clicks import GolfClicks, clicked_pose
from keyrecon.golf.fit.handedness import mirror_evidence, mirror_initial
from keyrecon.golf.fit.initial_pose import Placement
from keyrecon.golf.fit.swing_search import SwingEvidence, draw_swing, silhouette
from keyrecon.golf.observe.shaft_hypotheses import ShaftHypotheses
from keyrecon.golf.prior.skeleton import size_body
from keyrecon.golf.records import Camera, InitialJoints
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


CAMERA, SIZE, FOCAL = Camera(500.0, np.array([159.5, 119.5])), (320, 240), 500.0
KEYS = np.array([10.0, 33.0, 41.0, 52.0])


def seen_swing(azimuth, left_handed=False):
    """Masks, clubs and clicks of the mean swing, by somebody who knows everything."""
    rotation, position = camera_before(azimuth)
    phase = np.interp(np.arange(FRAMES), KEYS, MODEL.keys)
    body, place = size_body(1.8), Placement(rotation, position)
    drawn = draw_swing(MODEL, body, np.zeros(2), phase, place, CAMERA)
    masks = np.array([
        silhouette(ends, radii, np.ones(2), SIZE) > 0
        for ends, radii in zip(drawn.capsules, drawn.radii, strict=True)
    ])  # fmt: skip
    shafts = tuple(ShaftHypotheses(c[None], np.array([0.4]), np.array([True])) for c in drawn.club)
    first = drawn.joints[0]
    hips = first[[LSP14.index("right_hip"), LSP14.index("left_hip")]].mean(axis=0)
    places = [hips if n == "root" else first[LSP14.index(n)] for n in CLICKED]
    height = float(np.ptp(first[:, 1]))
    evidence = SwingEvidence(masks, 1.0, height, shafts, 30.0)
    joints = InitialJoints(0, CLICKED, np.array(places))
    if left_handed:
        evidence, joints = mirror_evidence(evidence, SIZE[0]), mirror_initial(joints, SIZE[0])
    return evidence, joints


def weigh(evidence, joints, left_handed):
    """The clicks of a player of some hand, and what this hand and the other cost."""
    places = {n: tuple(p) for n, p in zip(joints.names, joints.places, strict=True)}
    pose, other = (
        clicked_pose(GolfClicks(0, SIZE, places, left_handed=hand, stature=1.8, focal=FOCAL))
        for hand in (left_handed, not left_handed)
    )
    return pose, HandCosts(*(least_cost(evidence, p, MODEL) for p in (pose, other)))


@pytest.mark.parametrize("azimuth", [180, 130, 90])
@pytest.mark.parametrize("left_handed", [False, True])
def test_a_forgotten_hand_is_told(azimuth, left_handed):
    pose, costs = weigh(*seen_swing(azimuth, left_handed), left_handed)
    check_hand(costs, pose, "clicks.json")
    forgotten = replace(pose, left_handed=not left_handed)
    with pytest.raises(KeyreconError, match="the swing goes round the other way"):
        check_hand(HandCosts(costs.other, costs.given), forgotten, "clicks.json")


def test_exchanged_sides_from_the_front_are_told_by_the_swing():
    evidence, joints = seen_swing(180)
    other = tuple(
        name.replace("right", "?").replace("left", "right").replace("?", "left") for name in CLICKED
    )
    pose, costs = weigh(evidence, replace(joints, names=other), False)
    with pytest.raises(KeyreconError, match="or left and right of the clicks are exchanged"):
        check_hand(costs, pose, "clicks.json")


def test_a_film_that_shows_nothing_tells_nothing():
    evidence, joints = seen_swing(180)
    nothing = ShaftHypotheses(np.zeros((0, 2, 2)), np.zeros(0), np.zeros(0, bool))
    players = np.zeros_like(evidence.players)
    blind = replace(evidence, players=players, shafts=(nothing,) * FRAMES)
    pose, costs = weigh(blind, joints, True)
    check_hand(costs, pose, "clicks.json")


def test_a_film_too_short_for_a_swing_tells_nothing():
    evidence, joints = seen_swing(180)
    short = replace(evidence, players=evidence.players[:4], shafts=evidence.shafts[:4])
    pose, costs = weigh(short, joints, True)
    check_hand(costs, pose, "clicks.json")
