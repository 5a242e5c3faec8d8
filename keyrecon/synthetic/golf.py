"""A driving range: mown grass with a mat, marker boards, a line of trees and sky.

Drawn once per sequence by casting a ray per pixel, as the tennis court is.

A golf swing filmed: the figure with a club on a range, with every truth.

Beside the joints, `truth.npz` holds `club3d` and `club2d` (between the hands, end of the head) and
`keys` (frames of the key postures, not rounded).
"""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicSpline

from keyrecon.body import LSP14
from keyrecon.golf.records import Swing
from keyrecon.progress import Progress, silent
from keyrecon.synthetic.cameras import CameraMove, CameraPlanOptions, View
from keyrecon.synthetic.court import CourtPicture, cast_rays, sample
from keyrecon.synthetic.figure import unit
from keyrecon.synthetic.looks import Look
from keyrecon.synthetic.racket import golf_club
from keyrecon.synthetic.sequence import SceneOptions, film_stage, set_stage
from keyrecon.synthetic.shading import make_noise
from keyrecon.synthetic.stage import Stage

TREES_AWAY = 38.0
"""Metres from the player to the trees, all around."""
GRASS = (98, 132, 64)
MAT = (0.85, 0.75)
"""Half width and half depth of the mat, metres."""
MAT_COLOR = (52, 96, 66)
BOARDS = ((-14.0, (214, 60, 50)), (3.5, (238, 238, 232)), (16.0, (240, 196, 60)))
"""Marker boards: metres aside and colour."""


def draw_range(
    points: Float[np.ndarray, "T 14 3"], move: CameraMove, look: Look, seed: int
) -> CourtPicture:
    """Surroundings of a golfer as seen in all frames; nothing stands where `points` are."""
    rays, rotation, focal, corner = cast_rays(move)
    rng = np.random.default_rng([seed, 29])
    grain = make_noise(rng, 1024, (1.0, 4.0, 14.0))
    broad = make_noise(rng, 1024, (10.0, 35.0, 90.0))
    floor_t = rays.meet(1, 0.0)
    wall_t = np.minimum(
        rays.meet(0, np.where(rays.direction[0] > 0, TREES_AWAY, -TREES_AWAY).astype(np.float32)),
        rays.meet(2, np.where(rays.direction[2] > 0, TREES_AWAY, -TREES_AWAY).astype(np.float32)),
    )
    x, z = (np.clip(rays.at(floor_t, axis), -200, 200) for axis in (0, 2))
    x, z = x - points[..., 0].mean(), z - points[..., 2].mean()
    picture = _paint_grass(x, z, (grain, broad))
    along = rays.at(wall_t, 0) + rays.at(wall_t, 2)
    trees = _paint_trees(along, rays.at(wall_t, 1), look, (grain, broad))
    picture = np.where((floor_t < wall_t)[..., None], picture, trees)
    return CourtPicture(np.clip(picture, 0, 255).astype(np.uint8), rotation, focal, corner)


def _paint_grass(
    x: Float[np.ndarray, "h w"], z: Float[np.ndarray, "h w"], tiles: tuple
) -> Float[np.ndarray, "h w 3"]:
    """Grass mown in stripes, worn in places, and the mat that the player stands on."""
    grain, broad = tiles
    light = 1 + 0.10 * sample(grain, x, z, 0.012) + 0.07 * sample(broad, x, z, 0.03)
    light += 0.06 * np.sign(np.sin((x + 0.3 * z) * np.pi / 2.2))
    color = np.array(GRASS, np.float32) * light[..., None]
    mat = (np.abs(x) < MAT[0]) & (np.abs(z + 0.2) < MAT[1])
    weave = 1 + 0.06 * sample(grain, z, x, 0.006)
    return np.where(mat[..., None], np.array(MAT_COLOR, np.float32) * weave[..., None], color)


def _paint_trees(
    along: Float[np.ndarray, "h w"], height: Float[np.ndarray, "h w"], look: Look, tiles: tuple
) -> Float[np.ndarray, "h w 3"]:
    """Trees of uneven height with boards before them, sky above."""
    grain, broad = tiles
    along, height = np.clip(along, -200, 200), np.clip(height, -50, 300)
    crown = 5.5 + 1.8 * sample(broad, along, 0 * along, 0.07)
    crown += 0.4 * sample(grain, along, height, 0.04)
    leaves = 1 + 0.22 * sample(grain, along, height, 0.05)
    leaves += 0.25 * sample(broad, along, height, 0.03)
    trees = np.array(look.court.trees, np.float32) * np.clip(leaves, 0.25, 2)[..., None]
    haze = np.clip((height - 4) / 40, 0, 1)[..., None]
    sky = np.array(look.court.sky, np.float32) * (1 - 0.2 * haze)
    foot = np.abs(np.gradient(height, axis=0)) + 1e-3
    cover = np.clip((crown - height) / foot + 0.5, 0, 1)[..., None]
    picture = sky + cover * (trees - sky)
    for place, color in BOARDS:
        board = (np.abs(along - place) < 1.1) & (height > 0.4) & (height < 1.7)
        picture[board] = color
    return picture.astype(np.float32)


STEEL = (176, 180, 186)
MIRROR = np.array([-1.0, 1.0, 1.0])


@dataclass(frozen=True)
class SwingFilm:
    """How a swing is filmed."""

    scene: SceneOptions = field(
        default_factory=lambda: SceneOptions(
            camera=CameraPlanOptions(View.FACE_ON, player_px=370.0), shutter=0.006
        )
    )
    """Camera, looks and noise."""
    fps: float = 60.0
    """Frames per second."""
    before: float = 0.6
    """Seconds of address before the upswing; the first posture is held if the capture has less."""
    after: float = 0.4
    """Seconds after the finish."""
    tempo: float = 1.0
    """How many times faster than captured the swing is."""


@dataclass(frozen=True, eq=False)
class Played:
    """A swing at the frame rate of the film, in swing axes."""

    points: Float[np.ndarray, "T 14 3"]
    toes: Float[np.ndarray, "T 2 3"]
    club: Float[np.ndarray, "T 2 3"]
    keys: Float[np.ndarray, "4"]


def film_swing(swing: Swing, film: SwingFilm, out: Path, progress: Progress = silent) -> None:
    """Render a swing into a folder: video.mp4, truth.npz, picks.json, scene.json."""
    played = play_swing(swing, film)
    if film.scene.left_handed:
        played = Played(
            played.points[:, LSP14.mirror] * MIRROR, played.toes[:, ::-1] * MIRROR,
            played.club * MIRROR, played.keys,
        )  # fmt: skip
    stage = _hold_club(set_stage(played.points, film.fps, film.scene, draw_range), played)
    film_stage(stage, film.fps, film.scene, out, progress)
    _add_truth(out / "truth.npz", stage, played)


def play_swing(swing: Swing, film: SwingFilm) -> Played:
    """The swing resampled to the film's frames."""
    pace = swing.fps * film.tempo / film.fps
    first = swing.keys[0] - film.before * swing.fps * film.tempo
    last = swing.keys[3] + film.after * swing.fps * film.tempo
    frames = np.arange(first, last, pace)
    captured = np.arange(len(swing.joints))
    inside = np.clip(frames, 0, captured[-1])
    joints, toes, club = (
        CubicSpline(captured, values)(inside) for values in (swing.joints, swing.toes, swing.club)
    )
    return Played(joints, toes, club, (swing.keys - first) / pace)


def _hold_club(stage: Stage, played: Played) -> Stage:
    """The stage with a club in the hands and the captured feet."""
    grip, head = played.club[:, 0], played.club[:, 1]
    way = unit(head - grip)
    ankles = played.points[:, [LSP14.index("right_ankle"), LSP14.index("left_ankle")]]
    pointers = replace(stage.pointers, toes=unit(played.toes - ankles), racket=way)
    across = unit(np.cross(way, np.gradient(way, axis=0) + 1e-6))
    across = unit(np.cross(across, way))
    reach = float(np.median(np.linalg.norm(head - grip, axis=1)))
    return replace(
        stage, pointers=pointers, racket=np.stack([grip, way, across], axis=1),
        held=golf_club(reach), look=replace(stage.look, racket=STEEL), toes=played.toes,
    )  # fmt: skip


def _add_truth(path: Path, stage: Stage, played: Played) -> None:
    """Write the club and the key postures beside the joints."""
    with np.load(path) as stored:
        truth = dict(stored)
    del truth["points3d_world"]  # a range has no court
    truth["club3d"] = stage.move.to_camera(played.club)
    truth["club2d"] = stage.move.project(played.club)
    truth["keys"] = played.keys
    np.savez(path, **truth)
