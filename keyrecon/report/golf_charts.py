"""What is measured of one swing, or of two aligned at their key postures, over the frames.

The horizontal axis counts frames of the first swing. The second is drawn where it stands in the
same posture: between two key postures its time is stretched evenly.
"""

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go
from jaxtyping import Float

from keyrecon.golf.records import RecordedSwing
from keyrecon.report.charts import stack_charts, style_chart
from keyrecon.report.golf_measures import KEY_NAMES, Curve, SwingMeasures
from keyrecon.report.markup import data_block

GROUPS = (
    ("turns", "Turn from the address", (
        ("shoulder_turn", "var(--right)"), ("hip_turn", "var(--left)"),
        ("x_factor", "var(--trunk)"),
    )),
    ("spine", "Spine against the vertical", (
        ("spine_ahead", "var(--right)"), ("spine_aside", "var(--left)"),
    )),
    ("sway", "Moved since the address", (
        ("hip_sway", "var(--right)"), ("hip_lift", "var(--left)"),
        ("head_sway", "var(--annotated)"), ("head_lift", "var(--refined)"),
    )),
)  # fmt: skip
"""Charts, and the curves in each with their colours."""
HEIGHT = 300


def curve_charts(
    swings: Sequence[RecordedSwing], measures: Sequence[SwingMeasures], names: Sequence[str] = ("",)
) -> list[str]:
    """All charts of one swing, or of two in the frames of the first."""
    frames = [np.arange(len(swings[0].motion.time), dtype=float)]
    frames += [align_frames(swings[0], swing) for swing in swings[1:]]
    charts = []
    for chart, title, curves in GROUPS:
        unit = measures[0].curve(curves[0][0]).unit
        figure = stack_charts((f"{title}, {unit}",), len(frames[0]))
        for number, (at, of_swing, name) in enumerate(zip(frames, measures, names, strict=True)):
            for curve, color in curves:
                _add_curve(figure, at, of_swing.curve(curve), color, (number, name))
        for key in swings[0].keys[np.isfinite(swings[0].keys)]:
            figure.add_vline(x=float(key), line={"width": 1, "color": "var(--rule)"})
        figure.update_xaxes(
            tickvals=swings[0].keys.round(1).tolist(), ticktext=list(KEY_NAMES), title_text=""
        )
        charts.append(follow_chart(chart, style_chart(figure, HEIGHT)))
    return charts


def align_frames(first: RecordedSwing, second: RecordedSwing) -> Float[np.ndarray, "T"]:
    """The frame of the first swing at which every frame of the second is to be shown."""
    frames = np.arange(len(second.motion.time), dtype=float)
    pace = first.motion.fps / second.motion.fps
    inside = np.interp(frames, second.keys, first.keys)
    before = np.minimum(frames - second.keys[0], 0) * pace
    after = np.maximum(frames - second.keys[3], 0) * pace
    aligned: Float[np.ndarray, "T"] = inside + before + after
    return aligned


def _add_curve(
    figure: go.Figure,
    frames: Float[np.ndarray, "T"],
    curve: Curve,
    color: str,
    swing: tuple[int, str],
) -> None:
    """A line with the band of its usual error; the second swing's is dashed, without a band."""
    number, name = swing
    label = f"{curve.label} {name}".strip()
    if number == 0:
        known = np.isfinite(curve.values)  # a band is filled in one piece
        over, under = curve.values + curve.error, curve.values - curve.error
        over, under, inside = over[known], under[known], frames[known]
        figure.add_scatter(
            x=np.concatenate([inside, inside[::-1]]),
            y=np.concatenate([over, under[::-1]]).round(1),
            fill="toself", fillcolor=color, opacity=0.10, line={"width": 0}, hoverinfo="skip",
            showlegend=False, mode="lines",
        )  # fmt: skip
    figure.add_scatter(
        x=frames.round(2), y=curve.values.round(1), name=label, mode="lines",
        line={"width": 2, "color": color, "dash": "dash" if number else "solid"},
    )  # fmt: skip


def follow_chart(name: str, figure: go.Figure) -> str:
    """A chart over the frames, with the page's cursor."""
    return _chart(name, figure, " data-follows")


def plain_chart(name: str, figure: go.Figure) -> str:
    """A chart of something else."""
    return _chart(name, figure, "")


def _chart(name: str, figure: go.Figure, more: str) -> str:
    block = data_block(f"chart-{name}", figure.to_json())
    height = figure.layout.height
    return (
        f'<div class="chart" data-chart="{name}"{more} style="min-height:{height}px"></div>{block}'
    )
