"""Charts of a swing over time, and of its style; colours are names of the page's style sheet."""

import numpy as np
import plotly.graph_objects as go

from keyrecon.golf.records import FittedSwing, MotionModel, Observations
from keyrecon.report.charts import stack_charts, style_chart
from keyrecon.report.golf_measures import SwingMeasures

KEY_NAMES = ("Beginning", "Top", "Hit", "Finish")
MOST_ALPHAS = 12
"""Components shown: those of the largest variance come first."""


def time_chart(fitted: FittedSwing, observations: Observations, model: MotionModel) -> go.Figure:
    """Normalised time against the frame (Fig. 9): first guess from the club, and fitted."""
    frames = np.arange(len(fitted.state.mu))
    figure = stack_charts(("Normalised time",), len(frames))
    figure.add_scatter(
        x=frames,
        y=observations.mu.round(4),
        name="guess from the club",
        mode="lines",
        line={"width": 1.2, "dash": "dot", "color": "var(--muted)"},
    )
    figure.add_scatter(
        x=frames,
        y=fitted.state.mu.round(4),
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
    """The alphas: how this swing differs from the mean one, in standard deviations."""
    alpha = fitted.state.alpha[:MOST_ALPHAS]
    figure = go.Figure(
        go.Bar(x=[f"alpha {i}" for i in range(1, len(alpha) + 1)], y=alpha.round(3),
               marker={"color": "var(--accent)"},
               hovertemplate="%{x}: %{y:.2f} standard deviations<extra></extra>")
    )  # fmt: skip
    figure.update_yaxes(title_text="standard deviations")
    return style_chart(figure, 260, legend=False)
