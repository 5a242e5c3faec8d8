"""Which code makes a stage's result."""

import ast
from pathlib import Path

import pytest

from keyrecon.io.stage_tasks import PACKAGE, imported_files

FILES = sorted(PACKAGE.rglob("*.py"))


def module_file(name):
    return PACKAGE.parent.joinpath(*name.split(".")).with_suffix(".py")


def imports(file):
    """What Python's own parser finds that a file imports of the package."""
    found = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(PACKAGE.name):
            found.add(module_file(node.module))
            found |= {module_file(f"{node.module}.{name.name}") for name in node.names}
        if isinstance(node, ast.Import):
            found |= {module_file(n.name) for n in node.names if n.name.startswith(PACKAGE.name)}
    return {path for path in found if path.is_file()}


def test_what_a_module_imports_is_what_python_imports():
    direct = {file: imports(file) for file in FILES}
    for file in FILES:
        every, open_ones = {file}, [file]
        while open_ones:
            new = direct[open_ones.pop()] - every
            every |= new
            open_ones += new
        assert imported_files(file) == every


@pytest.mark.parametrize(
    ("stage", "used"),
    [
        ("lifting/lifting.py", "body_models/depth_model.py"),
        ("propagation/propagation.py", "body_models/side_model.py"),
        ("propagation/propagation.py", "keyframes/edge_distance.py"),
        ("keyframes/selection.py", "annotation_budget.py"),
        ("tracking/camera_motion.py", "io/frame_times.py"),
    ],
)
def test_code_that_a_stage_runs_in_other_folders_is_its_code(stage, used):
    assert Path(PACKAGE / used) in imported_files(PACKAGE / stage)
    assert PACKAGE / "report/page.py" not in imported_files(PACKAGE / stage)
