"""Exported motions in Blender itself, which has its own readers (Debian: apt install blender)."""

import json
import shutil
import subprocess
import sysconfig

import numpy as np
import pytest
from humanoid_names import JOINTS
from small_motion import FPS, make_motion

from keyrecon.body import LSP14
from keyrecon.io.formats.bvh_motion import write_bvh
from keyrecon.io.formats.conventions import stand_on_floor
from keyrecon.io.formats.glb import write_glb

pytestmark = pytest.mark.skipif(shutil.which("blender") is None, reason="Blender is not installed")

READ = """
import builtins, json, sys
source, result, fps, packages = sys.argv[-4:]
sys.path.append(packages)
with_old_modes = builtins.open
builtins.open = lambda f, mode="r", *a, **k: with_old_modes(f, mode.replace("U", ""), *a, **k)
import bpy
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.fps = int(fps)
if source.endswith(".bvh"):
    bpy.ops.import_anim.bvh(filepath=source)
else:
    bpy.ops.import_scene.gltf(filepath=source)
figure = next(o for o in bpy.data.objects if o.type == "ARMATURE")
first, last = map(round, figure.animation_data.action.frame_range)
places = []
for frame in range(first, last + 1):
    scene.frame_set(frame)
    places.append({b.name: list(figure.matrix_world @ b.head) for b in figure.pose.bones})
with open(result, "w") as file:
    json.dump(places, file)
"""
"""Blender 3.4's BVH reader opens files in a mode that Python 3.11 no longer has, and its glTF
reader needs NumPy, which Debian's does not bring."""


@pytest.mark.parametrize(("suffix", "write"), [(".bvh", write_bvh), (".glb", write_glb)])
def test_joints_are_where_the_motion_has_them_with_z_up(tmp_path, suffix, write):
    motion = make_motion(wildness=0.4)
    source, script = (tmp_path / f"a{suffix}").resolve(), tmp_path / "read.py"
    write(source, motion)
    script.write_text(READ)
    subprocess.run(
        [
            *("blender", "--background", "--factory-startup", "--python-exit-code", "1"),
            *("--python", script, "--", source, tmp_path / "places.json", str(int(FPS))),
            sysconfig.get_path("purelib"),
        ],
        check=True,
        capture_output=True,
        timeout=120,
    )
    places = json.loads((tmp_path / "places.json").read_text())
    x, y, z = np.moveaxis(stand_on_floor(motion).points, 2, 0)
    truth = np.stack([x, -z, y], axis=2)
    assert len(places) == len(truth)
    for bone, joint in JOINTS.items():
        there = np.array([frame[bone] for frame in places])
        error = np.linalg.norm(there - truth[:, LSP14.index(joint)], axis=1)
        assert error.max() < 0.001, bone
