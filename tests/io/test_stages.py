import gc
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from weakref import ref

import numpy as np
import pytest

from keyrecon.errors import KeyreconError
from keyrecon.io.stages import StageStore
from keyrecon.progress import silent


@dataclass(frozen=True)
class PowerOptions:
    power: int = 2


CALLS = []


def raise_to(values, options=PowerOptions(), progress=silent):
    CALLS.append(options.power)
    return values**options.power


def add_one(values, progress=silent):
    CALLS.append("add")
    return values + 1


@pytest.fixture(autouse=True)
def no_calls():
    CALLS.clear()


def recipe(store, values, options=PowerOptions()):
    return store.keep("add", add_one, store.keep("power", raise_to, values, options=options))


def test_a_finished_stage_is_not_run_again(tmp_path):
    first = recipe(StageStore(tmp_path), np.arange(3.0))
    second = recipe(StageStore(tmp_path), np.arange(3.0))
    assert np.array_equal(first, second)
    assert CALLS == [2, "add"]


def test_other_options_or_inputs_make_it_and_what_follows_anew(tmp_path):
    recipe(StageStore(tmp_path), np.arange(3.0))
    recipe(StageStore(tmp_path), np.arange(3.0), PowerOptions(3))
    recipe(StageStore(tmp_path), np.arange(4.0))
    assert CALLS == [2, "add", 3, "add", 2, "add"]
    recipe(StageStore(tmp_path), np.arange(3.0), PowerOptions(3))
    assert len(CALLS) == 6


def test_force_makes_everything_anew(tmp_path):
    recipe(StageStore(tmp_path), np.arange(3.0))
    recipe(StageStore(tmp_path, force=True), np.arange(3.0))
    assert CALLS == [2, "add"] * 2


def test_an_interrupted_run_goes_on_after_the_last_finished_stage(tmp_path):
    def interrupted(values, progress=silent):
        raise KeyboardInterrupt

    store = StageStore(tmp_path)
    power = store.keep("power", raise_to, np.arange(3.0), options=PowerOptions())
    with pytest.raises(KeyboardInterrupt):
        store.keep("add", interrupted, power)
    recipe(StageStore(tmp_path), np.arange(3.0))
    assert CALLS == [2, "add"]


def test_a_result_is_recalled_without_ever_being_made(tmp_path):
    store, values = StageStore(tmp_path), np.arange(3.0)
    with pytest.raises(KeyreconError, match=r"'power' is not in"):
        store.recall("power", raise_to, values, options=PowerOptions())
    assert CALLS == []
    made = recipe(store, values)
    again = StageStore(tmp_path)
    power = again.recall("power", raise_to, values, options=PowerOptions())
    assert np.array_equal(again.recall("add", add_one, power), made)
    assert CALLS == [2, "add"]


@pytest.mark.parametrize(
    "unknown", [{"a": 1}, [1.0], np.array([None, 1.0]), np.array(["a", [1]], object)]
)
def test_an_input_whose_content_cannot_be_told_apart_is_refused(tmp_path, unknown):
    """An array of objects holds where they lie in memory, which is elsewhere in the next run."""
    with pytest.raises(TypeError, match="has no digest"):
        StageStore(tmp_path).keep("add", add_one, unknown)
    assert CALLS == []


def test_a_result_that_nobody_has_any_more_is_let_go(tmp_path):
    store = StageStore(tmp_path)
    held = ref(store.keep("power", raise_to, np.arange(3.0)))
    gc.collect()
    assert held() is None
    assert not store._kept


@pytest.mark.parametrize("keep", [0, 30, 0.5, -1])
def test_a_result_that_a_loss_of_power_tore_is_made_again(tmp_path, keep):
    first = recipe(StageStore(tmp_path), np.arange(3.0))
    for file in tmp_path.glob("*.npz"):
        data = file.read_bytes()
        file.write_bytes(data[: round(keep * len(data)) if isinstance(keep, float) else keep])
    assert np.array_equal(recipe(StageStore(tmp_path), np.arange(3.0)), first)
    assert CALLS == [2, "add"] * 2


def test_processes_that_try_out_options_side_by_side_do_not_stumble_over_one_another(tmp_path):
    def work(_):
        store = StageStore(tmp_path)
        return [recipe(store, np.arange(3.0), PowerOptions(power)) for power in range(12)]

    with ThreadPoolExecutor(4) as pool:
        for made in pool.map(work, range(8)):
            assert [values[2] for values in made] == [2.0**power + 1 for power in range(12)]
