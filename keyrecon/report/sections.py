"""The sections that show pictures: the video, keyframes, distances and views from elsewhere."""

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from keyrecon.body import Skeleton
from keyrecon.errors import counted
from keyrecon.hyperextension import hyperextended_stretches
from keyrecon.io.formats.conventions import stature
from keyrecon.records import HalfKeyframes, Motion
from keyrecon.report.headline import in_words, marked_frames
from keyrecon.report.instants import instant_angles, key_instants
from keyrecon.report.markup import (
    ReportMaterial,
    note,
    number,
    section,
    sentence,
    table,
    text,
    to_json,
)
from keyrecon.report.pictures import Pictures, png_uri
from keyrecon.report.summary import center_on_root, scale_truth
from keyrecon.report.views import VIEWS, pose_drawing
from keyrecon.uncertainty import (
    UncertainStretch,
    uncertain_parts,
    uncertain_stretches,
    worst_frames,
)

MATRIX_SIDE = 600
"""Largest side of a distance matrix in the page, px."""


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
    return section("video", "Through the video", note(key), f'<div class="strip">{stills}</div>')


def warnings(material: ReportMaterial) -> str:
    """What cannot be overlooked; empty where everything fits together."""
    if not material.warnings:
        return ""
    lines = "".join(f"<li>{sentence(line)}</li>" for line in material.warnings)
    return (
        '<section class="warning" role="alert"><h2>Not everything fits together</h2>'
        f"<ul>{lines}</ul></section>"
    )


def instants(material: ReportMaterial, pictures: Pictures) -> str:
    """Where a hand is fastest, with the angles there; empty where no hand ever is."""
    motion = material.motion
    pictured = [instant for instant in key_instants(motion) if instant.frame in pictures.instants]
    if not pictured:
        return ""
    unit = "m/s" if motion.units == "m" else "heights/s"
    doubtful = uncertain_parts(motion, [instant.frame for instant in pictured])
    stills = "".join(
        f'<button type="button" class="still" data-frame="{instant.frame}">'
        f'<img src="{pictures.instants[instant.frame]}" alt="Frame {instant.frame}, the '
        f'{instant.hand} hand is fastest">'
        f"<span>{instant.frame} <small>{motion.time[instant.frame]:.2f} s"
        f"{f', {parts} uncertain' if parts else ''}</small></span></button>"
        for instant, parts in zip(pictured, doubtful, strict=True)
    )
    angles = instant_angles(motion)
    rows = [
        (
            f"{instant.frame}",
            f"{motion.time[instant.frame]:.2f} s",
            f"{instant.hand}, {instant.speed:.1f} {unit}",
            *(number(float(values[instant.frame]), ".0f") + "°" for values in angles.values()),
            f"{parts} uncertain" if parts else "",
        )
        for instant, parts in zip(pictured, doubtful, strict=True)
    ]
    about = note(
        "The frames in which a hand is fastest, relative to the body: strokes, throws, swings. A "
        "knee or elbow is straight at 180°; shoulders to hips is the angle between both lines as "
        "seen from above. On rendered strokes whose truth is known, hands lose a fifth of their "
        "speed and angles are off by 8 to 15°"
        + (
            "; where joints are uncertain, by far more: mark these frames."
            if any(doubtful)
            else "."
        )
    )
    listed = table(("frame", "time", "fastest hand", *angles, ""), rows, "Key instants")
    shown = f'<div class="strip four">{stills}</div>'
    return section("instants", "Key instants", about, shown, listed)


def _length_there(motion: Motion, stretch: UncertainStretch) -> str:
    scale = float(motion.scale[stretch.first : stretch.last + 1].mean())
    return in_words(stretch.error / scale, motion.units)


def doubts(material: ReportMaterial) -> str:
    """Where the motion is least sure of itself, and the frames with the largest expected errors;
    empty where none are known."""
    motion, backward = material.motion, hyperextended_stretches(material.motion)
    if motion.expected_error is None and not backward:
        return ""
    found = [(stretch.frame, stretch.text) for stretch in backward]
    found += [
        (stretch.frame, stretch.in_words(_length_there(motion, stretch)))
        for stretch in uncertain_stretches(motion)
    ]
    lines = "".join(
        f'<li><button type="button" class="goes" data-frame="{frame}">{text(line)}</button></li>'
        for frame, line in found
    )
    rows = [
        (
            f"{frame}",
            ", ".join(
                f"{name.replace('_', ' ')} {in_words(error / motion.scale[frame], motion.units)}"
                for name, error in joints
            ),
        )
        for frame, joints in worst_frames(motion)
    ]
    about = note(
        "How far each joint of the drawn pose probably is from where a person would mark it, as "
        "learnt from real videos that were marked by eye; of what was reported as uncertain "
        "there, six in ten had a joint far off. Lengths are across the picture; depth is less sure."
    )
    listed = f'<ul class="doubts">{lines}</ul>' if lines else note("No stretch stands out.")
    worst = table(("frame", "least sure joints, expected error"), rows, "Worst frames", "texts")
    return section("doubts", "Where it is least sure", about, listed, worst)


def keyframe_pictures(material: ReportMaterial, pictures: Pictures) -> str:
    """Every frame that was marked, with its marks and how many frames it stands for."""
    keyframes, marked = material.keyframes, marked_frames(material.annotations)
    cards = []
    for frame in marked:
        badges = "".join(
            f"<li>{name} body, stands for {counted(count, 'frame')}</li>"
            for name, half in (("upper", keyframes.upper), ("lower", keyframes.lower))
            if (count := stands_for(half, frame)) is not None
        )
        cards.append(
            f'<button type="button" class="still keyframe" data-frame="{frame}">'
            f'<img src="{pictures.keyframes[frame]}" alt="Frame {frame} with its marks">'
            f"<span>frame {frame}</span><ul>{badges or '<li>marked in addition</li>'}</ul></button>"
        )
    left = sorted(set(keyframes.frames.tolist()) - set(marked))
    about = note(
        "The frames a person marked. Rings: placed though hidden. A keyframe stands for the frames "
        "that look most like it, one half of the body at a time."
        + (f" Asked for and not marked: {', '.join(map(str, left))}." if left else "")
    )
    shown = f'<div class="strip wide">{"".join(cards)}</div>'
    return section("keyframes", f"{len(marked)} marked frames", about, shown)


def stands_for(half: HalfKeyframes, frame: int) -> int | None:
    """How many frames a keyframe stands for; None where it is no keyframe of this half."""
    if frame not in half.frames:
        return None
    return int(((half.nearest == frame) & np.isfinite(half.distance)).sum())


def matrices(material: ReportMaterial) -> str:
    """Pose distance of every two frames, as pictures with a readout."""
    keyframes, comparison = material.keyframes, material.pose_distances
    unseen = not np.isfinite(keyframes.upper.distance).all()
    halves = (
        ("Upper body", keyframes.upper, comparison.upper),
        ("Lower body", keyframes.lower, comparison.lower),
    )
    figures = "".join(
        _matrix(title, half, distances, comparison.row) for title, half, distances in halves
    )
    about = note(
        "Dark: the two frames show alike poses. Diagonal stripes are movements that come back. "
        "Distances are in player heights; the line on the scale is β, under which a keyframe "
        "stands for a frame. Point at a pair to read it, press to go to the frame."
        + (" White: frames without the player are compared with none." if unseen else "")
    )
    return section(
        "distances", "Which frames look alike", about, f'<div class="pair">{figures}</div>'
    )


def _matrix(
    title: str,
    half: HalfKeyframes,
    distances: Float[np.ndarray, "M M"],
    row: Int[np.ndarray, "T"],
) -> str:
    grey, top = reduce_matrix(distances, row, np.isfinite(half.distance))
    setting = {
        "title": title,
        "top": top,
        "beta": half.beta,
        "frames": len(row),
        "keyframes": half.frames.tolist(),
    }
    return (
        f'<figure class="matrix" data-matrix="{text(to_json(setting))}"><figcaption>{text(title)}'
        f', β = {half.beta:.3f}</figcaption><div class="plate"><img src="{png_uri(grey)}" '
        f'alt="Pose distance of every two frames, {text(title.lower())}"></div>'
        '<output aria-live="off">&nbsp;</output></figure>'
    )


def reduce_matrix(
    distances: Float[np.ndarray, "M M"],
    row: Int[np.ndarray, "T"],
    compared: Bool[np.ndarray, "T"] | None = None,
) -> tuple[UInt8[np.ndarray, "side side"], float]:
    """The matrix over all frames as grey values, at most MATRIX_SIDE px; 254 is `top`, player
    heights, and 255 where a frame is compared with none: those that are not `compared`."""
    side = min(len(row), MATRIX_SIDE)
    shown = np.linspace(0, len(row) - 1, side).round().astype(int)
    if len(distances) <= MATRIX_SIDE or len(distances) < len(row):
        small = distances[np.ix_(row[shown], row[shown])]
    else:
        small = cv2.resize(
            np.asarray(distances, np.float32), (side, side), interpolation=cv2.INTER_AREA
        )
    known = np.isfinite(small)
    if compared is not None:
        known &= np.outer(compared[shown], compared[shown])
    top = float(np.quantile(small[known], 0.995)) if known.any() else 1.0
    scaled = np.clip(np.where(known, small, top) / max(top, 1e-9), 0, 1)
    return np.where(known, np.round(254 * scaled), 255).astype(np.uint8), round(top, 5)


def reference_views(material: ReportMaterial, frames: list[int]) -> str:
    """The motion seen from elsewhere, beside the truth where it is known (Fig. 11)."""
    motion = material.motion
    root, height = motion.skeleton.root, stature(motion)
    points = center_on_root(motion.points3d, root)
    rows = [("video", [f'<img data-copy="still-{frame}" alt="Frame {frame}">' for frame in frames])]
    truth = material.true_joints
    true = None if truth is None else scale_truth(motion, truth.points3d)
    for view in VIEWS:
        rows.append((view, _drawings(points, frames, motion.skeleton, view, height)))
        if true is not None:
            truth_row = _drawings(true, frames, motion.skeleton, view, height)
            rows.append(("truth", truth_row))
    body = "".join(
        f'<tr{" class=true" if name == "truth" else ""}><th scope="row">{name}</th>'
        + "".join(f"<td>{cell}</td>" for cell in cells)
        + "</tr>"
        for name, cells in rows
    )
    head = "".join(f'<th scope="col">{frame}</th>' for frame in frames)
    about = note(
        "Views from cameras that were not used, drawn in parallel projection; each pose is centred."
        + (
            " The truth has one scale for the whole sequence and is not turned."
            if true is not None
            else ""
        )
    )
    return section(
        "views",
        "Seen from elsewhere",
        about,
        '<div class="scroll" tabindex="0" role="region" aria-label="Views"><table class="views">'
        f"<thead><tr><th>frame</th>{head}</tr></thead><tbody>{body}</tbody></table></div>",
    )


def _drawings(
    points: Float[np.ndarray, "T J 3"],
    frames: list[int],
    skeleton: Skeleton,
    view: str,
    height: float,
) -> list[str]:
    return [pose_drawing(points[frame], skeleton, view, height) for frame in frames]
