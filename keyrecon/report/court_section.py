"""The player on the court: the way from above, and what it amounts to in numbers.

The map and the figure on its court are drawn by `court.js` and `figure.js` from the numbers that
`court_numbers` gives them.
"""

import numpy as np
import plotly.graph_objects as go
from jaxtyping import Float
from scipy.ndimage import gaussian_filter

from keyrecon.records import Motion
from keyrecon.report.charts import break_at_cuts, stack_charts, style_chart
from keyrecon.report.court_drawing import metre_grid
from keyrecon.report.markup import ReportMaterial, note, pack, section, text, thinning
from keyrecon.world.court import HALF_DOUBLES, HALF_LENGTH, tennis_court
from keyrecon.world.records import COURT, Origin, WorldCamera, WorldMotion
from keyrecon.world.run_measures import (
    ON_BASELINE,
    ZONES,
    RunMeasures,
    frame_seconds,
    measure_run,
)

BESIDE, BEYOND_NET = 3.7, 1.0
"""Metres shown beside the court and behind it, and beyond the net."""
CELL, SPREAD = 0.25, 0.35
"""Side of a cell of the heat map, and the standard deviation it is smoothed with, metres."""
VIEWS = (
    ("Camera", "camera"),
    ("Umpire", "umpire"),
    ("Above", "above"),
    ("Behind the opponent", "opponent"),
)
"""From where the figure on the court can be seen."""
COURT_EYES = ("umpire", "opponent")
"""Those that there are on a court alone."""
UMPIRE, OPPONENT = (-HALF_DOUBLES - 1.8, 0.0, 2.4), (0.0, HALF_LENGTH + 4.0, 2.5)
"""Eyes of an umpire in the chair and of somebody behind the opponent, metres; x and y are mirrored
for a player on the far half."""


def court_section(material: ReportMaterial, chart: str) -> str:
    """The way on the court; empty where it is not known. `chart` is that of `run_chart`."""
    if material.court is None or (way := measure_run(material.court[0], material.motion)) is None:
        return ""
    place = material.court[1].origin
    on_court = place == COURT
    tiles = "".join(
        f"<div><dt>{text(name)}</dt><dd>{text(value)}<small>{text(more)}</small></dd></div>"
        for name, value, more in (*_pace(way, place), *(_whereabouts(way) if on_court else []))
    )
    buttons = "".join(
        f'<button type="button" data-map="{kind}">{name}</button>'
        for kind, name in (("speed", "Speed"), ("time", "Time"), ("heat", "Where most"))
    )
    return section(
        "court",
        f"On the {place}",
        note(
            f"The {place} from above, to scale, the camera's end below"
            f"{'' if on_court else ', in squares of a metre'}; where the middle of the hips "
            "is over the ground. Press the way to go to a frame. &plusmn; is the standard error on "
            "rendered rallies whose truth is known, of walks and short steps, which come out short "
            "rather than long; the camera's own is "
            f"{_camera_error(material.court[1]):.2f} m"
            + (
                f". On the baseline is within {ON_BASELINE} m of it, with the hips."
                if on_court
                else f", and lengths away from the camera are off by {_focal_error(material):.0%} "
                "besides."
            )
        ),
        f'<dl class="cards">{tiles}</dl>',
        f'<div class="views-bar">{buttons}<output id="court-now"></output></div>'
        f'<canvas id="court-map" tabindex="0" aria-label="The {place} from above with the way of '
        'the player"></canvas>',
        chart,
    )


def _pace(way: RunMeasures, place: Origin) -> tuple[tuple[str, str, str], ...]:
    speed, turn = way.top_speed, way.top_acceleration
    known = f"in {way.known_seconds:.1f} s on the {place}"
    return (
        ("Distance", f"{way.length.value:.1f} m", f"\u00b1 {way.length.sd:.1f} m, {known}"),
        (
            "Top speed",
            f"{speed.value:.1f} m/s",
            f"\u00b1 {speed.sd:.2f} m/s, {3.6 * speed.value:.0f} km/h, mean of half a second",
        ),
        (
            "Top acceleration",
            f"{turn.value:.1f} m/s\u00b2",
            f"\u00b1 {turn.sd:.1f} m/s\u00b2, starting, stopping or turning",
        ),
    )


def _whereabouts(way: RunMeasures) -> list[tuple[str, str, str]]:
    total = max(way.known_seconds, 1e-9)
    return [
        (zone[:1].upper() + zone[1:], f"{seconds / total:.0%}", f"of the time, {seconds:.1f} s")
        for zone, seconds in zip(ZONES, way.seconds, strict=True)
    ]


def _camera_error(camera: WorldCamera) -> float:
    """Standard deviation of the camera's place, the largest of all frames, metres."""
    return float(np.linalg.norm(camera.sd_centre[camera.found], axis=1).max())


def _focal_error(material: ReportMaterial) -> float:
    """Spread of the focal length, which stretches the way away from the camera."""
    camera = material.court[1] if material.court else None
    return float(np.nanmax(camera.sd_focal / camera.focal)) if camera else 0.0


def run_chart(material: ReportMaterial) -> go.Figure | None:
    """Speed and acceleration over the frames; None where the way is not known."""
    if material.court is None or (way := measure_run(material.court[0], material.motion)) is None:
        return None
    titles = (f"Speed over the {material.court[1].origin}, m/s", "Acceleration, m/s²")
    figure = stack_charts(titles, len(way.speed))
    for row, values in enumerate((way.speed, way.acceleration), start=1):
        places, broken = break_at_cuts(values.astype(np.float32).round(3), material.motion.cuts)
        figure.add_scatter(
            x=places,
            y=broken,
            row=row,
            col=1,
            mode="lines",
            line={"width": 1.6, "color": "var(--accent)"},
        )
    figure.update_yaxes(rangemode="tozero")
    return style_chart(figure, 380, legend=False)


def view_buttons(material: ReportMaterial) -> str:
    """Buttons from where the figure on the court is seen; empty without one."""
    if material.court is None:
        return ""
    buttons = "".join(
        f'<button type="button" data-eye="{eye}">{name}</button>'
        for name, eye in VIEWS
        if material.court[1].origin == COURT or eye not in COURT_EYES
    )
    return (
        f'<span class="on-court">{buttons}</span>'
        '<label><input type="checkbox" id="on-court" checked> on the '
        f"{material.court[1].origin}</label>"
    )


def court_numbers(material: ReportMaterial) -> dict[str, object] | None:
    """What the page's scripts draw the court from, metres on it; None without one."""
    if material.court is None or (way := measure_run(material.court[0], material.motion)) is None:
        return None
    world, camera = material.court
    on_court = camera.origin == COURT
    ends = tennis_court().ends if on_court else metre_grid(world.root[:, :2])
    half = -1.0 if np.nanmedian(world.root[:, 1]) <= 0 else 1.0
    frame = _map_frame(world.root) if on_court else _around(ends)
    every = thinning(len(world.points))
    return {
        "lines": ends.round(3).tolist(),
        "points": pack(world.points, every),
        "root": pack(world.root[:, :2], every),
        "speed": pack(way.speed, every),
        "contact": pack(world.contact.astype(float), every),
        "feet": _feet(material.motion),
        "camera": pack(camera.centre, every),
        "origin": camera.origin,
        "umpire": list(UMPIRE) if on_court else None,
        "opponent": [OPPONENT[0], -half * OPPONENT[1], OPPONENT[2]] if on_court else None,
        "surface": [HALF_DOUBLES, HALF_LENGTH] if on_court else None,
        "frame": frame,
        "heat": {"cell": CELL, "seconds": pack(_heat(world, material.motion, frame))},
    }


def _feet(motion: Motion) -> list[int]:
    return [motion.skeleton.index(f"{side}_ankle") for side in ("right", "left")]


def _map_frame(root: Float[np.ndarray, "T 3"]) -> list[float]:
    """Left, near, right and far edge of the map: the half that the player keeps to, or all."""
    wide, long = HALF_DOUBLES + BESIDE, HALF_LENGTH + BESIDE
    low, high = np.nanmin(root[:, 1]), np.nanmax(root[:, 1])
    near = -max(long, 1.0 - low) if low < 0 else -BEYOND_NET
    far = max(long, high + 1.0) if high > 0 else BEYOND_NET
    across = max(wide, float(np.nanmax(np.abs(root[:, 0]))) + 1.0)
    return [float(v) for v in (-across, near, across, far)]


def _around(lines: Float[np.ndarray, "L 2 3"]) -> list[float]:
    """Left, near, right and far edge of a grid."""
    low, high = lines[..., :2].min(axis=(0, 1)), lines[..., :2].max(axis=(0, 1))
    return [float(v) for v in (*low, *high)]


def _heat(
    world: WorldMotion, motion: Motion, frame: list[float]
) -> Float[np.ndarray, "rows columns"]:
    """Seconds spent at every square metre of the map, from its near left corner."""
    known = np.isfinite(world.root).all(axis=1)
    places = world.root[known, :2]
    edges = [
        np.arange(low, high + CELL, CELL) for low, high in zip(frame[:2], frame[2:], strict=True)
    ]
    seconds = frame_seconds(motion)[known]
    counted, _, _ = np.histogram2d(places[:, 1], places[:, 0], edges[::-1], weights=seconds)
    return gaussian_filter(counted / CELL**2, SPREAD / CELL)
