"""A walking figure with everything that a report is made from, and a small video of it."""

from dataclasses import replace

import numpy as np
from court_walker import court_camera
from painted_court import camera_at

from keyrecon.body import LSP14
from keyrecon.io.video import open_video
from keyrecon.io.video_writer import write_video
from keyrecon.records import Annotations, HalfKeyframes, Keyframes, Motion, PoseDistances, Track
from keyrecon.report.drawing import draw_pose
from keyrecon.report.markup import ReportMaterial
from keyrecon.report.page import cut_report_pictures, write_page
from keyrecon.world.records import GROUND, WorldMotion

SCALE, FPS = 90.0, 25.0


def walking_pose(phase):
    """Joints in metres in the axes of a camera that sees the walker half from the side."""
    swing = 0.5 * np.sin(phase)
    points = {"neck": (0, -1.45, 0), "head_top": (0, -1.75, 0)}
    for side, across, turn in (("left", 0.16, swing), ("right", -0.16, -swing)):
        hip = np.array([0.6 * across, -0.93, 0])
        bend = 0.5 + 0.5 * np.sin(phase + (0 if side == "left" else np.pi) + 1)
        knee = hip + 0.43 * np.array([0, np.cos(turn), -np.sin(turn)])
        ankle = knee + 0.43 * np.array([0, np.cos(turn - bend), -np.sin(turn - bend)])
        shoulder = np.array([across, -1.42, 0])
        elbow = shoulder + 0.32 * np.array([0, np.cos(turn), np.sin(turn)])
        wrist = elbow + 0.26 * np.array([0, np.cos(turn + 0.6), -np.sin(-turn - 0.6)])
        joints = ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")
        parts = (hip, knee, ankle, shoulder, elbow, wrist)
        points |= {f"{side}_{name}": part for name, part in zip(joints, parts, strict=True)}
    pose = np.array([points[name] for name in LSP14.names], dtype=float)
    cos, sin = np.cos(0.7), np.sin(0.7)
    return pose @ np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]]).T


def walk(count):
    """(points3d, points2d) of `count` frames; the walker crosses the picture."""
    points3d = np.stack([walking_pose(0.25 * t) for t in range(count)])
    where = np.stack([80 + 0.8 * np.arange(count) % 160, np.full(count, 200.0)], axis=1)
    return points3d, SCALE * points3d[..., :2] + where[:, None]


def half(frames, distances, beta=0.04):
    near = distances[:, frames]
    best = near.argmin(axis=1)
    distance = near[np.arange(len(near)), best]
    well = distance < beta
    return HalfKeyframes(
        frames=frames,
        nearest=frames[best],
        distance=distance,
        represented=well,
        coverage=float(well.mean()),
        beta=beta,
        printed_count=len(frames),
    )


def compare(points2d):
    flat = (points2d - points2d[:, 12:13]).reshape(len(points2d), -1) / SCALE
    distances = np.linalg.norm(flat[:, None] - flat[None], axis=2).astype(np.float32) / 10
    everything = np.arange(len(flat))
    exemplar_distance = np.zeros((2, len(flat)))
    step = np.stack([distances[everything[:-1], everything[1:]]] * 2).astype(float)
    all_seen = np.ones((2, len(flat)))
    return PoseDistances(
        distances, distances, everything, everything, exemplar_distance, step, all_seen[0], all_seen
    )


def make_motion(points3d, points2d, keyframes, rng, units="m"):
    found = points2d + rng.normal(0, 2, points2d.shape)
    found[rng.random(found.shape[:2]) < 0.05] = np.nan
    source = np.where(np.isfinite(found[..., 0]), 1, 2)
    source[keyframes] = 0
    return Motion(
        skeleton=LSP14,
        points3d=points3d + rng.normal(0, 0.01, points3d.shape),
        points2d=points2d + rng.normal(0, 0.5, points2d.shape),
        points2d_propagated=found,
        confidence=rng.uniform(0.3, 1, found.shape[:2]),
        source=source,
        scale=np.full(len(points3d), SCALE),
        fps=FPS,
        time=np.arange(len(points3d)) / FPS,
        units=units,
        keyframes=keyframes,
    )


def write_walk_video(path, points2d, size=(240, 320)):
    background = np.zeros((*size, 3), np.uint8) + np.array([176, 108, 74], np.uint8)
    background[::16] = 150
    write_video(path, (draw_pose(background, pose, LSP14) for pose in points2d), FPS)
    return open_video(path)


def make_material(folder, count=40, with_truth=True, video=None, name="walk.mp4"):
    """Everything for a report on `count` frames of walking."""
    rng = np.random.default_rng(1)
    points3d, points2d = walk(count)
    video = video or write_walk_video(folder / name, points2d)
    head, feet = points2d[:, 13], points2d[:, [0, 5]]
    box = np.concatenate([points2d.min(axis=1) - 20, points2d.max(axis=1) + 20], axis=1)
    track = Track(head, feet, np.full(count, 1.7 * SCALE), box, np.ones(count))
    comparison = compare(points2d)
    upper = half(np.linspace(3, count - 5, 5).round().astype(int), comparison.upper)
    lower = half(np.linspace(6, count - 9, 4).round().astype(int), comparison.lower)
    keyframes = Keyframes(upper, lower, 10, 0.95)
    frames = keyframes.frames
    asked = np.where(
        LSP14.is_lower,
        np.isin(frames, lower.frames)[:, None],
        np.isin(frames, upper.frames)[:, None],
    )
    marks = np.where(asked[..., None], points2d[frames], np.nan)
    visible = asked & (np.arange(14) % 5 > 0)
    nearer = np.zeros((len(frames), 13), dtype=int)
    truth = {
        "points3d": points3d,
        "points2d": points2d,
        "fps": np.array(FPS),
        "joint_names": np.array(LSP14.names),
    }
    return ReportMaterial(
        video,
        track,
        comparison,
        keyframes,
        Annotations(LSP14, frames, marks, visible, nearer),
        make_motion(points3d, points2d, frames, rng),
        {"track": 1.5, "edges": 0.7},
        truth if with_truth else None,
    )


def on_court(material):
    """The same walk about two metres behind the baseline; the court is lost in frames 5 to 7."""
    motion = material.motion
    count = len(motion.time)
    middle = np.column_stack([np.linspace(-2, 2, count), np.full(count, -14.0), np.ones(count)])
    x, y, z = (motion.points3d - motion.points3d[:, :1]).transpose(2, 0, 1)
    points, root = np.stack([x, z, -y], axis=2) + middle[:, None], middle
    points[5:8], root[5:8] = np.nan, np.nan
    world = WorldMotion(points, root, np.ones((count, 2), dtype=bool), 1.0)
    camera = court_camera(camera_at((1, -25, 5), (0, -9, 0), size=(240, 320)), count)
    return replace(material, court=(world, camera))


def on_ground(material):
    """The same where there is no court."""
    world, camera = on_court(material).court
    return replace(material, court=(world, replace(camera, origin=GROUND)))


def renamed_video(material, path):
    """The same material with a video of another name."""
    return replace(material, video=replace(material.video, path=path))


def write_report(path, material):
    """The report of a material, as `keyrecon run` writes it."""
    write_page(path, material, cut_report_pictures(material))
