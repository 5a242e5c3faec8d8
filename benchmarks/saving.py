"""How long an edit on the annotator's page takes to be safe on the disk, by number of keyframes.

    python benchmarks/saving.py [--folder DIR]

Marks every joint of some keyframes in one go, then moves one joint at a time and times the store
until it acknowledges: journal and annotations.json are then on the disk. Most of it is waiting
for that disk, so give a folder on the one that projects lie on. Prints a table, asserts nothing.
"""

import argparse
import itertools
import statistics
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from keyrecon.annotate.store.cells import Change
from keyrecon.annotate.store.edits import Limits, MarkEdit
from keyrecon.annotate.store.store import Store
from keyrecon.body import LSP14
from keyrecon.io.workspace import Workspace

KEYFRAMES = (1, 30, 200, 1000)
EDITS = 60
GAP = 10
"""Frames between two keyframes."""


def open_store(folder: Path, keyframes: int) -> Store:
    """A project whose keyframes are all marked."""
    (folder / "project.toml").write_text('[video]\npath = "v.mp4"\nfingerprint = "x"\n')
    store = Store(Workspace(folder), Limits(LSP14, GAP * keyframes, (1280, 720)))
    places = itertools.product(range(keyframes), enumerate(LSP14.names))
    store.apply(
        "import",
        [
            Change(("mark", GAP * k, name), None, [100.5 + k % 50, 200.25 + j, 2])
            for k, (j, name) in places
        ],
    )
    return store


def time_edits(store: Store, keyframes: int) -> list[tuple[float, float]]:
    """Milliseconds by the clock and of computing, for each edit."""
    times = []
    for n in range(EDITS):
        frame = GAP * (n % keyframes)
        was = tuple(store.state.cells["mark", frame, "neck"])
        moved = MarkEdit(f"edit {n}", frame, "neck", (300.0 + n, 50.0, 2), was)
        clock, computing = time.perf_counter(), time.process_time()
        assert store.submit([moved])[0]["ok"]
        times.append((1e3 * (time.perf_counter() - clock), 1e3 * (time.process_time() - computing)))
    return times


def main() -> None:
    """One line for each number of keyframes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, help="where to try; a temporary folder without it")
    place = parser.parse_args().folder
    print(f"{'keyframes':>10}{'median':>10}{'worst':>10}{'computing':>11}  ms")
    for keyframes in KEYFRAMES:
        with TemporaryDirectory(dir=place) as folder:
            store = open_store(Path(folder), keyframes)
            waited, computed = zip(*time_edits(store, keyframes), strict=True)
            store.close()
        median, computing = statistics.median(waited), statistics.median(computed)
        print(f"{keyframes:>10}{median:>10.1f}{max(waited):>10.1f}{computing:>11.1f}")


if __name__ == "__main__":
    main()
