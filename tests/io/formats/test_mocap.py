from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from bvh_files import LIMBS, bvh_text

from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.acclaim import read_acclaim
from keyrecon.io.formats.bvh import read_bvh
from keyrecon.io.formats.c3d import fill_gaps
from keyrecon.io.formats.mocap import read_capture, read_mocap
from keyrecon.io.formats.rigs import PERSON, UNITS, metres_per_unit, stature

MOCAP = Path(__file__).parents[4] / "shared" / "data" / "mocap"


@pytest.mark.parametrize("order", ["ZXY", "ZYX", "XYZ", "YZX"])
def test_bvh_joints_are_where_a_walk_over_the_tree_puts_them(tmp_path, order):
    text, places = bvh_text(order=order)
    (tmp_path / "a.bvh").write_text(text)
    figure = read_bvh(tmp_path / "a.bvh")
    assert figure.fps == 120
    assert set(figure.names) == set(places)
    for j, name in enumerate(figure.names):
        assert np.allclose(figure.positions[:, j], places[name], atol=1e-5), name


def test_position_channels_take_the_place_of_the_offset(tmp_path):
    text = """HIERARCHY ROOT A { OFFSET 7 7 7 CHANNELS 3 Xposition Yposition Zposition
      JOINT B { OFFSET 1 2 3 CHANNELS 1 Yposition End Site { OFFSET 0 0 1 } } }
      MOTION Frames: 1 Frame Time: 0.01 10 20 30 5"""
    (tmp_path / "a.bvh").write_text(text)
    positions = read_bvh(tmp_path / "a.bvh").positions[0]
    assert positions.tolist() == [[10, 20, 30], [11, 25, 33], [11, 25, 34]]


@pytest.mark.parametrize("unit", ["metres", "inches", "centimetres", "millimetres", "CMU units"])
def test_the_unit_is_the_one_in_which_the_figure_is_a_person(tmp_path, unit):
    text, places = bvh_text(scale=0.01 / UNITS[unit])
    (tmp_path / "a.bvh").write_text(text)
    capture = read_capture(tmp_path / "a.bvh")
    assert stature(capture.joints) == pytest.approx(1.75, abs=0.1)
    ankle = places["LeftFoot"] * UNITS[unit]
    assert np.allclose(capture.joints[:, LSP14.index("left_ankle")], ankle, atol=1e-4)


def test_no_figure_is_a_person_in_two_units():
    factors = sorted(UNITS.values())
    for small, large in pairwise(factors):
        assert small * PERSON[1] / PERSON[0] < large


def test_a_figure_of_no_persons_size_is_refused(tmp_path):
    (tmp_path / "a.bvh").write_text(bvh_text(scale=0.03)[0])
    with pytest.raises(KeyreconError, match=r"a\.bvh: The figure is .* which is no person"):
        read_capture(tmp_path / "a.bvh")


def test_a_figure_with_z_up_is_turned(tmp_path):
    rows = tuple((n, p, (x, -z, y)) for n, p, (x, y, z) in LIMBS)
    text, places = bvh_text(rows=rows)
    (tmp_path / "a.bvh").write_text(text)
    joints = read_capture(tmp_path / "a.bvh").joints
    x, y, z = places["LeftHand"].T / 100
    assert np.allclose(joints[:, LSP14.index("left_wrist")], np.stack([x, z, -y], 1), atol=1e-4)


def test_a_lying_figure_is_refused(tmp_path):
    rows = tuple((n, p, (y, x, z)) for n, p, (x, y, z) in LIMBS)
    (tmp_path / "a.bvh").write_text(bvh_text(rows=rows)[0])
    with pytest.raises(KeyreconError, match="head lies along X"):
        read_capture(tmp_path / "a.bvh")


def test_a_mirrored_figure_is_refused(tmp_path):
    rows = tuple((n, p, (-x, y, z)) for n, p, (x, y, z) in LIMBS)
    (tmp_path / "a.bvh").write_text(bvh_text(rows=rows)[0])
    with pytest.raises(KeyreconError, match="mirrored"):
        read_capture(tmp_path / "a.bvh")


def test_toes_are_right_then_left(tmp_path):
    text, places = bvh_text()
    (tmp_path / "a.bvh").write_text(text)
    toes = read_capture(tmp_path / "a.bvh").toes
    assert np.allclose(toes[:, 0], places["RightFoot end"] / 100, atol=1e-4)
    assert np.allclose(toes[:, 1], places["LeftFoot end"] / 100, atol=1e-4)


def test_trimming_drops_frames_at_both_ends(tmp_path):
    (tmp_path / "a.bvh").write_text(bvh_text()[0])
    whole = read_capture(tmp_path / "a.bvh")
    part = read_capture(tmp_path / "a.bvh", trim=3)
    assert np.array_equal(part.joints, whole.joints[3:-3])
    assert len(part.toes) == len(part.joints)
    with pytest.raises(KeyreconError, match="too few to drop 6"):
        read_capture(tmp_path / "a.bvh", trim=6)


BROKEN = {
    "begin with HIERARCHY": lambda t: t.replace("HIERARCHY", "", 1),
    "not understood": lambda t: t.replace("OFFSET", "OFSET", 1),
    "channel 'Wrotation'": lambda t: t.replace("Zrotation", "Wrotation", 1),
    "are expected": lambda t: t.rsplit("\n", 1)[0],
    "not a whole BVH": lambda t: t[: t.index("MOTION")],
    "is not closed": lambda t: t.replace("}\nMOTION", "\nMOTION"),
    "not finite": lambda t: t.rsplit(" ", 1)[0] + " nan",
    "Frame Time": lambda t: t.replace("Frame Time", "Frametime"),
}


@pytest.mark.parametrize("message", BROKEN)
def test_broken_bvh_is_refused(tmp_path, message):
    (tmp_path / "a.bvh").write_text(BROKEN[message](bvh_text()[0]))
    with pytest.raises(KeyreconError, match=message):
        read_capture(tmp_path / "a.bvh")


def test_a_rig_with_unknown_names_is_refused(tmp_path):
    (tmp_path / "a.bvh").write_text(bvh_text()[0].replace("ForeArm", "Tentacle"))
    with pytest.raises(KeyreconError, match="No known rig has joints called Hips, Neck"):
        read_capture(tmp_path / "a.bvh")


def test_names_with_a_figure_before_them_are_understood(tmp_path):
    text = bvh_text()[0]
    (tmp_path / "a.bvh").write_text(text)
    (tmp_path / "b.bvh").write_text(text.replace("JOINT ", "JOINT mixamorig:"))
    assert np.array_equal(
        read_capture(tmp_path / "a.bvh").joints, read_capture(tmp_path / "b.bvh").joints
    )


def test_files_of_other_kinds_are_refused(tmp_path):
    with pytest.raises(KeyreconError, match="does not exist"):
        read_capture(tmp_path / "a.bvh")
    (tmp_path / "a.fbx").write_text("")
    with pytest.raises(KeyreconError, match=r"'\.fbx' is not motion capture"):
        read_capture(tmp_path / "a.fbx")
    with pytest.raises(KeyreconError, match="no motion among"):
        read_mocap([tmp_path / "a.asf"])


ASF = """:version 1.10
:units
  length 0.45
  angle deg
:root
  order TX TY TZ RX RY RZ
  axis XYZ
  position 0 0 0
  orientation 0 0 0
:bonedata
  begin
    id 1
    name thigh
    direction 0 -1 0
    length 2
    axis 0 0 0 XYZ
    dof rx ry rz
  end
  begin
    id 2
    name shank
    direction 0 -1 0
    length 3
    axis 0 0 90 XYZ
    dof rx
  end
:hierarchy
  begin
    root thigh
    thigh shank
  end
"""


def test_acclaim_bones_turn_about_their_own_axes(tmp_path):
    (tmp_path / "7.asf").write_text(ASF)
    (tmp_path / "7_01.amc").write_text(
        ":FULLY-SPECIFIED\n:DEGREES\n1\nroot 1 2 3 0 0 0\nthigh 90 0 0\nshank 90\n"
        "2\nroot 0 0 0 0 90 0\nthigh 90 0 0\nshank 0\n"
    )
    figure = read_acclaim(tmp_path / "7_01.amc")
    assert figure.names == ("root", "thigh", "shank")
    # Frame 1: -Y turned by 90 degrees about X is -Z. The shank's own X axis is the thigh's Y
    # (its axis is turned by 90 degrees about Z), about which -Y does not move.
    assert np.allclose(figure.positions[0], [[1, 2, 3], [1, 2, 1], [1, 2, -2]])
    # Frame 2: the root turns -Z to -X.
    assert np.allclose(figure.positions[1], [[0, 0, 0], [-2, 0, 0], [-5, 0, 0]])


@pytest.mark.parametrize(
    ("note", "fps"), [("# fps 60\n", 60), (":FRAMERATE = 50\n", 50), ("", 120)]
)
def test_the_rate_of_an_acclaim_file_is_read_or_its_assumption_told(tmp_path, caplog, note, fps):
    (tmp_path / "7.asf").write_text(ASF)
    amc = tmp_path / "7_01.amc"
    amc.write_text(f"{note}:DEGREES\n1\nroot 1 2 3 0 0 0\nthigh 90 0 0\nshank 90\n")
    assert read_acclaim(amc).fps == fps
    assert ("7_01.amc does not say its rate" in caplog.text) == (not note)


def test_acclaim_faults_are_named(tmp_path):
    amc = tmp_path / "7_01.amc"
    amc.write_text("1\nroot 0 0 0 0 0 0\n")
    with pytest.raises(KeyreconError, match=r"put 7\.asf into the same folder"):
        read_acclaim(amc)
    (tmp_path / "7.asf").write_text(ASF.replace(":hierarchy", ":tree"))
    with pytest.raises(KeyreconError, match="no section :hierarchy"):
        read_acclaim(amc)
    (tmp_path / "7.asf").write_text(ASF)
    amc.write_text("1\nroot 0 0 0 0 0 0\nthigh 1 2 3\n2\nroot 0 0 0 0 0 0\n")
    with pytest.raises(KeyreconError, match="thigh has values in 1 of 2 frames"):
        read_acclaim(amc)


def test_gaps_in_markers_are_filled_along_the_path():
    path = np.stack([np.linspace(0, 1, 20), np.zeros(20), np.ones(20)], axis=1)
    gappy = path.copy()
    gappy[[0, 5, 6, 7, 19]] = np.nan
    filled = fill_gaps(gappy)
    assert np.allclose(filled[1:-1], path[1:-1])
    assert np.allclose(filled[[0, -1]], path[[1, -2]])


def test_a_file_that_is_no_c3d_is_refused(tmp_path):
    pytest.importorskip("c3d")
    (tmp_path / "a.c3d").write_bytes(b"hello" * 200)
    with pytest.raises(KeyreconError, match="is not a whole C3D file"):
        read_capture(tmp_path / "a.c3d")


def captures():
    if not MOCAP.is_dir():
        return []
    files = sorted(p for p in MOCAP.rglob("*") if p.suffix in (".bvh", ".amc", ".c3d"))
    return [p for p in files if p.name != CUT_SHORT]


CUT_SHORT = "jsguevara_Derecha_17seg.bvh"
"""This one's header and frames disagree by one; it is refused in a line."""


@pytest.mark.skipif(not captures(), reason="no motion capture in ../shared/data/mocap")
@pytest.mark.parametrize("path", captures()[:1] + captures()[-8:], ids=lambda p: p.name)
def test_real_captures_are_upright_people_of_constant_limbs(path):
    capture = read_capture(path, trim=10)
    assert 1.5 < stature(capture.joints) < 2.0
    assert metres_per_unit(capture.joints) == 1
    for name in ("knee", "ankle", "elbow", "wrist"):
        for side in ("right", "left"):
            child = LSP14.index(f"{side}_{name}")
            bone = capture.joints[:, child] - capture.joints[:, LSP14.parents[child]]
            length = np.linalg.norm(bone, axis=1)
            assert length.std() < (0.06 if path.suffix == ".c3d" else 1e-6) * length.mean()
    head, ankles = capture.joints[:, 13, 1], capture.joints[:, [0, 5], 1].min(axis=1)
    assert np.median(head - ankles) > 1.2
    assert capture.toes is not None
