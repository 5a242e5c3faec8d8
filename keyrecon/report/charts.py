"""Charts over time, as plotly figures whose colours are named by the page's style sheet.

Colours are CSS variables, `var(--left)`, which the page replaces by what the light or the dark
scheme says. The horizontal axis is always the frame number, so that one cursor serves them all.
"""

from typing import Any

import numpy as np
import plotly.graph_objects as go
from jaxtyping import Float, Int, Num
from plotly.subplots import make_subplots

from keyrecon.body import Skeleton, plain_name
from keyrecon.records import SOURCES, HalfKeyframes, Keyframes, Motion, PoseDistances
from keyrecon.report.drawing import joint_sides
from keyrecon.report.markup import thinning
from keyrecon.report.summary import (
    hinge_angles,
    hinges,
    missing_shares,
    order_by_pose,
    source_shares,
)

SIDE_COLORS = ("var(--left)", "var(--right)", "var(--trunk)")
SOURCE_COLORS = ("var(--annotated)", "var(--propagated)", "var(--interpolated)", "var(--refined)")


def keyframe_chart(
    keyframes: Keyframes, comparison: PoseDistances, cuts: Int[np.ndarray, "C"] | None = None
) -> go.Figure:
    """Which keyframe stands for which frame (Fig. 6), both halves of the body."""
    figure = stack_charts(("Upper body", "Lower body"), len(comparison.row))
    halves = ((keyframes.upper, comparison.upper), (keyframes.lower, comparison.lower))
    for row, (half, distances) in enumerate(halves, start=1):
        _add_occurrence(figure, row, half, _between_keyframes(half, comparison, distances), cuts)
        figure.update_yaxes(title_text="keyframe", row=row, col=1, rangemode="tozero")
    return style_chart(figure, 460, legend=False)


def _between_keyframes(
    half: HalfKeyframes, comparison: PoseDistances, distances: Float[np.ndarray, "M M"]
) -> Float[np.ndarray, "K K"]:
    rows = comparison.row[half.frames]
    return distances[np.ix_(rows, rows)].astype(np.float64)


def _add_occurrence(
    figure: go.Figure,
    row: int,
    half: HalfKeyframes,
    between: Float[np.ndarray, "K K"],
    cuts: Int[np.ndarray, "C"] | None,
) -> None:
    """One line that jumps between keyframes; frames that none represents are hollow, and there is
    nothing where the player is not to be seen."""
    rank = np.empty(len(half.frames), dtype=np.int64)
    rank[order_by_pose(between)] = np.arange(1, len(half.frames) + 1)
    shown = np.isfinite(half.distance)
    height = np.where(shown, rank[np.searchsorted(half.frames, half.nearest)], np.float32(np.nan))
    frames = np.arange(len(height))
    hover = "frame %{x}: keyframe at frame %{customdata}<extra></extra>"
    well = half.represented | ~shown
    places, broken = break_at_cuts(height, cuts)
    figure.add_scatter(
        x=places,
        y=broken,
        customdata=break_at_cuts(half.nearest.astype(np.float32), cuts)[1],
        hovertemplate=hover,
        row=row,
        col=1,
        mode="lines",
        line={"shape": "hv", "width": 1, "color": "var(--propagated)"},
    )
    figure.add_scatter(
        x=frames[~well],
        y=height[~well],
        mode="markers",
        hoverinfo="skip",
        row=row,
        col=1,
        marker={"size": 4, "symbol": "circle-open", "color": "var(--right)"},
    )
    figure.add_scatter(
        x=half.frames,
        y=rank,
        mode="markers",
        row=row,
        col=1,
        customdata=half.frames,
        hovertemplate="keyframe at frame %{x}<extra></extra>",
        marker={"size": 8, "symbol": "diamond", "color": "var(--annotated)"},
    )


def joint_chart(frames: int, has_truth: bool) -> go.Figure:
    """An empty chart of one joint's position; the page fills in the chosen joint."""
    figure = stack_charts(("Across the picture (x), px", "Down the picture (y), px"), frames)
    for row in (1, 2):
        shown = row == 1
        traces: list[dict[str, Any]] = [
            {
                "name": "before refinement",
                "mode": "markers",
                "marker": {"size": 3.5, "color": "var(--muted)"},
            },
            {"name": "refined", "mode": "lines", "line": {"width": 2, "color": "var(--accent)"}},
        ]
        if has_truth:
            truth_line = {"width": 1.2, "dash": "dot", "color": "var(--truth)"}
            traces.append({"name": "truth", "mode": "lines", "line": truth_line})
        traces.append(
            {
                "name": "annotated",
                "mode": "markers",
                "marker": {"size": 9, "symbol": "diamond", "color": "var(--annotated)"},
            }
        )
        for trace in traces:
            figure.add_scatter(
                x=[], y=[], showlegend=shown, legendgroup=trace["name"], row=row, col=1, **trace
            )
    figure.update_yaxes(autorange="reversed", row=2, col=1)  # down the picture is down here
    return _names_below(style_chart(figure, 460))


def angle_chart(motion: Motion) -> go.Figure:
    """Bend of elbows and knees over time, degrees."""
    skeleton = motion.skeleton
    joints, sides = hinges(skeleton), joint_sides(skeleton)
    degrees = np.degrees(hinge_angles(motion.points3d, skeleton)).astype(np.float32)
    titles = list(dict.fromkeys(_pair_name(skeleton, joint) for joint in joints))
    figure = stack_charts(tuple(title.capitalize() for title in titles), len(degrees))
    for column, joint in enumerate(joints):
        row = titles.index(_pair_name(skeleton, joint)) + 1
        places, bends = break_at_cuts(degrees[:, column].round(1), motion.cuts)
        figure.add_scatter(
            x=places,
            y=bends,
            row=row,
            col=1,
            name=("left", "right", "middle")[sides[joint]],
            showlegend=row == 1,
            legendgroup=str(sides[joint]),
            mode="lines",
            line={"width": 1.6, "color": SIDE_COLORS[sides[joint]]},
        )
    figure.update_yaxes(range=[0, 185], dtick=45, ticksuffix="°")
    return style_chart(figure, 60 + 190 * len(titles))


def _pair_name(skeleton: Skeleton, joint: int) -> str:
    return plain_name(skeleton.names[joint].replace("left_", "").replace("right_", ""))


def source_chart(motion: Motion) -> go.Figure:
    """Where each joint comes from, and how often it was not found in the picture."""
    names = [plain_name(name) for name in motion.skeleton.names]
    shares = source_shares(motion)
    figure = make_subplots(
        cols=2,
        shared_yaxes=True,
        column_widths=[0.68, 0.32],
        horizontal_spacing=0.04,
        subplot_titles=("Where each joint comes from", "Not found in the picture"),
    )
    for kind, name in enumerate(SOURCES):
        figure.add_bar(
            y=names,
            x=shares[:, kind].round(4),
            name=name,
            orientation="h",
            row=1,
            col=1,
            marker={"color": SOURCE_COLORS[kind]},
            hovertemplate=f"%{{y}}: {name} in %{{x:.1%}} of frames<extra></extra>",
        )
    figure.add_bar(
        y=names,
        x=missing_shares(motion).round(4),
        name="not found",
        orientation="h",
        row=1,
        col=2,
        marker={"color": "var(--muted)"},
        showlegend=False,
        hovertemplate="%{y}: not found in %{x:.1%} of frames<extra></extra>",
    )
    figure.update_xaxes(tickformat=".0%", rangemode="tozero")
    figure.update_yaxes(autorange="reversed")
    for title, axis in zip(figure.layout.annotations, ("xaxis", "xaxis2"), strict=True):
        title.update(x=figure.layout[axis].domain[0], xanchor="left")
    return style_chart(figure, 440).update_layout(
        barmode="stack",
        bargap=0.25,
        hovermode="closest",
        margin={"l": 110, "b": 70},
        legend={"y": -0.1, "x": 0, "xanchor": "left", "yanchor": "top", "traceorder": "normal"},
    )


def doubt_chart(values: Float[np.ndarray, "T"], motion: Motion, title: str) -> go.Figure:
    """One number of every frame that tells how good it is, with the annotated frames marked."""
    figure, keyframes = stack_charts((title,), len(values)), motion.keyframes
    places, broken = break_at_cuts(values.astype(np.float32).round(4), motion.cuts)
    figure.add_scatter(
        x=places,
        y=broken,
        mode="lines",
        line={"width": 1.4, "color": "var(--accent)"},
        name="every frame",
    )
    figure.add_scatter(
        x=keyframes,
        y=values[keyframes].round(4),
        mode="markers",
        name="annotated",
        marker={"size": 8, "symbol": "diamond", "color": "var(--annotated)"},
    )
    figure.update_yaxes(rangemode="tozero")
    return _names_below(style_chart(figure, 250))


def _names_below(figure: go.Figure) -> go.Figure:
    """The legend under the chart: a narrow one has no room for it beside its title."""
    height, margin = figure.layout.height, figure.layout.margin
    lower = 55 / (height - margin.t - margin.b)  # px, below the axis and its title
    return figure.update_layout(
        height=height + 40,
        margin={"b": margin.b + 40},
        legend={"y": -lower, "x": 0, "xanchor": "left", "yanchor": "top"},
    )


def break_at_cuts(
    values: Num[np.ndarray, "T"], cuts: Int[np.ndarray, "C"] | None
) -> tuple[Float[np.ndarray, "P"], Num[np.ndarray, "P"]]:
    """Frames and their values as a line that ends with every shot: between two of them lies a
    place without a value. Of hours every few frames (`markup.thinning`).
    """
    every = thinning(len(values))
    frames, held = np.arange(0, len(values), every, dtype=np.float32), values[::every]
    if cuts is None or not len(cuts):
        return frames, held
    behind = np.searchsorted(frames, cuts)
    return np.insert(frames, behind, cuts - 0.5), np.insert(held + np.float32(0), behind, np.nan)


def stack_charts(titles: tuple[str, ...], frames: int) -> go.Figure:
    """Charts over the same frames, one above the other."""
    count = max(1, len(titles))
    figure = make_subplots(
        rows=count,
        shared_xaxes=True,
        subplot_titles=titles,
        vertical_spacing=0.22 / max(2, count),
    )
    figure.update_annotations(x=0, xanchor="left")
    figure.update_xaxes(range=[-0.5, frames - 0.5])
    return figure.update_xaxes(title_text="frame", row=count, col=1)


def style_chart(figure: go.Figure, height: int, legend: bool = True) -> go.Figure:
    """Quiet axes, no frame, room for nothing but the data."""
    line = {"gridcolor": "var(--rule)", "zeroline": False, "linecolor": "var(--rule)"}
    figure.update_xaxes(**line).update_yaxes(**line)
    figure.update_annotations(font_size=13)
    return figure.update_layout(
        template="none",
        height=height,
        showlegend=legend,
        hovermode="x unified",
        paper_bgcolor="rgba(0,0,0,0)",
        plot_bgcolor="rgba(0,0,0,0)",
        font={"family": "system-ui, sans-serif", "size": 12, "color": "var(--ink)"},
        margin={"l": 56, "r": 12, "t": 34, "b": 40},
        legend={"orientation": "h", "y": 1.0, "x": 1.0, "xanchor": "right", "yanchor": "bottom"},
        hoverlabel={
            "bgcolor": "var(--card)",
            "font": {"color": "var(--ink)"},
            "bordercolor": "var(--rule)",
        },
    )
