"""Charts of a swing over time, and of its style; colours are names of the page's style sheet.

The report of a fitted swing: one HTML file that opens without a network.

It answers, in this order: how the swing was timed, whether the model lies on the player, where the
club and the hands went, how shoulders and hips turned, and how the swing differs from the mean of
those that the model was learnt from.
"""

from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from plotly.offline import get_plotlyjs

from keyrecon import __version__
from keyrecon.golf.plausibility import SwingDoubt, find_doubts
from keyrecon.golf.records import FittedSwing, MotionModel, Observations
from keyrecon.io.durable import write_durably
from keyrecon.io.video import Video
from keyrecon.report.charts import stack_charts, style_chart
from keyrecon.report.golf_measures import SwingMeasures, measure_swing
from keyrecon.report.golf_pictures import key_pictures, overlay_strip, path_picture
from keyrecon.report.markup import data_block, note, number, section, text
from keyrecon.report.page import POLICY
from keyrecon.report.scripts import bundle_scripts

KEY_NAMES = ("Beginning", "Top", "Hit", "Finish")
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
        y=fitted.state.phase.round(4),
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


def turn_chart(measures: SwingMeasures, keys: np.ndarray) -> go.Figure:
    """Turns of shoulders and hips, and the X-factor, degrees."""
    frames = np.arange(len(measures.hips))
    figure = stack_charts(("Turn from the beginning of the upswing",), len(frames))
    rows = (
        ("shoulders", measures.shoulders, "var(--right)"), ("hips", measures.hips, "var(--left)"),
        ("X-factor", measures.x_factor, "var(--trunk)"),
    )  # fmt: skip
    for name, values, color in rows:
        figure.add_scatter(
            x=frames,
            y=values.round(1),
            name=name,
            mode="lines",
            line={"width": 1.8, "color": color},
        )
    for frame in keys[1:3]:
        figure.add_vline(x=float(frame), line={"width": 1, "color": "var(--annotated)"})
    figure.update_yaxes(ticksuffix="°", dtick=45)
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
    path: Path, fitted: FittedSwing, observations: Observations, model: MotionModel, video: Video
) -> None:
    """Write the report of a swing to one HTML file."""
    measures = measure_swing(fitted, observations)
    doubts = find_doubts(fitted, observations)
    body = "".join((
        _headline(fitted, measures, video, doubts),
        _key_postures(fitted, observations, video),
        _timing(fitted, observations, model),
        _strip(fitted, observations, video),
        _paths(fitted, observations, video),
        _turns(fitted, measures),
        _style(fitted, model),
    ))  # fmt: skip
    write_durably(path, _page(video.path.name, body))


def _page(title: str, body: str) -> str:
    style = (files("keyrecon.report") / "report.css").read_text("utf-8")
    scripts = (get_plotlyjs(), bundle_scripts("golf"))
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{text(title)}: keyrecon swing report</title>"
        f"<style>{style}</style></head><body><main>{body}</main>"
        f"{''.join(f'<script>{script}</script>' for script in scripts)}</body></html>"
    )


def _headline(
    fitted: FittedSwing, measures: SwingMeasures, video: Video, doubts: Sequence[SwingDoubt]
) -> str:
    """The figures that matter, first; of a doubtful fit only what speaks against it."""
    top = min(round(float(fitted.keys[1])), len(measures.hips) - 1)
    cards = [
        ("Tempo", f"{number(measures.tempo, '.1f')} : 1",
         f"{measures.upswing:.2f} s up, {measures.downswing:.2f} s down"),
        ("Shoulder turn", f"{measures.shoulders[top]:.0f}°", "at the top, about the vertical"),
        ("Hip turn", f"{measures.hips[top]:.0f}°", "at the top"),
        ("X-factor", f"{measures.x_factor[top]:.0f}°",
         f"at the top; most {measures.x_factor.max():.0f}°"),
        ("Club found", f"{measures.club_found:.0%}", "of the frames"),
    ]  # fmt: skip
    if doubts:
        cards = cards[-1:]
    tiles = "".join(
        f"<div><dt>{text(name)}</dt><dd>{text(value)}<small>{text(more)}</small></dd></div>"
        for name, value, more in cards
    )
    return (
        f'<header><p class="kicker">keyrecon swing report</p><h1>{text(video.path.name)}</h1>'
        f'<p class="lead">{video.width} &times; {video.height} px, {len(video)} frames, '
        f'{video.fps:.4g} per second</p></header>{_warning(doubts)}<dl class="cards">{tiles}</dl>'
    )


def _warning(doubts: Sequence[SwingDoubt]) -> str:
    """What cannot be overlooked: the fit does not explain the video."""
    if not doubts:
        return ""
    lines = "".join(f"<li>{text(d.text)} (frame {d.frame})</li>" for d in doubts)
    return (
        '<section class="warning" role="alert"><h2>This fit is doubtful</h2>'
        f"<ul>{lines}</ul><p>Tempo and angles are not shown, and the curves below are not "
        "measurements. Look at the fit through the swing; where the body is off, mark whole bodies "
        "on a few frames and use <code>keyrecon run --prior golf</code>.</p></section>"
    )


def _key_postures(fitted: FittedSwing, observations: Observations, video: Video) -> str:
    cards = "".join(
        f'<div class="still">{_image(uri, f"{name}, frame {frame}")}'
        f"<span>{name} <small>frame {frame}</small></span>"
        f"{_image(above, f'{name} from above')}</div>"
        for name, (frame, uri, above) in zip(
            KEY_NAMES, key_pictures(video, fitted, observations), strict=True
        )
    )
    about = note("The fitted primitives on the picture, and from above with the camera below.")
    return section("keys", "Key postures", about, f'<div class="strip four">{cards}</div>')


def _timing(fitted: FittedSwing, observations: Observations, model: MotionModel) -> str:
    about = note(
        "Where in the learnt motion every frame is. The dotted line is the first guess, from the "
        "frames in which the club passes the key postures."
    )
    chart = _chart("time", time_chart(fitted, observations, model))
    return section("timing", "Normalised time", about, chart)


def _strip(fitted: FittedSwing, observations: Observations, video: Video) -> str:
    stills = "".join(
        f'<div class="still">{_image(uri, f"Frame {frame} with the golfer")}'
        f"<span>{frame}</span></div>"
        for frame, uri in overlay_strip(video, fitted, observations)
    )
    about = note("Check the fit here: the primitives should lie on the player in every frame.")
    return section("fit", "The fit through the swing", about, f'<div class="strip">{stills}</div>')


def _paths(fitted: FittedSwing, observations: Observations, video: Video) -> str:
    about = note(
        "Lines are the fitted paths of club head (vermillion) and hands (blue), dots detections."
    )
    picture = _image(path_picture(video, fitted, observations), "Paths of club and hands")
    return section("paths", "Club and hands", about, f"<figure>{picture}</figure>")


def _turns(fitted: FittedSwing, measures: SwingMeasures) -> str:
    about = note(
        "Lines between both shoulders and both hips, turned about the vertical. From one camera "
        "the motion model has a large share in these angles."
    )
    return section("turns", "Turns", about, _chart("turns", turn_chart(measures, fitted.keys)))


def _style(fitted: FittedSwing, model: MotionModel) -> str:
    about = note(
        "How the swing differs from the mean of the model, in standard deviations of the swings "
        f"it was learnt from: {text(model.provenance)}."
    )
    made = note(f"keyrecon {text(__version__)}")
    return section("style", "Style", about, _chart("style", style_bars(fitted)), made)


def _chart(name: str, figure: go.Figure) -> str:
    block = data_block(f"chart-{name}", figure.to_json())
    height = figure.layout.height
    return f'<div class="chart" data-chart="{name}" style="min-height:{height}px"></div>{block}'


def _image(uri: str, about: str) -> str:
    return f'<img style="aspect-ratio:auto;width:100%" src="{uri}" alt="{text(about)}">'
