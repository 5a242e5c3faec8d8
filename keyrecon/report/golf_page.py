"""The report of a fitted swing: one HTML file that opens without a network.

It answers in this order: the swing beside the body in space, its numbers and how far they may be
off, the key postures side by side, how the body moved, where club and hands went; and at the end
how it was made, so that whoever doubts a number can see what it came from.
"""

from importlib.resources import files
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from plotly.offline import get_plotlyjs

from keyrecon import __version__
from keyrecon.golf.records import (
    FittedSwing,
    MotionModel,
    Observations,
    RecordedSwing,
    fitted_frames,
)
from keyrecon.io.durable import write_durably
from keyrecon.io.video import Video
from keyrecon.progress import Progress, silent
from keyrecon.report.charts import stack_charts, style_chart
from keyrecon.report.golf_charts import curve_charts, follow_chart, plain_chart
from keyrecon.report.golf_measures import KEY_NAMES, SwingMeasures, measure_swing
from keyrecon.report.golf_pictures import key_pictures, overlay_strip, path_picture
from keyrecon.report.golf_player import cut_clip, player
from keyrecon.report.golf_tables import DOUBT_NOTE, cards, measure_table, warning
from keyrecon.report.markup import note, section, sentence, text
from keyrecon.report.page import POLICY
from keyrecon.report.scripts import bundle_scripts

MOST_COEFFICIENTS = 12
"""Coefficients drawn: those of the largest variance come first."""


def time_chart(fitted: FittedSwing, observations: Observations, model: MotionModel) -> go.Figure:
    """Normalised time against the frame (Fig. 9): first guess from the club, and fitted."""
    frames = np.arange(len(fitted.state.phase))
    figure = stack_charts(("Normalised time",), len(frames))
    figure.add_scatter(
        x=frames,
        y=observations.phase.round(4),
        name="guess from the club",
        mode="lines",
        line={"width": 1.2, "dash": "dot", "color": "var(--muted)"},
    )
    figure.add_scatter(
        x=frames,
        y=np.where(fitted_frames(fitted.motion), fitted.state.phase, np.nan).round(4),
        name="fitted",
        mode="lines",
        line={"width": 2, "color": "var(--accent)"},
    )
    figure.add_scatter(
        x=fitted.keys.round(2),
        y=model.keys.round(4),
        name="key postures",
        mode="markers+text",
        text=KEY_NAMES,
        textposition="top left",
        marker={"size": 8, "symbol": "diamond", "color": "var(--annotated)"},
    )
    figure.update_yaxes(range=[-0.05, 1.15])
    return style_chart(figure, 320)


def style_bars(fitted: FittedSwing) -> go.Figure:
    """The coefficients: how this swing differs from the mean one, in standard deviations."""
    coefficients = fitted.state.coefficients[:MOST_COEFFICIENTS]
    figure = go.Figure(
        go.Bar(x=[f"component {i + 1}" for i in range(len(coefficients))], y=coefficients.round(3),
               marker={"color": "var(--accent)"},
               hovertemplate="%{x}: %{y:.2f} standard deviations<extra></extra>")
    )  # fmt: skip
    figure.update_yaxes(title_text="standard deviations")
    return style_chart(figure, 260, legend=False)


def write_golf_report(
    path: Path,
    swing: RecordedSwing,
    fitted: FittedSwing,
    observations: Observations,
    model: MotionModel,
    video: Video,
    progress: Progress = silent,
) -> None:
    """Write the report of a swing to one HTML file; a doubtful one has no numbers."""
    measures = measure_swing(swing)
    body = "".join((
        _headline(swing, measures, video),
        section("swing", "The swing", player([swing], [cut_clip(video, swing, progress)])),
        "" if swing.doubts else _numbers(measures),
        _key_postures(swing, fitted, observations, video),
        "" if swing.doubts else _curves(swing, measures),
        _paths(fitted, observations, video),
        _strip(fitted, observations, video),
        _making(fitted, observations, model, measures),
    ))  # fmt: skip
    write_durably(path, golf_page(video.path.name, body))


def golf_page(title: str, body: str) -> str:
    """A page of one swing or of two."""
    style = "".join(
        (files("keyrecon.report") / name).read_text("utf-8") for name in ("report.css", "golf.css")
    )
    scripts = (get_plotlyjs(), bundle_scripts("golf"))
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{text(title)}: keyrecon swing report</title>"
        f"<style>{style}</style></head><body><main>{body}</main>"
        f"{''.join(f'<script>{script}</script>' for script in scripts)}</body></html>"
    )


def _headline(swing: RecordedSwing, measures: SwingMeasures, video: Video) -> str:
    """The figures that matter, first; of a doubtful fit what speaks against it instead."""
    hand = "left-handed" if swing.left_handed else "right-handed"
    return (
        f'<header><p class="kicker">keyrecon swing report</p><h1>{text(video.path.name)}</h1>'
        f'<p class="lead">{video.width} &times; {video.height} px, {len(video)} frames, '
        f"{video.fps:.4g} per second, {hand}</p>"
        f"{''.join(note(f'{sentence(t[0].upper() + t[1:])}.') for t in swing.notes)}</header>"
        f"{warning(swing.doubts)}{'' if swing.doubts else cards(measures)}"
    )


def _numbers(measures: SwingMeasures) -> str:
    doubts = f"<div><h3>Where the doubts come from</h3>{note(DOUBT_NOTE)}</div>"
    about = note("At the key postures, with one standard deviation of doubt.")
    both = f'<div class="beside">{measure_table(measures)}{doubts}</div>'
    return section("numbers", "Numbers", about, both)


def _key_postures(
    swing: RecordedSwing, fitted: FittedSwing, observations: Observations, video: Video
) -> str:
    names = [
        name if shown else f"{name} not shown"
        for name, shown in zip(KEY_NAMES, swing.shown, strict=True)
    ]
    stills = "".join(
        f'<div class="still">{_image(uri, f"{name}, frame {frame}")}'
        f"<span>{name} <small>frame {frame}</small></span>"
        f"{_image(above, f'{name} from above')}</div>"
        for name, (frame, uri, above) in zip(
            names, key_pictures(video, fitted, observations), strict=True
        )
    )
    about = note("The fitted body on the picture, and from above with the camera below.")
    return section("keys", "Key postures", about, f'<div class="strip four">{stills}</div>')


def _curves(swing: RecordedSwing, measures: SwingMeasures) -> str:
    about = note(
        "Lines with the band of their usual error. Vertical lines are address, top, hit and "
        "finish. Press a chart to go to a frame."
    )
    return section("curves", "How the body moved", about, *curve_charts([swing], [measures]))


def _paths(fitted: FittedSwing, observations: Observations, video: Video) -> str:
    about = note(
        "Lines are the fitted paths of club head (vermillion) and hands (blue), dots detections: "
        "where dots leave a line, believe the dots."
    )
    picture = _image(path_picture(video, fitted, observations), "Paths of club and hands")
    return section("paths", "Club and hands", about, f'<figure class="paths">{picture}</figure>')


def _strip(fitted: FittedSwing, observations: Observations, video: Video) -> str:
    stills = "".join(
        f'<div class="still">{_image(uri, f"Frame {frame} with the golfer")}'
        f"<span>{frame}</span></div>"
        for frame, uri in overlay_strip(video, fitted, observations)
    )
    about = note("Check the fit here: the body should lie on the player in every frame.")
    return section("fit", "The fit through the swing", about, f'<div class="strip">{stills}</div>')


def _making(
    fitted: FittedSwing, observations: Observations, model: MotionModel, measures: SwingMeasures
) -> str:
    timing = note(
        f"The club was detected in {measures.club_found:.0%} of the frames. Where in the learnt "
        "motion every frame is; the dotted line is the first guess, from the frames in which the "
        "club passes the key postures."
    )
    style = note(
        "How the swing differs from the mean of the model, in standard deviations of the swings "
        f"it was learnt from: {text(model.provenance)}. keyrecon {text(__version__)}."
    )
    charts = (
        timing, follow_chart("time", time_chart(fitted, observations, model)),
        style, plain_chart("style", style_bars(fitted)),
    )  # fmt: skip
    return section("making", "How it was made", *charts)


def _image(uri: str, about: str) -> str:
    return f'<img style="aspect-ratio:auto;width:100%" src="{uri}" alt="{text(about)}">'
