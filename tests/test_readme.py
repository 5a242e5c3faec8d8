"""What the README names is there."""

import ast
import re
from importlib import import_module
from pathlib import Path

import pytest

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
