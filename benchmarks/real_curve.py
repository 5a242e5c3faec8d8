"""What marks teach on real videos: PCK@0.2 with ever more whole bodies marked.

    python benchmarks/real_curve.py [--only NAME ...] [--half develop|report|all] [--work DIR]

With 2, 5, 10 and 20 whole bodies, added in three orders (by time, and at random twice), each time
from nothing, joints are carried to every frame. Scored are visible joints of every second frame
with truth by eye (`benchmarks/real.py`); these are marked in no order, so that a row may be read
from left to right: it should rise, and never fall by more than a point.
"""

import argparse
from pathlib import Path

import numpy as np
from real import DEVELOP, TRUTH, Clip, hits, load_clip, take

from keyrecon.app.console import show
from keyrecon.errors import KeyreconError
from keyrecon.io.stages import StageStore
from keyrecon.library import carry_joints
from keyrecon.pipeline import Options, prepare

CURVE = (2, 5, 10, 20)
"""Whole bodies marked."""


def mark_orders(clip: Clip) -> dict[str, np.ndarray]:
    """Rows of the truth in the orders in which they are marked; every second one is never."""
    rows = np.arange(0, len(clip.truth.frames), 2)
    shuffled = {f"random {seed}": np.random.default_rng(seed).permutation(rows) for seed in (1, 2)}
    return {"by time": rows, **shuffled}


def print_curve(clip: Clip, work: Path) -> None:
    """One row for every order of marks."""
    never = np.zeros(len(clip.truth.frames), dtype=bool)
    never[1::2] = True
    known = np.isfinite(clip.truth.joints[..., 0]) & clip.seen & never[:, None]
    store = StageStore(work / clip.name / "curve")
    for name, order in mark_orders(clip).items():
        scores = []
        for count in [c for c in CURVE if c <= len(order)]:
            marks = take(clip, order[:count], order[:count])
            try:
                preparation = prepare(clip.video, (), Options(), store.keep, show, marks)
                tracks = carry_joints(preparation, marks, Options(), store.keep, show)
                scores.append(f"{hits(tracks.joints, clip, 0.2)[known].mean():7.1%}")
            except KeyreconError:
                scores.append("      -")
        print(f"{clip.name:<25}{name:<10}" + "".join(scores), flush=True)


def main() -> None:
    """Print the rows."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--half", choices=("develop", "report", "all"), default="all")
    parser.add_argument("--only", nargs="*", help="names of clips")
    parser.add_argument("--work", type=Path, default=Path("benchmarks/work/real"))
    words = parser.parse_args()
    names = [file.stem for file in sorted(TRUTH.glob("*.json"))]
    halves = {name: "develop" if name in DEVELOP else "report" for name in names}
    chosen = [n for n in names if words.half in (halves[n], "all")]
    print(f"{'clip':<25}{'order':<10}" + "".join(f"{count:7}" for count in CURVE))
    for name in [n for n in chosen if not words.only or n in words.only]:
        print_curve(load_clip(name), words.work)


if __name__ == "__main__":
    main()
