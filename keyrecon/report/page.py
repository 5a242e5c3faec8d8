"""report.html: one file that tells a person what was found and how far to trust it.

The file opens without a network: scripts, styles, pictures, the small video and all numbers
stand in it, and its content security policy forbids it to load anything. Charts are drawn by
plotly, whose script comes from the installed package; the cursor that links everything, the
distance matrices and the turning figure are small scripts of our own.
"""

from importlib.resources import files
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from plotly.offline import get_plotlyjs

from keyrecon import __version__
from keyrecon.annotation_budget import annotation_cost
from keyrecon.body import plain_name
from keyrecon.io.durable import write_durably
from keyrecon.io.formats.conventions import stature
from keyrecon.progress import Progress, silent
from keyrecon.report import charts, sections, tables
from keyrecon.report.court_section import court_numbers, court_section, run_chart, view_buttons
from keyrecon.report.drawing import bone_sides, drawn_bones, head_bone, trunk_outline
from keyrecon.report.headline import figures, opening
from keyrecon.report.instants import key_instants
from keyrecon.report.markup import (
    ReportMaterial,
    data_block,
    note,
    pack,
    section,
    text,
    thinning,
    to_json,
)
from keyrecon.report.pictures import Pictures, Watch, cut_pictures, ignore
from keyrecon.report.scripts import bundle_scripts
from keyrecon.report.summary import (
    center_on_root,
    error_per_frame,
    expected_lengths,
    scale_truth,
)

POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src data: blob:; media-src data: blob:"
)
SCRIPTS = ("charts", "matrices", "figure", "court")
VIEW_COUNT = 12
"""Frames shown from elsewhere; the paper shows every 50th of 36 s."""


def cut_report_pictures(
    material: ReportMaterial, progress: Progress = silent, watch: Watch = ignore
) -> Pictures:
    """What the report shows of the video; `watch` sees the marked frames too."""
    return cut_pictures(
        material.video,
        material.track,
        material.annotations,
        material.motion,
        progress=progress,
        instants=[instant.frame for instant in key_instants(material.motion)],
        watch=watch,
    )


def write_page(path: Path, material: ReportMaterial, pictures: Pictures) -> None:
    """Write the report to one HTML file with its pictures; a minute of video makes it about 10 MB.

    Of hours, the video in it has smaller pictures (`pictures.clip_side`).
    """
    write_durably(path, build_page(material, pictures))


def build_page(material: ReportMaterial, pictures: Pictures) -> str:
    """The whole page as text."""
    title = text(material.video.name)
    navigation = _navigation(material, pictures)
    style = (files("keyrecon.report") / "report.css").read_text("utf-8")
    scripts = (get_plotlyjs(), bundle_scripts(*SCRIPTS))
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{title}: keyrecon report</title><style>{style}</style></head><body>"
        f"{navigation}<main>{_body(material, pictures)}</main>{_transport()}"
        f"{data_block('motion-data', to_json(_numbers(material)))}"
        f"{''.join(f'<script>{script}</script>' for script in scripts)}</body></html>"
    )


def _body(material: ReportMaterial, pictures: Pictures) -> str:
    """What a reader came for, then how far to trust it, then how it was made."""
    strip = list(pictures.strip)
    chosen = strip[:: max(1, round(len(strip) / VIEW_COUNT))]
    return "".join(
        (
            opening(material),
            sections.warnings(material),
            _figure_player(pictures, material),
            _on_court(material),
            sections.instants(material, pictures),
            sections.story(pictures, material.motion.time),
            _trust(material),
            sections.doubts(material),
            _angles(material),
            _joint_curves(material),
            sections.reference_views(material, chosen),
            _making(material, pictures),
        )
    )


def _trust(material: ReportMaterial) -> str:
    shown = (figures(material), _doubt_over_time(material))
    return section("accuracy", "How far to trust it", *shown)


def _making(material: ReportMaterial, pictures: Pictures) -> str:
    return section(
        "making",
        "How it was made",
        sections.keyframe_pictures(material, pictures),
        _occurrence(material),
        sections.matrices(material),
        _sources(material),
        tables.body_tables(material),
        section(
            "stages",
            "Stages and options",
            tables.stage_times(material.seconds),
            tables.option_table(material.options),
            note(f"keyrecon {text(__version__)}"),
        ),
    )


def _chart(name: str, figure: go.Figure) -> str:
    block = data_block(f"chart-{name}", figure.to_json())
    height = figure.layout.height
    return f'<div class="chart" data-chart="{name}" style="min-height:{height}px"></div>{block}'


def _doubt_over_time(material: ReportMaterial) -> str:
    """The error of every frame where the truth is known, else the expected one."""
    motion, truth = material.motion, material.true_joints
    unit, size = ("cm", 100) if motion.units == "m" else ("% of the height", 100)
    expected = expected_lengths(motion)
    if truth is not None:
        values, title = size * error_per_frame(motion, truth), f"Mean error of all joints, {unit}"
    elif expected is not None:
        values, title = size * expected.mean(axis=1), f"Expected error across the picture, {unit}"
    else:
        return ""
    return _chart("doubt", charts.doubt_chart(values, motion, title))


def _occurrence(material: ReportMaterial) -> str:
    return section(
        "occurrence",
        "Which keyframe stands for which frame",
        note(
            "Keyframes are ordered so that similar poses lie side by side: opposite strokes show "
            "as peaks and troughs. Diamonds are the keyframes themselves, rings are frames "
            "farther than β from every keyframe. Press a chart to go to a frame. "
            f"{_coverage(material)}"
        ),
        _chart(
            "occurrence",
            charts.keyframe_chart(
                material.keyframes, material.pose_distances, material.motion.cuts
            ),
        ),
    )


def _coverage(material: ReportMaterial) -> str:
    keyframes = material.keyframes
    cost = annotation_cost(keyframes, len(material.motion.time))
    return (
        f"Asked for were {len(keyframes.upper.frames)} upper and {len(keyframes.lower.frames)} "
        f"lower bodies ({cost:.2%} of the frames, a half body counted half), which stand for "
        f"{keyframes.upper.coverage:.1%} and {keyframes.lower.coverage:.1%} of the frames with the "
        f"player, short gaps between such frames included; {keyframes.alpha:.0%} were asked for."
    )


def _joint_curves(material: ReportMaterial) -> str:
    names = material.motion.skeleton.names
    options = "".join(
        f'<option value="{joint}">{text(plain_name(name))}</option>'
        for joint, name in enumerate(names)
    )
    return section(
        "curves",
        "Joints before and after refinement",
        f'<label class="chooser">Joint <select id="joint">{options}</select></label>',
        _chart("joint", charts.joint_chart(len(material.motion.time), material.truth is not None)),
    )


def _on_court(material: ReportMaterial) -> str:
    figure = run_chart(material)
    return "" if figure is None else court_section(material, _chart("run", figure))


def _figure_player(pictures: Pictures, material: ReportMaterial) -> str:
    views = "".join(
        f'<button type="button" data-yaw="{yaw}" data-pitch="{pitch}">{name}</button>'
        for name, yaw, pitch in (
            ("Camera", 0, 0),
            ("Right", 90, 0),
            ("Left", -90, 0),
            ("Above", 0, 90),
            ("Free", 35, 18),
        )
    )
    truth_switch = (
        '<label><input type="checkbox" id="show-truth" checked> truth in grey</label>'
        if material.truth is not None
        else ""
    )
    return section(
        "figure",
        "The motion",
        f'<div class="player">'
        f'<video id="clip" src="{pictures.clip}" muted playsinline preload="auto" '
        'aria-label="The player with the reconstructed pose"></video>'
        '<div class="plate"><canvas id="figure-canvas" tabindex="0" '
        'aria-label="Turnable 3D figure"></canvas></div></div>'
        f'<div class="views-bar">{view_buttons(material)}'
        f'<span class="off-court">{views} {truth_switch}</span></div>',
        note(
            "Play it at the foot of the page. Drag the figure to turn it, arrow keys while it has "
            "the focus, Ctrl and wheel to zoom. "
            + (
                "The body is held at its root; the grid lies at the lower foot."
                if material.court is None
                else f"It stands on the {material.court[1].origin}, and the way of two seconds "
                f"lies on it; off the {material.court[1].origin} the body is held at its root, and "
                "the grid lies at the lower foot."
            )
            + _every_few(len(material.motion.time))
        ),
    )


def _every_few(frames: int) -> str:
    """What a report of hours leaves out."""
    every = thinning(frames)
    return (
        f" So that this file stays small, pictures, figure and curves are of one frame in {every}, "
        "and straight lines between."
        if every > 1
        else ""
    )


def _sources(material: ReportMaterial) -> str:
    return section(
        "sources",
        "Where the joints come from",
        note(
            "Every number can be traced to a mark that a person made or to a stated rule. "
            "<em>Annotated</em>: marked on this frame. <em>Propagated</em>: carried over from a "
            "keyframe. <em>Interpolated</em>: not found, filled in. <em>Refined</em>: found, and "
            "replaced because it disagreed with the rest."
        ),
        _chart("sources", charts.source_chart(material.motion)),
    )


def _angles(material: ReportMaterial) -> str:
    return section(
        "angles",
        "Joint angles",
        note(
            "Angle between the two bones that meet at the joint, in space: 180° is straight, "
            "smaller is more bent. It does not depend on the camera or on the units."
        ),
        _chart("angles", charts.angle_chart(material.motion)),
    )


def _navigation(material: ReportMaterial, pictures: Pictures) -> str:
    links = (
        ("figure", "Motion"),
        *([("instants", "Key instants")] if pictures.instants else []),
        *([("court", material.court[1].origin.title())] if material.court is not None else []),
        ("video", "Video"),
        ("accuracy", "Trust"),
        *([("doubts", "Doubts")] if material.motion.expected_error is not None else []),
        ("angles", "Angles"),
        ("curves", "Curves"),
        ("views", "Views"),
        ("making", "How it was made"),
    )
    items = "".join(f'<a href="#{name}">{label}</a>' for name, label in links)
    return f'<nav aria-label="Sections"><div>{items}</div></nav>'


def _transport() -> str:
    speeds = "".join(
        f'<option value="{speed}"{" selected" if speed == 1 else ""}>{speed}&times;</option>'
        for speed in (0.1, 0.25, 0.5, 1, 2)
    )
    return (
        '<footer class="transport"><button type="button" id="play" aria-label="Play">▶</button>'
        '<input type="range" id="frame" min="0" value="0" step="1" aria-label="Frame">'
        f'<output id="now"></output><label>speed <select id="speed">{speeds}</select></label>'
        '</footer><dialog id="large"><button type="button" autofocus>Close</button>'
        '<img alt=""><p></p></dialog>'
    )


def _numbers(material: ReportMaterial) -> dict[str, object]:
    """What the page's script draws from."""
    motion, skeleton = material.motion, material.motion.skeleton
    truth, marks = material.true_joints, material.annotations
    every = thinning(len(motion.time))
    return {
        "fps": motion.fps,
        "first": int(motion.known.argmax()),
        "cuts": [] if motion.cuts is None else motion.cuts.tolist(),
        "late": pack(motion.time - np.arange(len(motion.time)) / motion.fps, every),
        "bones": drawn_bones(skeleton).tolist(),
        "sides": bone_sides(skeleton).tolist(),
        "stature": stature(motion),
        "units": motion.units,
        "trunk": trunk_outline(skeleton),
        "head": head_bone(skeleton),
        "points3d": pack(center_on_root(motion.points3d, skeleton.root), every),
        "truth3d": None if truth is None else pack(scale_truth(motion, truth.points3d), every),
        "refined": pack(motion.points2d, every),
        "raw": pack(motion.points2d_propagated, every),
        "truth2d": None if truth is None else pack(truth.points2d, every),
        "court": court_numbers(material),
        "marked": {"frames": marks.frames.tolist(), "points": pack(marks.joints)},
    }
