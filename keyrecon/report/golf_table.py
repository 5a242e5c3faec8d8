"""golf.csv: everything that is measured of a swing, with its doubt, for spreadsheets and programs.

One row per number. Rows whose `frame` is empty are of the whole swing. Rows at a key posture come
first, then every number in every frame, in the order of time; `doubt` is one standard deviation
(`golf_measures` says of what). Frames to which nothing was fitted have empty values.
"""

import csv
import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from keyrecon.golf.records import RecordedSwing
from keyrecon.io.durable import write_durably
from keyrecon.report.golf_measures import SwingMeasures, measure_swing

HEAD = ("measure", "posture", "frame", "time", "value", "doubt", "unit")


def write_golf_table(path: Path, swing: RecordedSwing) -> None:
    """Write all numbers; the lines on top say what is told of the film, and what speaks against a
    doubtful fit."""
    measures = measure_swing(swing)
    text = io.StringIO()
    text.write("# keyrecon golf swing; doubt is one standard deviation\n")
    for note in swing.notes:
        text.write(f"# {note}\n")
    for doubt in swing.doubts:
        text.write(f"# DOUBTFUL, these are no measurements: {doubt}\n")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(HEAD)
    writer.writerows(_key_rows(swing, measures))
    writer.writerows(_frame_rows(swing, measures))
    write_durably(path, text.getvalue())


def _key_rows(swing: RecordedSwing, measures: SwingMeasures) -> Iterator[tuple[str, ...]]:
    time = swing.motion.time
    for key in measures.keys:
        moment = np.interp(key.frame, np.arange(len(time)), time) if key.posture else np.nan
        yield (
            key.name, key.posture.lower(), _cell(key.frame, 2), _cell(float(moment), 4),
            _cell(key.value, 3), _cell(key.doubt, 3), key.unit,
        )  # fmt: skip


def _frame_rows(swing: RecordedSwing, measures: SwingMeasures) -> Iterator[tuple[str, ...]]:
    club = np.where(swing.fitted[:, None, None], swing.club2d, np.nan)
    for frame, moment in enumerate(swing.motion.time):
        at = ("", str(frame), f"{moment:.4f}")
        for curve in measures.curves:
            value = _cell(float(curve.values[frame]), 3)
            error = _cell(float(curve.error[frame]), 3)
            yield (curve.name, *at, value, error, curve.unit)
        for end, name in enumerate(("hands", "club_head")):
            for axis, letter in enumerate("xy"):
                place = _cell(float(club[frame, end, axis]), 1)
                yield (f"{name}_{letter}", *at, place, "", "px")


def _cell(value: float, digits: int) -> str:
    """A number, or nothing where it is unknown."""
    return f"{value:.{digits}f}" if np.isfinite(value) else ""
