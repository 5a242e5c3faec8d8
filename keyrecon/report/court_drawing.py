"""Court or ground drawn on a frame, so that a wrong camera is seen at a glance."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from keyrecon.io.durable import write_durably
from keyrecon.records import Motion
from keyrecon.report.drawing import LEFT, RIGHT
from keyrecon.world.court import HALF_DOUBLES, HALF_LENGTH, CourtModel, tennis_court
from keyrecon.world.records import COURT, Origin, WorldCamera, WorldMotion

GROUND, NET = (255, 40, 120), (0, 220, 255)
"""Colours of the lines on the ground and of the net's tape: neither is found on courts."""
WAY, STANCE = (255, 225, 60), 0.16
"""Colour of the way, and radius of the ring about a standing foot, metres."""
RECENT, FAINT = 2.0, 0.4
"""Seconds of the way that are drawn in full, and how much of the rest is seen."""
SURFACE, SURROUND = (52, 84, 138), (64, 106, 88)
PER_METRE, BESIDE = 28, 4.5
"""px per metre of the court from above, and metres shown beside it at least."""
AROUND, WORDS = 1.0, 76
"""Metres shown about the way, and px that the words take above it."""
GRID, ABOUT, LEAST_PICTURE = (128, 160, 146), 3, 640
"""Colour of squares of a metre, how many there are about the way, and px of the longer side."""
PAINT, PIECE = (245, 245, 245), 0.25
"""Colour of lines from aside, and metres of them that are drawn, or left out, as a whole."""
Projection = Callable[[Float[np.ndarray, "n 3"]], Float[np.ndarray, "n 2"]]
SUBPIXEL = 4
QUALITY = 92


def draw_court(
    picture: UInt8[np.ndarray, "h w 3"],
    camera: WorldCamera,
    frame: int,
    court: CourtModel | None = None,
) -> UInt8[np.ndarray, "h w 3"]:
    """A copy of the picture with the model's lines; as it is where the camera was not found."""
    drawn = picture.copy()
    if not camera.found[frame]:
        return drawn
    court = court or tennis_court()
    pixels = camera.project(frame, court.points)
    limit = 4 * max(picture.shape)
    usable = np.isfinite(pixels).all(axis=1) & (np.abs(np.nan_to_num(pixels)) < limit).all(axis=1)
    thick = max(1, round(picture.shape[1] / 1280))
    for number in range(len(court.names)):
        of_line = np.flatnonzero((court.line == number) & usable)
        if len(of_line) < 2:
            continue
        way = np.rint(pixels[of_line] * 2**SUBPIXEL).astype(np.int32)
        color = NET if court.ends[number, :, 2].any() else GROUND
        cv2.polylines(drawn, [way[:, None]], False, color, thick, cv2.LINE_AA, SUBPIXEL)
    return drawn


def draw_grid(
    picture: UInt8[np.ndarray, "h w 3"], camera: WorldCamera, frame: int, height: float
) -> UInt8[np.ndarray, "h w 3"]:
    """A copy of the picture with squares of a metre about the origin, and a post at it."""
    drawn = picture.copy()
    thick = max(1, round(picture.shape[1] / 1280))
    for start, end in metre_grid(np.zeros((1, 2))):
        _draw_line(drawn, camera.project(frame, np.linspace(start, end, 41)), GROUND, thick)
    post = np.linspace([0, 0, 0], [0, 0, height], 11)
    _draw_line(drawn, camera.project(frame, post), NET, 2 * thick)
    return drawn


def metre_grid(places: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "L 2 3"]:
    """Lines on whole metres about some places, both ends of each."""
    known = places[np.isfinite(places).all(axis=1)]
    low, high = np.floor(known.min(axis=0)) - ABOUT, np.ceil(known.max(axis=0)) + ABOUT
    across = [[[low[0], y, 0], [high[0], y, 0]] for y in np.arange(low[1], high[1] + 1)]
    along = [[[x, low[1], 0], [x, high[1], 0]] for x in np.arange(low[0], high[0] + 1)]
    return np.array(across + along)


def draw_way(
    world: WorldMotion,
    motion: Motion,
    speed: Float[np.ndarray, "T"],
    title: str,
    origin: Origin = COURT,
) -> UInt8[np.ndarray, "h w 3"]:
    """The court from above, to scale, with the way of the root coloured by its speed.

    The near half is below, as the camera sees it; frames without a place are left out, and no line
    leads from one shot to the next. Without a court there are squares of a metre.
    """
    on_court, root = origin == COURT, world.root
    lines = tennis_court().ends if on_court else metre_grid(root[:, :2])
    half = np.array([HALF_DOUBLES, HALF_LENGTH])
    low, high = _shown(root[:, :2], half)
    if not on_court:
        low, high = lines[..., :2].min(axis=(0, 1)), lines[..., :2].max(axis=(0, 1))
    scale = max(PER_METRE, LEAST_PICTURE / float((high - low).max()))
    shape = np.ceil((high - low)[::-1] * scale).astype(int)
    picture = np.full((*shape, 3), SURROUND, np.uint8)

    def pixel(place: Float[np.ndarray, "n 2"]) -> np.ndarray:
        way = (place - [low[0], high[1]]) * [1, -1] * scale
        return np.rint(way * 2**SUBPIXEL).astype(np.int32)

    if on_court:
        corners = pixel(np.array([-half, half])) >> SUBPIXEL
        cv2.rectangle(picture, corners[0].tolist(), corners[1].tolist(), SURFACE, -1)
    for ends in lines:
        color = NET if ends[:, 2].any() else (245, 245, 245) if on_court else GRID
        a, b = pixel(ends[:, :2]).tolist()
        cv2.line(picture, a, b, color, 2 if on_court else 1, cv2.LINE_AA, SUBPIXEL)
    top = max(float(np.nanmax(speed)), 1e-6)
    share = np.nan_to_num(255 * speed / top).astype(np.uint8)
    colors = cv2.applyColorMap(share[:, None], cv2.COLORMAP_VIRIDIS)[:, 0, ::-1]
    shown = np.isfinite(root).all(axis=1)
    places = pixel(np.nan_to_num(root[:, :2]))
    for part in motion.stretches:
        for t in range(part.start, part.stop - 1):
            if shown[t] and shown[t + 1]:
                a, b, color = places[t].tolist(), places[t + 1].tolist(), colors[t].tolist()
                cv2.line(picture, a, b, color, 3, cv2.LINE_AA, SUBPIXEL)
    font = cv2.FONT_HERSHEY_SIMPLEX
    cv2.putText(picture, title, (16, 34), font, 0.75, (255, 255, 255), 2, cv2.LINE_AA)
    words = f"from dark (0) to yellow ({top:.1f} m/s)"
    cv2.putText(picture, words, (16, 62), font, 0.55, (255, 255, 255), 1, cv2.LINE_AA)
    return picture


def _shown(
    places: Float[np.ndarray, "T 2"], half: Float[np.ndarray, "2"]
) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2"]]:
    """Corners of what is shown: the court with room, and all of the way, clear of the words."""
    known = places[np.isfinite(places).all(axis=1)]
    low, high = (-half - BESIDE, half + BESIDE)
    if len(known):
        low = np.minimum(low, known.min(axis=0) - AROUND)
        high = np.maximum(high, known.max(axis=0) + np.array((AROUND, AROUND + WORDS / PER_METRE)))
    return low, high


def draw_ground(
    picture: UInt8[np.ndarray, "h w 3"],
    court: tuple[WorldMotion, WorldCamera],
    motion: Motion,
    frame: int,
) -> UInt8[np.ndarray, "h w 3"]:
    """A copy of the picture with the court's lines, the way so far and rings about standing feet.

    The way lies on the ground under the middle of the hips. As it is where the court is not seen.
    """
    world, camera = court
    drawn = draw_court(picture, camera, frame) if camera.origin == COURT else picture.copy()
    if frame >= len(camera.found) or not camera.found[frame]:
        return drawn
    _draw_way_so_far(drawn, lambda points: camera.project(frame, points), world, motion, frame)
    return drawn


def draw_ground_beside(
    pane: UInt8[np.ndarray, "h w 3"],
    project: Projection,
    court: tuple[WorldMotion, WorldCamera],
    motion: Motion,
    frame: int,
) -> None:
    """Draw the court's lines, or squares of a metre, way and standing feet into a view from aside.

    `project` takes points in the world to the view's px.
    """
    world, camera = court
    on_court = camera.origin == COURT
    lines = tennis_court().ends if on_court else metre_grid(world.root[:, :2])
    for start, end in lines:
        count = 2 + int(np.linalg.norm(end - start) / PIECE)
        color = NET if start[2] else PAINT if on_court else GRID
        _draw_line(pane, project(np.linspace(start, end, count)), color, 2 if on_court else 1)
    _draw_way_so_far(pane, project, world, motion, frame)


def _draw_way_so_far(
    drawn: UInt8[np.ndarray, "h w 3"],
    project: Projection,
    world: WorldMotion,
    motion: Motion,
    frame: int,
) -> None:
    """Draw the way up to a frame, and rings about the feet that stand there."""
    thick = max(1, round(drawn.shape[1] / 640))
    ground, recent = world.root * [1, 1, 0], motion.time > motion.time[frame] - RECENT
    so_far = [slice(part.start, min(part.stop, frame + 1)) for part in motion.stretches]
    faint = drawn.copy()
    for part in so_far:
        _draw_line(faint, project(ground[part]), WAY, thick)
    cv2.addWeighted(faint, FAINT, drawn, 1 - FAINT, 0, dst=drawn)
    for part in so_far:
        _draw_line(drawn, project(ground[part][recent[part]]), WAY, thick)
    turn = np.linspace(0, 2 * np.pi, 25)
    ring = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(25)]) * STANCE
    for foot, (side, color) in enumerate((("right", RIGHT), ("left", LEFT))):
        ankle = world.points[frame, motion.skeleton.index(f"{side}_ankle")] * [1, 1, 0]
        if world.contact[frame, foot]:
            _draw_line(drawn, project(ankle + ring), color, thick + 1)


def _draw_line(
    picture: UInt8[np.ndarray, "h w 3"],
    pixels: Float[np.ndarray, "n 2"],
    color: tuple[int, int, int],
    thick: int,
) -> None:
    """Draw into the picture; gaps and what is far outside are left out."""
    limit = 4 * max(picture.shape)
    usable = np.isfinite(pixels).all(axis=1) & (np.abs(np.nan_to_num(pixels)) < limit).all(axis=1)
    places = np.rint(np.where(usable[:, None], pixels, 0) * 2**SUBPIXEL).astype(np.int32)
    for k in np.flatnonzero(usable[1:] & usable[:-1]):
        a, b = places[k].tolist(), places[k + 1].tolist()
        cv2.line(picture, a, b, color, thick, cv2.LINE_AA, SUBPIXEL)


def write_court_picture(path: Path, picture: UInt8[np.ndarray, "h w 3"]) -> None:
    """Write an RGB picture as JPEG."""
    turned = cv2.cvtColor(picture, cv2.COLOR_RGB2BGR)
    encoded = cv2.imencode(".jpg", turned, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1]
    write_durably(path, encoded.tobytes())
