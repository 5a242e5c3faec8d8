"""The numbers of one swing or of two as HTML, each with its doubt."""

from collections.abc import Sequence

import numpy as np

from keyrecon.report.golf_measures import KEY_NAMES, KeyMeasure, SwingMeasures
from keyrecon.report.markup import table, text

DOUBT_NOTE = (
    "A doubt is one standard deviation, made of two independent parts. The first is how far such "
    "numbers were off on rendered swings of players that the motion model had not seen: from one "
    "camera depth comes from the model, so angles that turn in depth are the least sure. The "
    "second is when the key posture was: half a frame either way (a frame / &radic;12) and what "
    "finding it adds (14 ms at the hit, 36 at the top, about 0.1 s at start and finish, as marked "
    "by eye in ten real swings), times how fast the number changes there. Tempo is timing alone; "
    "at 30 frames a second, 0.75 s up and 0.25 s down, one frame at the hit moves it by 0.4."
)


def warning(doubts: Sequence[str]) -> str:
    """What cannot be overlooked: the fit does not explain the video."""
    if not doubts:
        return ""
    lines = "".join(f"<li>{text(doubt)}</li>" for doubt in doubts)
    return (
        '<section class="warning" role="alert"><h2>This fit is doubtful</h2>'
        f"<ul>{lines}</ul><p>Tempo and angles are not shown: they would not be measurements. Look "
        "at the fit through the swing; where body or club is off, put it right on the page of "
        "<code>keyrecon annotate</code> (2 Swing), and fit again.</p></section>"
    )


def cards(measures: SwingMeasures) -> str:
    """The numbers that a coach asks first."""
    up, down, tempo = (measures.key(name) for name in ("upswing", "downswing", "tempo"))
    rows = [
        ("Tempo", tempo, f"{_plain(up)} s up, {_plain(down)} s down"),
        ("Shoulder turn", measures.key("shoulder_turn", "Top"), "at the top"),
        ("Hip turn", measures.key("hip_turn", "Top"), "at the top"),
        ("X-factor", measures.key("x_factor", "Top"), "at the top"),
        ("Spine angle", measures.key("spine_ahead", "Address"), "ahead, at address"),
        ("Hip sway", measures.key("hip_sway", "Hit"), "towards the target, at the hit"),
    ]
    tiles = "".join(
        f"<div><dt>{text(name)}</dt><dd>{_value(measure)} <i>&plusmn; {_doubt(measure)}</i>"
        f"<small>{text(more)}</small></dd></div>"
        for name, measure, more in rows
    )
    return f'<dl class="cards">{tiles}</dl>'


def measure_table(measures: SwingMeasures) -> str:
    """A row per number, a column per key posture; empty where a number says nothing."""
    names = dict.fromkeys(key.name for key in measures.keys)
    cells = {
        (key.name, key.posture): f"{_plain(key)} \u00b1 {_doubt(key)}" for key in measures.keys
    }
    labels = {key.name: _label(key) for key in measures.keys}
    rows = [
        [labels[name], *(cells.get((name, posture), "") for posture in ("", *KEY_NAMES))]
        for name in names
    ]
    return table(["", "Whole", *KEY_NAMES], rows, "Numbers of the swing")


def comparison_table(pair: Sequence[SwingMeasures], names: Sequence[str]) -> str:
    """A row per number of both swings with their difference, in two columns."""
    rows = [
        [
            f"{_label(one)}{', ' if one.posture else ''}{one.posture.lower()}",
            *(f"{_plain(key)} \u00b1 {_doubt(key)}" for key in (one, other)),
            _difference(one, other),
        ]
        for one, other in zip(pair[0].keys, pair[1].keys, strict=True)
    ]
    head, half = ["", *names, f"{names[1]} less {names[0]}"], (len(rows) + 1) // 2
    tables = (table(head, part, "Numbers of both swings") for part in (rows[:half], rows[half:]))
    return f'<div class="pair tables">{"".join(tables)}</div>'


def _label(key: KeyMeasure) -> str:
    return f"{key.label}, {'to 1' if key.unit == ': 1' else key.unit}"


def _difference(one: KeyMeasure, other: KeyMeasure) -> str:
    digits = _digits(one)
    if not np.isfinite(one.value + other.value):
        return "\u2013"
    apart = _rounded(other.value - one.value, digits)
    return f"{apart:+.{digits}f} \u00b1 {np.hypot(one.doubt, other.doubt):.{digits}f}"


def _rounded(value: float, digits: int) -> float:
    """Rounded, and never minus nought."""
    return float(np.round(value, digits)) + 0.0


def _digits(key: KeyMeasure) -> int:
    return {"s": 2, ": 1": 1}.get(key.unit, 0)


def _plain(key: KeyMeasure) -> str:
    digits = _digits(key)
    return f"{_rounded(key.value, digits):.{digits}f}" if np.isfinite(key.value) else "\u2013"


def _value(key: KeyMeasure) -> str:
    gap = "" if key.unit == "°" else " "
    return text(f"{_plain(key)}{gap}{key.unit}")


def _doubt(key: KeyMeasure) -> str:
    return f"{key.doubt:.{_digits(key)}f}" if np.isfinite(key.doubt) else "\u2013"
