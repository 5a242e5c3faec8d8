"""Tables of a motion with gaps, and of one that a camera has put into the world."""

import csv
from dataclasses import replace

import numpy as np
import pytest
from small_motion import make_motion

from keyrecon.io.formats.export import export_motion

FRAMES, GAP = 60, slice(20, 25)
LOST = slice(40, 43)
"""Frames in which there is a motion, and the camera was not found."""


@pytest.fixture(scope="module")
def motion():
    """Nobody is there in `GAP`."""
    whole = make_motion(FRAMES)
    points, pixels, confidence = whole.points3d.copy(), whole.points2d.copy(), whole.confidence
    confidence = np.where(np.isin(np.arange(FRAMES), np.r_[GAP])[:, None], 0.0, confidence)
    confidence[41, 5] = 0.0  # filled in where the camera was lost
    points[GAP], pixels[GAP] = np.nan, np.nan
    return replace(whole, points3d=points, points2d=pixels, confidence=confidence)


@pytest.fixture(scope="module")
def world(motion):
    """What motion.npz holds of the world: x right, y away from the camera, z up."""
    x, y, z = motion.points3d.transpose(2, 0, 1)
    points = np.stack([x + 3, z - 20, 1.2 - y], axis=2)
    points[LOST] = np.nan
    return {"points3d_world": points, "origin": np.array("court")}


@pytest.mark.parametrize("in_world", [False, True])
def test_joints_have_a_source_in_the_table_where_there_is_a_motion(
    tmp_path, motion, world, in_world
):
    export_motion(tmp_path / "a.csv", motion, further=world if in_world else None)
    lines = [row for row in (tmp_path / "a.csv").read_text().splitlines() if row[0] != "#"]
    rows = list(csv.DictReader(lines))
    assert ("neck_world_x" in rows[0]) == in_world
    first = (tmp_path / "a.csv").read_text().splitlines()[0]
    assert "relative to the camera" in first
    assert ("in the world (world_x, world_y, world_z)" in first) == in_world
    for name in motion.skeleton.names:
        told = np.array([row[f"{name}_source"] != "" for row in rows])
        np.testing.assert_array_equal(told, motion.known)


def test_netcdf_holds_the_joints_in_the_world_beside_those_of_the_camera(tmp_path, motion, world):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    told = export_motion(tmp_path / "a.nc", motion, further=world)
    assert "and the world's besides" in told
    with xarray.open_dataset(tmp_path / "a.nc", engine="h5netcdf") as data:
        placed = data["position_world"]
        assert placed.dims == data["position"].dims == ("time", "space", "keypoint", "individual")
        neck = placed.sel(keypoint="neck", individual="athlete")
        index = motion.skeleton.index("neck")
        np.testing.assert_array_equal(neck, world["points3d_world"][:, index])
        np.testing.assert_array_equal(data["position"][..., 0], motion.points3d.transpose(0, 2, 1))
        assert placed.attrs["units"] == "m"
        assert placed.attrs["axes"].startswith("origin on the ground at the middle of the net")


def test_netcdf_of_a_motion_without_a_world_has_none(tmp_path, motion):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    assert "world" not in export_motion(tmp_path / "a.nc", motion)
    with xarray.open_dataset(tmp_path / "a.nc", engine="h5netcdf") as data:
        assert "position_world" not in data
