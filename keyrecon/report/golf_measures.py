"""What a coach asks of a swing, as numbers that tell how far they may be off.

Turns are angles of the line between both shoulders (hips) about the vertical, counted from the
beginning of the upswing, positive away from the target; the X-factor is the shoulders' turn less
the hips' (McLean, Golf Magazine, 1992). The spine goes from between the hips to the neck; it bends
ahead towards the ball and aside away from the target, against the vertical and the line between the
ankles at address. Sway is how far the middle between the hips (or the head) has moved towards the
target since then, lift how far up. The vertical is that of the fitted swing. All of it is measured
as a camera sees it that stands still, whatever the real one did.

Every number has a doubt, one standard deviation, made of two parts that are independent:

- how far such numbers are off on rendered swings of players that the prior had not seen, at the
  true moment (`MEASURE_ERRORS`; `python benchmarks/golf_measures.py` prints them). From one camera
  this is the larger part: depth comes from the prior.
- when the key posture was: half a frame either way, which is a frame / sqrt(12), and what finding
  it adds (`KEY_ERRORS`). It is multiplied by how fast the number changes there: turns hardly change
  at the top, and by hundreds of degrees a second at the hit. Tempo is all timing:

      tempo = up / down,   d tempo = -d start / down + d top (1 / down + up / down^2)
                                     - d hit up / down^2

  At 30 frames a second, 0.75 s up and 0.25 s down, one frame at the hit alone is 0.4.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from keyrecon.golf.records import FittedSwing, Observations, RecordedSwing
from keyrecon.numerics.geometry import unit_vectors

KEY_NAMES = ("Address", "Top", "Hit", "Finish")
"""Key postures in words; the address is where the upswing begins."""
KEY_ERRORS = (0.095, 0.036, 0.014, 0.125)
"""Seconds by which key postures are off, root mean square over ten real swings that were marked by
eye (`benchmarks/golf_real.py`; top .032). On the seven rendered scenes of `benchmarks/golf.py` it
is .014, .036, .012 and .025: nobody there takes the club away slowly, waggles or moves on in the
finish. With these, upswings of seven of the ten real swings were off by two to six doubts."""
MEASURE_ERRORS = {
    "shoulder_turn": (0.0, 21.2, 9.4, 10.5),
    "hip_turn": (0.0, 4.2, 6.1, 5.1),
    "x_factor": (0.0, 22.9, 3.9, 10.2),
    "spine_ahead": (2.5, 4.0, 3.3, 3.3),
    "spine_aside": (3.0, 5.7, 4.5, 4.5),
    "hip_sway": (0.0, 4.9, 1.7, 3.3),
    "hip_lift": (0.0, 1.5, 1.5, 2.5),
    "head_sway": (0.0, 7.6, 3.2, 11.4),
    "head_lift": (0.0, 1.3, 1.2, 2.8),
}
"""Root mean square errors at the true address, top, hit and finish, degrees and centimetres, of the
same scenes (`python benchmarks/golf_measures.py OUT` prints them). The model knew one other player
there, and his shoulders at the top are largely what it tells: 11 to 26 degrees too far for the one,
16 to 27 too short for the other. Most of the head's sway at the finish is one scene's, down the
line, where sway is depth; angles are as wrong from there as face-on, to a quarter."""
DEPTH_SWAY = {"hip_sway": (0.0, 16.0, 3.5, 7.0), "head_sway": (0.0, 12.0, 19.0, 9.0)}
"""By how much a sway along the line of sight is off besides, centimetres: root mean square of three
real swings from down the line about the mean of five from the front. Of the hips at the top those
told 14, 17 and 19 cm away from the target, these -4 to 1, of the head at the hit 26, 2 and 17 cm
towards it, these -4 to 4."""
RATE_WINDOW = 0.05
"""Seconds to either side over which it is measured how fast a number changes."""


@dataclass(frozen=True, eq=False)
class Curve:
    """A number over time."""

    name: str
    """As in tables for programs."""
    label: str
    """In words."""
    unit: str
    values: Float[np.ndarray, "T"]

    error: Float[np.ndarray, "T"]
    """Usual error where the moment is known: that of the key postures, and between them between."""


@dataclass(frozen=True)
class KeyMeasure:
    """A number of one swing, at a key posture or of the whole."""

    name: str
    label: str
    posture: str
    """One of KEY_NAMES; empty for the whole swing."""
    frame: float
    """NaN for the whole swing."""
    value: float
    doubt: float
    """One standard deviation."""
    unit: str


@dataclass(frozen=True, eq=False)
class SwingMeasures:
    """All numbers of one swing."""

    curves: tuple[Curve, ...]
    keys: tuple[KeyMeasure, ...]
    club_found: float
    """Share of the frames in which the club was detected."""

    def curve(self, name: str) -> Curve:
        """A curve by its name."""
        return next(curve for curve in self.curves if curve.name == name)

    def key(self, name: str, posture: str = "") -> KeyMeasure:
        """A number by its name and posture."""
        return next(k for k in self.keys if (k.name, k.posture) == (name, posture))


AT = {
    "shoulder_turn": (1, 2, 3), "hip_turn": (1, 2, 3), "x_factor": (1, 2, 3),
    "spine_ahead": (0, 1, 2), "spine_aside": (0, 1, 2), "hip_sway": (1, 2, 3),
    "hip_lift": (1, 2, 3), "head_sway": (1, 2, 3), "head_lift": (1, 2, 3),
}  # fmt: skip
"""Key postures at which each number says something: what is counted from the address is 0 there."""


def record_swing(
    fitted: FittedSwing,
    observations: Observations,
    doubts: tuple[str, ...] = (),
    notes: tuple[str, ...] = (),
    shown: tuple[bool, bool, bool, bool] = (True, True, True, True),
) -> RecordedSwing:
    """What is kept of a fitted swing."""
    up = fitted.state.rotation[..., 1] * ([-1, 1, 1] if observations.left_handed else [1, 1, 1])
    return RecordedSwing(
        motion=fitted.motion,
        club=fitted.club,
        club2d=fitted.club2d,
        club_seen=np.isfinite(observations.club).all(axis=(1, 2)),
        keys=fitted.keys,
        vertical=unit_vectors(up.mean(axis=0), 1e-9),
        left_handed=observations.left_handed,
        doubts=doubts,
        notes=notes,
        shown=shown,
        camera=fitted.camera,
    )


def measure_swing(swing: RecordedSwing) -> SwingMeasures:
    """The numbers of a swing; NaN where they need a key posture that its film does not show."""
    curves = measure_curves(swing)
    keys = _measure_tempo(swing)
    for curve in curves:
        keys += [_measure_key(swing, curve, posture) for posture in AT[curve.name]]
    return SwingMeasures(curves, tuple(keys), float(swing.club_seen[swing.fitted].mean()))


def measure_curves(swing: RecordedSwing) -> tuple[Curve, ...]:
    """Everything that is measured in every frame; NaN in those to which nothing was fitted."""
    start = _nearest(swing, swing.keys[0])
    across, ahead, up = _player_axes(swing, start)
    shoulders, hips = (_turn(swing, part, start) for part in ("shoulder", "hip"))
    pelvis, neck, head = _mid(swing, "hip"), _joint(swing, "neck"), _joint(swing, "head_top")
    spine = neck - pelvis
    centimetres = 100.0 if swing.motion.units == "m" else 100.0 * STATURE_OF_UNITS
    moved = {"hip": pelvis - pelvis[start], "head": head - head[start]}
    values = {
        "shoulder_turn": shoulders,
        "hip_turn": hips,
        "x_factor": shoulders - hips,
        "spine_ahead": _degrees(spine @ ahead, spine @ up),
        "spine_aside": _degrees(-(spine @ across), spine @ up),
        "hip_sway": centimetres * moved["hip"] @ across,
        "hip_lift": centimetres * moved["hip"] @ up,
        "head_sway": centimetres * moved["head"] @ across,
        "head_lift": centimetres * moved["head"] @ up,
    }
    if not swing.shown[0]:
        values = {n: v if n in ABSOLUTE else np.full_like(v, np.nan) for n, v in values.items()}
    fitted = np.where(swing.fitted, 1.0, np.nan)
    return tuple(
        Curve(
            name, *LABELS[name], fitted * of_name,
            fitted * _spread_errors(swing, _key_errors(swing, name)),
        )
        for name, of_name in values.items()
    )  # fmt: skip


def _key_errors(swing: RecordedSwing, name: str) -> Float[np.ndarray, "4"]:
    """Usual errors of a number at the key postures, as this camera stands."""
    usual = np.array(MEASURE_ERRORS[name])
    if name not in DEPTH_SWAY:
        return usual
    start = _nearest(swing, swing.keys[0])
    across, _, _ = _player_axes(swing, start)
    sight = unit_vectors(_mid(swing, "hip")[start], 1e-9)
    errors: Float[np.ndarray, "4"] = np.hypot(usual, np.array(DEPTH_SWAY[name]) * (across @ sight))
    return errors


def _spread_errors(swing: RecordedSwing, at_keys: Float[np.ndarray, "4"]) -> Float[np.ndarray, "T"]:
    """Errors of the key postures over all frames."""
    frames = np.arange(len(swing.motion.time))
    spread: Float[np.ndarray, "T"] = np.interp(frames, np.nan_to_num(swing.keys), at_keys)
    return spread


LABELS = {
    "shoulder_turn": ("Shoulder turn", "°"), "hip_turn": ("Hip turn", "°"),
    "x_factor": ("X-factor", "°"), "spine_ahead": ("Spine, ahead", "°"),
    "spine_aside": ("Spine, aside", "°"), "hip_sway": ("Hip sway", "cm"),
    "hip_lift": ("Hip lift", "cm"), "head_sway": ("Head sway", "cm"),
    "head_lift": ("Head lift", "cm"),
}  # fmt: skip
"""In words, and units."""
ABSOLUTE = ("spine_ahead", "spine_aside")
"""What is not counted from the address."""
STATURE_OF_UNITS = 1.75
"""Metres of a body height, where a motion has no metres."""


def key_time_errors(swing: RecordedSwing) -> Float[np.ndarray, "4"]:
    """Standard deviation of the key postures' times, seconds."""
    return np.sqrt(np.array(KEY_ERRORS) ** 2 + 1 / (12 * swing.motion.fps**2))


def _measure_tempo(swing: RecordedSwing) -> list[KeyMeasure]:
    """Times of upswing and downswing, and their ratio."""
    time = swing.motion.time
    start, top, hit = np.interp(swing.keys[:3], np.arange(len(time)), time)
    start = start if swing.shown[0] else np.nan
    errors = np.where(swing.shown, key_time_errors(swing), np.nan)
    up, down = top - start, hit - top
    if down > 0:
        slopes = np.array([-1 / down, 1 / down + up / down**2, -up / down**2])
        tempo, doubt = up / down, float(np.linalg.norm(slopes * errors[:3]))
    else:
        tempo, doubt = float("nan"), float("nan")
    whole = ("", float("nan"))
    return [
        KeyMeasure("upswing", "Upswing", *whole, up, float(np.hypot(*errors[:2])), "s"),
        KeyMeasure("downswing", "Downswing", *whole, down, float(np.hypot(*errors[1:3])), "s"),
        KeyMeasure("tempo", "Tempo", *whole, tempo, doubt, ": 1"),
    ]


def _measure_key(swing: RecordedSwing, curve: Curve, posture: int) -> KeyMeasure:
    """A curve's value at a key posture."""
    moment = float(np.interp(swing.keys[posture], np.arange(len(curve.values)), swing.motion.time))
    time, values = swing.motion.time[swing.fitted], curve.values[swing.fitted]
    value = float(np.interp(moment, time, values)) if swing.shown[posture] else np.nan
    around = moment + np.array([-RATE_WINDOW, RATE_WINDOW])
    around = np.clip(around, time[0], time[-1])
    before, after = np.interp(around, time, values)
    rate = (after - before) / max(around[1] - around[0], 1e-9)
    doubt = float(
        np.hypot(_key_errors(swing, curve.name)[posture], rate * key_time_errors(swing)[posture])
    )
    doubt = doubt if np.isfinite(value) else np.nan
    return KeyMeasure(
        curve.name, curve.label, KEY_NAMES[posture], float(swing.keys[posture]), value, doubt,
        curve.unit,
    )  # fmt: skip


def _nearest(swing: RecordedSwing, key: float) -> int:
    return int(np.clip(np.nan_to_num(np.round(key)), 0, len(swing.motion.time) - 1))


def _joint(swing: RecordedSwing, name: str) -> Float[np.ndarray, "T 3"]:
    return swing.standing_points[:, swing.motion.skeleton.index(name)]


def _mid(swing: RecordedSwing, part: str) -> Float[np.ndarray, "T 3"]:
    return (_joint(swing, f"left_{part}") + _joint(swing, f"right_{part}")) / 2


def _player_axes(
    swing: RecordedSwing, start: int
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
    """Towards the target, towards the ball, and up, by the ankles at address."""
    up = swing.vertical
    right = _joint(swing, "right_ankle")[start] - _joint(swing, "left_ankle")[start]
    right = unit_vectors(right - (right @ up) * up, 1e-9)
    ahead = np.cross(up, right)
    return (right if swing.left_handed else -right), ahead, up


def _degrees(
    opposite: Float[np.ndarray, "T"], adjacent: Float[np.ndarray, "T"]
) -> Float[np.ndarray, "T"]:
    return np.degrees(np.arctan2(opposite, adjacent))


def _turn(swing: RecordedSwing, part: str, start: int) -> Float[np.ndarray, "T"]:
    """Angle of a line about the vertical since a frame, degrees, away from the target."""
    up = swing.vertical
    line = _joint(swing, f"right_{part}") - _joint(swing, f"left_{part}")
    flat = line - (line @ up)[:, None] * up
    east = unit_vectors(flat[start], 1e-9)
    angle = np.unwrap(np.arctan2(flat @ np.cross(up, east), flat @ east))
    sign = 1.0 if swing.left_handed else -1.0
    return sign * np.degrees(angle - angle[start])
