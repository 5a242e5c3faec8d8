"""An attack on everything that keyrecon reads: damaged files, absurd options, kills.

    python benchmarks/campaign.py [--reader NAME] [--files N] [--commands N] [--options N]
                                  [--kills N] [--seed S]

N cases of each kind, each in a process of its own with a limit of time and memory. A damaged file
must be read, or refused in one line that names it; a refused command must leave the project as it
was; a stage that is killed must come out to the digit as if it had not been. Prints a table and
every case that fails with the seed that makes it again; ends with 1 if there is one. The kills of
the annotator are a test: KEYRECON_KILLS=1000 python -m pytest tests/annotate/test_durability.py
"""

import argparse
import hashlib
import math
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from mutations import READERS, make_samples, mutate

from keyrecon import cli
from keyrecon.app import exporting, golf, keyframing
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.coco import write_coco
from keyrecon.io.formats.keyframes import read_keyframes
from keyrecon.io.option_tables import OptionRecord
from keyrecon.io.workspace import Workspace
from keyrecon.metrics import read_truth
from keyrecon.pipeline import Options
from keyrecon.synthetic.marks import mark_from_truth

SECONDS, MEMORY = 20.0, 4 << 30
"""Limits of a case."""
GAPS = (
    *("joints", "points2d_propagated", "expected_error", "points", "confidence"),
    *("shafts", "keys", "sd_tilt"),
)
"""Arrays in which NaN says that nothing is known there."""
ABSURD = ("-1e9", "1e12", "nan", "inf", "-inf", "0.5.5", "x", "1e400", "", "[1]")
"""Values that no option can have."""
GOOD = ("read", "refused")
LOADED = (exporting, golf, keyframing)
"""Modules that commands would load themselves: a case begins with all of them in memory."""


@dataclass(frozen=True)
class Outcome:
    """What became of a case."""

    verdict: str
    """read, refused, traceback, crash, hang, memory, not finite, many lines, changed."""
    text: str = ""


def run_apart(work: Callable[[], Outcome], seconds: float = SECONDS) -> Outcome:
    """`work` in a process of its own."""
    ours, theirs = os.pipe()
    child = os.fork()
    if not child:
        os.close(ours)
        _limit_memory()
        os.write(theirs, _told(work).encode(errors="replace")[:60_000])
        os._exit(0)
    os.close(theirs)
    try:
        status, usage = _wait(child, seconds)
        if status is None:
            return Outcome("hang", f"longer than {seconds:g} s")
        if os.WIFSIGNALED(status):
            return Outcome("crash", signal.Signals(os.WTERMSIG(status)).name)
        if usage.ru_maxrss * 1024 > MEMORY:
            return Outcome("memory", f"{usage.ru_maxrss >> 20} GiB")
        verdict, _, text = os.read(ours, 1 << 16).decode(errors="replace").partition("\n")
        return Outcome(verdict or "crash", text)
    finally:
        os.close(ours)


def _limit_memory() -> None:
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * resource.getpagesize() + MEMORY + (1 << 28)
    resource.setrlimit(resource.RLIMIT_AS, (most, most))


def _told(work: Callable[[], Outcome]) -> str:
    try:
        outcome = work()
    except KeyreconError as fault:
        outcome = Outcome("refused", str(fault))
    except BaseException:  # noqa: BLE001 - whatever it is, it is what is looked for
        outcome = Outcome("traceback", traceback.format_exc()[-1500:])
    return f"{outcome.verdict}\n{outcome.text}"


def _wait(child: int, seconds: float) -> tuple[int | None, Any]:
    """The child's end and what it used; None where it had to be killed."""
    end = time.monotonic() + seconds
    pause = 0.001
    while time.monotonic() < end:
        done, status, usage = os.wait4(child, os.WNOHANG)
        if done:
            return status, usage
        time.sleep(pause)
        pause = min(0.05, 1.5 * pause)
    os.kill(child, signal.SIGKILL)
    return None, os.wait4(child, 0)[2]


def unfinished(value: Any, name: str = "") -> str | None:
    """The first place in a result that holds a number that is none; None where all are."""
    if isinstance(value, float):
        return None if math.isfinite(value) else name
    if isinstance(value, np.ndarray) and value.dtype.kind == "f":
        known = value[~np.isnan(value)] if name in GAPS else value
        return None if np.isfinite(known).all() else name
    if is_dataclass(value):
        parts = ((field.name, getattr(value, field.name)) for field in fields(value))
    elif isinstance(value, dict):
        parts = (("points" if isinstance(v, np.ndarray) else str(k), v) for k, v in value.items())
    elif isinstance(value, tuple | list):
        parts = ((name, part) for part in value)
    else:
        return None
    return next((found for n, part in parts if (found := unfinished(part, n))), None)


def attack_file(name: str, case: int, samples: Path, seed: int) -> Outcome:
    """One reader and one damaged file."""
    reader, rng = READERS[name], random.Random(f"{seed} {name} {case}")
    with TemporaryDirectory() as folder:
        path = Path(folder) / reader.name
        path.parent.mkdir(exist_ok=True)
        for beside in (samples / reader.name).parent.iterdir():
            if beside.is_file() and (beside.stem == path.stem or "/" in reader.name):
                shutil.copy(beside, path.parent / beside.name)
        path.write_bytes(mutate((samples / reader.name).read_bytes(), rng))

        def work() -> Outcome:
            value = reader.read(path)
            found = None if name == "cache" else unfinished(value)
            return Outcome("not finite", found) if found else Outcome("read")

        outcome = run_apart(work)
        if outcome.verdict == "refused" and not _is_one_line(outcome.text, path):
            return Outcome("many lines", outcome.text)
        return outcome


def _is_one_line(text: str, path: Path) -> bool:
    """Whether a refusal is one line that names the file, or the files that go with it."""
    named = any(word in text for word in (path.name, f"{path.stem}.amc", path.parent.name))
    return named and "\n" not in text.strip() and len(text) < 1000


COMMANDS = (
    ("coco.json", "import {p} {f}"),
    ("dlc.csv", "import {p} {f}"),
    ("cvat.xml", "import {p} {f} --replace"),
    ("project.toml", "pick {p} --frame 3 --head 20,30"),
    ("project.toml", "relink {p} {p}/v.mp4"),
    ("picks.json", "pick {p} --frame 3 --head 20,30"),
    ("picks.json", "keyframes {p}"),
    ("keyframes.json", "run {p} --partial"),
    ("annotations.json", "run {p} --partial --height 1.8"),
    ("motion.npz", "export {p} {o}/m.bvh {o}/m.csv {o}/m.json"),
    ("motion.npz", "evaluate {p} --truth {s}/truth.npz"),
    ("truth.npz", "evaluate {s}/motion.npz --truth {f}"),
    ("v.mp4", "new {f} --project {o}/new"),
    ("v.avi", "new {f} --project {o}/new"),
    ("skeleton.json", "new {p}/v.mp4 --project {o}/new --skeleton {f}"),
    ("depths.npz", "run {p} --partial --depths {f}"),
    ("a.bvh", "depths {f} --out {o}/d.npz --poses 1"),
    ("prior.npz", "golf fit {p}/v.mp4 --clicks {s}/clicks.json --prior {f} --out {o}/swing"),
    ("clicks.json", "golf fit {p}/v.mp4 --clicks {f} --out {o}/swing"),
)
"""Files to damage, and what is asked for with them: {p} the project, {f} the file itself."""
OF_PROJECT = ("project.toml", "picks.json", "keyframes.json", "annotations.json", "motion.npz")


def make_project(samples: Path, folder: Path) -> Path:
    """A project with everything in it."""
    project = folder / "p"
    project.mkdir()
    for name in ("project.toml", "v.mp4", "picks.json", "keyframes.json", "motion.npz"):
        shutil.copy(samples / name, project / name)
    shutil.copy(samples / "coco.json", project / "annotations.json")
    return project


def attack_command(case: int, samples: Path, seed: int) -> Outcome:
    """One command and one damaged file."""
    rng = random.Random(f"{seed} command {case}")
    name, line = COMMANDS[case % len(COMMANDS)]
    with TemporaryDirectory() as folder:
        project, out = make_project(samples, Path(folder)), Path(folder) / "out"
        out.mkdir()
        file = project / name if name in OF_PROJECT else out / f"damaged{Path(name).suffix}"
        whole = samples / ("coco.json" if name == "annotations.json" else name)
        file.write_bytes(mutate(whole.read_bytes(), rng))
        words = line.format(p=project, f=file, o=out, s=samples).split()
        return run_command(words, project)


def attack_option(case: int, names: list[str], samples: Path) -> Outcome:
    """One option with a value that it cannot have."""
    name, value = names[case % len(names)], ABSURD[(case // len(names) + case) % len(ABSURD)]
    with TemporaryDirectory() as folder:
        project = make_project(samples, Path(folder))
        outcome = run_command(["keyframes", str(project), f"--{name}={value}"], project)
        if outcome.verdict == "read":
            return Outcome("taken", f"--{name}={value}")
        return outcome


def run_command(words: list[str], project: Path) -> Outcome:
    """A command of keyrecon; refused, it must say one line and change nothing."""
    before, said = _contents(project), project.parent / "said"

    def work() -> Outcome:
        with said.open("w") as file:
            os.dup2(file.fileno(), 1)
            os.dup2(file.fileno(), 2)
            sys.argv = ["keyrecon", *words]
            try:
                cli.main()
            except SystemExit as end:
                sys.stderr.flush()
                return Outcome("refused" if end.code else "read", str(end.code))
        return Outcome("read")

    outcome = run_apart(work, 3 * SECONDS)
    text = said.read_text(errors="replace") if said.exists() else ""
    if outcome.verdict not in GOOD:
        return Outcome(outcome.verdict, f"{' '.join(words)}\n{outcome.text}")
    if "Traceback" in text:
        return Outcome("traceback", f"{' '.join(words)}\n{text[-1500:]}")
    lines = [line for line in text.splitlines() if line.startswith("keyrecon: ")]
    if outcome.text == "1" and len(lines) != 1:
        return Outcome("many lines", f"{' '.join(words)}\n{text[-1500:]}")
    if outcome.verdict == "refused" and _contents(project) != before:
        return Outcome("changed", " ".join(words))
    return outcome


def _contents(project: Path) -> dict[str, bytes]:
    """What a project holds besides its cache."""
    files = (p for p in project.rglob("*") if p.is_file() and "cache" not in p.parts)
    return {str(p): p.read_bytes() for p in files if p.suffix != ".lock"}


def option_names(options: OptionRecord, prefix: str = "") -> Iterator[str]:
    """Dotted names of all options."""
    for field in fields(options):
        value, name = getattr(options, field.name), f"{prefix}{field.name}"
        if isinstance(value, OptionRecord):
            yield from option_names(value, f"{name}.")
        elif not isinstance(value, bool | str):
            yield name


STEPS = (("keyframes", "--budget", "0.1"), ("run", "--partial"))
"""What is killed, and taken up again."""


def attack_stages(kills: int, seed: int) -> Iterator[Outcome]:
    """Kill the stages on a rendered clip at any moment, from first to last, and let them go on."""
    rng = random.Random(f"{seed} kills")
    with TemporaryDirectory() as folder:
        clip = Path(folder) / "clip"
        _keyrecon("synth", "--out", clip, "--seconds", "2", "--fps", "15", "--width", "320",
                  "--height", "180", "--player-px", "90")  # fmt: skip
        _mark(clip, Path(folder) / "marks")
        wanted, started = _finish(clip, Path(folder) / "whole"), time.monotonic()
        _finish(clip, Path(folder) / "again")
        lasts = time.monotonic() - started
        for number in range(kills):
            project = Path(folder) / f"p{number}"
            _begin(clip, project)
            _kill(project, rng.uniform(0, lasts))
            found = _finish(clip, project)
            left = [*project.rglob("*.part")]
            shutil.rmtree(project)
            if left:
                yield Outcome("leftovers", str(left[0]))
            else:
                yield Outcome("read") if found == wanted else Outcome("changed", "other results")


def _mark(clip: Path, project: Path) -> None:
    """Marks of the clip's keyframes from its truth, kept beside it."""
    _begin(clip, project)
    _keyrecon(STEPS[0][0], project, *STEPS[0][1:])
    workspace, truth = Workspace(project), read_truth(clip / "truth.npz")
    video = workspace.video()
    found = read_keyframes(workspace.keyframes_file)
    marks = mark_from_truth(found, truth["points2d"], truth["points3d"], truth["visible"])
    write_coco(clip / "annotations.json", marks, (video.width, video.height))


def _kill(project: Path, seconds: float) -> None:
    """Begin with the first step, and kill whatever runs after some seconds."""
    end = time.monotonic() + seconds
    for step, *options in STEPS:
        running = subprocess.Popen(
            [sys.executable, "-m", "keyrecon", step, str(project), *options],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            running.wait(max(0.0, end - time.monotonic()))
        except subprocess.TimeoutExpired:
            running.kill()
            running.wait()
            return


def _begin(clip: Path, project: Path) -> None:
    if not project.exists():
        _keyrecon("new", clip / "video.mp4", "--project", project)
        for name in ("picks.json", "annotations.json"):
            if (clip / name).exists():
                shutil.copy(clip / name, project / name)


def _finish(clip: Path, project: Path) -> str:
    """Digest of all that the steps make."""
    _begin(clip, project)
    for step, *options in STEPS:
        _keyrecon(step, project, *options)
    texts = [project / name for name in ("keyframes.json", "annotations.json", "project.toml")]
    digest = hashlib.sha256(b"".join(file.read_bytes() for file in texts))
    for file in (project / "motion.npz", *sorted((project / "cache").glob("*.npz"))):
        with np.load(file) as stored:
            for name in stored.files:
                digest.update(stored[name].tobytes())
    return digest.hexdigest()


def _keyrecon(*words: str | Path) -> None:
    subprocess.run([sys.executable, "-m", "keyrecon", *words], check=True, capture_output=True)


def report(kind: str, outcomes: Iterator[tuple[str, Outcome]]) -> bool:
    """Count what became of the cases, print those that failed; whether none did."""
    counts: Counter[str] = Counter()
    for case, outcome in outcomes:
        counts[outcome.verdict] += 1
        if outcome.verdict not in GOOD:
            print(f"  {case}: {outcome.verdict}: {outcome.text}")
    told = ", ".join(f"{n} {verdict}" for verdict, n in sorted(counts.items()))
    print(f"{kind:<12}{sum(counts.values()):>7} cases: {told}", flush=True)
    return counts.keys() <= {*GOOD}


def attack(asked: argparse.Namespace) -> bool:
    """All that is asked for; whether everything held."""
    held = True
    names = [asked.reader] if asked.reader else list(READERS)
    options = list(option_names(Options()))
    with TemporaryDirectory() as folder:
        samples = Path(folder)
        make_samples(samples)
        for name in names if asked.files else ():
            each = range(asked.first, asked.first + math.ceil(asked.files / len(names)))
            cases = ((f"{name} {c}", attack_file(name, c, samples, asked.seed)) for c in each)
            held &= report(name, cases)
        if asked.commands:
            each = range(asked.commands)
            held &= report(
                "commands", ((f"{c}", attack_command(c, samples, asked.seed)) for c in each)
            )
        if asked.options:
            each = range(asked.options)
            held &= report("options", ((f"{c}", attack_option(c, options, samples)) for c in each))
    if asked.kills:
        held &= report("kills", (("", o) for o in attack_stages(asked.kills, asked.seed)))
    return held


def main() -> None:
    """One line for each kind of attack."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--reader", choices=list(READERS), help="one reader alone")
    parser.add_argument("--files", type=int, default=0, help="damaged files, over all readers")
    parser.add_argument("--first", type=int, default=0, help="number of the first file's case")
    parser.add_argument("--commands", type=int, default=0, help="commands with a damaged file")
    parser.add_argument("--options", type=int, default=0, help="absurd values of options")
    parser.add_argument("--kills", type=int, default=0, help="kills of stages")
    parser.add_argument("--seed", type=int, default=0)
    sys.exit(not attack(parser.parse_args()))


if __name__ == "__main__":
    main()
