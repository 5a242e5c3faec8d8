"""The sections of the report, each a function from the material to HTML."""

from dataclasses import fields, is_dataclass

import cv2
import numpy as np
from jaxtyping import Float, Int

from keyrecon.body import Skeleton
from keyrecon.metrics import Scores, evaluate_motion
from keyrecon.records import HalfKeyframes, Motion
from keyrecon.report.charts import plain_name
from keyrecon.report.markup import note, number, section, table, text, to_json
from keyrecon.report.material import ReportMaterial
from keyrecon.report.pictures import Pictures, png_uri
from keyrecon.report.summary import (
    annotation_cost,
    bone_lengths,
    center_on_root,
    correction,
    foot_speed,
    joint_acceleration,
    missing_shares,
    scale_truth,
    stature,
    truth_error_2d,
)
from keyrecon.report.views import VIEWS, pose_drawing

MATRIX_SIDE = 600
"""Largest side of a distance matrix in the page, px."""


def headline(material: ReportMaterial) -> str:
    """The figures that matter, first."""
    video, motion, keyframes = material.video, material.motion, material.keyframes
    count = len(motion.points3d)
    cost = annotation_cost(keyframes, count)
    halves = f"{len(keyframes.upper.frames)} upper, {len(keyframes.lower.frames)} lower body"
    scores = None if material.truth is None else evaluate_motion(motion, material.truth)
    cards = [
        ("Frames", f"{count:,}", f"{motion.time[-1]:.1f} s at {motion.fps:.4g} per second"),
        ("Keyframes", f"{len(keyframes.frames)}", halves),
        ("Annotation cost", f"{cost:.2%}", "of the frames, half-body marks counted half"),
        ("Coverage", f"{min(keyframes.upper.coverage, keyframes.lower.coverage):.1%}",
         f"upper {keyframes.upper.coverage:.1%}, lower {keyframes.lower.coverage:.1%}, "
         f"asked for {keyframes.alpha:.0%}"),
        *(_trust_cards(motion) if scores is None else _score_cards(scores)),
    ]
    tiles = "".join(
        f"<div><dt>{text(name)}</dt><dd>{text(value)}<small>{text(more)}</small></dd></div>"
        for name, value, more in cards
    )
    return (
        f'<header><p class="kicker">keyrecon motion report</p><h1>{text(video.path.name)}</h1>'
        f'<p class="lead">{video.width} &times; {video.height} px, '
        f"{motion.time[-1]:.1f} s</p></header>"
        f'<dl class="cards">{tiles}</dl>{_conventions(motion)}'
        f"{'' if scores is None else accuracy(scores)}"
    )


def _score_cards(scores: Scores) -> list[tuple[str, str, str]]:
    return [
        ("PA-MPJPE", f"{scores.pa_mpjpe:.0f} mm", "mean joint error after the best similarity"),
        ("Acceleration error", f"{scores.acceleration:.1f}", "mm per frame squared"),
    ]


def accuracy(scores: Scores) -> str:
    """Every measure against the truth, with what it means."""
    scaled = "; the motion was first scaled to the truth as a whole" if scores.scaled else ""
    rows = [
        ("MPJPE", f"{scores.mpjpe:.1f} mm", f"mean joint error around the hips{scaled}"),
        ("N-MPJPE", f"{scores.n_mpjpe:.1f} mm", "the same after the best scale of every frame"),
        ("PA-MPJPE", f"{scores.pa_mpjpe:.1f} mm", "the same after the best similarity"),
        ("acceleration error", f"{scores.acceleration:.1f} mm/frame²", "jitter and lost motion"),
        ("PCK@0.2", f"{scores.pck:.1%}", "joints within 0.2 torso lengths in the picture"),
        ("median in the picture", f"{scores.median_px:.1f} px", "half of the joints are closer"),
        ("bone lengths vary", f"{scores.limb_variation:.2%}",
         f"mean of all bones; the worst {scores.limb_variation_max:.2%}"),
    ]
    return "<h3>Accuracy against the known truth</h3>" + table(
        ("measure", "value", "meaning"), rows, "Accuracy", "texts"
    )


def _trust_cards(motion: Motion) -> list[tuple[str, str, str]]:
    sure = float((motion.confidence >= 0.5).mean())
    missing = float(missing_shares(motion).mean())
    return [
        ("Confidence", f"{float(np.nanmean(motion.confidence)):.2f}",
         f"mean over joints and frames; {sure:.0%} at 0.5 or more"),
        ("Found in the picture", f"{1 - missing:.1%}", "of joints; the rest is filled in"),
    ]


def _conventions(motion: Motion) -> str:
    if motion.units == "m":
        unit = "Lengths are metres, from the body height that was given"
    else:
        unit = "Lengths are body heights, because no height in metres was given"
    return note(
        f"<strong>How to read the numbers.</strong> {unit}. Positions are relative to the camera, "
        "not to the ground: x to the right of the picture, y down, z away from the camera. One "
        "camera does not tell how far away the player is, so depth is that of the joints within "
        "the body. Frames count from 0."
    )


def story(pictures: Pictures, time: Float[np.ndarray, "T"]) -> str:
    """Frames evenly through the video with the reconstructed pose."""
    stills = "".join(
        f'<button type="button" class="still" data-frame="{frame}">'
        f'<img id="still-{frame}" src="{uri}" alt="Frame {frame} with the reconstructed pose">'
        f"<span>{frame} <small>{time[frame]:.1f} s</small></span></button>"
        for frame, uri in pictures.strip.items()
    )
    key = (
        '<span class="key left">left</span> <span class="key right">right</span> '
        '<span class="key trunk">trunk</span>. Diamonds were marked by a person, discs found in '
        "the picture, rings filled in. Choose a picture to enlarge it and to go to its frame."
    )
    return section("video", "The video", note(key), f'<div class="strip">{stills}</div>')


def keyframe_pictures(material: ReportMaterial, pictures: Pictures) -> str:
    """Every keyframe with its marks and how many frames it stands for."""
    keyframes, marked = material.keyframes, set(material.annotations.frames.tolist())
    cards = []
    for frame in sorted(set(keyframes.frames.tolist()) | marked):
        badges = "".join(
            f"<li>{name} body, stands for {count} frames</li>"
            for name, half in (("upper", keyframes.upper), ("lower", keyframes.lower))
            if (count := stands_for(half, frame)) is not None
        )
        uri = pictures.keyframes.get(frame)
        shown = (
            f'<img src="{uri}" alt="Keyframe {frame} with its marks">' if uri
            else '<span class="empty">not annotated</span>'
        )
        cards.append(
            f'<button type="button" class="still keyframe" data-frame="{frame}">{shown}'
            f"<span>frame {frame}</span><ul>{badges or '<li>marked in addition</li>'}</ul></button>"
        )
    about = note(
        "The frames a person marked. Rings: placed though hidden. A keyframe stands for the frames "
        "that look most like it, one half of the body at a time."
    )
    shown = f'<div class="strip wide">{"".join(cards)}</div>'
    return section("keyframes", "Keyframes", about, shown)


def stands_for(half: HalfKeyframes, frame: int) -> int | None:
    """How many frames a keyframe stands for; None where it is no keyframe of this half."""
    return int((half.nearest == frame).sum()) if frame in half.frames else None


def matrices(material: ReportMaterial) -> str:
    """Pose distance of every two frames, as pictures with a readout."""
    keyframes, comparison = material.keyframes, material.comparison
    halves = (("Upper body", keyframes.upper, comparison.upper),
              ("Lower body", keyframes.lower, comparison.lower))
    figures = "".join(
        _matrix(title, half, distances, comparison.row) for title, half, distances in halves
    )
    about = note(
        "Dark: the two frames show alike poses. Diagonal stripes are movements that come back. "
        "Distances are in player heights; the line on the scale is β, under which a keyframe "
        "stands for a frame. Point at a pair to read it, press to go to the frame."
    )
    return section("distances", "Which frames look alike", about,
                   f'<div class="pair">{figures}</div>')


def _matrix(
    title: str,
    half: HalfKeyframes,
    distances: Float[np.ndarray, "M M"],
    row: Int[np.ndarray, "T"],
) -> str:
    grey, top = reduce_matrix(distances, row)
    setting = {"title": title, "top": top, "beta": half.beta, "frames": len(row),
               "keyframes": half.frames.tolist()}
    return (
        f'<figure class="matrix" data-matrix="{text(to_json(setting))}"><figcaption>{text(title)}'
        f', β = {half.beta:.3f}</figcaption><div class="plate"><img src="{png_uri(grey)}" '
        f'alt="Pose distance of every two frames, {text(title.lower())}"></div>'
        '<output aria-live="off">&nbsp;</output></figure>'
    )


def reduce_matrix(
    distances: Float[np.ndarray, "M M"], row: Int[np.ndarray, "T"]
) -> tuple[np.ndarray, float]:
    """The matrix over all frames as grey values, at most MATRIX_SIDE px; 255 is `top`."""
    side = min(len(row), MATRIX_SIDE)
    if len(distances) <= MATRIX_SIDE or len(distances) < len(row):
        at = row[np.linspace(0, len(row) - 1, side).round().astype(int)]
        small = distances[np.ix_(at, at)]
    else:
        small = cv2.resize(np.asarray(distances, np.float32), (side, side),
                           interpolation=cv2.INTER_AREA)
    known = np.isfinite(small)
    top = float(np.quantile(small[known], 0.995)) if known.any() else 1.0
    scaled = np.where(known, small, top) / max(top, 1e-9)
    return np.round(255 * np.clip(scaled, 0, 1)).astype(np.uint8), round(top, 5)


def reference_views(material: ReportMaterial, frames: list[int]) -> str:
    """The motion seen from elsewhere, beside the truth where it is known (Fig. 11)."""
    motion = material.motion
    root, height = motion.skeleton.root, stature(motion)
    found = center_on_root(motion.points3d, root)
    rows = [("video", [f'<img data-copy="still-{frame}" alt="Frame {frame}">' for frame in frames])]
    truth = material.true_joints
    true = None if truth is None else scale_truth(motion, truth.points3d)
    for view in VIEWS:
        rows.append((view, _drawings(found, frames, motion.skeleton, view, height)))
        if true is not None:
            truth_row = _drawings(true, frames, motion.skeleton, view, height)
            rows.append(("truth", truth_row))
    body = "".join(
        f'<tr{" class=true" if name == "truth" else ""}><th scope="row">{name}</th>'
        + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"
        for name, cells in rows
    )
    head = "".join(f'<th scope="col">{frame}</th>' for frame in frames)
    about = note(
        "Views from cameras that were not used, drawn in parallel projection; each pose is centred."
        + (" The truth has one scale for the whole sequence and is not turned." if true is not None
           else "")
    )
    return section(
        "views", "Seen from elsewhere", about,
        '<div class="scroll" tabindex="0" role="region" aria-label="Views"><table class="views">'
        f"<thead><tr><th>frame</th>{head}</tr></thead><tbody>{body}</tbody></table></div>",
    )


def _drawings(
    points: Float[np.ndarray, "T J 3"], frames: list[int], skeleton: Skeleton, view: str,
    height: float,
) -> list[str]:
    return [pose_drawing(points[frame], skeleton, view, height) for frame in frames]


def body_tables(material: ReportMaterial) -> str:
    """Bones that should not change, joints that should not jitter, feet that should not slide."""
    motion = material.motion
    slow = foot_speed(motion, material.track)
    feet = note(
        f"Slower foot: {np.median(slow):.2f} player heights per second across the picture "
        f"(median), {np.quantile(slow, 0.9):.2f} at the 90th percentile. A player on the ground "
        "has one foot at rest most of the time, so with a camera at rest this should be near 0."
    ) if len(slow) else ""
    return section(
        "body", "Bones, joints and feet",
        f'<div class="pair tables"><div><h3>Bone lengths</h3>{_bone_table(motion)}</div>',
        f"<div><h3>Joints in the picture</h3>{_joint_table(material)}</div></div>",
        _joint_note(), feet,
    )


def _joint_note() -> str:
    return note(
        "Bones: mean over time, its standard deviation, the longer side and the average adult "
        "(Winter). Joints: not found, share of frames; moved by refinement and error, median in "
        "% of the player's height; acceleration, mean in player heights per second squared: noise "
        "shows there first."
    )


def _bone_table(motion: Motion) -> str:
    skeleton = motion.skeleton
    lengths = bone_lengths(motion.points3d, skeleton)
    mean, spread = np.nanmean(lengths, axis=0), np.nanstd(lengths, axis=0)
    expected = skeleton.lengths * stature(motion)
    unit = "m" if motion.units == "m" else "body heights"
    rows = []
    for bone, (parent, child) in enumerate(skeleton.bones):
        other = int(skeleton.bone_mirror[bone])
        mirrored = mean[bone] / mean[other] - 1 if other != bone else np.nan
        rows.append((
            f"{plain_name(skeleton.names[parent])} to {plain_name(skeleton.names[child])}",
            f"{mean[bone]:.3f}", f"{spread[bone] / mean[bone]:.2%}",
            number(mirrored, "+.1%"), f"{mean[bone] / expected[bone] - 1:+.1%}",
        ))
    head = ("bone", f"length, {unit}", "varies", "other side", "average")
    return table(head, rows, "Bone lengths")


def _joint_table(material: ReportMaterial) -> str:
    motion, track = material.motion, material.track
    columns = [
        ("not found", missing_shares(motion), ".1%"),
        ("moved", correction(motion, track), ".1%"),
        ("acceleration before", joint_acceleration(motion.points2d_propagated, track, motion.fps),
         ".1f"),
        ("acceleration after", joint_acceleration(motion.points2d, track, motion.fps), ".1f"),
    ]
    if material.true_joints is not None:
        error = truth_error_2d(motion, material.true_joints.points2d, track)
        columns.append(("error", error, ".1%"))
    rows = [
        (plain_name(name), *(number(float(values[joint]), form) for _, values, form in columns))
        for joint, name in enumerate(motion.skeleton.names)
    ]
    return table(("joint", *(name for name, _, _ in columns)), rows, "Joints")


def stage_times(seconds: dict[str, float]) -> str:
    """How long the stages took that were run."""
    if not seconds:
        return note("All stages were taken from earlier runs.")
    total = sum(seconds.values())
    rows = [(name, f"{value:.2f}", f"{value / total:.0%}") for name, value in seconds.items()]
    rows.append(("together", f"{total:.2f}", ""))
    return table(("stage", "seconds", "share"), rows, "Stage times")


def option_table(options: object) -> str:
    """Every option with its value; those that differ from the defaults cannot hide."""
    if options is None or not is_dataclass(options):
        return ""
    rows = list(_flat_options(options, ""))
    listed = table(("option", "value"), rows, "Options", "texts")
    return f"<details><summary>All {len(rows)} options</summary>{listed}</details>"


def _flat_options(options: object, prefix: str) -> list[tuple[str, object]]:
    rows: list[tuple[str, object]] = []
    for field in fields(options):
        value = getattr(options, field.name)
        if is_dataclass(value):
            rows += _flat_options(value, f"{prefix}{field.name}.")
        else:
            rows.append((prefix + field.name, value))
    return rows
