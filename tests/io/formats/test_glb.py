"""GLB: an armature with a skin, whose joints are where the motion has them."""

import json
import os
import struct
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from humanoid_names import JOINTS
from scipy.spatial.transform import Rotation
from small_motion import make_motion

from keyrecon.body import LSP14, Skeleton
from keyrecon.io.formats.conventions import stand_on_floor
from keyrecon.io.formats.glb import write_glb

WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class Scene:
    """What a file holds, read as the specification says."""

    def __init__(self, path):
        data = path.read_bytes()
        magic, version, total = struct.unpack_from("<4sII", data)
        assert (magic, version, total) == (b"glTF", 2, len(data))
        length, kind = struct.unpack_from("<I4s", data, 12)
        assert kind == b"JSON"
        self.document = json.loads(data[20 : 20 + length])
        size, kind = struct.unpack_from("<I4s", data, 20 + length)
        assert kind == b"BIN\0"
        self.binary = data[28 + length : 28 + length + size]
        assert self.document["buffers"][0]["byteLength"] == len(self.binary)
        self.nodes = self.document["nodes"]
        self.skin = self.document["skins"][0]
        self.joints = self.skin["joints"]

    def array(self, number):
        entry = self.document["accessors"][number]
        view = self.document["bufferViews"][entry["bufferView"]]
        kind = {5126: "<f4", 5123: "<u2"}[entry["componentType"]]
        assert view["byteOffset"] % 4 == 0
        raw = self.binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
        found = np.frombuffer(raw, kind).reshape(entry["count"], WIDTHS[entry["type"]])
        if "min" in entry:
            assert np.allclose(found.min(axis=0), entry["min"])
            assert np.allclose(found.max(axis=0), entry["max"])
        return found

    def worlds(self, frame=None):
        """Matrix of every node, at rest or in a frame."""
        local = {}
        for number, node in enumerate(self.nodes):
            local[number] = np.eye(4)
            local[number][:3, 3] = node.get("translation", (0, 0, 0))
        if frame is not None:
            animation = self.document["animations"][0]
            for channel in animation["channels"]:
                values = self.array(animation["samplers"][channel["sampler"]]["output"])[frame]
                matrix = local[channel["target"]["node"]]
                if channel["target"]["path"] == "translation":
                    matrix[:3, 3] = values
                else:
                    matrix[:3, :3] = Rotation.from_quat(values).as_matrix()
        found = {}

        def place(number, above):
            found[number] = above @ local[number]
            for child in self.nodes[number].get("children", ()):
                place(child, found[number])

        for root in self.document["scenes"][0]["nodes"]:
            place(root, np.eye(4))
        assert len(found) == len(self.nodes), "every node hangs in the scene once"
        return found

    def skinned(self, frame=None):
        """Vertices as a program moves them by the skin."""
        worlds = self.worlds(frame)
        inverse = self.array(self.skin["inverseBindMatrices"]).reshape(-1, 4, 4)
        moves = np.array([worlds[j] @ m.T for j, m in zip(self.joints, inverse, strict=True)])
        moved = []
        for primitive in self.document["meshes"][0]["primitives"]:
            attributes = {n: self.array(a) for n, a in primitive["attributes"].items()}
            assert np.allclose(attributes["WEIGHTS_0"].sum(axis=1), 1)
            assert attributes["JOINTS_0"].max() < len(self.joints)
            at = np.concatenate(
                [attributes["POSITION"], np.ones((len(attributes["NORMAL"]), 1))], 1
            )
            blended = np.einsum(
                "vk,vkij->vij", attributes["WEIGHTS_0"], moves[attributes["JOINTS_0"]]
            )
            moved.append(np.einsum("vij,vj->vi", blended, at)[:, :3])
        return moved


@pytest.fixture(scope="module")
def motion():
    return make_motion(wildness=0.4)


@pytest.fixture(scope="module")
def scene(motion, tmp_path_factory):
    path = tmp_path_factory.mktemp("glb") / "a.glb"
    write_glb(path, motion)
    return Scene(path)


def test_the_skin_holds_a_tree_of_joints_with_humanoid_names(scene):
    names = [scene.nodes[joint]["name"] for joint in scene.joints]
    assert names[0] == "Hips"
    assert {"Spine", "Head", *JOINTS} <= set(names)
    assert len(set(names)) == len(names)
    body = next(node for node in scene.nodes if "mesh" in node)
    assert body["skin"] == 0
    assert "children" not in body


@pytest.mark.parametrize("frame", [0, 17, 59])
def test_joints_are_where_the_motion_has_them(scene, motion, frame):
    worlds, points = scene.worlds(frame), stand_on_floor(motion).points[frame]
    for number, node in enumerate(scene.nodes):
        if joint := JOINTS.get(node["name"]):
            error = worlds[number][:3, 3] - points[LSP14.index(joint)]
            assert np.linalg.norm(error) < 0.001, node["name"]


def test_the_skin_leaves_the_rest_pose_alone_and_it_stands_on_the_floor(scene):
    raw = [
        scene.array(p["attributes"]["POSITION"]) for p in scene.document["meshes"][0]["primitives"]
    ]
    for still, moved in zip(raw, scene.skinned(), strict=True):
        assert np.allclose(still, moved, atol=1e-5)
    assert min(part[:, 1].min() for part in raw) == pytest.approx(0, abs=0.05)


def test_the_body_surrounds_its_joints(scene, motion):
    vertices = np.concatenate(scene.skinned(30))
    points = stand_on_floor(motion).points[30]
    for joint in range(len(LSP14.names)):
        assert np.linalg.norm(vertices - points[joint], axis=1).min() < 0.15


def test_times_are_the_frames_own_and_rotations_do_not_flip(tmp_path):
    time = np.cumsum(np.random.default_rng(3).uniform(0.5, 1.5, 60)) / 50
    write_glb(tmp_path / "a.glb", make_motion(time=time))
    scene = Scene(tmp_path / "a.glb")
    animation = scene.document["animations"][0]
    for channel in animation["channels"]:
        sampler = animation["samplers"][channel["sampler"]]
        assert np.allclose(scene.array(sampler["input"])[:, 0], time - time[0], atol=1e-5)
        values = scene.array(sampler["output"])
        assert len(values) == 60
        if channel["target"]["path"] == "rotation":
            assert np.allclose(np.linalg.norm(values, axis=1), 1, atol=1e-5)
            assert ((values[1:] * values[:-1]).sum(axis=1) > 0).all()


def test_surfaces_face_outwards(scene):
    for primitive in scene.document["meshes"][0]["primitives"]:
        vertices = scene.array(primitive["attributes"]["POSITION"]).astype(float)
        normals = scene.array(primitive["attributes"]["NORMAL"]).astype(float)
        assert np.allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-5)
        faces = scene.array(primitive["indices"]).reshape(-1, 3)
        assert faces.max() < len(vertices)
        a, b, c = vertices[faces].transpose(1, 0, 2)
        facing = (np.cross(b - a, c - a) * normals[faces].mean(axis=1)).sum(axis=1)
        assert facing.min() > -1e-9
        assert facing.max() > 0


def test_a_skeleton_that_is_no_person_has_an_armature_too(tmp_path, motion):
    chain = Skeleton(("a", "b", "c"), (1, -1, 1), (), (1.0, 0.0, 1.0), ())
    names = ("points3d", "points2d", "points2d_propagated", "confidence", "source")
    parts = {name: getattr(motion, name)[:, :3] for name in names}
    other = replace(motion, skeleton=chain, **parts)
    write_glb(tmp_path / "a.glb", other)
    scene = Scene(tmp_path / "a.glb")
    points = stand_on_floor(other).points
    for frame in (0, 40):
        worlds = scene.worlds(frame)
        for number, name in enumerate("bac"):
            assert scene.nodes[number]["name"] == name
            assert np.allclose(worlds[number][:3, 3], points[frame, "abc".index(name)], atol=1e-5)
        ends = np.concatenate(scene.skinned(frame))
        assert all(np.linalg.norm(ends - p, axis=1).min() < 0.03 for p in points[frame])


@pytest.mark.skipif("GLTF_VALIDATOR" not in os.environ, reason="needs npm's gltf-validator")
def test_the_khronos_validator_finds_nothing(tmp_path, motion):
    """GLTF_VALIDATOR is the folder that `npm install gltf-validator` made its node_modules in."""
    write_glb(tmp_path / "a.glb", motion)
    code = (
        "require(process.argv[1]).validateBytes(new Uint8Array(require('fs').readFileSync("
        "process.argv[2]))).then(r => console.log(JSON.stringify(r.issues.messages)))"
    )
    module = f"{os.environ['GLTF_VALIDATOR']}/node_modules/gltf-validator"
    found = subprocess.run(
        ["node", "-e", code, module, tmp_path / "a.glb"], capture_output=True, text=True, check=True
    )
    assert json.loads(found.stdout) == []
