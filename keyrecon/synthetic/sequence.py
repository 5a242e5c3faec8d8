"""Make a sequence: motion, camera and looks by a seed, then video, truth, picks and settings.

Files written: `video.mp4`, `truth.npz` (see `write_truth`), `picks.json` (what a person would
click, taken from the renderer's own part labels) and `scene.json` (options and looks).
"""

import json
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from multiprocessing import get_context
from os import cpu_count
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
from jaxtyping import Float

from keyrecon.body import LSP14
from keyrecon.io.durable import make_folder
from keyrecon.io.formats.mocap import read_mocap
from keyrecon.io.formats.picks import write_picks
from keyrecon.io.local_workers import belong_to_parent
from keyrecon.io.option_tables import check_options
from keyrecon.io.video_writer import write_video
from keyrecon.progress import Progress, silent
from keyrecon.ranges import SEEDS, within
from keyrecon.records import Pick
from keyrecon.synthetic.cameras import CameraMove, CameraPlanOptions, plan_camera
from keyrecon.synthetic.clips import JOINTS, JoinOptions, join_with_toes
from keyrecon.synthetic.contacts import find_contacts
from keyrecon.synthetic.court import CourtPicture, draw_background, on_court
from keyrecon.synthetic.figure import FOOT_LENGTH, PARTS, STATURE, point_figure
from keyrecon.synthetic.looks import Look, choose_look
from keyrecon.synthetic.motion import MotionOptions, play_tennis
from keyrecon.synthetic.racket import RACKET, racket_frames
from keyrecon.synthetic.render import Frame, draw_frame
from keyrecon.synthetic.shading import make_tiles
from keyrecon.synthetic.stage import Stage


@dataclass(frozen=True)
class SceneOptions:
    """How a motion is filmed."""

    seed: Annotated[int, SEEDS] = 0
    """Decides looks, light, camera placement and noise."""
    camera: CameraPlanOptions = field(default_factory=CameraPlanOptions)
    shutter: Annotated[float, within(0, 0.1)] = 0.012
    """Seconds that the shutter is open."""
    noise: Annotated[float, within(0, 50)] = 2.2
    """Spread of the sensor noise, grey levels."""
    left_handed: bool = False
    """Mirror the motion and put the racket into the left hand."""
    crf: Annotated[int, within(0, 51)] = 23
    """Constant quality of the video, 18 very good to 28 coarse."""
    workers: Annotated[int, within(0, 256)] = 0
    """Processes that draw; 0 for one per core. The pictures do not depend on it."""


@dataclass(frozen=True)
class SynthOptions:
    """A whole sequence: what moves, and how it is filmed."""

    scene: SceneOptions = field(default_factory=SceneOptions)
    """Camera, looks and noise."""
    clips: JoinOptions = field(default_factory=JoinOptions)
    """Length and frame rate of the sequence, and how clips are joined."""
    trim: Annotated[int, within(0, 100_000)] = 30
    """Frames dropped at both ends of every motion-capture file, where markers come and go."""


def synthesize(
    out: Path,
    mocap: Sequence[Path] = (),
    options: SynthOptions = SynthOptions(),
    progress: Progress = silent,
) -> None:
    """Render a sequence into a folder, from motion capture or from the built-in tennis motion."""
    check_options(options)
    scene, clips = options.scene, options.clips
    toes = None
    if mocap:
        joined = join_with_toes(read_mocap([Path(p) for p in mocap], options.trim), clips)
        points, toes = joined[:, :JOINTS], joined[:, JOINTS:]
        if scene.left_handed:
            points = points[:, LSP14.mirror] * np.array([-1.0, 1, 1])
            toes = toes[:, ::-1] * np.array([-1.0, 1, 1])
    else:
        play = MotionOptions(
            clips.seconds, clips.fps, left_handed=scene.left_handed, seed=scene.seed
        )
        points = play_tennis(play)
    render_sequence(points, clips.fps, scene, out, progress, toes)


def draw_court(
    points: Float[np.ndarray, "T 14 3"], move: CameraMove, look: Look, seed: int
) -> CourtPicture:
    """A tennis court with nothing standing between camera and player."""
    return draw_background(move, look, seed, float(move.to_camera(points)[..., 2].max()) + 0.8)


def set_stage(
    points: Float[np.ndarray, "T 14 3"],
    fps: float,
    options: SceneOptions = SceneOptions(),
    surroundings: Callable[..., CourtPicture] = draw_court,
) -> Stage:
    """Everything that frames are drawn from; `points` in the world, metres, y up, floor at 0.

    `surroundings` is called with points, camera move, look and seed.
    """
    rng = np.random.default_rng([options.seed, 3])
    look = choose_look(options.seed)
    pointers = point_figure(points, fps, options.left_handed)
    move = plan_camera(points, fps, pointers.stature, options.camera, rng)
    width, height = move.size
    grey = rng.normal(0, options.noise, (height + 64, width + 64, 1))
    color = rng.normal(0, 0.6 * options.noise, (height + 64, width + 64, 3))
    return Stage(
        points, pointers, racket_frames(points, pointers), RACKET, move,
        surroundings(points, move, look, options.seed), look,
        make_tiles(rng), np.round(grey + color).astype(np.int8),
        min(1.0, options.shutter * fps), options.seed,
    )  # fmt: skip


def render_sequence(
    points: Float[np.ndarray, "T 14 3"],
    fps: float,
    options: SceneOptions,
    out: Path,
    progress: Progress = silent,
    toes: Float[np.ndarray, "T 2 3"] | None = None,
) -> None:
    """Film a motion and write the sequence into a folder, which is made if need be.

    `toes` are those that were captured, of which the truth tells; NaN, or none, where they were
    not. The feet that are drawn point where the knees do.
    """
    stage = replace(set_stage(points, fps, options), toes=toes)
    film_stage(stage, fps, options, out, progress)


def film_stage(
    stage: Stage, fps: float, options: SceneOptions, out: Path, progress: Progress = silent
) -> None:
    """Draw all frames of a stage and write video, truth, picks and scene into a folder."""
    make_folder(out)
    frames = len(stage.points)
    chosen = {round(share * (frames - 1)) for share in (0.1, 0.5, 0.9)}
    picks: list[Pick] = []
    visible, club = np.zeros((frames, len(LSP14.names)), bool), np.zeros(frames)

    def pictures() -> Iterator[np.ndarray]:
        drawn = _draw_all(stage, options.workers or cpu_count() or 1, chosen)
        for t, frame in enumerate(progress(drawn, "Drawing", frames)):
            visible[t], club[t] = frame.visible, frame.club
            if t in chosen:
                picks.extend(click_parts(frame.parts, t))
            yield frame.picture

    write_video(out / "video.mp4", pictures(), fps, options.crf)
    write_truth(out / "truth.npz", stage, fps, (visible, club))
    write_picks(out / "picks.json", picks)
    scene = {"options": asdict(options), "look": asdict(stage.look), "fps": fps}
    (out / "scene.json").write_text(json.dumps(scene, indent=2, default=str) + "\n")


_stage: Stage | None = None


def _enter(stage: Stage) -> None:
    """Keep the stage in a worker process, so that it travels once."""
    belong_to_parent()
    global _stage
    _stage = stage
    cv2.setNumThreads(1)


def _draw_chunk(frames: range, labelled: frozenset[int]) -> list[Frame]:
    if _stage is None:
        raise RuntimeError("a worker draws only after _enter gave it the stage")
    return [_without_labels(draw_frame(_stage, t), t in labelled) for t in frames]


def _without_labels(frame: Frame, keep: bool) -> Frame:
    """Spare the process boundary the part labels that nobody reads."""
    return frame if keep else replace(frame, parts=frame.parts[:0])


def _draw_all(stage: Stage, workers: int, labelled: set[int]) -> Iterator[Frame]:
    """All frames in order, drawn by several processes that stay a little ahead."""
    frames = len(stage.points)
    if workers == 1 or frames < 32:
        yield from (draw_frame(stage, t) for t in range(frames))
        return
    chunks = [range(t, min(t + 8, frames)) for t in range(0, frames, 8)]
    draw = partial(_draw_chunk, labelled=frozenset(labelled))
    with ProcessPoolExecutor(workers, get_context("spawn"), _enter, (stage,)) as pool:
        ahead = 2 * workers
        waiting = [pool.submit(draw, c) for c in chunks[:ahead]]
        for following in range(ahead, len(chunks) + ahead):
            if not waiting:
                return
            yield from waiting.pop(0).result()
            if following < len(chunks):
                waiting.append(pool.submit(draw, chunks[following]))


def write_truth(path: Path, stage: Stage, fps: float, seen: tuple[np.ndarray, np.ndarray]) -> None:
    """Joints in each frame's camera axes, on the court (metres) and in pixels, and the camera they
    are seen by.

    `seen` tells in every frame which joints are visible, and how much of the racket or club.
    """
    move, toes = stage.move, _toes(stage)
    ankles = stage.points[:, [LSP14.index(f"{side}_ankle") for side in ("right", "left")]]
    np.savez(
        path,
        points3d=move.to_camera(stage.points),
        points2d=move.project(stage.points),
        points3d_world=on_court(stage.points, move.center),
        joint_names=np.array(LSP14.names),
        fps=fps,
        toes3d=move.to_camera(toes),
        contact=find_contacts(ankles, toes, fps),
        visible=seen[0],
        club_visible=seen[1],
        height_m=stage.pointers.stature,
        focal=move.focal,
        rotation=move.rotation,
        center=move.center,
        principal=move.principal,
    )


def _toes(stage: Stage) -> Float[np.ndarray, "T 2 3"]:
    """Right and left toes in the world: captured ones, else those of the feet that are drawn."""
    if stage.toes is not None and np.isfinite(stage.toes).all():
        return stage.toes
    ankles = stage.points[:, [LSP14.index(f"{side}_ankle") for side in ("right", "left")]]
    return ankles + FOOT_LENGTH * stage.pointers.stature / STATURE * stage.pointers.toes


_CLICKS: dict[str, tuple[Sequence[str], ...]] = {
    "head": (("hair", "face"),),
    "foot": (("right_shoe",), ("left_shoe",)),
    "shirt": (("shirt",),),
    "shorts": (("shorts",),),
    "skin": (("skin",),),
    "hair": (("hair",),),
}
SMALLEST = 1.6
"""px from the edge of a part within which nobody clicks."""


def click_parts(parts: np.ndarray, frame: int) -> list[Pick]:
    """The point deepest inside every visible part, as a careful person clicks it."""
    picks = []
    for name, places in _CLICKS.items():
        for members in places:
            mask = np.isin(parts, [PARTS.index(m) for m in members])
            depth = cv2.distanceTransform(np.pad(mask, 1).astype(np.uint8), cv2.DIST_L2, 5)
            y, x = np.unravel_index(depth.argmax(), depth.shape)
            if depth[y, x] > SMALLEST:
                picks.append(Pick(frame, name, float(x - 1), float(y - 1)))
    return picks
