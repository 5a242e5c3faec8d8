"""The head of the report: the figures that matter, and how to read them."""

import numpy as np

from keyrecon.annotation_budget import annotation_cost
from keyrecon.metrics import Scores, evaluate_motion
from keyrecon.records import Motion
from keyrecon.report.markup import ReportMaterial, note, table, text
from keyrecon.report.summary import missing_shares


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
        (
            "Coverage",
            f"{min(keyframes.upper.coverage, keyframes.lower.coverage):.1%}",
            f"upper {keyframes.upper.coverage:.1%}, lower {keyframes.lower.coverage:.1%}, "
            f"asked for {keyframes.alpha:.0%}",
        ),
        *(_confidence_cards(motion) if scores is None else _score_cards(scores)),
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
        (
            "bone lengths vary",
            f"{scores.limb_variation:.2%}",
            f"mean of all bones; the worst {scores.limb_variation_max:.2%}",
        ),
    ]
    return "<h3>Accuracy against the known truth</h3>" + table(
        ("measure", "value", "meaning"), rows, "Accuracy", "texts"
    )


def _confidence_cards(motion: Motion) -> list[tuple[str, str, str]]:
    sure = float((motion.confidence >= 0.5).mean())
    missing = float(missing_shares(motion).mean())
    return [
        (
            "Confidence",
            f"{float(np.nanmean(motion.confidence)):.2f}",
            f"mean over joints and frames; {sure:.0%} at 0.5 or more",
        ),
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
