"""Whether two versions of keyrecon give the same motions to the digit.

    python benchmarks/identity.py OUT [--work FOLDER] [--only NAME ...] [--write FILE]
        [--against FILE]

Runs the commands of the checkout it lies in (nothing is imported from the package, so that it
runs on any version) on the demos, on the rendered sequences that `accuracy.py` left in the work
folder, and on the real videos whose picks, marks or clicks are kept in `annotations/`. Prints one
digest for each array of each motion.npz; `--write` keeps them, `--against` compares with kept
ones and names every array that differs.
"""

import argparse
import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parent.parent
VIDEOS = ROOT.parent / "shared" / "data" / "video"
SEQUENCES = (
    "ground-back-static",
    "ground-oblique-pan",
    "serve-side-static",
    "serve-back-pan",
    "mixed-front-static",
    "mixed-side-pan",
    "volley-above-static",
    "all-oblique-small",
)
SWINGS = ("golf_faceon", "golf_dtl", "golf_dtl_slow")
CLICK_NOISE = 3.0 / 400
"""Of marks made from the truth, player heights."""


def keyrecon(*words: object) -> None:
    """Run a command of this checkout."""
    ran = subprocess.run(
        [sys.executable, "-m", "keyrecon", *map(str, words)],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "100"},
        stdout=subprocess.DEVNULL,
        check=False,
    )
    if ran.returncode:
        raise SystemExit(f"keyrecon {' '.join(map(str, words))} failed with {ran.returncode}.")


def run_demo(name: str, folder: Path) -> Path:
    """A demo; its motion."""
    keyrecon("demo", name, "--out", folder)
    return folder / ("project" if name == "tennis" else "swing") / "motion.npz"


def run_sequence(source: Path, folder: Path) -> Path:
    """A rendered sequence, marked from its truth at the keyframes."""
    if not (folder / "project.toml").is_file():
        keyrecon("new", source / "video.mp4", "--project", folder)
        (folder / "picks.json").write_bytes((source / "picks.json").read_bytes())
    keyrecon("keyframes", folder)
    with np.load(source / "truth.npz") as truth:
        marks = mark(json.loads((folder / "keyframes.json").read_text()), truth)
    file = folder / "marks.json"
    file.write_text(json.dumps(marks))
    keyrecon("import", folder, file, "--replace")
    keyrecon("run", folder, "--height", "1.8")
    return folder / "motion.npz"


def mark(keyframes: dict, truth: dict[str, np.ndarray]) -> dict:
    """COCO annotations from the truth with the noise of clicks; no depth signs."""
    names = [str(n) for n in truth["joint_names"]]
    lower = [any(part in name for part in ("ankle", "knee", "hip")) for name in names]
    tall = float(np.median(np.ptp(truth["points2d"][..., 1], axis=1)))
    rng = np.random.default_rng(0)
    images, annotations = [], []
    for number, frame in enumerate(keyframes["frames"], start=1):
        joints = truth["points2d"][frame] + rng.normal(0, CLICK_NOISE * tall, (len(names), 2))
        asked = np.where(lower, frame in keyframes["lower"], frame in keyframes["upper"])
        flat = [[x, y, 2] if a else [0, 0, 0] for (x, y), a in zip(joints, asked, strict=True)]
        images.append({"id": number, "file_name": f"frame_{frame:06d}.png", "frame": frame})
        annotations.append(
            {
                "id": number,
                "image_id": number,
                "category_id": 1,
                "keypoints": np.ravel(flat).tolist(),
            }
        )
    category = {"id": 1, "name": "person", "keypoints": names}
    return {"images": images, "annotations": annotations, "categories": [category]}


def run_rally(folder: Path) -> Path:
    """The real rally with the marks that are kept of it."""
    if not (folder / "project.toml").is_file():
        keyrecon("new", VIDEOS / "tennis_rally.mp4", "--project", folder)
        picks = ROOT / "annotations" / "tennis_rally.picks.json"
        (folder / "picks.json").write_bytes(picks.read_bytes())
    keyrecon("keyframes", folder, "--budget", "0.05")
    keyrecon("import", folder, ROOT / "annotations" / "tennis_rally.json", "--replace")
    keyrecon("run", folder, "--height", "1.70", "--partial")
    return folder / "motion.npz"


def run_swing(name: str, folder: Path) -> Path:
    """A real golf swing from its kept clicks."""
    clicks = ROOT / "annotations" / f"{name}.clicks.json"
    keyrecon("golf", "fit", VIDEOS / f"{name}.mp4", "--clicks", clicks, "--out", folder)
    return folder / "motion.npz"


def digests(file: Path) -> dict[str, str]:
    """One digest for each array but the version's."""
    with np.load(file) as arrays:
        return {
            name: hashlib.sha256(repr(a.dtype).encode() + a.tobytes()).hexdigest()[:16]
            for name, a in arrays.items()
            if name != "keyrecon_version"
        }


def cases(out: Path, work: Path) -> dict:
    """What can be run here: a name and how."""
    found = {
        "demo": lambda: run_demo("tennis", out / "demo"),
        "demo-golf": lambda: run_demo("golf", out / "demo-golf"),
    }
    if VIDEOS.is_dir():
        found["tennis_rally"] = lambda: run_rally(out / "tennis_rally")
        found |= {name: lambda n=name: run_swing(n, out / n) for name in SWINGS}
    found |= {
        name: lambda n=name: run_sequence(work / n, out / n)
        for name in SEQUENCES
        if (work / name / "truth.npz").is_file()
    }
    return found


def main() -> None:
    """Run, print, keep, compare."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--work", type=Path, default=Path("benchmarks/work"))
    parser.add_argument("--only", nargs="*")
    parser.add_argument("--write", type=Path)
    parser.add_argument("--against", type=Path)
    words = parser.parse_args()
    kept = json.loads(words.against.read_text()) if words.against else {}
    found, different = {}, 0
    for name, case in cases(words.out.resolve(), words.work.resolve()).items():
        if words.only and name not in words.only:
            continue
        found[name] = digests(case())
        if words.write:
            words.write.write_text(json.dumps(found, indent=1))
        if not words.against:
            print(name, found[name]["points3d"], found[name]["points2d"], flush=True)
            continue
        before = kept.get(name, {})
        off = [array for array, digest in before.items() if found[name].get(array) != digest]
        different += bool(off) or not before
        verdict = f"differs in {', '.join(off)}" if off else "identical"
        print(f"{name:<22}{verdict if before else 'not kept'}", flush=True)
    sys.exit(different > 0)


if __name__ == "__main__":
    main()
