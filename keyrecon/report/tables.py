"""The tables of the report: bones, joints, feet, stage times and options."""

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass

import numpy as np

from keyrecon.body import plain_name
from keyrecon.io.formats.conventions import stature
from keyrecon.records import Motion
from keyrecon.report.markup import ReportMaterial, note, number, section, table
from keyrecon.report.summary import (
    bone_lengths,
    correction,
    foot_speed,
    joint_acceleration,
    missing_shares,
    truth_error_2d,
)


def body_tables(material: ReportMaterial) -> str:
    """Bones that should not change, joints that should not jitter, feet that should not slide."""
    motion = material.motion
    slow = foot_speed(motion, material.track)
    feet = (
        note(
            f"Slower foot: {np.median(slow):.2f} player heights per second across the picture "
            f"(median), {np.quantile(slow, 0.9):.2f} at the 90th percentile. A player on the "
            "ground has one foot at rest most of the time, so with a camera at rest this should "
            "be near 0."
        )
        if len(slow)
        else ""
    )
    return section(
        "body",
        "Bones, joints and feet",
        f'<div class="pair tables"><div><h3>Bone lengths</h3>{_bone_table(motion)}</div>',
        f"<div><h3>Joints in the picture</h3>{_joint_table(material)}</div></div>",
        _joint_note(),
        feet,
    )


def _joint_note() -> str:
    return note(
        "Bones: mean over time, its standard deviation, and the length against that of the other "
        "side and of the average adult (Winter). Joints: not found, share of frames; moved by "
        "refinement and error, median in % of the player's height; acceleration, mean in player "
        "heights per second squared: noise shows there first."
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
        rows.append(
            (
                f"{plain_name(skeleton.names[parent])} to {plain_name(skeleton.names[child])}",
                f"{mean[bone]:.3f}",
                f"{spread[bone] / mean[bone]:.2%}",
                number(mirrored, "+z.1%"),
                f"{mean[bone] / expected[bone] - 1:+z.1%}",
            )
        )
    head = ("bone", f"length, {unit}", "varies", "other side", "average")
    return table(head, rows, "Bone lengths")


def _joint_table(material: ReportMaterial) -> str:
    motion, track = material.motion, material.track
    columns = [
        ("not found", missing_shares(motion), ".1%"),
        ("moved", correction(motion, track), ".1%"),
        (
            "acceleration before",
            joint_acceleration(motion.points2d_propagated, motion, track),
            ".1f",
        ),
        ("acceleration after", joint_acceleration(motion.points2d, motion, track), ".1f"),
    ]
    if material.true_joints is not None:
        error = truth_error_2d(motion, material.true_joints.points2d, track)
        columns.append(("error", error, ".1%"))
    rows = [
        (plain_name(name), *(number(float(values[joint]), form) for _, values, form in columns))
        for joint, name in enumerate(motion.skeleton.names)
    ]
    return table(("joint", *(name for name, _, _ in columns)), rows, "Joints")


def stage_times(seconds: Mapping[str, float]) -> str:
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
    rows = list(_flat_options(options))
    listed = table(("option", "value"), rows, "Options", "texts")
    return f"<details><summary>All {len(rows)} options</summary>{listed}</details>"


def _flat_options(options: object, prefix: str = "") -> Iterator[tuple[str, object]]:
    if not is_dataclass(options):
        return
    for field in fields(options):
        value = getattr(options, field.name)
        if is_dataclass(value):
            yield from _flat_options(value, f"{prefix}{field.name}.")
        else:
            yield prefix + field.name, value
