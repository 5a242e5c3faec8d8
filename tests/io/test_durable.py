import os
import subprocess
import sys
import time

import pytest

from keyrecon.errors import KeyreconError
from keyrecon.io import durable
from keyrecon.io.durable import hold_lock, put_aside, write_durably


def test_text_and_bytes_are_written_as_they_are(tmp_path):
    write_durably(tmp_path / "a.txt", "Größe\n")
    assert (tmp_path / "a.txt").read_bytes() == "Größe\n".encode()
    write_durably(tmp_path / "a.txt", b"\x00\xff")
    assert (tmp_path / "a.txt").read_bytes() == b"\x00\xff"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


def test_permissions_are_those_of_the_old_file_or_the_usual_ones(tmp_path):
    write_durably(tmp_path / "new.txt", "a")
    (tmp_path / "plain.txt").write_text("a")
    assert (tmp_path / "new.txt").stat().st_mode == (tmp_path / "plain.txt").stat().st_mode
    (tmp_path / "plain.txt").chmod(0o600)
    write_durably(tmp_path / "plain.txt", "b")
    assert (tmp_path / "plain.txt").stat().st_mode & 0o777 == 0o600


def test_files_are_written_where_the_system_sets_no_permissions_of_an_open_file(
    tmp_path, monkeypatch
):
    monkeypatch.delattr(os, "fchmod")  # Python before 3.13 on Windows
    write_durably(tmp_path / "a.txt", "a")
    assert (tmp_path / "a.txt").read_text() == "a"


def test_a_folder_that_is_not_there_is_told(tmp_path):
    with pytest.raises(KeyreconError, match="could not be written"):
        write_durably(tmp_path / "none" / "a.txt", "a")


def test_a_failed_write_leaves_the_old_content_and_nothing_else(tmp_path, monkeypatch):
    write_durably(tmp_path / "a.txt", "old")

    def refuse(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(KeyreconError, match="No space left"):
        write_durably(tmp_path / "a.txt", "new")
    assert (tmp_path / "a.txt").read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


def test_copies_put_aside_never_take_one_anothers_place(tmp_path):
    def keep(content):
        (tmp_path / "marks.json").write_text(content)
        put_aside(tmp_path / "marks.json")

    keep("first")
    keep("second")
    (tmp_path / "marks.old-1.json").unlink()
    (tmp_path / "marks.old-mine.json").write_text("by hand")
    keep("third")
    keep("fourth")
    kept = [(tmp_path / f"marks.old-{name}.json").read_text() for name in (2, 3, 4, "mine")]
    assert kept == ["second", "third", "fourth", "by hand"]


def test_where_no_lock_can_be_written_the_folder_is_named(tmp_path):
    (tmp_path / "lock").mkdir()
    with pytest.raises(KeyreconError, match="make it writable"):
        hold_lock(tmp_path / "lock")


def test_a_killed_writer_leaves_a_whole_file(tmp_path):
    path = tmp_path / "a.txt"
    write_durably(path, "0" * 300_000)
    code = (
        "import sys; from pathlib import Path; from keyrecon.io.durable import write_durably\n"
        "n = 0\n"
        "while True:\n"
        "    n += 1; write_durably(Path(sys.argv[1]), str(n % 10) * 300_000)\n"
        "    print(n, flush=True)\n"
    )
    for delay in (0.0, 0.003, 0.007):
        with subprocess.Popen(
            [sys.executable, "-c", code, str(path)], stdout=subprocess.PIPE
        ) as writer:
            writer.stdout.readline()
            time.sleep(delay)
            writer.kill()
        text = path.read_text()
        assert len(text) == 300_000
        assert len(set(text)) == 1


def test_what_a_killed_process_left_half_written_goes_and_what_another_writes_stays(tmp_path):
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    mine = durable._MACHINE
    left = tmp_path / f".a.json.{mine}-{ended.pid}.x1.part"
    old = tmp_path / ".b.json.x2.part"
    living = tmp_path / f".c.json.{mine}-{os.getpid()}.x3.part"
    elsewhere = tmp_path / f".d.json.00000000-{ended.pid}.x4.part"
    for file in (left, old, living, elsewhere):
        file.write_text("half")
    os.utime(old, (0, 0))
    durable.clear_leftovers(tmp_path)
    assert {*tmp_path.iterdir()} == {living, elsewhere}
