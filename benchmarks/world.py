"""The camera from the court, and the motion on it, against rendered truth; pictures of real clips.

    python benchmarks/world.py [--work DIR] [--only NAME ...] [--half develop|report] [--rendered]
    python benchmarks/world.py --lifts FOLDER ... [--frames N]

Rendered, 6 s each, views of which the court is to be found without a click:

    found     share of the frames whose camera was found
    reproj.   points of the court in the picture, median distance from where they are, px
    centre    camera's place, off by so many % of its distance from the baseline; in standard
              deviations that were told
    focal     off by %
    root      root where a foot stands, off by so many cm, median
    slip      speed of feet that stand, cm/s, median
    contact   F1 of standing feet, as it is / where two frames off count as right; truth: toes or
              ankle within 3 cm of their rest and slower than .3 m/s (`synthetic/contacts.py`)
    apex      height of jumps (hips above where they are while a foot stands), off by so many cm,
              median, of so many; truth: the body falls freely for .08 s, and rises by 5 cm
    W-MPJPE   joints in the world, mm
    N-MPJPE   pose after the best scale of each frame, mm: as lifted > on the court
    PA-MPJPE  the same after the best similarity
    lean      angle between trunk and true trunk, degrees, median, likewise

    s         seconds of processor time for the calibration, reading the video twice included

The motion is the true one with slow noise, as a lifting would have it: 2 px, and directions of
bones off by .05 in the picture and .16 in depth. With --lifts, the last lifted motions of
folders as `benchmarks/accuracy.py --work` leaves them are put on their ground by the true camera.

Real clips: share of the frames found, the camera's place with its standard deviations; every tenth
frame is drawn into DIR/world/CLIP.png, to be looked at. Golf clips must have no court.
"""

import argparse
import time
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from real import DEVELOP, VIDEOS
from scipy.ndimage import binary_dilation, gaussian_filter1d
from way import lifted

from keyrecon.app.console import show
from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.io.frame_reader import read_grey
from keyrecon.io.video import Video, open_video
from keyrecon.metrics import n_mpjpe, pa_mpjpe
from keyrecon.numerics.geometry import look_at, unit_vectors
from keyrecon.records import CameraPath, Motion
from keyrecon.report.court_drawing import draw_court
from keyrecon.synthetic.cameras import UP, CameraMove
from keyrecon.synthetic.motion import MotionOptions, play_tennis
from keyrecon.synthetic.sequence import SceneOptions, film_stage, set_stage
from keyrecon.synthetic.sequence import draw_court as paint_court
from keyrecon.timeline import PER_FRAME
from keyrecon.tracking.camera_motion import estimate_camera_motion
from keyrecon.world.calibration import CalibrationOptions, calibrate_court
from keyrecon.world.court import CourtOptions, tennis_court
from keyrecon.world.court_tracking import SPACING, check_still
from keyrecon.world.pinhole import Pinhole
from keyrecon.world.placement import place_motion
from keyrecon.world.records import WorldCamera, WorldMotion
from keyrecon.world.sight import sight_axes
from keyrecon.world.world_terms import joint_masses

FPS, SECONDS, SIZE = 50.0, 6.0, (1280, 720)
NET = -11.885
TO_COURT = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
"""Axes of rendered worlds (y up, net at negative z) to those of the court."""
TO_MIDDLES = CalibrationOptions(CourtOptions(0.0, 0.0))
"""Rendered lines are measured to their middles."""

FALL, JUMP = -6.5, 0.05
"""Acceleration of a body that nothing holds, m/s^2 after smoothing, and metres that are a jump."""
HIPS, ANKLES = (
    [LSP14.index(f"{side}_{part}") for side in ("right", "left")] for part in ("hip", "ankle")
)
NECK = LSP14.index("neck")


@dataclass(frozen=True)
class Setting:
    """A camera at a rendered court; axes of the rendered world, metres."""

    name: str
    centre: tuple[float, float, float]
    target: tuple[float, float, float]
    focal: float
    """In widths of the picture."""
    seed: int
    pan: float = 0.0
    """Degrees to both sides."""
    zoom: float = 0.0
    """Share by which the focal length grows and falls."""


SETTINGS = (
    Setting("broadcast", (0.6, 9.0, 21.0), (0.0, 0.0, -8.5), 1.45, 31),
    Setting("broadcast-pan", (-0.5, 14.0, 30.0), (0.0, 0.0, -8.0), 1.9, 32, 4.0, 0.06),
    Setting("phone-fence", (2.6, 3.0, 6.5), (-0.4, 0.3, -7.0), 0.85, 33),
    Setting("behind-baseline", (-0.8, 1.4, 6.6), (0.2, 0.9, -8.0), 1.0, 34),
    Setting("side-half", (15.0, 4.0, -3.0), (0.0, 0.2, -5.5), 0.9, 35),
    Setting("corner-pan", (8.0, 3.2, 6.0), (-0.6, 0.3, -5.0), 0.95, 36, 5.0, 0.05),
)


def render(setting: Setting, work: Path) -> Path:
    """The folder of the rendered sequence; rendered if it is not there."""
    folder = work / setting.name
    if (folder / "truth.npz").is_file():
        return folder
    points = play_tennis(MotionOptions(SECONDS, FPS, seed=setting.seed))
    stage = set_stage(points, FPS, SceneOptions(setting.seed))
    frames = len(points)
    phase = np.sin(2 * np.pi * np.arange(frames) / frames)
    centre, target = np.array(setting.centre), np.array(setting.target)
    rotations = []
    for turn in np.radians(setting.pan) * phase:
        c, s = np.cos(turn), np.sin(turn)
        way = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ (target - centre)
        rotations.append(look_at(centre, centre + way, UP))
    focal = setting.focal * SIZE[0] * (1 + setting.zoom * np.cos(3 * phase))
    move = CameraMove(centre, np.array(rotations), focal, SIZE)
    background = paint_court(points, move, stage.look, setting.seed)
    stage = replace(stage, move=move, background=background)
    film_stage(stage, FPS, SceneOptions(setting.seed, workers=1), folder, show)
    return folder


@dataclass(frozen=True, eq=False)
class Truth:
    """The camera and the joints in the court's axes."""

    cameras: list[Pinhole]
    points: np.ndarray
    points2d: np.ndarray
    contact: np.ndarray

    @classmethod
    def read(cls, file: Path) -> "Truth":
        """From a rendered sequence's truth.npz."""
        stored = np.load(file)
        shift = np.array([0, NET, 0])
        centre = TO_COURT @ stored["center"] + shift
        cameras = [
            Pinhole(float(f), stored["principal"], r @ TO_COURT.T, centre)
            for f, r in zip(stored["focal"], stored["rotation"], strict=True)
        ]
        world = np.einsum("tji,tnj->tni", stored["rotation"], stored["points3d"])
        world = (world + stored["center"]) @ TO_COURT.T + shift
        if "contact" not in stored:
            raise SystemExit(f"{file} is of a former version and tells no contacts; render it anew")
        return cls(cameras, world, stored["points2d"], stored["contact"])


def lift_truth(truth: Truth, camera: WorldCamera, seed: int) -> Motion:
    """The true motion as a lifting would have it: orthographic about the sight, with slow noise."""
    rng = np.random.default_rng(seed)
    count, joints = truth.points.shape[:2]

    def noise(spread: float, axes: int) -> np.ndarray:
        slow = gaussian_filter1d(rng.standard_normal((count, joints, axes)), 8.0, axis=0)
        return spread * slow / slow.std()

    pixels = truth.points2d + noise(2.0, 2)
    axes = sight_axes(camera, truth.points2d[:, HIPS].mean(axis=1))
    parents, children = LSP14.bones.T
    bones = np.einsum("tij,tbi->tbj", axes, truth.points[:, children] - truth.points[:, parents])
    lengths = np.linalg.norm(bones, axis=2, keepdims=True)
    off = np.concatenate([noise(0.05, 2), noise(0.16, 1)], axis=2)[:, children]
    pose = LSP14.ancestry @ (np.median(lengths, axis=0) * unit_vectors(bones / lengths + off))
    far = np.linalg.norm(truth.points[:, HIPS].mean(axis=1) - camera.centre, axis=1)
    return Motion(
        LSP14, pose, pixels, pixels, np.ones((count, joints)),
        np.zeros((count, joints), dtype=np.int64), camera.focal / far, FPS,
        np.arange(count) / FPS, "m", np.array([0]),
    )  # fmt: skip


def true_camera(truth: Truth) -> WorldCamera:
    """What a perfect calibration would find."""
    inner = np.array([np.diag([c.focal, c.focal, 1.0]) for c in truth.cameras])
    inner[:, :2, 2] = [c.principal for c in truth.cameras]
    turns = np.array([c.rotation for c in truth.cameras])
    shifts = np.array([-c.rotation @ c.centre for c in truth.cameras])
    count = len(turns)
    sure = np.zeros((count, 3)), np.zeros(count), np.zeros(count)
    return WorldCamera(inner, turns, shifts, np.ones(count, dtype=bool), *sure)


def measure(setting: Setting, work: Path) -> str:
    """One row of the table."""
    folder = render(setting, work)
    video, truth = open_video(folder / "video.mp4"), Truth.read(folder / "truth.npz")
    path = estimate_camera_motion(video)
    began = time.process_time()
    try:
        camera = calibrate_court(video, path, (), TO_MIDDLES)
    except KeyreconError as fault:
        return f"{setting.name:<18}{fault}"
    seconds = time.process_time() - began
    seen = np.flatnonzero(camera.found)
    grid = np.meshgrid(np.linspace(-5.4, 5.4, 9), np.linspace(-11.8, 11.8, 17))
    court = np.column_stack([grid[0].ravel(), grid[1].ravel(), np.zeros(grid[0].size)])
    off: list[float] = []
    for t in seen[::5]:
        there = truth.cameras[t].project(court)
        inside = ((there > 0) & (there < SIZE)).all(axis=1)
        off += np.linalg.norm(camera.project(t, court) - there, axis=1)[inside].tolist()
    true = truth.cameras[0].centre
    turned = np.sign(true[1]) * np.sign(camera.centre[seen[0]][1])
    away = camera.centre[seen[0]] - true * [turned, turned, 1]
    distance = float(np.linalg.norm(true - [0, NET, 0]))
    deviations = float(np.abs(away / camera.sd_centre[seen[0]]).max())
    focal = np.median([camera.focal[t] / truth.cameras[t].focal - 1 for t in seen])
    motion = lift_truth(truth, true_camera(truth), setting.seed)
    return (
        f"{setting.name:<18}{camera.found.mean():7.1%}{np.median(off):9.2f}"
        f"{np.linalg.norm(away) / distance:8.2%} ({deviations:.1f} sd){focal:+8.2%}"
        f"{seconds:7.1f}{_place(truth.points, truth.contact, camera, motion)}"
    )


def measure_lift(folder: Path, frames: int) -> str:
    """One row of the table of lifted motions."""
    truth, fps = Truth.read(folder / "truth.npz"), float(np.load(folder / "truth.npz")["fps"])
    own = slice(0, frames)
    motion, camera = lifted(folder, fps), true_camera(truth)
    motion = replace(motion, **{name: getattr(motion, name)[own] for name in PER_FRAME})
    camera = camera.part(own)
    return f"{folder.name:<24}{_place(truth.points[own], truth.contact[own], camera, motion)}"


def _place(true: np.ndarray, stands: np.ndarray, camera: WorldCamera, motion: Motion) -> str:
    """Root, slip, contact, jumps, joints in the world, and the pose before and after."""
    began = time.process_time()
    world = place_motion(motion, camera)
    pace = (time.process_time() - began) / len(true) * 1000
    if world is None:
        return "  no foot stands"
    root = true[:, HIPS].mean(axis=1)
    error = np.linalg.norm(world.root - root, axis=1)
    steps = np.linalg.norm(np.diff(world.points[:, ANKLES, :2], axis=0), axis=2) * motion.fps
    both = world.contact[1:] & world.contact[:-1]
    axes = sight_axes(camera, motion.points2d[:, HIPS].mean(axis=1))
    before = np.einsum("tij,tnj->tni", axes, motion.points3d)
    known = np.isfinite(world.points[:, 0, 0])
    pairs = []
    for measured in (_n_mpjpe, _pa_mpjpe, _lean):
        old, new = (measured(points[known], true[known]) for points in (before, world.points))
        pairs.append(f"{old:7.1f} >{new:5.1f}")
    return (
        f"{np.nanmedian(error[world.contact.any(axis=1)]) * 100:7.1f}"
        f"{np.nanmedian(steps[both]) * 100:7.2f}{_f1(world.contact, stands, 0):6.2f} /"
        f"{_f1(world.contact, stands, 2):5.2f}{_apex(world, true, stands, motion.fps)}"
        f"{np.nanmean(np.linalg.norm(world.points - true, axis=2)) * 1000:9.0f}"
        f"{''.join(pairs)}{pace:7.1f}"
    )


PLACED = (
    f"{'root':>7}{'slip':>7}{'contact':>13}{'apex':>11}{'W-MPJPE':>9}{'N-MPJPE':>14}{'PA-MPJPE':>14}"
    f"{'lean':>14}{'ms':>7}"
)
"""Heads of what `_place` prints; ms: milliseconds of processor time a frame."""


def _apex(world: WorldMotion, true: np.ndarray, stands: np.ndarray, fps: float) -> str:
    """By how much heights of jumps are off, cm, and how many there are."""
    body = (joint_masses(LSP14.names)[:, None] * true).sum(axis=1)[:, 2]
    body = gaussian_filter1d(body, 0.02 * fps)
    falls = np.gradient(np.gradient(body)) * fps**2 < FALL
    ends = np.flatnonzero(np.diff(np.concatenate([[0], falls.astype(int), [0]])))
    hips = true[:, HIPS, 2].mean(axis=1)
    before, after = (
        height - np.nanmedian(height[standing.any(axis=1)])
        for height, standing in ((hips, stands), (world.root[:, 2], world.contact))
    )
    around, off = round(0.1 * fps), []
    for first, end in zip(ends[::2], ends[1::2], strict=True):
        jump = slice(max(first - around, 0), end + around)
        if end - first >= 0.08 * fps and before[jump].max() > JUMP:
            off.append(abs(np.nanmax(after[jump]) - before[jump].max()) * 100)
    return f"{np.median(off):6.1f} ({len(off):2d})" if off else f"{'-':>6} ( 0)"


def _f1(found: np.ndarray, true: np.ndarray, off: int) -> float:
    """Of frames that stand, where so many frames off count as right."""
    around = np.ones((2 * off + 1, 1), dtype=bool)
    right = (found & binary_dilation(true, around)).sum() / max(found.sum(), 1)
    seen = (true & binary_dilation(found, around)).sum() / max(true.sum(), 1)
    return float(2 * right * seen / max(right + seen, 1e-9))


def _n_mpjpe(points: np.ndarray, true: np.ndarray) -> float:
    return n_mpjpe(points, true, HIPS) * 1000


def _pa_mpjpe(points: np.ndarray, true: np.ndarray) -> float:
    return pa_mpjpe(points, true) * 1000


def _lean(points: np.ndarray, true: np.ndarray) -> float:
    """Angle between the trunks, degrees."""
    one, other = (unit_vectors(p[:, NECK] - p[:, HIPS].mean(axis=1)) for p in (points, true))
    return float(np.median(np.degrees(np.arccos(np.clip((one * other).sum(axis=1), -1, 1)))))


def look(name: str, work: Path) -> str:
    """One real clip: a row, and every tenth frame drawn."""
    video = open_video(VIDEOS / f"{name}.mp4")
    path: CameraPath = estimate_camera_motion(video)
    try:
        camera = calibrate_court(video, path)
    except KeyreconError as fault:
        return f"{name:<26}{str(fault)[:70]}"
    seen = np.flatnonzero(camera.found)
    draw(video, camera, work / f"{name}.png")
    x, y, z = camera.centre[seen[0]]
    sd = camera.sd_centre[seen[0]]
    still = bool((path.to_reference == np.eye(3)).all())
    speed = _pace(video, camera) if still else ""
    return (
        f"{name:<26}{camera.found.mean():7.1%}  x {x:6.2f} ({sd[0]:.2f})  y {y:7.2f} ({sd[1]:.2f})"
        f"  z {z:6.2f} ({sd[2]:.2f})  focal {camera.focal[seen].min():.0f}-"
        f"{camera.focal[seen].max():.0f} px{speed}"
    )


def _pace(video: Video, camera: WorldCamera) -> str:
    """Milliseconds a frame of looking at the lines of a still camera."""
    greys = [grey for _, grey in zip(range(20), read_grey(video, 1280), strict=False)]
    t = int(np.flatnonzero(camera.found)[0])
    pinhole = Pinhole(camera.focal[t], camera.K[t, :2, 2], camera.R[t], camera.centre[t])
    pinhole = pinhole.resized(greys[0].shape[1] / video.width)
    began = time.process_time()
    check_still(greys, pinhole, tennis_court())
    return f"  {(time.process_time() - began) / len(greys) * 1000:.1f} ms a frame ({SPACING:g} px)"


def draw(video: Video, camera: WorldCamera, file: Path) -> None:
    """Every tenth frame with the model's lines, on one sheet."""
    tiles = []
    for t in range(0, len(video), 10):
        drawn = draw_court(video.frame(t), camera, t)
        tiles.append(cv2.resize(drawn, (960, round(960 * video.height / video.width))))
    tiles += [np.zeros_like(tiles[0])] * (-len(tiles) % 3)
    rows = [np.hstack(tiles[i : i + 3]) for i in range(0, len(tiles), 3)]
    cv2.imwrite(str(file), np.vstack(rows)[..., ::-1])


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--work", type=Path, default=Path("bench"))
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--half", choices=("develop", "report"), default="develop")
    parser.add_argument("--rendered", action="store_true", help="leave out the real clips")
    parser.add_argument("--lifts", type=Path, nargs="*", default=[], help="rendered sequences")
    parser.add_argument("--frames", type=int, default=600, help="of each lifted motion at most")
    told = parser.parse_args()
    if told.lifts:
        print(f"{'lifted':<24}{PLACED}")
        for folder in told.lifts:
            print(measure_lift(folder, told.frames), flush=True)
        return
    work = told.work / "world"
    work.mkdir(parents=True, exist_ok=True)
    rendered = [s for s in SETTINGS if not told.only or s.name in told.only]
    if rendered:
        print(
            f"{'rendered':<18}{'found':>7}{'reproj.':>9}{'centre':>17}{'focal':>8}{'s':>7}{PLACED}"
        )
    for setting in rendered:
        print(measure(setting, work), flush=True)
    names = sorted(p.stem for p in VIDEOS.glob("*.mp4"))
    names = [n for n in names if (n in DEVELOP) == (told.half == "develop")]
    for name in [] if told.rendered else names:
        if not told.only or name in told.only:
            print(look(name, work), flush=True)


if __name__ == "__main__":
    main()
