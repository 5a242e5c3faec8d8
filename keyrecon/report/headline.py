"""The head of the report, and how far to trust it: the figures that matter and how to read them."""

import numpy as np

from keyrecon.metrics import Scores, evaluate_motion
from keyrecon.records import Annotations, Motion
from keyrecon.report.markup import ReportMaterial, note, sentence, table, text
from keyrecon.report.summary import expected_length, missing_shares
from keyrecon.uncertainty import uncertain_share


def opening(material: ReportMaterial) -> str:
    """What was filmed, and in one line how much of it was marked and how sure the rest is."""
    video, motion = material.video, material.motion
    error = expected_length(motion)
    sure = (
        ""
        if error is None
        else f"; joints are expected to be {in_words(error, motion.units)} off in the picture,"
        " more in depth"
    )
    return (
        f'<header><p class="kicker">keyrecon motion report</p><h1>{text(video.name)}</h1>'
        f'<p class="lead">{video.width} &times; {video.height} px, {motion.time[-1]:.1f} s, '
        f"{len(motion.time):,} frames, {len(marked_frames(material.annotations))} of them marked "
        f"by a person{sure}</p>{''.join(note(sentence(line)) for line in material.shots)}</header>"
    )


def figures(material: ReportMaterial) -> str:
    """The figures that matter as cards, every measure where the truth is known, and conventions."""
    motion, annotations = material.motion, material.annotations
    count, marked = len(motion.points3d), marked_frames(annotations)
    asked = len(material.keyframes.frames)
    scores = None if material.truth is None else evaluate_motion(motion, material.truth)
    cards = [
        (
            "Marked by a person",
            f"{len(marked)}",
            f"of {count:,} frames; {asked} keyframes were asked for",
        ),
        (
            "Marks",
            f"{marked_share(annotations, count):.2%}",
            "of the frames, where one half of the body counts half",
        ),
        *_error_cards(motion),
        *([] if scores is None else _score_cards(scores)),
    ]
    tiles = "".join(
        f"<div><dt>{text(name)}</dt><dd>{text(value)}<small>{text(more)}</small></dd></div>"
        for name, value, more in cards
    )
    return (
        f'<dl class="cards">{tiles}</dl>{_lens(material)}{_conventions(motion)}'
        f"{'' if scores is None else accuracy(scores)}"
    )


def marked_frames(annotations: Annotations) -> list[int]:
    """Frames with a mark of a person."""
    marked = np.isfinite(annotations.joints).all(axis=2).any(axis=1)
    return annotations.frames[marked].tolist()


def marked_share(annotations: Annotations, count: int) -> float:
    """Share of `count` frames that a person marked; one half of the body counts half."""
    marked = np.isfinite(annotations.joints).all(axis=2)
    lower = annotations.skeleton.is_lower
    halves = marked[:, lower].any(axis=1).sum() + marked[:, ~lower].any(axis=1).sum()
    return float(halves / 2 / count)


def in_words(length: float, units: str) -> str:
    """A length in the motion's unit as a person says it: centimetres, or a share of the height."""
    return f"{100 * length:.1f} cm" if units == "m" else f"{length:.1%} of the height"


def _error_cards(motion: Motion) -> list[tuple[str, str, str]]:
    missing = float(missing_shares(motion).mean())
    located = ("Found in the picture", f"{1 - missing:.1%}", "of joints; the rest is filled in")
    error = expected_length(motion)
    if error is None:
        return [located]
    value, _, of = in_words(error, motion.units).partition(" of ")
    return [
        (
            "Expected error",
            value,
            f"{'of the height, ' if of else ''}mean of all joints across the picture; depth is "
            "less sure",
        ),
        (
            "Uncertain",
            f"{uncertain_share(motion):.0%}",
            "of the frames have arms, legs or head that may be off",
        ),
        located,
    ]


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


def _lens(material: ReportMaterial) -> str:
    if material.lens is None:
        return ""
    return note(f"<strong>The lens is not known.</strong> {sentence(material.lens)}")


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
