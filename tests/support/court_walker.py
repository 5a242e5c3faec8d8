"""A figure of stiff bones that walks on a court: one foot stands while the other swings."""

import numpy as np

from keyrecon.body import LSP14
from keyrecon.records import Motion
from keyrecon.world.placement import ANKLE_SHARE
from keyrecon.world.records import WorldCamera

STATURE, FPS, STEP = 1.8, 50.0, 25
THIGH, SHANK = 0.25, 0.24
"""Statures."""


def _stand():
    """Joints above the ground, metres: x to the figure's right, z up."""
    place = {
        "ankle": (0.12, ANKLE_SHARE), "hip": (0.09, 0.49),
        "wrist": (0.22, 0.42), "elbow": (0.2, 0.57), "shoulder": (0.11, 0.78),
    }  # fmt: skip
    joints = np.zeros((14, 3))
    for j, name in enumerate(LSP14.names):
        side, _, part = name.partition("_")
        if part in place:
            x, z = place[part]
            joints[j] = (x if side == "right" else -x, 0, z)
        else:
            joints[j] = (0, 0, 0.81 if name == "neck" else 0.97)
    return joints * STATURE


def walk(steps=6, stride=0.5, start=(-1.0, -9.0)):
    """Joints in the world and which foot stands: right, left, right, ..."""
    frames = steps * STEP
    points = np.repeat(_stand()[None], frames, axis=0)
    contact = np.zeros((frames, 2), dtype=bool)
    feet = np.zeros((frames, 2, 2))
    at = np.array([[0.0, 0.0], [0.0, 0.0]])
    for s in range(steps):
        swing, stand = s % 2, 1 - s % 2
        for k in range(STEP):
            t, share = s * STEP + k, 0.5 - 0.5 * np.cos(np.pi * k / STEP)
            feet[t, stand] = at[stand]
            feet[t, swing] = at[swing] + share * np.array([stride, 0.3 * stride])
            contact[t, stand] = True
            lift = 0.25 * np.sin(np.pi * k / STEP)
            foot = LSP14.index("right_ankle" if swing == 0 else "left_ankle")
            points[t, foot, 2] += lift
        at[swing] = at[swing] + np.array([stride, 0.3 * stride])
    body = feet.mean(axis=1) + start
    points[..., :2] += body[:, None]
    for foot, name in enumerate(("right_ankle", "left_ankle")):
        points[:, LSP14.index(name), :2] += feet[:, foot] - feet.mean(axis=1)
    for side in ("right", "left"):
        hip, knee, ankle = (LSP14.index(f"{side}_{part}") for part in ("hip", "knee", "ankle"))
        points[:, knee] = _knees(points[:, hip], points[:, ankle])
    return points, contact


def _knees(hips, ankles):
    """Knees bent forward, y, so that thighs and shanks keep their lengths."""
    leg = ankles - hips
    far = np.linalg.norm(leg, axis=1, keepdims=True)
    along = (far**2 + (THIGH**2 - SHANK**2) * STATURE**2) / (2 * far)
    leg = leg / far
    forward = np.array([0, 1.0, 0]) - leg * leg[:, 1:2]
    forward /= np.linalg.norm(forward, axis=1, keepdims=True)
    return hips + along * leg + np.sqrt((THIGH * STATURE) ** 2 - along**2) * forward


def court_camera(pinhole, frames):
    """A camera that stands still, found in all frames."""
    inner = np.array(
        [[pinhole.focal, 0, pinhole.principal[0]], [0, pinhole.focal, pinhole.principal[1]],
         [0, 0, 1.0]]
    )  # fmt: skip
    shift = -pinhole.rotation @ pinhole.centre
    return WorldCamera(
        *(np.repeat(a[None], frames, axis=0) for a in (inner, pinhole.rotation, shift)),
        np.ones(frames, dtype=bool),
        np.full((frames, 3), 0.02),
        np.full(frames, 3.0),
        np.full(frames, np.nan),
    )


def lifted(points, pinhole, units="m"):
    """The motion as a perfect lifting has it: scaled orthography about the line of sight.

    Its scale is that of the picture, which is larger off the camera's axis.
    """
    hips = points[:, [LSP14.index("right_hip"), LSP14.index("left_hip")]].mean(axis=1)
    sight = hips - pinhole.centre
    far = np.linalg.norm(sight, axis=1)
    ray = sight / far[:, None] @ pinhole.rotation.T
    right = np.cross([0.0, 1.0, 0.0], ray)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    axes = np.stack([right, np.cross(ray, right), ray], axis=1)
    pose = np.einsum("tij,jk,tnk->tni", axes, pinhole.rotation, points - hips[:, None])
    unit = 1.0 if units == "m" else STATURE
    pixels = np.stack([pinhole.project(frame) for frame in points])
    count = len(points)
    return Motion(
        LSP14, pose / unit, pixels, pixels, np.ones((count, 14)),
        np.zeros((count, 14), dtype=np.int64), pinhole.focal / (far * ray[:, 2]) * unit, FPS,
        np.arange(count) / FPS, units, np.array([0]),
    )  # fmt: skip
