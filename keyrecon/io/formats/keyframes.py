"""keyframes.json: the frames that a person is asked to annotate, and what each stands for.

    {"n_frames": 1800, "upper": [..], "lower": [..], "frames": [union, sorted],
     "beta": {"upper": .., "lower": ..}, "T": 10, "alpha": 0.95,
     "method": "coverage", "coverage": {..}, "cost": 0.015, "printed_count": {..},
     "nearest": {..}, "distance": {..}, "represented": {..}}

`method` tells how they were chosen, "paper" by Eq. 2-4 as printed; older files are without it.
`cost` is the share of frames to mark, a half body counted half, `printed_count` the keyframes
that the choice as printed (Eq. 2-4) would take at the same beta. `nearest` has the keyframe of
every frame, `distance` how far it is (player heights), `represented` the frames closer than beta,
as [first, end) stretches.
"""

import json
from typing import Any

import numpy as np
from jaxtyping import Bool

from keyrecon.errors import KeyreconError, explain
from keyrecon.records import HalfKeyframes, Keyframes

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
        "nearest": {name: half.nearest.tolist() for name, half in halves.items()},
        "distance": {
            name: np.round(half.distance.astype(float), 5).tolist() for name, half in halves.items()
        },
        "represented": {name: _stretches(half.represented) for name, half in halves.items()},
    }
    lines = (f"  {json.dumps(key)}: {json.dumps(value)}" for key, value in data.items())
    return "{\n" + ",\n".join(lines) + "\n}\n"


def keyframes_from_json(text: str) -> Keyframes:
    """Read what `keyframes_to_json` wrote; raises KeyreconError that names what is wrong."""
    try:
        data = json.loads(text)
        halves = {name: _half(data, name) for name in HALVES}
        return Keyframes(
            upper=halves["upper"],
            lower=halves["lower"],
            reach=int(data["T"]),
            alpha=float(data["alpha"]),
            method=_method(data),
        )
    except (ValueError, KeyError, TypeError, AttributeError) as fault:
        raise KeyreconError(
            f"keyframes.json cannot be read ({explain(fault)}); make it again with keyrecon "
            "keyframes."
        ) from fault


def _method(data: dict[str, Any]) -> str:
    method = data.get("method", METHODS[0])
    if method not in METHODS:
        raise ValueError(f"'method' must be one of {', '.join(METHODS)}")
    return method


def _half(data: dict[str, Any], name: str) -> HalfKeyframes:
    n_frames = int(data["n_frames"])
    frames = np.array(data[name], dtype=np.int64)
    nearest = np.array(data["nearest"][name], dtype=np.int64)
    distance = np.array(data["distance"][name], dtype=np.float64)
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
        represented=_from_stretches(data["represented"][name], n_frames),
        coverage=float(data["coverage"][name]),
        beta=float(data["beta"][name]),
        distance=distance,
        printed_count=int(data["printed_count"][name]),
    )


def _stretches(flags: Bool[np.ndarray, "T"]) -> list[list[int]]:
    """[first, end) of every run of True."""
    ends = np.flatnonzero(np.diff(flags.astype(np.int8), prepend=0, append=0))
    return ends.reshape(-1, 2).tolist()


def _from_stretches(stretches: list[list[int]], n_frames: int) -> Bool[np.ndarray, "T"]:
    flags = np.zeros(n_frames, dtype=bool)
    for first, end in stretches:
        flags[first:end] = True
    return flags
