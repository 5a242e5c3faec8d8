"""The parts of benchmarks/sensitivity.py that find and change numbers, on a small package."""

import ast
import json
import random
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

BENCHMARKS = Path(__file__).parent.parent / "benchmarks"

PIPELINE = """
from keyrecon.tracking.find import FindOptions, find
from keyrecon.lifting.lift import lift

class Options:
    find: FindOptions = FindOptions()
    depths: str = "none"

def prepare(keep):
    return keep("find", find)

def reconstruct(keep):
    return keep("lift", lift)
"""
FIND = '''
from dataclasses import dataclass
from keyrecon.numerics.shared import STEP

RADIUS = 0.5
"""Evidence."""
LEFT, RIGHT = 2, -3.0
HALF_TURN = np.pi / 2
BY_PART = {"head": 0.1, "foot": 0.0}
LADDER = (Rung(1.0, 2), Rung(3.0, 4), Rung(5.0, every=6))
SQUARE = 1 << 4
lower = 7.0

@dataclass
class Rung:
    height: float
    every: int

class FindOptions:
    speed: float = 3.0
    method: str = "x"
    limit: float | None = None
    flag: bool = True

class NoOptions:
    speed: float = 4.0

def find(size=LEFT):
    return RADIUS * STEP
'''
SOURCES = {
    "pipeline.py": PIPELINE,
    "tracking/find.py": FIND,
    "lifting/lift.py": "from keyrecon.numerics.shared import OTHER\ndef lift(): return OTHER\n",
    "numerics/shared.py": "STEP = 4\nOTHER = 5\n",
    "golf/club.py": "LENGTH = 1.0\n",
}


@pytest.fixture
def numbers(monkeypatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    import tuned_numbers

    yield tuned_numbers
    sys.modules.pop("tuned_numbers")


@pytest.fixture
def trees():
    return {file: ast.parse(text) for file, text in SOURCES.items()}


@pytest.fixture(scope="module")
def package():
    """The parsed source of the package itself."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(BENCHMARKS))
        import tuned_numbers

        yield tuned_numbers.read_package()
    sys.modules.pop("tuned_numbers", None)


@pytest.fixture
def package_numbers(numbers, package):
    return numbers.find_numbers(package)


def test_every_number_is_found_by_file_and_name(numbers, trees):
    found = {number.key: number.values for number in numbers.find_numbers(trees)}
    assert found == {
        "tracking/find.py:RADIUS": (0.5,),
        "tracking/find.py:LEFT": (2,),
        "tracking/find.py:RIGHT": (-3.0,),
        "tracking/find.py:HALF_TURN": (pytest.approx(1.5708, abs=1e-4),),
        "tracking/find.py:BY_PART['head']": (0.1,),
        "tracking/find.py:LADDER.height": (1.0, 3.0, 5.0),
        "tracking/find.py:LADDER.every": (2, 4, 6),
        "tracking/find.py:SQUARE": (16,),
        "tracking/find.py:FindOptions.speed": (3.0,),
        "numerics/shared.py:STEP": (4,),
        "numerics/shared.py:OTHER": (5,),
    }


def test_a_changed_number_stands_where_the_old_one_stood(numbers, trees):
    for number in numbers.find_numbers(trees):
        new = {place: float(at + 100) for at, place in enumerate(number.places)}
        changed = numbers.rewrite(ast.parse(SOURCES[number.module]), new)
        again = {**trees, number.module: ast.parse(ast.unparse(changed))}
        found = {n.key: n.values for n in numbers.find_numbers(again)}
        assert found[number.key] == tuple(new.values())
        others = {n.key: n.values for n in numbers.find_numbers(trees) if n.key != number.key}
        assert {key: found[key] for key in others} == others


def test_a_place_without_a_number_is_refused(numbers, trees):
    with pytest.raises(ValueError, match="no number"):
        numbers.rewrite(trees["tracking/find.py"], {(1, 90, 1, 95): 1.0})


@pytest.mark.parametrize(
    ("value", "factor", "expected"),
    [(2.0, 1.25, 2.5), (8, 0.75, 6), (1, 1.25, 2), (1, 0.75, 0), (-2, 1.25, -3), (-2, 0.75, -1)],
)
def test_whole_numbers_stay_whole_and_move(numbers, value, factor, expected):
    assert numbers.vary(value, factor) == expected
    assert isinstance(numbers.vary(value, factor), type(value))


def test_a_change_reaches_the_stages_whose_code_names_it(numbers, trees):
    stages = numbers.find_stages(trees)
    assert list(stages) == ["find", "lift"]
    called = {
        "find": {"tracking/find.py": {"RADIUS", "STEP", "speed"}},
        "lift": {"lifting/lift.py": {"OTHER", "speed"}},
        "": {"tracking/find.py": {"RIGHT"}},
    }
    reach = {stage: numbers.reached_from(file, trees) for stage, file in stages.items()}
    reached = {
        n.name: numbers.stages_using(n, trees, reach, called) for n in numbers.find_numbers(trees)
    }
    assert {name: found for name, found in reached.items() if found} == {
        "RADIUS": ("find",),
        "STEP": ("find",),
        "LEFT": ("find",),  # an argument's default has been read on import
        "RIGHT": ("",),
        "FindOptions.speed": ("find",),  # lifting cannot know the record
        "OTHER": ("lift",),
    }


def test_prose_makes_no_other_version(numbers, trees):
    digest = numbers.code_digest(trees)
    prose = {**trees, "tracking/find.py": ast.parse(FIND.replace("Evidence.", "Better evidence."))}
    code = {**trees, "tracking/find.py": ast.parse(FIND.replace("0.5", "0.6"))}
    assert numbers.code_digest(prose) == digest
    assert numbers.code_digest(code) != digest


def test_the_package_itself_has_stages_and_numbers_for_all_of_them(
    numbers, package, package_numbers
):
    names = list(numbers.find_stages(package))
    assert (names[0], names[-1]) == ("camera", "lift")
    files = [*numbers.PACKAGE.glob("*.py"), *numbers.PACKAGE.glob("shots/*.py")]
    recipes = "\n".join(file.read_text() for file in files)
    assert set(names) == set(re.findall(r'keep\(\s*f?"(\w+)', recipes))
    assert len({number.key for number in package_numbers}) == len(package_numbers) > 200
    for module in {number.module for number in package_numbers}:
        own = [number for number in package_numbers if number.module == module]
        new = {place: 1.0 for number in own for place in number.places}
        assert len(new) == sum(len(number.places) for number in own)
        numbers.rewrite(ast.parse((numbers.PACKAGE / module).read_text()), new)


def test_the_package_is_imported_with_the_other_number(package_numbers):
    number = next(
        n
        for n in package_numbers
        if n.name == n.symbol and len(n.values) == 1 and isinstance(n.values[0], float)
    )
    module = "keyrecon." + number.module.removesuffix(".py").replace("/", ".")
    code = (
        "import importlib, json, sys; from varied_import import vary_imports;"
        "module, file, place, name = json.loads(sys.argv[1]);"
        "vary_imports({file: {tuple(place): 123.5}});"
        "print(getattr(importlib.import_module(module), name))"
    )
    told = json.dumps([module, number.module, number.places[0], number.symbol])
    found = subprocess.run(
        [sys.executable, "-c", code, told],
        env={"PYTHONPATH": f"{BENCHMARKS.parent}:{BENCHMARKS}"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert found.stdout.strip() == "123.5"


@pytest.fixture
def make_row(numbers):
    import sensitivity_rows

    def make(number, change, clip, changes, others=0, fault=""):
        scores = 0.9, 50.0, 60.0, *changes
        return sensitivity_rows.Row(
            "code", clip, 0, number, 7, "1", change, "lift", others, 0, *scores, 1.0, fault
        )

    yield make
    sys.modules.pop("sensitivity_rows")


def test_a_numbers_effect_is_its_largest_change_either_way(make_row):
    from sensitivity_rows import Effect

    nan = float("nan")
    effect = Effect.of([
        make_row("a.py:N", "x0.75", "one", (-1.0, 2.0, 2.0)),
        make_row("a.py:N", "x0.75", "real", (0.5, nan, nan)),
        make_row("a.py:N", "x1.25", "one", (0.2, -4.0, 1.0)),
        make_row("a.py:N", "x1.25", "two", (nan, nan, nan), fault="ValueError"),
    ])  # fmt: skip
    assert (effect.pck, effect.pa, effect.clips, effect.alone) == (1.0, 4.0, 2, True)
    assert effect.is_much
    assert effect.faults == ("x1.25: ValueError",)


def test_what_a_group_does_counts_for_each_only_where_it_is_little(make_row):
    from sensitivity_rows import Effect

    little = make_row("a.py:N", "x2", "one", (0.2, 0.3, 0.1), others=4)
    much = make_row("a.py:N", "x2", "two", (0.2, 9.0, 0.1), others=4)
    effect = Effect.of([little, much])
    assert (effect.pa, effect.clips, effect.alone) == (0.3, 1, False)


def test_rows_are_read_as_they_were_written(make_row, numbers, tmp_path):
    import argparse

    import sensitivity

    file = tmp_path / "rows.csv"
    rows = [make_row("a.py:N", change, "one", (0.1, 1 / 3, 2.0)) for change in ("x0.75", "x1.25")]
    for row in rows:  # a bench of its own each time, as after an interruption
        sensitivity.Bench(argparse.Namespace(out=file, frames=0, workers=1), "code").add(row)
    bench = sensitivity.Bench(argparse.Namespace(out=file, frames=0, workers=1), "code")
    assert bench.rows == rows
    assert bench.known == {row.key: row for row in rows}


def test_the_rendered_clips_are_sequences_of_the_other_benchmarks(numbers):
    import sensitivity

    code = "import sequences; print(*(s.name for s in sequences.TENNIS))"
    found = subprocess.run(
        [sys.executable, "-c", code],
        env={"PYTHONPATH": f"{BENCHMARKS.parent}:{BENCHMARKS}"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert {c for c in sensitivity.CLIPS if "_" not in c} == set(found.stdout.split())


@pytest.fixture
def store(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    import variant_store

    yield lambda changed: variant_store.VariantStore(tmp_path, changed)
    sys.modules.pop("variant_store")


def run_stages(keep, doubled=1.0, added=0.0, made=None):
    """Three stages one after the other; what was made is noted."""

    def note(name, result):
        (made if made is not None else []).append(name)
        return result

    first = keep("find@0", lambda video: note("find", doubled * video), np.arange(3.0))
    second = keep("track", lambda found: note("track", np.round(found + added)), first)
    return keep("lift", lambda track: note("lift", track + 1), second)


def test_a_variant_makes_only_what_its_change_reaches(store):
    whole, made = store(None), []
    with whole.watched():
        as_it_is = run_stages(whole.keep)
    varied = run_stages(store(frozenset({"track"})).keep, added=5.0, made=made)
    assert made == ["track", "lift"]
    assert np.array_equal(varied, as_it_is + 5)


def test_a_variant_ends_where_what_it_changes_gives_the_same_bits(store):
    from variant_store import Unchanged

    whole, made = store(None), []
    with whole.watched():
        run_stages(whole.keep)
    with pytest.raises(Unchanged):
        run_stages(store(frozenset({"track"})).keep, added=0.1, made=made)
    assert made == ["track"]
    made.clear()
    run_stages(store(frozenset({"find"})).keep, doubled=2.0, made=made)
    assert made == ["find", "track", "lift"]


@pytest.fixture
def screening(monkeypatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    import screening

    yield screening
    for name in ("screening", "tuned_numbers"):
        sys.modules.pop(name, None)


def many_numbers(screening, count):
    return [
        screening.TunedNumber("a.py", f"N{at:03}", "N", at, ((at, 0, at, 1),), (1.0,))
        for at in range(count)
    ]


def response(effects, runs):
    """How much a group changes a result that is the sum of its numbers' effects."""

    def is_large(group):
        runs.append(group)
        pairs = zip(group.numbers, group.ups, strict=True)
        return abs(sum((1 if up else -1) * effects.get(n.name, 0.01) for n, up in pairs)) > 1

    return is_large


def test_screening_finds_the_few_numbers_that_matter(screening):
    numbers, runs = many_numbers(screening, 120), []
    effects = {"N007": 3.0, "N050": -2.0, "N051": 4.5, "N119": 1.5}
    expected = dict.fromkeys((n.key for n in numbers), 0.2)
    is_large = response(effects, runs)
    found = set()
    for group in screening.draw_groups(numbers, expected, 1.0, random.Random(3)):
        for part in (group, group.mirrored()):
            if is_large(part):
                found |= {one.numbers[0].name for one in screening.locate(part, is_large)}
    assert found == set(effects)
    assert len(runs) < len(numbers)


def test_a_number_alone_is_measured_before_it_is_told(screening):
    pair = screening.Group(tuple(many_numbers(screening, 2)), (True, True))
    runs = []
    effects = {"N000": 0.6, "N001": 0.6}  # together, and neither alone
    is_large = response(effects, runs)
    assert is_large(pair)
    assert not list(screening.locate(pair, is_large))


def test_numbers_of_which_much_is_expected_have_small_groups(screening):
    numbers = many_numbers(screening, 40)
    expected = {n.key: 0.9 if n.line < 4 else 0.1 for n in numbers}  # .81 + 18 x .01 < 1
    groups = screening.draw_groups(numbers, expected, 1.0, random.Random(0))
    assert [len(group.numbers) for group in groups] == [1, 1, 1, 19, 18]
    assert sorted(n.key for group in groups for n in group.numbers) == sorted(expected)


def test_mirrored_every_number_goes_the_other_way(screening):
    numbers = many_numbers(screening, 30)
    group = screening.draw_directions(numbers, dict.fromkeys((n.key for n in numbers), 1.0),
                                      random.Random(1))  # fmt: skip
    ways = zip(group.ups, group.mirrored().ups, strict=True)
    assert {up != mirrored for up, mirrored in ways} == {True}
    assert 5 < sum(group.ups) < 25


def test_what_is_missing_to_the_whole_is_varied_of_a_share_of_nearly_all(numbers, package_numbers):
    found = {n.key: n for n in package_numbers}
    for key, whole in numbers.ENDS.items():
        (value,) = found[key].values
        (more,), (less,) = (found[key].varied(factor) for factor in (0.75, 1.25))
        assert less < value < more < whole


def test_the_table_tells_what_a_number_does_alone_and_what_its_groups_do(make_row, capsys):
    from sensitivity_rows import print_summary

    nan = float("nan")
    print_summary(
        [
            make_row("a.py:LARGE", "x0.75", "one", (0.0, 5.0, 6.0), others=1),
            make_row("a.py:QUIET", "x1.25", "one", (0.0, 5.0, 6.0), others=1),
            make_row("a.py:LARGE", "x0.75", "one", (0.1, 4.5, 5.5)),
            make_row("a.py:LARGE", "x0.75", "real", (-0.5, nan, nan)),
            make_row("a.py:QUIET", "x1.25", "one", (0.0, 0.5, 0.5), others=2),
            make_row("a.py:PAIR", "x1.25", "two", (2.5, 0.5, 0.5), others=1),
            make_row("b.py:ALL", "x1.01", "one", (0.0, 1.5, 0.5), others=90),
        ],
        [],
        "# Head",
    )
    table = capsys.readouterr().out.splitlines()
    assert "| `a.py:LARGE` | 1 | x0.75 | -0.2 +4.5 +5.5 | +0.1 +4.5 +5.5 on one | 2 |" in table
    assert "| `a.py:QUIET` | 1 | 0.0 points, 0.5 mm (x1.25 alone, with others) | - | 1 |" in table
    assert "| two | 1, `a.py:PAIR` | +2.5 | +0.5 | +0.5 |" in table
    assert "| one | b.py:ALL | 91 | +0.0 | +1.5 | +0.5 |" in table
