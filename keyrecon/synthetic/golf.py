"""A golf swing filmed: the figure with a club on a range, with every truth.

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
from keyrecon.synthetic.cameras import CameraOptions, View
from keyrecon.synthetic.golf_range import draw_range
from keyrecon.synthetic.pointers import unit
from keyrecon.synthetic.racket import golf_club
from keyrecon.synthetic.sequence import SceneOptions, film_stage, set_stage
from keyrecon.synthetic.stage import Stage

STEEL = (176, 180, 186)
MIRROR = np.array([-1.0, 1.0, 1.0])


@dataclass(frozen=True)
class SwingFilm:
    """How a swing is filmed."""

    scene: SceneOptions = field(
        default_factory=lambda: SceneOptions(
            camera=CameraOptions(View.FACE_ON, player_px=370.0), shutter=0.006
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
        held=golf_club(reach), look=replace(stage.look, racket=STEEL),
    )  # fmt: skip


def _add_truth(path: Path, stage: Stage, played: Played) -> None:
    """Write the club and the key postures beside the joints."""
    with np.load(path) as stored:
        truth = dict(stored)
    truth["club3d"] = stage.move.to_camera(played.club)
    truth["club2d"] = stage.move.project(played.club)
    truth["keys"] = played.keys
    np.savez(path, **truth)
