"""Marks that tennis needs, against the minutes of it that are filmed.

    python benchmarks/marks_needed.py OUT [--minutes 0.5 2 8 30]

One player plays the built-in tennis (serves and rallies, no two strokes alike) at 25 frames a
second before a camera that follows. Rendering half an hour and following the player through it
takes hours, so what the stages before the comparison make is drawn instead: the parts of the
figure at the size of the crops, their contours as edge elements, and the true track. From there
on everything is as in a video: frames are compared, and keyframes chosen. Prints the marks that
reach the coverage at the sufficient distance beside those that 1.5 % of the frames would be, and
writes `marks_needed.html`. An interrupted run goes on where it stopped.
"""

import argparse
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import plotly.graph_objects as go

from keyrecon.io.stages import StageStore
from keyrecon.io.storage import load_record, save_record
from keyrecon.keyframes.distance_matrix import compare_frames
from keyrecon.keyframes.selection import KeyframeOptions, choose_keyframes, count_labels
from keyrecon.records import Edges, Keyframes, Track
from keyrecon.segmentation.contours import OVERLAP, WAIST_SHARE, EdgeOptions, trace_edges
from keyrecon.synthetic.cameras import CameraPlanOptions, View
from keyrecon.synthetic.figure import PARTS, joint
from keyrecon.synthetic.motion import MotionOptions, play_tennis
from keyrecon.synthetic.raster import Solids, draw_solids
from keyrecon.synthetic.sequence import SceneOptions, set_stage
from keyrecon.synthetic.stage import Stage, pose_figure
from keyrecon.timeline import join_frames, take_frames

FPS = 25.0
LONGEST = 30.0
"""Minutes that are played: shorter videos are its beginning."""
HEAD_TO_FEET = 0.87
"""From the centre of the head to the ankles, statures."""
CHUNK = 1500
"""Frames that are drawn and stored together: an interrupted run goes on there."""
COLORS = {
    "skin": 1, "face": 1, "hair": 2, "shirt": 3, "sleeve": 3, "shorts": 4,
    "right_shoe": 5, "left_shoe": 5, "sock": 5,
}  # fmt: skip
"""Label of each part that a player's colours tell apart."""
LABELS = np.array([COLORS.get(part, 0) for part in PARTS], np.uint8)


def draw_edges(stage: Stage, frames: range) -> tuple[tuple[Edges, ...], Track]:
    """What tracking and tracing would make of some frames."""
    pixels = stage.move.project(stage.points)[frames.start : frames.stop]
    head = (joint(pixels, "head_top") + joint(pixels, "neck")) / 2
    feet = np.stack([joint(pixels, f"{side}_ankle") for side in ("right", "left")], axis=1)
    options = EdgeOptions()
    depth = stage.move.to_camera(stage.points)[frames.start : frames.stop, :, 2].mean(axis=1)
    focal = stage.move.focal[frames.start : frames.stop]
    height = HEAD_TO_FEET * stage.pointers.stature * focal / depth
    solids = pose_figure(stage, np.arange(frames.start, frames.stop, dtype=float))
    found = []
    for row, t in enumerate(frames):
        rotation = stage.move.rotation[t]
        local = Solids(
            stage.in_camera(solids.start[row], t), stage.in_camera(solids.end[row], t),
            solids.side[row] @ rotation.T, solids.radii, solids.squeeze, solids.open_end,
        )  # fmt: skip
        surface = draw_solids(local, float(focal[row]), stage.move.principal, stage.move.size)
        labels = np.zeros((4, 4), np.uint8)
        if surface is not None:
            hit = surface.solid >= 0
            labels = np.zeros(surface.solid.shape, np.uint8)
            labels[hit] = LABELS[solids.part[surface.solid[hit]]]
            labels = np.pad(labels, 4)
        corner = (0, 0) if surface is None else (surface.left - 4, surface.top - 4)
        elements = trace_edges(labels, replace(options, player=round(float(height[row]))))
        points = elements.points + corner
        way = feet[row].mean(axis=0) - head[row]
        share = (points - head[row]) @ way / max(float(way @ way), 1e-9)
        upper, lower = share < WAIST_SHARE + OVERLAP / 2, share > WAIST_SHARE - OVERLAP / 2
        found.append(
            Edges(points.astype(np.float32), elements.tangent.astype(np.float32),
                  elements.color.astype(np.int64), upper, lower)
        )  # fmt: skip
    count = len(frames)
    box = np.concatenate([head - 1, head + 1], axis=1)
    return tuple(found), Track(head, feet, height, box, np.ones(count))


def film(folder: Path, n_frames: int) -> tuple[tuple[Edges, ...], Track]:
    """Edges and track of the first frames of what is played, drawn or found in `folder`."""
    edges: list[Edges] = []
    tracks: list[Track] = []
    for first in range(0, n_frames, CHUNK):
        path = folder / f"edges-{first}.npz"
        if not path.is_file():
            save_record(path, draw_edges(set_court(), range(first, min(first + CHUNK, n_frames))))
        own, track = load_record(path)
        edges += own
        tracks.append(track)
    track = join_frames(tracks)
    return tuple(edges[:n_frames]), take_frames(track, slice(n_frames))


@cache
def set_court() -> Stage:
    """Tennis before a camera that follows, the player as tall in the picture as in the crops."""
    points = play_tennis(MotionOptions(60 * LONGEST, FPS, seed=3))
    player = EdgeOptions().player / HEAD_TO_FEET
    camera = CameraPlanOptions(view=View.BACK, pan=True, width=384, height=216, player_px=player)
    return set_stage(points, FPS, SceneOptions(seed=3, camera=camera))


def measure(folder: Path, minutes: float, store: StageStore) -> Keyframes:
    """The keyframes of the first minutes."""
    edges, track = film(folder, round(60 * FPS * minutes))
    distances = store.keep("compare", compare_frames, edges, track)
    return store.keep("keyframes", choose_keyframes, distances, FPS)


def show(minutes: float, found: Keyframes) -> float:
    """One line of the table; the share of the frames to mark."""
    frames = len(found.upper.nearest)
    labels = len(found.upper.frames) + len(found.lower.frames)
    limit = count_labels(KeyframeOptions(budget=0.015), frames, FPS)
    gains = [half.gains for half in (found.upper, found.lower)]
    covered = " ".join(f"{one.coverage[-1]:7.1%}{one.next_gain:+7.2%}" for one in gains if one)
    print(
        f"{minutes:7.1f}{frames:8}{limit / 2:9.1f}{labels / 2:9.1f}{labels / 2 / frames:8.2%} "
        f"{found.upper.beta:8.4f}{found.lower.beta:8.4f} {covered}",
        flush=True,
    )
    return labels / 2 / frames


def plot(minutes: list[float], shares: list[float], path: Path) -> None:
    """Share of the frames to mark against minutes."""
    figure = go.Figure(go.Scatter(x=minutes, y=[100 * s for s in shares], mode="lines+markers"))
    figure.update_layout(
        xaxis={"type": "log", "title": "minutes of tennis"},
        yaxis={"type": "log", "title": "frames to mark, %"},
    )
    figure.write_html(path)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--minutes", nargs="+", type=float, default=[0.5, 2, 8, 30])
    words = parser.parse_args()
    words.out.mkdir(parents=True, exist_ok=True)
    store = StageStore(words.out / "cache")
    print("minutes  frames  1.5 %   needed   share  beta: upper   lower  covered, one more brings")
    shares = [show(m, measure(words.out, m, store)) for m in words.minutes]
    plot(words.minutes, shares, words.out / "marks_needed.html")


if __name__ == "__main__":
    main()
