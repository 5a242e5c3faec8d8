import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import BrokenExecutor
from pathlib import Path

import numpy as np
import pytest
from command_line import keyrecon
from processes import is_running, needs_proc

from keyrecon.errors import KeyreconError
from keyrecon.io import workers as io_workers
from keyrecon.io.local_workers import local_processes
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
    made = store.parallel_map(frames_before, ((FRAMES + n, 12) for n in range(20)))
    for n, own in enumerate(made):
        np.testing.assert_array_equal(own, frames_before(FRAMES + n, 12))
    assert not list(tmp_path.iterdir())


def test_what_a_stage_refuses_elsewhere_is_told_here(tmp_path, processes):
    store = StageStore(tmp_path, workers=processes)
    with pytest.raises(KeyreconError, match="--budget is a share"):
        store.keep("labels", count_labels, KeyframeOptions(budget=2.0), 100, 25.0)


def own_process(seed):
    """The process that it is called in."""
    return os.getpid()


def test_stages_of_one_shot_are_done_by_one_process(tmp_path, processes):
    store = StageStore(tmp_path, workers=processes)

    def shot(number):
        return {store.keep(f"p{stage}@{number}", own_process, stage) for stage in range(4)}

    by = [*store.each(shot, range(8))]
    assert {len(one) for one in by} == {1}
    assert os.getpid() not in set.union(*by)


def test_where_nothing_is_said_only_shots_are_given_away(tmp_path, monkeypatch):
    monkeypatch.setattr(io_workers, "core_count", lambda: 2)
    before = multiprocessing.active_children()
    with open_workers(None) as workers:
        store = StageStore(tmp_path, workers=workers)
        assert store.keep("alone", own_process, 1) == os.getpid()
        assert multiprocessing.active_children() == before
        [of_shot] = store.each(lambda n: store.keep(f"p@{n}", own_process, n), [1])
        assert of_shot != os.getpid()
    assert not still_there([of_shot])


def test_nothing_of_a_pool_is_left_when_a_refusal_leaves_the_program(tmp_path):
    """What is left would be woken at the end of the program, maybe as it closes what wakes it."""
    before = {*threading.enumerate()}
    with (
        pytest.raises(KeyreconError, match="--budget is a share"),
        open_workers("1") as workers,
    ):
        store = StageStore(tmp_path, workers=workers)
        store.keep("labels", count_labels, KeyframeOptions(budget=2.0), 100, 25.0)
    assert {*threading.enumerate()} <= before


def test_nothing_is_left_of_a_pool_whose_process_was_lost(tmp_path):
    before = {*threading.enumerate()}
    with open_workers("1") as workers:
        StageStore(tmp_path / "c", workers=workers).keep("l", die_once, str(tmp_path / "trace"))
    assert {*threading.enumerate()} <= before


def test_no_process_is_begun_any_more_when_they_are_closed(tmp_path):
    task = StageStore(tmp_path)._task(tmp_path / "a.npz", frames_before, (FRAMES, 12), {})
    before = multiprocessing.active_children()
    with local_processes(1) as processes:
        pass
    with pytest.raises(BrokenExecutor):
        processes.carry_out(task)
    assert multiprocessing.active_children() == before


def test_of_what_takes_much_memory_two_are_worked_on_at_a_time(monkeypatch):
    monkeypatch.setattr(io_workers, "core_count", lambda: 6)
    at_work, most = set(), []

    def work(number):
        at_work.add(number)
        most.append(len(at_work))
        time.sleep(0.05)
        at_work.remove(number)
        return number

    with open_workers(None) as workers:
        assert [*workers.each(work, range(6), large=True)] == [*range(6)]
        assert max(most) <= 2
        assert [*workers.each(work, range(12))] == [*range(12)]
        assert max(most) > 2
    with open_workers("6") as workers:
        assert workers.large_at_once is None


def test_on_one_core_there_are_no_workers(monkeypatch):
    monkeypatch.setattr(io_workers, "core_count", lambda: 1)
    with open_workers(None) as workers:
        assert workers is None


def die_once(trace):
    """Be killed the first time."""
    if not os.path.exists(trace):
        open(trace, "w").close()
        os.kill(os.getpid(), signal.SIGKILL)
    return os.getpid()


def die(seed):
    """Be killed each time."""
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_process_that_is_lost_does_its_stage_again_and_no_other_shot_suffers(tmp_path):
    with open_workers("2") as workers:
        store = StageStore(tmp_path / "cache", workers=workers)

        def shot(number):
            if number == 2:
                store.keep("lost@2", die_once, str(tmp_path / "trace"))
            return store.keep(f"p@{number}", own_process, number)

        by = [*store.each(shot, range(5))]
    assert len(by) == 5
    assert (tmp_path / "trace").exists()


def test_a_process_that_is_lost_again_ends_in_one_line_and_what_was_made_stays(tmp_path):
    with open_workers("1") as workers:
        store = StageStore(tmp_path, workers=workers)
        recipe(store)
        with pytest.raises(KeyreconError, match=r"workers of this machine.*goes on from there"):
            store.keep("third", die, 0)
    again = StageStore(tmp_path)
    recipe(again)
    assert again.seconds == {}


WAITING = """
import signal
import sys
from pathlib import Path
from keyrecon.io.stages import StageStore
from keyrecon.io.workers import open_workers
from test_workers import wait_here
if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # shells take it from what is behind
    with open_workers("2") as workers:
        store = StageStore(Path(sys.argv[1]), workers=workers)
        list(store.each(lambda n: store.keep(f"w@{n}", wait_here, str(n), sys.argv[2]), range(2)))
"""


def wait_here(name, folder):
    """Tell the process and wait."""
    with open(os.path.join(folder, name), "w") as file:
        file.write(str(os.getpid()))
    time.sleep(60)


def still_there(processes, seconds=5.0):
    """Those of some processes that have not ended by then."""
    end = time.monotonic() + seconds
    while left := [pid for pid in processes if is_running(pid)]:
        if time.monotonic() > end:
            return left
        time.sleep(0.05)
    return []


@needs_proc
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_processes_end_with_the_one_that_began_them(tmp_path, how):
    told = tmp_path / "told"
    told.mkdir()
    script = tmp_path / "waiting.py"
    script.write_text(WAITING)
    paths = os.pathsep.join([str(Path(__file__).parent), *sys.path])
    command = [sys.executable, script, tmp_path / "cache", told]
    with subprocess.Popen(
        command, env={**os.environ, "PYTHONPATH": paths}, stderr=subprocess.PIPE,
        start_new_session=True,
    ) as asking:  # fmt: skip
        end = time.monotonic() + 30
        while len(files := [f for f in told.iterdir() if f.read_text()]) < 2:
            assert time.monotonic() < end
            time.sleep(0.05)
        working = [int(file.read_text()) for file in files]
        if how == signal.SIGINT:
            os.killpg(asking.pid, how)  # as a terminal does
        else:
            asking.send_signal(how)
        asking.wait(10)
    assert not still_there(working)


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
