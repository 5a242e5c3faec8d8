"""Whole files of every kind that keyrecon reads, and files damaged as disks, tools and people do.

`SAMPLES` makes a small file of each kind and `READERS` reads it to the last byte. `mutate` damages
it: bytes flipped, cut off, doubled, blanked, or words in their place that no program expects.
Everything follows from one seed, so that a case is found again by its number.
"""

import io
import json
import random
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import av
import numpy as np

from keyrecon.annotate.store.edits import Limits, MarkEdit
from keyrecon.annotate.store.store import Store
from keyrecon.body import LSP14, read_skeleton
from keyrecon.golf.records import SwingMarks
from keyrecon.io.formats.acclaim import read_acclaim
from keyrecon.io.formats.annotations import read_annotations
from keyrecon.io.formats.bvh_motion import write_bvh
from keyrecon.io.formats.c3d import read_points, write_c3d
from keyrecon.io.formats.camera_file import read_camera, write_camera
from keyrecon.io.formats.clicks import read_clicks
from keyrecon.io.formats.coco import coco_text
from keyrecon.io.formats.court_points import read_court_points, write_court_points
from keyrecon.io.formats.cvat import cvat_text
from keyrecon.io.formats.dlc import dlc_text
from keyrecon.io.formats.golf_marks import read_golf_marks, write_golf_marks
from keyrecon.io.formats.ground_marks import read_ground_marks, write_ground_marks
from keyrecon.io.formats.keyframes import keyframes_to_json, read_keyframes
from keyrecon.io.formats.mocap import read_capture
from keyrecon.io.formats.model_file import (
    BUILT_IN_DEPTH_MODEL,
    BUILT_IN_SWING_PRIOR,
    read_depth_model,
    read_motion_model,
)
from keyrecon.io.formats.motion_file import read_motion, write_motion
from keyrecon.io.formats.picks import read_picks, write_picks
from keyrecon.io.formats.shot_choices import ShotChoices, read_shot_choices, write_shot_choices
from keyrecon.io.project_file import new_project
from keyrecon.io.storage import load_record, save_record
from keyrecon.io.video import open_video
from keyrecon.io.video_writer import write_video
from keyrecon.io.workspace import Workspace
from keyrecon.metrics import read_truth
from keyrecon.pipeline import Options
from keyrecon.records import Annotations, HalfKeyframes, Keyframes, Motion, Pick
from keyrecon.synthetic.motion import MotionOptions, play_tennis
from keyrecon.world.records import CourtClick, GroundMark, GroundMarks, WorldCamera

KEPT = Path(__file__).parent.parent / "annotations"
FRAMES, SIZE = 40, (160, 96)
LIMITS = Limits(LSP14, FRAMES, SIZE)
WORDS = (
    b"1e999", b"-1", b"0", b"NaN", b"inf", b"9" * 400, b"null", b'""', b"[" * 3000, b"{}", b"true",
    b"\xff", b"\x00", b"1979-05-27", b"'", b'"', b"<", b"99999999999", b"   ", b"-0.5", b"ZZY",
)  # fmt: skip
"""What stands in the place of a word or number."""
ASF = """:version 1.10
:units
 length 0.45
:root
 order TX TY TZ RX RY RZ
 position 0 0 0
:bonedata
 begin
  id 1
  name thigh
  direction 0 -1 0
  length 7.5
  axis 0 0 20 XYZ
  dof rx ry rz
 end
 begin
  id 2
  name shank
  direction 0 -1 0
  length 7
  axis 0 0 20 XYZ
  dof rx
 end
:hierarchy
 begin
  root thigh
  thigh shank
 end
"""


class Reader(NamedTuple):
    """A kind of file."""

    name: str
    """Of its sample."""
    read: Callable[[Path], Any]


def make_samples(folder: Path) -> None:
    """One whole file of each kind, and what stands beside it."""
    _make_motions(folder, _motion())
    _make_marks(folder, _marks())
    _make_project(folder)


def _make_motions(folder: Path, motion: Motion) -> None:
    write_bvh(folder / "a.bvh", motion)
    write_c3d(folder / "a.c3d", motion)
    (folder / "b.asf").write_text(ASF)
    rows = (f"{f}\nroot 0 15 0 0 {f} 0\nthigh {f} 2 3\nshank 20" for f in range(1, 30))
    (folder / "b.amc").write_text(":DEGREES\n" + "\n".join(rows) + "\n")
    write_motion(folder / "motion.npz", motion)
    save_record(folder / "cache.npz", (motion, (motion, motion)))
    truth = {"points3d": motion.points3d, "points2d": motion.points2d, "fps": np.array(25.0)}
    np.savez(folder / "truth.npz", joint_names=np.array(LSP14.names), **truth)
    shutil.copy(BUILT_IN_DEPTH_MODEL, folder / "depths.npz")
    shutil.copy(BUILT_IN_SWING_PRIOR, folder / "prior.npz")


def _make_marks(folder: Path, marks: Annotations) -> None:
    (folder / "coco.json").write_text(coco_text(marks, SIZE))
    (folder / "dlc.csv").write_text(dlc_text(marks, SIZE))
    (folder / "cvat.xml").write_text(cvat_text(marks, SIZE))
    shutil.copy(KEPT / "golf_faceon.clicks.json", folder / "clicks.json")
    write_picks(folder / "picks.json", [Pick(f, p, 20.5, 30) for f in (0, 9) for p in "ab"])
    (folder / "keyframes.json").write_text(keyframes_to_json(_keyframes()))
    (folder / "skeleton.json").write_text(_skeleton_text())
    joints = np.where(np.isfinite(marks.joints), marks.joints, 20.0)
    swing = replace(SwingMarks.of_joints(marks.frames, joints), keys=np.array([2.0, 9, 12, 30]))
    write_golf_marks(folder / "golf_marks.json", swing, SIZE)
    corners = ("near baseline, left", "far baseline, right")
    clicks = [CourtClick(name, 9, 20.5, 30.25) for name in corners]
    write_court_points(folder / "court_points.json", clicks)
    post = GroundMark("vertical", 3, (212.0, 120.5), (214.0, 655.0), 2.44)
    write_ground_marks(folder / "ground_marks.json", GroundMarks((post,), 62.0))
    write_shot_choices(folder / "shots.json", ShotChoices((1, 3), (2,)))
    write_camera(folder / "camera.npz", _camera())


def _make_project(folder: Path) -> None:
    pictures = np.random.default_rng(0).integers(0, 255, (FRAMES, SIZE[1], SIZE[0], 3), np.uint8)
    write_video(folder / "v.mp4", pictures, 25.0)
    for suffix, codec in (("mkv", "libx264"), ("avi", "mpeg4")):
        _encode(folder / f"v.{suffix}", codec, pictures)
    video = open_video(folder / "v.mp4")
    told = {"path": "v.mp4", "fingerprint": video.fingerprint, "end": FRAMES}
    text = new_project(folder / "project.toml", told)
    (folder / "project.toml").write_text(f"{text}\n[options]\nlift.height = 1.8 # tall\n")
    (folder / "journal").mkdir()
    shutil.copy(folder / "project.toml", folder / "journal" / "project.toml")
    store = Store(Workspace(folder / "journal"), LIMITS)
    for n in range(FRAMES):
        store.submit([MarkEdit(f"e{n}", n, "neck", (10.5, n + 0.25, 2), None)])
    store.close()


def _motion() -> Motion:
    world = play_tennis(MotionOptions(seconds=FRAMES / 25, fps=25.0))
    points = np.stack([world[..., 0], -world[..., 1], 10 - world[..., 2]], axis=-1)
    pixels = 40 * points[..., :2] + [80, 80]
    ones = np.ones(points.shape[:2])
    return Motion(
        skeleton=LSP14,
        points3d=points,
        points2d=pixels,
        points2d_propagated=np.where(ones[..., None] > 0, pixels, np.nan),
        confidence=ones,
        source=np.zeros(ones.shape, np.int64),
        scale=np.full(len(points), 40.0),
        time=np.arange(len(points)) / 25.0,
        keyframes=np.array([0, FRAMES // 2]),
        fps=25.0,
        units="m",
    )


def _marks() -> Annotations:
    frames = np.array([0, 9, 30])
    places = np.random.default_rng(1).uniform(10, 90, (len(frames), 14, 2))
    places[1, 3:6] = np.nan
    nearer = np.ones((len(frames), len(LSP14.bones)), np.int64)
    return Annotations(LSP14, frames, places, np.isfinite(places[..., 0]), nearer, ((9, "neck"),))


def _keyframes() -> Keyframes:
    frames = np.array([0, 9, 30])
    nearest = frames[np.abs(np.arange(FRAMES)[:, None] - frames).argmin(axis=1)]
    half = HalfKeyframes(
        frames, nearest, np.arange(FRAMES) % 7 > 0, 0.9, 0.1, np.linspace(0, 0.2, FRAMES), 3
    )
    return Keyframes(half, half, 10, 0.95)


def _camera() -> WorldCamera:
    ones = np.ones(FRAMES)
    turn = np.tile(np.eye(3), (FRAMES, 1, 1))
    places = np.tile([0.0, 1.5, 20.0], (FRAMES, 1))
    return WorldCamera(900 * turn, turn, places, ones > 0, 0.01 * places, ones, ones)


def _skeleton_text() -> str:
    rows = [
        {"name": n, "parent": None if p < 0 else LSP14.names[p], "length": length}
        for n, p, length in zip(LSP14.names, LSP14.parents, LSP14.proportions, strict=True)
    ]
    return json.dumps({"joints": rows, "lower": [LSP14.names[j] for j in LSP14.lower]})


def _encode(path: Path, codec: str, pictures: np.ndarray) -> None:
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=25)
        stream.width, stream.height, stream.pix_fmt = *SIZE, "yuv420p"
        for picture in pictures:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        container.mux(stream.encode())


def _read_video(path: Path) -> float:
    video = open_video(path)
    return float(sum(picture.mean() for picture in video.frames()) + video.time.sum())


def _read_marks(path: Path) -> Annotations:
    return read_annotations(path, LSP14, FRAMES, SIZE)


def _read_golf_marks(path: Path) -> SwingMarks:
    return read_golf_marks(path, FRAMES, SIZE)


def _read_project(path: Path) -> object:
    return Workspace(path.parent).options(Options(), Options())


def _open_journal(path: Path) -> dict:
    store = Store(Workspace(path.parent), LIMITS)
    cells = dict(store.state.cells)
    store.close()
    if cells != {("mark", n, "neck"): [10.5, n + 0.25, 2] for n in range(FRAMES)}:
        raise AssertionError("the journal opened with other marks than were made")
    return cells


READERS = {
    "bvh": Reader("a.bvh", read_capture),
    "c3d": Reader("a.c3d", read_points),
    "amc": Reader("b.amc", read_acclaim),
    "asf": Reader("b.asf", lambda path: read_acclaim(path.with_name("b.amc"))),
    "coco": Reader("coco.json", _read_marks),
    "dlc": Reader("dlc.csv", _read_marks),
    "cvat": Reader("cvat.xml", _read_marks),
    "motion": Reader("motion.npz", read_motion),
    "cache": Reader("cache.npz", load_record),
    "truth": Reader("truth.npz", read_truth),
    "depths": Reader("depths.npz", read_depth_model),
    "prior": Reader("prior.npz", read_motion_model),
    "clicks": Reader("clicks.json", read_clicks),
    "picks": Reader("picks.json", read_picks),
    "golf marks": Reader("golf_marks.json", _read_golf_marks),
    "court points": Reader("court_points.json", read_court_points),
    "shots": Reader("shots.json", read_shot_choices),
    "ground marks": Reader("ground_marks.json", read_ground_marks),
    "camera": Reader("camera.npz", read_camera),
    "keyframes": Reader("keyframes.json", read_keyframes),
    "skeleton": Reader("skeleton.json", read_skeleton),
    "mp4": Reader("v.mp4", _read_video),
    "mkv": Reader("v.mkv", _read_video),
    "avi": Reader("v.avi", _read_video),
    "project": Reader("project.toml", _read_project),
    "journal": Reader("journal/annotate.sqlite", _open_journal),
}


def mutate(data: bytes, rng: random.Random) -> bytes:
    """A file damaged in one to four places: in its bytes, or in the values that it holds."""
    if rng.random() < 0.5:
        if data.startswith(b"PK"):
            return _mutate_arrays(data, rng)
        if data.lstrip().startswith(b"{"):
            return _mutate_json(data, rng)
    damaged = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        rng.choice(_DAMAGES)(damaged, rng)
    return bytes(damaged)


def _mutate_arrays(data: bytes, rng: random.Random) -> bytes:
    """An npz file, whole as such, with other values, types or shapes in an array, or without it."""
    with np.load(io.BytesIO(data)) as stored:
        arrays = dict(stored)
    name = rng.choice(sorted(arrays))
    array, how = arrays.pop(name), rng.randrange(6)
    if how == 0 and array.size and array.dtype.kind in "fi":
        array = array.copy()
        value = rng.choice([-1, 0, 1e6] + [np.nan, np.inf] * (array.dtype.kind == "f"))
        array.flat[rng.randrange(array.size)] = value
    elif how == 1:
        array = array[..., : array.shape[-1] // 2] if array.ndim else array[None]
    elif how == 2:
        kinds = ["f4", "i8", "c16", "?"] if array.dtype.kind in "fi" else []
        array = array.astype(rng.choice([*kinds, "U9", "S9"]))
    elif how == 3:
        array = np.zeros(rng.choice([(), (0,), (3, 3), (2, 0, 5)]))
    elif how == 4 and array.ndim:
        array = array[:-1]
    if how < 5:
        arrays[name] = array
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def _mutate_json(data: bytes, rng: random.Random) -> bytes:
    """A JSON file with another value, or none, in one place."""
    root: Any = json.loads(data)
    within: Any = root
    while True:
        keys = [*within] if isinstance(within, dict) else [*range(len(within))]
        if not keys:
            return data
        key = rng.choice(keys)
        if not isinstance(within[key], dict | list) or not within[key] or rng.random() < 0.1:
            break
        within = within[key]
    if rng.random() < 0.2:
        del within[key]
        return json.dumps(root).encode()
    within[key] = "HERE"
    return json.dumps(root).encode().replace(b'"HERE"', rng.choice(WORDS))


def _flip(data: bytearray, rng: random.Random) -> None:
    for _ in range(rng.choice((1, 1, 8, 64))):
        if data:
            data[_place(data, rng)] ^= 1 << rng.randrange(8)


def _overwrite(data: bytearray, rng: random.Random) -> None:
    place, size = _place(data, rng), rng.choice((1, 2, 4, 8, 64))
    data[place : place + size] = rng.choice((b"\x00", b"\xff", rng.randbytes(1))) * size


def _cut(data: bytearray, rng: random.Random) -> None:
    del data[_place(data, rng) :]


def _drop(data: bytearray, rng: random.Random) -> None:
    place = _place(data, rng)
    del data[place : place + rng.choice((1, 4, 100))]


def _double(data: bytearray, rng: random.Random) -> None:
    place, size = _place(data, rng), rng.choice((1, 10, 1000))
    data[place:place] = data[place : place + size]


def _replace_word(data: bytearray, rng: random.Random) -> None:
    """Another word where one stands, from one separator to the next."""
    if not data:
        return
    start = end = _place(data, rng)
    while start > 0 and data[start - 1] not in b' \n\t,:[]{}="<>':
        start -= 1
    while end < len(data) and data[end] not in b' \n\t,:[]{}="<>':
        end += 1
    data[start:end] = rng.choice(WORDS)


_DAMAGES = (_flip, _overwrite, _cut, _drop, _double, _replace_word, _replace_word)


def _place(data: bytearray, rng: random.Random) -> int:
    """Anywhere; half of the time near the beginning or end, where headers are."""
    if not data:
        return 0
    near = min(len(data), 600)
    where = rng.random()
    if where < 0.3:
        return rng.randrange(near)
    return len(data) - 1 - rng.randrange(near) if where < 0.5 else rng.randrange(len(data))
