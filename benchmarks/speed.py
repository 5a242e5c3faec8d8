"""Time of every automatic stage per frame, and peak memory, on one rendered sequence.

    python benchmarks/speed.py [--work DIR] [--mocap DIR] [--only NAME]

Everything is made anew. Times are wall-clock; quote them with the number of cores.
"""

import argparse
import os
import resource
import tempfile
import time
from pathlib import Path

from accuracy import Case, solve
from sequences import DATA, TENNIS, render

from keyrecon.io.formats.picks import read_picks
from keyrecon.io.stages import StageStore
from keyrecon.io.video import open_video
from keyrecon.metrics import read_truth
from keyrecon.pipeline import Options, prepare


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--work", type=Path, default=Path("benchmarks/work"))
    parser.add_argument("--mocap", type=Path, default=DATA / "mocap")
    parser.add_argument("--only", default=TENNIS[0].name, choices=[s.name for s in TENNIS])
    words = parser.parse_args()
    sequence = next(s for s in TENNIS if s.name == words.only)
    folder = render(sequence, words.work, words.mocap)
    video = open_video(folder / "video.mp4")
    decoding = time.perf_counter()
    for _ in video.frames():
        pass
    decoding = time.perf_counter() - decoding
    with tempfile.TemporaryDirectory() as cache:
        store = StageStore(Path(cache))
        picks = read_picks(folder / "picks.json")
        preparation = prepare(video, picks, Options(), store.keep)
        solve(Case(sequence, preparation, read_truth(folder / "truth.npz"), store), Options())
    print(f"{sequence.name}: {len(video)} frames of {video.width}x{video.height}, "
          f"{os.cpu_count()} cores")  # fmt: skip
    print(f"{'stage':<16}{'ms per frame':>14}")
    for stage, seconds in store.seconds.items():
        print(f"{stage:<16}{seconds / len(video) * 1000:14.2f}")
    print(f"{'all stages':<16}{sum(store.seconds.values()) / len(video) * 1000:14.2f}")
    print(f"{'(decoding once)':<16}{decoding / len(video) * 1000:14.2f}")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"Peak memory {peak:.0f} MB.")


if __name__ == "__main__":
    main()
