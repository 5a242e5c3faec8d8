"""keyframes.json: the frames that a person is asked to annotate, and what each stands for.

    {"n_frames": 1800, "upper": [..], "lower": [..], "frames": [union, sorted],
     "beta": {"upper": .., "lower": ..}, "T": 10, "alpha": 0.95,
     "method": "coverage", "coverage": {..}, "cost": 0.015, "printed_count": {..},
     "gains": {"upper": {"beta": .., "order": [..], "coverage": [..], "next_gain": ..}, ..},
     "nearest": {..}, "distance": {..}, "represented": {..}}

`method` tells how they were chosen, "paper" by Eq. 2-4 as printed; older files are without it.
`cost` is the share of frames to mark, a half body counted half, `printed_count` the keyframes
that the choice as printed (Eq. 2-4) would take at the same beta. `nearest` has the keyframe of
every frame, `distance` how far it is (player heights; null in frames without the player, for which
it does not stand), `represented` the frames closer than beta, as [first, end) stretches. `gains`
lists the keyframes by what they bring, the best first, with the coverage that each and those before
it reach at the distance `beta`, and what one more would add; older files are without it.
"""

import json
from math import inf, isfinite
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Int

from keyrecon.reading import parse_json, read_text, reading, real, whole
from keyrecon.records import HalfKeyframes, Keyframes, MarkGains

HALVES = ("upper", "lower")
METHODS = ("coverage", "paper")
"""Ways to choose keyframes; files of versions that wrote none were chosen by the first."""


def keyframes_to_json(keyframes: Keyframes) -> str:
    """The text of keyframes.json."""
    halves = {name: getattr(keyframes, name) for name in HALVES}
    n_frames = len(keyframes.upper.nearest)
    labels = sum(len(half.frames) for half in halves.values())
    data = {
        "n_frames": n_frames,
        "upper": keyframes.upper.frames.tolist(),
        "lower": keyframes.lower.frames.tolist(),
        "frames": keyframes.frames.tolist(),
        "beta": {name: float(half.beta) for name, half in halves.items()},
        "T": keyframes.reach,
        "alpha": keyframes.alpha,
        "method": keyframes.method,
        "coverage": {name: float(half.coverage) for name, half in halves.items()},
        "cost": labels / 2 / n_frames,
        "printed_count": {name: half.printed_count for name, half in halves.items()},
        "gains": {name: _gains_to_json(half.gains) for name, half in halves.items() if half.gains},
        "nearest": {name: half.nearest.tolist() for name, half in halves.items()},
        "distance": {
            name: [round(far, 5) if isfinite(far) else None for far in half.distance.tolist()]
            for name, half in halves.items()
        },
        "represented": {name: _stretches(half.represented) for name, half in halves.items()},
    }
    lines = (f"  {json.dumps(key)}: {json.dumps(value)}" for key, value in data.items())
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _gains_to_json(gains: MarkGains) -> dict[str, Any]:
    return {
        "beta": gains.beta,
        "order": gains.order.tolist(),
        "coverage": np.round(gains.coverage, 5).tolist(),
        "next_gain": round(gains.next_gain, 5),
    }


def read_keyframes(path: Path | str) -> Keyframes:
    """Read a file that `keyframes_to_json` wrote; raises KeyreconError that says what is wrong."""
    path = Path(path)
    with reading(path, "a choice of keyframes", "make it again with keyrecon keyframes"):
        return keyframes_from_json(read_text(path))


def keyframes_from_json(text: str) -> Keyframes:
    """What `keyframes_to_json` wrote; ValueError and others for any other text."""
    data = parse_json(text)
    halves = {name: _half(data, name) for name in HALVES}
    return Keyframes(
        upper=halves["upper"],
        lower=halves["lower"],
        reach=_at_least(1, whole(data["T"]), "T"),
        alpha=_share(data["alpha"], "alpha"),
        method=_method(data),
    )


def _at_least(least: int, number: int, name: str) -> int:
    if number < least:
        raise ValueError(f"'{name}' cannot be {number}")
    return number


def _share(value: object, name: str) -> float:
    if not 0 <= (share := real(value)) <= 1:
        raise ValueError(f"'{name}' cannot be {share:g}")
    return share


def _method(data: dict[str, Any]) -> str:
    method = data.get("method", METHODS[0])
    if method not in METHODS:
        raise ValueError(f"'method' must be one of {', '.join(METHODS)}")
    return method


def _half(data: dict[str, Any], name: str) -> HalfKeyframes:
    n_frames = _at_least(1, whole(data["n_frames"]), "n_frames")
    frames = np.array([whole(frame) for frame in data[name]], dtype=np.int64)
    nearest = np.array([whole(frame) for frame in _of_half(data, "nearest", name)], dtype=np.int64)
    distance = np.array([inf if v is None else real(v) for v in _of_half(data, "distance", name)])
    if not len(frames) or (np.diff(frames) <= 0).any():
        raise ValueError(f"'{name}' must list frame numbers in ascending order")
    if frames[0] < 0 or frames[-1] >= n_frames:
        raise ValueError(f"'{name}' has frames outside 0..{n_frames - 1}")
    if nearest.shape != (n_frames,) or distance.shape != (n_frames,):
        raise ValueError(f"'nearest' and 'distance' of {name} need one number per frame")
    if not np.isin(nearest, frames).all():
        raise ValueError(f"'nearest' of {name} names frames that are no keyframes")
    return HalfKeyframes(
        frames=frames,
        nearest=nearest,
        represented=_from_stretches(_of_half(data, "represented", name), n_frames),
        coverage=_share(_of_half(data, "coverage", name), "coverage"),
        beta=real(_of_half(data, "beta", name)),
        distance=distance,
        printed_count=_at_least(0, whole(_of_half(data, "printed_count", name)), "printed_count"),
        gains=_gains(data.get("gains", {}).get(name), frames, name),
    )


def _of_half(data: dict[str, Any], key: str, name: str) -> Any:
    """The value of one half of the body under a key."""
    if not isinstance(data[key], dict) or data[key].get(name) is None:
        raise ValueError(f"'{key}' tells nothing of {name}")
    return data[key][name]


def _gains(
    data: dict[str, Any] | None, frames: Int[np.ndarray, "K"], name: str
) -> MarkGains | None:
    if data is None:
        return None
    order = np.array([whole(frame) for frame in data["order"]], dtype=np.int64)
    coverage = np.array([_share(value, "coverage") for value in data["coverage"]])
    if not np.array_equal(np.sort(order), frames) or len(coverage) != len(order):
        raise ValueError(f"'gains' of {name} must list each keyframe once, with its coverage")
    next_gain = _share(data["next_gain"], "next_gain")
    return MarkGains(real(data["beta"]), order, coverage, next_gain)


def _stretches(flags: Bool[np.ndarray, "T"]) -> list[list[int]]:
    """[first, end) of every run of True."""
    ends = np.flatnonzero(np.diff(flags.astype(np.int8), prepend=0, append=0))
    return ends.reshape(-1, 2).tolist()


def _from_stretches(stretches: list[list[int]], n_frames: int) -> Bool[np.ndarray, "T"]:
    flags = np.zeros(n_frames, dtype=bool)
    for first, end in stretches:
        if not 0 <= whole(first) < whole(end) <= n_frames:
            raise ValueError(f"'represented' has frames {first} to {end} of {n_frames}")
        flags[first:end] = True
    return flags
