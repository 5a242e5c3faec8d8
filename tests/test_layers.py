"""How the house is built: which way imports point, and that one name means one thing."""

import ast
import importlib.util
import subprocess
import sys
from collections import defaultdict
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "keyrecon"
STAGES = {"tracking", "keyframes", "propagation", "lifting", "golf", "world", "strokes"}
OUTER = {"app", "cli", "commands", "pipeline", "shots", "annotate", "report", "synthetic"}
OUTER |= {"keeping"}
BASE = {
    "records",
    "timeline",
    "body",
    "metrics",
    "errors",
    "reading",
    "ranges",
    "progress",
    "parallel_map",
    "numerics",
}
SHARED = BASE | {"segmentation", "io"}


@cache
def modules():
    """Every module's name and its parsed source."""
    return [
        (path.relative_to(PACKAGE).with_suffix("").parts, ast.parse(path.read_text()))
        for path in sorted(PACKAGE.rglob("*.py"))
    ]


@cache
def imported(tree):
    """The package's modules that a module imports, as tuples of names."""
    return frozenset(_imports(tree))


def _imports(tree):
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "keyrecon":
            inside = tuple(node.module.split(".")[1:])
            for alias in node.names:
                deeper = (*inside, alias.name)
                file = PACKAGE.joinpath(*deeper)
                yield deeper if file.with_suffix(".py").is_file() or file.is_dir() else inside
        elif isinstance(node, ast.Import):
            yield from (
                tuple(a.name.split(".")[1:]) for a in node.names if a.name.startswith("keyrecon.")
            )


@pytest.mark.parametrize("stage", sorted(STAGES))
def test_stages_know_neither_one_another_nor_what_calls_them(stage):
    banned = (STAGES - {stage}) | OUTER
    for name, tree in modules():
        if name[0] == stage:
            found = {target[0] for target in imported(tree) if target}
            assert not banned & found, name
            assert ("io", "workspace") not in imported(tree), name


def test_the_base_layer_knows_only_itself():
    for name, tree in modules():
        if name[0] in BASE:
            inner = {target for target in imported(tree) if target} - {("io", "video")}
            assert {target[0] for target in inner} <= BASE, name


def test_colours_and_scene_know_no_stage():
    for name, tree in modules():
        if name[0] == "segmentation":
            assert {target[0] for target in imported(tree) if target} <= SHARED, name


def test_rules_learnt_from_captures_know_no_stage():
    for name, tree in modules():
        if name[0] == "body_models":
            known = {target[0] for target in imported(tree) if target}
            assert known <= BASE | {"body_models"}, name


def test_the_annotators_server_and_store_know_no_stage():
    for name, tree in modules():
        if name[:2] in (("annotate", "server"), ("annotate", "store")):
            found = {target[0] for target in imported(tree) if target}
            assert not (STAGES | {"pipeline", "app", "report", "cli"}) & found, name


def test_no_import_goes_in_a_circle():
    graph = {
        name: {t for t in imported(tree) if t and t != name and (*t, "__init__") != name}
        for name, tree in modules()
    }
    list(TopologicalSorter(graph).static_order())  # raises CycleError and names the circle


def test_a_class_name_occurs_once_in_the_package():
    found = defaultdict(list)
    for name, tree in modules():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                found[node.name].append("/".join(name))
    assert {name: places for name, places in found.items() if len(places) > 1} == {}


def test_importing_the_package_loads_no_heavy_library():
    code = "import sys, keyrecon; print(*{'cv2','av','plotly','scipy','tyro'} & set(sys.modules))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == ""


def _is_module(name):
    try:
        return importlib.util.find_spec(name) is not None
    except ModuleNotFoundError:
        return False


def test_benchmarks_take_from_the_package_what_it_has():
    for file in sorted(PACKAGE.with_name("benchmarks").glob("*.py")):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("keyrecon"):
                module = importlib.import_module(node.module)
                missing = [
                    name.name
                    for name in node.names
                    if not hasattr(module, name.name)
                    and not _is_module(f"{node.module}.{name.name}")
                ]
                assert not missing, f"{file.name}: {node.module} has no {missing}"
