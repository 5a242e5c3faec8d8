"""A project to be marked in a browser: a short video, keyframes, and a body that is known."""

import json
import time

import numpy as np

from keyrecon.app.project import start
from keyrecon.body import LSP14
from keyrecon.golf.clicks import GolfClicks
from keyrecon.golf.records import RecordedSwing
from keyrecon.io.formats.clicks import write_clicks
from keyrecon.io.formats.keyframes import keyframes_to_json
from keyrecon.io.formats.motion_file import write_motion
from keyrecon.io.formats.swing_file import write_swing
from keyrecon.io.provenance import golf_digest, note_fitted
from keyrecon.io.video_writer import write_video
from keyrecon.io.workspace import Workspace
from keyrecon.records import HalfKeyframes, Keyframes, Motion
from keyrecon.synthetic.motion import MotionOptions, play_tennis

FPS, FRAMES, SIZE = 25.0, 100, (640, 360)
STATURE = 1.78
"""Metres."""
PIXELS = 150.0
"""Pixels per metre."""


def read_number(blocks):
    """The number that the eight blocks of a picture show, from their brightness."""
    return sum((value > 120) << bit for bit, value in enumerate(blocks))


def block(bit):
    """Centre of the block that shows one bit of the frame number."""
    return 40 + 80 * bit, 30


def write_numbered_video(path):
    """Pictures whose blocks at the top tell their number."""

    def pictures():
        for number in range(FRAMES):
            picture = np.full((SIZE[1], SIZE[0], 3), 90, dtype=np.uint8)
            for bit in range(8):
                x, y = block(bit)
                picture[y - 20 : y + 20, x - 30 : x + 30] = 220 if number >> bit & 1 else 20
            yield picture

    write_video(path, pictures(), FPS)
    return path


def truth():
    """Joints of a tennis player in camera axes (metres) and on the picture."""
    world = play_tennis(MotionOptions(seconds=FRAMES / FPS, fps=FPS, stature=STATURE, seed=3))
    points3d = (world - world[:, 12:13]) * [1, -1, -1]
    points2d = points3d[..., :2] * PIXELS + [SIZE[0] / 2, 110]
    return points3d, points2d


def true_signs(points3d, flat=0.06):
    """Sign of every limb by name; limbs that lie flat (depth below `flat`, m) are left out."""
    parent, child = LSP14.bones.T
    depth = points3d[parent, 2] - points3d[child, 2]
    names = [LSP14.names[c] for c in child]
    return {n: int(np.sign(d)) for n, d in zip(names, depth, strict=True) if abs(d) > flat}


def _half(frames):
    frames = np.array(frames)
    nearest = frames[np.abs(np.arange(FRAMES)[:, None] - frames).argmin(axis=1)]
    return HalfKeyframes(
        frames, nearest, np.ones(FRAMES, bool), 1.0, 0.1, np.zeros(FRAMES), len(frames)
    )


def make_project(folder, video_file, upper=(10, 40, 70), lower=(10, 55, 70)):
    """A project with these keyframes."""
    start(video_file, folder)
    workspace = Workspace(folder)
    keyframes = Keyframes(_half(upper), _half(lower), reach=10, alpha=0.95)
    workspace.keyframes_file.write_text(keyframes_to_json(keyframes))
    return folder


def count_slowly(options, progress):
    """Work that takes longer than anybody waits."""
    for _ in progress(range(600), "Counting"):
        time.sleep(0.1)
    return "Counted."


def follow_at_once(folder, options, progress):
    """Nothing is followed; what asks for more bodies finds that it was."""
    (folder / "followed").touch()
    return "Followed."


def true_motion():
    """The motion that is known."""
    points3d, points2d = truth()
    return Motion(
        skeleton=LSP14,
        points3d=points3d,
        points2d=points2d,
        points2d_propagated=points2d,
        confidence=np.ones(points2d.shape[:2]),
        source=np.zeros(points2d.shape[:2], dtype=np.int64),
        scale=np.full(FRAMES, PIXELS),
        fps=FPS,
        time=np.arange(FRAMES) / FPS,
        units="m",
        keyframes=np.array([10, 40, 70]),
    )


def write_true_motion(folder):
    """The motion that is known, and a report, as a run leaves them."""
    write_motion(folder / "motion.npz", true_motion())
    script = """<script>
      let seen = "a cookie";
      try { document.cookie; } catch { seen = "no cookie"; }
      document.body.append(`, ${seen} for its script`);
    </script>"""
    (folder / "report.html").write_text(f"<!doctype html><body>A report{script}</body>")


def run_at_once(folder, options, progress):
    """A run that knows the motion; notes the options that it was told."""
    (folder / "told.json").write_text(json.dumps(options))
    write_true_motion(folder)
    return ""


ADDRESS = {
    "head_top": (160.0, 40.0), "root": (160.0, 142.0), "right_knee": (142.0, 192.0),
    "left_knee": (178.0, 192.0), "right_ankle": (138.0, 240.0), "left_ankle": (182.0, 240.0),
}  # fmt: skip
"""Six joints as a golfer has them at the address."""
CLUB = np.array([[300.0, 120.0], [420.0, 200.0]])
"""Both ends of a club in all frames, px."""


def make_golf_project(folder, video_file, doubts=(), first=0):
    """A golf project with its clicks and a fit, which is the motion that is known; nothing is
    fitted to the frames before `first`."""
    start(video_file, folder, golf=True)
    write_clicks(folder / "golf_clicks.json", GolfClicks(3, SIZE, ADDRESS))
    motion = true_motion()
    motion.confidence[:first] = 0
    swing = RecordedSwing(
        motion=motion,
        club=np.concatenate([motion.points3d[:, :1], motion.points3d[:, :1] + 1], axis=1),
        club2d=np.tile(CLUB, (FRAMES, 1, 1)),
        club_seen=np.ones(FRAMES, dtype=bool),
        keys=np.array([10.0, 40.0, 48.0, 70.0]),
        vertical=np.array([0.0, -1.0, 0.0]),
        left_handed=False,
        doubts=tuple(doubts),
    )
    workspace = Workspace(folder)
    note_fitted(workspace, golf_digest(workspace))
    (folder / "report.html").write_text("<!doctype html><body>A report</body>")
    write_swing(folder / "motion.npz", swing)
    return folder
