import sys

import numpy as np
import pytest
from command_line import keyrecon

from keyrecon.errors import KeyreconError
from keyrecon.io import workers as io_workers
from keyrecon.io.stages import StageStore
from keyrecon.io.workers import open_workers
from keyrecon.keyframes.selection import KeyframeOptions, count_labels
from keyrecon.timeline import frames_before

FRAMES = np.array([1, 4, 9])


def recipe(store):
    """Two stages of each of three shots, the second made of the first."""

    def shot(number):
        first = store.keep(f"first@{number}", frames_before, FRAMES + number, 12)
        return store.keep(f"second@{number}", frames_before, first, count=6)

    return list(store.each(shot, range(3)))


def contents(folder):
    return {file.name: file.read_bytes() for file in folder.iterdir()}


@pytest.fixture(scope="module")
def processes():
    with open_workers("2") as workers:
        yield workers


def test_workers_leave_the_same_files_as_work_done_here(tmp_path, processes):
    here = recipe(StageStore(tmp_path / "here"))
    elsewhere = recipe(StageStore(tmp_path / "elsewhere", workers=processes))
    np.testing.assert_array_equal(here, elsewhere)
    assert contents(tmp_path / "here") == contents(tmp_path / "elsewhere")


def test_what_was_made_here_is_not_made_again_by_workers(tmp_path, processes):
    recipe(StageStore(tmp_path))
    store = StageStore(tmp_path, workers=processes)
    recipe(store)
    assert store.seconds == {}


def test_pieces_of_a_stage_come_back_in_their_order(tmp_path, processes):
    store = StageStore(tmp_path, workers=processes)
    made = store.spread(frames_before, ((FRAMES + n, 12) for n in range(20)))
    for n, own in enumerate(made):
        np.testing.assert_array_equal(own, frames_before(FRAMES + n, 12))
    assert not list(tmp_path.iterdir())


def test_what_a_stage_refuses_elsewhere_is_told_here(tmp_path, processes):
    store = StageStore(tmp_path, workers=processes)
    with pytest.raises(KeyreconError, match="--budget is a share"):
        store.keep("labels", count_labels, KeyframeOptions(budget=2.0), 100, 25.0)


def test_a_process_that_is_lost_ends_in_one_line_and_what_was_made_stays(tmp_path):
    with open_workers("1") as workers:
        store = StageStore(tmp_path, workers=workers)
        recipe(store)
        for process in workers.executor._processes.values():
            process.kill()
        with pytest.raises(KeyreconError, match=r"workers of this machine.*goes on from there"):
            store.keep("third", frames_before, FRAMES, 20)
    again = StageStore(tmp_path)
    recipe(again)
    assert again.seconds == {}


@pytest.mark.parametrize(
    ("where", "told"),
    [
        ("0", "from 1 on, or an address"),
        ("tcp://127.0.0.1:9", "No Dask scheduler answers at tcp://127.0.0.1:9"),
        ("head", "--workers head has no port"),
        ("tcp://head", "--workers tcp://head has no port"),
        ("ftp://head:1", "No Dask scheduler answers at ftp://head:1"),
    ],
)
def test_an_address_without_a_scheduler_is_refused_in_one_line(
    where, told, folder, capsys, monkeypatch
):
    if where != "0":
        pytest.importorskip("distributed", reason="pip install 'keyrecon[cluster]'")
    monkeypatch.setattr(io_workers, "CONNECT_SECONDS", 0.5)
    assert keyrecon("run", folder, "--workers", where) == 1
    said = capsys.readouterr().err
    assert told in said
    assert len(said.splitlines()) == 1


def test_a_scheduler_without_workers_is_told_of(folder, capsys, monkeypatch):
    distributed = pytest.importorskip("distributed", reason="pip install 'keyrecon[cluster]'")
    monkeypatch.setattr(io_workers, "CONNECT_SECONDS", 1.0)
    with distributed.LocalCluster(
        n_workers=0, threads_per_worker=1, dashboard_address=None
    ) as empty:
        assert keyrecon("run", folder, "--workers", empty.scheduler_address) == 1
    assert "has no workers; start some with: dask worker tcp" in capsys.readouterr().err


def test_without_dask_the_extra_is_named(folder, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert keyrecon("keyframes", folder, "--workers", "tcp://head:8786") == 1
    assert "pip install 'keyrecon[cluster]'" in capsys.readouterr().err


def test_a_worker_that_does_not_see_the_folder_says_so(tmp_path, processes):
    store = StageStore(tmp_path / "mine", workers=processes)
    task = store._task(tmp_path / "mine" / "a.npz", frames_before, (FRAMES, 12), {})
    moved = type(task)(task.stage, tmp_path / "other" / "x.npz", task.result, task.code)
    with pytest.raises(KeyreconError, match=r"does not see .*same paths"):
        processes.carry_out(moved)
    other = type(task)(task.stage, task.inputs, task.result, "another")
    with pytest.raises(KeyreconError, match="another version of keyrecon"):
        processes.carry_out(other)
