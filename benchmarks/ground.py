"""The camera where there is no court: rendered sequences whose court is hidden, against truth.

    python benchmarks/ground.py FOLDER ... [--frames N]
    python benchmarks/ground.py --walks

FOLDERs are those of `benchmarks/accuracy.py --work`: the last lifted motion of each, its first
twelve seconds, and the true path of the camera; nothing is told of the court. --walks has players
who walk about before three cameras on walks that are made up, with lifts made of the truth as in
`benchmarks/world.py`, of which the size is 3 % too large and wavers by 1.3 %. Each with some kinds
of evidence:

    player    his height where he stands
    posts     two upright things besides, left and right, clicked 2 px off
    fov       the field of view besides, 5 % off
    horizon   two points of it besides, 3 px off
    length    4 m on the ground, across and away, besides the posts

    focal     off by %, and in brackets the standard deviation that was told
    tilt      degrees, likewise
    height    of the camera, %, likewise
    N-MPJPE   pose after the best scale of each frame, mm: as lifted > in the world that was found;
              the vertical that was found counts as the vertical
    PA-MPJPE  the same after the best similarity
    lean      angle between trunk and true trunk, degrees, median, likewise
    slip      speed of feet that stand, cm/s, median

"not used" where the tilt is too uncertain for `keyrecon run` to use it.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter1d
from way import lifted
from world import (
    ANKLES,
    HIPS,
    SIZE,
    Truth,
    _lean,
    _n_mpjpe,
    _pa_mpjpe,
    lift_truth,
    true_camera,
)

from keyrecon.app.placing import most_tilt_error
from keyrecon.records import CameraPath, Motion
from keyrecon.synthetic.motion import MotionOptions, place_joints
from keyrecon.synthetic.rally import PointPlan, Pose
from keyrecon.timeline import PER_FRAME
from keyrecon.world.ground_calibration import FieldOfView, GroundCalibration, calibrate_ground
from keyrecon.world.ground_evidence import GroundState
from keyrecon.world.placement import place_motion
from keyrecon.world.records import GroundMark, WorldCamera
from keyrecon.world.sight import sight_axes

POSED = 600
"""Frames whose pose is compared."""
CLICK, FAR_CLICK, FOV = 2.0, 3.0, 0.05
Z_UP = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
UPRIGHT = Pose(pitch=4.0, drop=0.03)
WALKS = {
    "walk, on a fence": (3.0, 12.0, 1100.0),
    "walk, tripod": (1.5, 4.0, 1100.0),
    "walk, level": (1.3, 0.0, 1100.0),
}
"""Height in metres, tilt in degrees and focal length in px of cameras."""
STOPS = ((-1.5, 6.5), (1.5, 9.0), (-2.0, 12.0), (2.0, 16.0), (0.0, 18.0), (-3.0, 11.0), (1.5, 7.0))
"""Where the player walks to, metres right of the camera and away from it."""


@dataclass(frozen=True, eq=False)
class Scene:
    """A motion, the truth and the way the camera moves."""

    name: str
    motion: Motion
    points: np.ndarray
    camera: WorldCamera
    path: CameraPath
    size: tuple[int, int]


def rendered(folder: Path, frames: int) -> Scene:
    """The first frames of a rendered sequence."""
    truth, stored = Truth.read(folder / "truth.npz"), np.load(folder / "truth.npz")
    own = slice(0, frames)
    motion = lifted(folder, float(stored["fps"]))
    motion = replace(motion, **{name: getattr(motion, name)[own] for name in PER_FRAME})
    width, height = (2 * stored["principal"] + 1).astype(int).tolist()
    camera = true_camera(truth).part(own)
    return Scene(folder.name, motion, truth.points[own], camera, path_of(camera), (width, height))


def path_of(camera: WorldCamera) -> CameraPath:
    """The true homographies to the first frame."""
    views = camera.K @ camera.R
    path = views[0] @ np.linalg.inv(views)
    return CameraPath(path / path[:, 2:, 2:], np.ones(len(path)))


def walk(fps: float) -> np.ndarray:
    """Joints of a player who walks from stop to stop, z up."""
    plan, place, foot, time = PointPlan(), np.array(STOPS[0]), 0, 0.5
    plan.poses.append((-1.0, UPRIGHT.numbers()))
    plan.moves.append((-3.0, -2.0, place))
    for side, aside in enumerate((0.12, -0.12)):
        plan.step(side, -0.4, -0.2, place + np.array([aside, 0.0]), 0.0)
    for goal in np.array(STOPS[1:]):
        way = goal - place
        count = max(2, int(np.ceil(np.linalg.norm(way) / 0.6)))
        pace, ahead = float(np.linalg.norm(way)) / count / 1.2, way / np.linalg.norm(way)
        heading = float(np.degrees(np.arctan2(*way)))
        plan.moves.append((time, time + count * pace + 0.2, way))
        plan.poses.append((time - 0.3, plan.poses[-1][1]))
        turned = replace(UPRIGHT, pelvis=heading, shoulders=heading)
        plan.poses.append((time + 0.2, turned.numbers()))
        for k in range(count + 1):
            aside = 0.1 * np.array([ahead[1], -ahead[0]]) * (1 - 2 * foot)
            at = place + way * min(k + 1, count) / count + aside
            plan.step(foot, time + k * pace, time + k * pace + 0.9 * pace, at, heading)
            foot = 1 - foot
        time, place = time + count * pace + 1.0, goal
    points = place_joints(plan, np.arange(round(time * fps)) / fps, MotionOptions(time, fps))
    return points @ Z_UP.T


def walk_about(name: str, seed: int) -> Scene:
    """A player who walks about before one of the cameras of `WALKS`."""
    height, tilt, focal = WALKS[name]
    points = walk(50.0)
    state = GroundState(np.log(focal), np.radians(tilt), 0.0, np.log(height), 0.0, 0.0)
    pinhole = state.pinhole((np.array(SIZE) - 1) / 2)
    pixels = np.stack([pinhole.project(frame) for frame in points])
    truth = Truth([pinhole] * len(points), points, pixels, np.ones((len(points), 2), dtype=bool))
    camera = true_camera(truth)
    motion = lift_truth(truth, camera, seed)
    slow = gaussian_filter1d(np.random.default_rng(seed).standard_normal(len(points)), 25.0)
    away = (pixels[:, HIPS].mean(axis=1) - pinhole.principal) / focal
    larger = np.sqrt(1 + (away**2).sum(axis=1)) * np.exp(0.03 + 0.013 * slow / slow.std())
    motion = replace(motion, scale=motion.scale * larger)
    return Scene(name, motion, points, camera, path_of(camera), SIZE)


@dataclass(frozen=True, eq=False)
class Clicks:
    """Clicks on things that stand before a camera in its first frame."""

    scene: Scene
    rng: np.random.Generator

    def _mark(self, kind: str, ends: np.ndarray, noise: float, metres: float | None) -> GroundMark:
        there = self.scene.camera.project(0, ends) + self.rng.normal(0, noise, (2, 2))
        (x0, y0), (x1, y1) = there.tolist()
        return GroundMark(kind, 0, (x0, y0), (x1, y1), metres)  # type: ignore[arg-type]

    def _place(self, aside: float, away: float, height: float) -> np.ndarray:
        """A place by its share of the half picture, of the player's distance, and its height."""
        camera = self.scene.camera
        ahead = camera.R[0, 2] * [1, 1, 0] / np.linalg.norm(camera.R[0, 2, :2])
        right = np.cross(ahead, [0, 0, 1.0])
        root = self.scene.points[0, HIPS].mean(axis=0)
        far = away * float((root - camera.centre[0]) @ ahead)
        half = self.scene.size[0] / 2 / camera.focal[0] * far
        ground = camera.centre[0] + far * ahead + aside * half * right
        return ground * [1, 1, 0] + [0, 0, height]

    def posts(self) -> tuple[GroundMark, ...]:
        """Two upright things."""
        ends = [np.array([self._place(a, 1.1, 0.0), self._place(a, 1.1, 2.5)]) for a in (-0.8, 0.8)]
        return tuple(self._mark("vertical", pair, CLICK, None) for pair in ends)

    def horizon(self) -> tuple[GroundMark, ...]:
        """Two points of it."""
        height = float(self.scene.camera.centre[0, 2])
        ends = np.array([self._place(a, 1e4, height) for a in (-0.6, 0.6)])
        return (self._mark("horizon", ends, FAR_CLICK, None),)

    def length(self) -> tuple[GroundMark, ...]:
        """Something long on the ground."""
        start = self._place(-0.3, 0.95, 0.0)
        root = self.scene.points[0, HIPS].mean(axis=0) * [1, 1, 0]
        way = root - self.scene.camera.centre[0] * [1, 1, 0]
        way = way / np.linalg.norm(way)
        end = start + 4.0 * (np.cross(way, [0, 0, 1.0]) + way) / np.sqrt(2)
        return (self._mark("length", np.array([start, end]), CLICK, 4.0),)

    def field_of_view(self) -> FieldOfView:
        """5 % off."""
        focal = float(self.scene.camera.focal[0] * np.exp(self.rng.normal(0, FOV)))
        return FieldOfView(focal, FOV, "the field of view")


def rows(scene: Scene) -> Iterator[str]:
    """One for each kind of evidence."""
    clicks = Clicks(scene, np.random.default_rng(0))
    posts, fov = clicks.posts(), clicks.field_of_view()
    kinds: tuple[tuple[str, tuple[GroundMark, ...], FieldOfView | None], ...] = (
        ("player", (), None),
        ("posts", posts, None),
        ("posts, length", (*posts, *clicks.length()), None),
        ("fov", (), fov),
        ("posts, fov", posts, fov),
        ("horizon, fov", clicks.horizon(), fov),
    )
    for name, marks, known in kinds:
        found = calibrate_ground(scene.motion, scene.path, scene.size, marks, known)
        yield f"{scene.name:<22}{name:<15}{_camera(found, scene)}{_pose(found, scene)}"


def _camera(found: GroundCalibration, scene: Scene) -> str:
    t, true = found.reference, scene.camera
    focal = found.camera.focal[t] / true.focal[t] - 1
    tilt = np.degrees(found.state.tilt - np.arcsin(-true.R[t, 2, 2]))
    height = np.exp(found.state.log_height) / true.centre[t, 2] - 1
    sd = found.sd
    return (
        f"{focal:+6.0%} ({sd.log_focal:3.0%}){tilt:+6.1f} ({np.degrees(sd.tilt):4.1f})"
        f"{height:+6.0%} ({sd.log_height:3.0%})"
    )


def _pose(found: GroundCalibration, scene: Scene) -> str:
    own = slice(0, POSED)
    motion = scene.motion
    motion = replace(motion, **{name: getattr(motion, name)[own] for name in PER_FRAME})
    true, found_camera, camera = scene.points[own], found.camera.part(own), scene.camera.part(own)
    axes = sight_axes(camera, motion.points2d[:, HIPS].mean(axis=1))
    before = np.einsum("tij,tnj->tni", axes, motion.points3d)
    olds = [measured(before, true) for measured in (_n_mpjpe, _pa_mpjpe, _lean)]
    if np.nanmax(found_camera.sd_tilt) > most_tilt_error(found_camera):
        return "".join(f"{old:7.1f} >    -" for old in olds) + "  not used"
    world = place_motion(motion, found_camera)
    if world is None:
        return "  no foot stands"
    t = found.reference
    ours, theirs = found.camera.R[t, 2], scene.camera.R[t, 2]
    turn = np.arctan2(theirs[1], theirs[0]) - np.arctan2(ours[1], ours[0])
    c, s = np.cos(turn), np.sin(turn)
    points = world.points @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]]).T
    known = np.isfinite(points[:, 0, 0])
    news = [m(points[known], true[known]) for m in (_n_mpjpe, _pa_mpjpe, _lean)]
    steps = np.linalg.norm(np.diff(world.points[:, ANKLES, :2], axis=0), axis=2) * motion.fps
    both = world.contact[1:] & world.contact[:-1]
    pairs = "".join(f"{a:7.1f} >{b:5.1f}" for a, b in zip(olds, news, strict=True))
    return f"{pairs}{np.nanmedian(steps[both]) * 100:7.2f}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folders", type=Path, nargs="*")
    parser.add_argument("--frames", type=int, default=600, help="of each sequence at most")
    parser.add_argument("--walks", action="store_true", help="players who walk about")
    told = parser.parse_args()
    print(
        f"{'':<22}{'evidence':<15}{'focal':>12}{'tilt':>13}{'height':>12}"
        f"{'N-MPJPE':>14}{'PA-MPJPE':>14}{'lean':>14}{'slip':>7}"
    )
    scenes = [walk_about(name, seed) for seed, name in enumerate(WALKS) if told.walks]
    for scene in [*(rendered(folder, told.frames) for folder in told.folders), *scenes]:
        for row in rows(scene):
            print(row, flush=True)


if __name__ == "__main__":
    main()
