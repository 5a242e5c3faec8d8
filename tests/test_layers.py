"""Which way imports point."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "keyrecon"
STAGES = {"tracking", "matching", "lifting", "golf"}
OUTER = {"cli", "pipeline", "workspace", "report", "synthetic"}
BASE = {"records", "body", "camera", "video", "metrics", "errors"}
BASE |= {"colors", "background", "pictures", "paths"}


def imported(path):
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("keyrecon."):
            yield node.module.split(".")[1]
        elif isinstance(node, ast.Import):
            yield from (a.name.split(".")[1] for a in node.names if a.name.startswith("keyrecon."))


@pytest.mark.parametrize("stage", sorted(STAGES))
def test_stages_know_neither_one_another_nor_what_calls_them(stage):
    banned = (STAGES - {stage}) | OUTER | {"formats"}
    for path in (PACKAGE / stage).rglob("*.py"):
        assert not banned & set(imported(path)), path


def test_the_annotator_knows_neither_the_stages_nor_what_calls_it():
    banned = (OUTER - {"workspace"}) | STAGES | {"assist", "project", "serving"}
    for path in (PACKAGE / "annotate").rglob("*.py"):
        assert not banned & set(imported(path)), path


def test_the_base_layer_knows_only_itself():
    for name in BASE:
        path = PACKAGE / f"{name}.py"
        assert set(imported(path)) <= BASE | {"progress"}, path


def test_importing_the_package_loads_no_heavy_library():
    import subprocess
    import sys

    code = "import sys, keyrecon; print(*{'cv2','av','plotly','scipy','tyro'} & set(sys.modules))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == ""
