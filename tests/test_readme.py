"""What the README names is there."""

import ast
import re
from importlib import import_module
from pathlib import Path

import pytest

from keyrecon.io.formats.motion_file import ARRAYS
from keyrecon.io.project_folder import OWN_NAMES

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
TEXTS = {
    name: (ROOT / name).read_text()
    for name in (
        "README.md",
        "annotations/README.md",
        "benchmarks/results.md",
        "keyrecon/paper/choices.md",
    )
}
PATH = re.compile(r"\b(?:keyrecon|benchmarks|annotations|tests)/[\w./*-]*")


@pytest.mark.parametrize("name", TEXTS)
def test_every_path_exists(name):
    named = {path.rstrip(".") for path in PATH.findall(TEXTS[name])}
    assert named
    assert not [path for path in sorted(named) if not list(ROOT.glob(path))]


def test_every_benchmark_of_the_map_exists():
    row = next(line for line in README.splitlines() if line.startswith("| measurements |"))
    named = re.findall(r"`(\w+\.py)`", row)
    assert len(named) > 5
    assert not [name for name in named if not (ROOT / "benchmarks" / name).is_file()]


def test_folders_of_the_map_lie_in_the_folder_named_before_them():
    for line in README.splitlines():
        outer = re.match(r"\| [^|]+ \| `(keyrecon/\w+/)`: ", line)
        inner = re.findall(r"`(\w+/)`", line.split(";")[0]) if outer else []
        assert not [name for name in inner if not list(ROOT.glob(f"{outer[1]}**/{name}"))], line


def test_every_package_is_on_the_map():
    packages = {path.parent.name for path in (ROOT / "keyrecon").glob("*/__init__.py")}
    assert not [name for name in sorted(packages) if f"`keyrecon/{name}/" not in README]


def test_what_the_library_example_imports_is_there():
    code = README.split("```python")[1].split("```")[0]
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.ImportFrom):
            assert all(hasattr(import_module(node.module), name.name) for name in node.names)
        if isinstance(node, ast.Attribute) and getattr(node.value, "id", None) == "keyrecon":
            assert hasattr(import_module("keyrecon"), node.attr)


def test_files_of_the_annotations_are_listed():
    listed = TEXTS["annotations/README.md"]
    files = [path.name for path in (ROOT / "annotations").glob("*.json")]
    assert not [name for name in files if f"`{name}`" not in listed]


def test_the_library_example_names_everything_that_it_uses():
    code = README.split("```python")[1].split("```")[0]
    nodes = [node for node in ast.walk(ast.parse(code)) if isinstance(node, ast.Name)]
    made = {node.id for node in nodes if isinstance(node.ctx, ast.Store)}
    known = made | set(dir(__builtins__)) | {"keyrecon", "read_coco", "len", "print"}
    assert not [node.id for node in nodes if node.id not in known]


def test_files_of_a_project_are_listed():
    listed = README.split("## What is in a project folder")[1].split("## ")[0]
    made = ("court.jpg", "way.jpg", "ground.jpg", "golf.csv", "exports/", "annotations.old-1.json")
    assert not [name for name in (*OWN_NAMES, *made) if f"`{name}`" not in listed]


def test_arrays_of_a_motion_are_listed():
    row = next(line for line in README.splitlines() if line.startswith("| `motion.npz` |"))
    names = {*ARRAYS, "mirrored", "proportions", "lower", "keyrecon_version"}
    assert not [name for name in sorted(names) if f"`{name}`" not in row]


def test_every_benchmark_that_is_to_be_run_is_on_the_map():
    row = next(line for line in README.splitlines() if line.startswith("| measurements |"))
    told = set(re.findall(r"python benchmarks/(\w+\.py)", README))
    assert not [name for name in sorted(told) if f"`{name}`" not in row]


def test_the_half_hour_match_is_told_as_it_was_measured():
    row = next(line for line in TEXTS["benchmarks/results.md"].splitlines() if "| 30.2 |" in line)
    asked, error, memory = (row.split(" | ")[n].strip() for n in (2, 3, 5))
    assert f"{asked} frames asked for, PA-MPJPE {error}, {memory.replace(', ', ' and ')}" in (
        " ".join(README.split())
    )
