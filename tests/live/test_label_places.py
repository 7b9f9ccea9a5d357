"""Where tables of labels stand: behind links, on full or slow disks, in folders of several users, under one lock."""

from __future__ import annotations

import errno
import fcntl
import os
import resource
import threading
import time
from collections import Counter
from pathlib import Path

import pytest

from taxel import ProblemError
from taxel.labels import Note
from taxel.live import _label_lock, _label_table
from taxel.live._label_join import Edit
from taxel.live._label_table import LabelTables

from .label_tables import OWN, SAVED, held, mark, texts


def test_a_link_to_a_table_stays_one_and_its_permissions_stay(tmp_path: Path, table: Path, tables) -> None:
    real = tmp_path / "real.csv"
    real.write_text("label,t_us\nheel,1\n")
    real.chmod(0o640)
    table.symlink_to(real)
    mark(tables, table, "toe", 2)
    assert table.is_symlink()
    assert real.stat().st_mode & 0o777 == 0o640
    assert sorted(held(real)) == [("heel", 1), ("toe", 2)]


def linked(table: Path, text: str) -> Path:
    """Replace a table by a link to a file in another folder with this text."""
    real = table.parent / "store" / "x.csv"
    real.parent.mkdir(exist_ok=True)
    real.write_text(text)
    link = table.with_name("link")
    link.symlink_to("store/x.csv")
    os.replace(link, table)
    return real


def test_a_table_that_becomes_a_link_and_a_file_again_keeps_what_was_acknowledged(table: Path, tables) -> None:
    for t in range(3):
        mark(tables, table, "heel", t)
    linked(table, "label,t_us\nheel,0\n")
    for again in (tables, LabelTables()):
        assert texts(again.read(table, OWN).conflict.missing) == [("heel", 1), ("heel", 2)]
    assert texts(mark(tables, table, "toe", 5).conflict.missing) == [("heel", 1), ("heel", 2)]
    tables.settle(table, OWN, tables.read(table, OWN).conflict, restore=True)
    tables.change(table, OWN, [[Edit(Note("heel", 0), None)]])
    assert table.is_symlink()
    text = table.read_text()
    table.unlink()
    table.write_text(text)
    read = tables.read(table, OWN)
    assert texts(read.rows) == [("heel", 1), ("heel", 2), ("toe", 5)]
    assert not read.conflict
    table.write_text("label,t_us\nheel,0\n")
    conflict = tables.read(table, OWN).conflict
    assert texts(conflict.missing) == [("heel", 1), ("heel", 2), ("toe", 5)]
    assert texts(conflict.returned) == [("heel", 0)]


def test_windows_on_a_table_and_on_a_link_to_it_are_in_no_conflict(table: Path, tables) -> None:
    mark(tables, table, "heel", 1)
    real = linked(table, table.read_text())
    for k in range(4):
        one, other = (real, table) if k % 2 else (table, real)
        mark(tables, one, "toe", k)
        assert not tables.change(other, OWN, [[Edit(Note("toe", k), Note("ball", k))]])[1].conflict
        assert not tables.read(one, OWN).conflict
    real.write_text("label,t_us\n")
    assert texts(tables.read(table, OWN).conflict.missing) == [*(("ball", k) for k in range(4)), ("heel", 1)]


def test_a_late_line_in_a_table_that_became_a_link_goes_to_its_file(table: Path, tables) -> None:
    mark(tables, table, "heel", 1)
    with table.open("a") as hand:
        mark(tables, table, "toe", 3)
        real = linked(table, table.read_text())
        hand.write("hand,2\n")
        hand.flush()
        tables.stamp(table)
    assert table.is_symlink()
    assert sorted(held(real)) == [("hand", 2), ("heel", 1), ("toe", 3)]


def test_what_is_no_regular_file_is_refused_at_once(table: Path, tables) -> None:
    os.mkfifo(table)
    with pytest.raises(ProblemError, match="a pipe, a socket or a device; must be a file"):
        mark(tables, table, "toe", 2)


def no_space(*_args: object) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_change_that_is_in_the_table_is_done_although_the_disk_is_full_then(table: Path, tables, monkeypatch) -> None:
    mark(tables, table, "heel", 1)
    put = _label_table._put

    def then_full(name: str, file) -> bool:
        done = put(name, file)
        monkeypatch.setattr(_label_table, "_save", no_space)
        return done

    monkeypatch.setattr(_label_table, "_put", then_full)
    mark(tables, table, "toe", 2)
    with pytest.raises(ProblemError, match=r"^walk.notes.csv cannot be saved: no space left on device$"):
        mark(tables, table, "ball", 3)
    monkeypatch.undo()
    assert sorted(held(table)) == [("heel", 1), ("toe", 2)]
    table.write_text("label,t_us\n")
    assert texts(LabelTables().read(table, OWN).conflict.missing) == [("heel", 1), ("toe", 2)]


def test_a_folder_that_cannot_be_written_is_named_with_its_reason(table: Path, monkeypatch) -> None:
    real = os.open

    def refused(place, flags, *more, **how):
        if flags & os.O_CREAT:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(place))
        return real(place, flags, *more, **how)

    monkeypatch.setattr(os, "open", refused)
    with pytest.raises(ProblemError, match=r"^walk.notes.csv cannot be saved: permission denied$"):
        mark(LabelTables(), table, "heel", 1)


@pytest.mark.parametrize("code", [errno.EPERM, errno.ENOTSUP, errno.EMLINK])
def test_a_file_system_without_hard_links_gets_its_first_label(code: int, table: Path, tables, monkeypatch) -> None:
    def link(*_args: object) -> None:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(os, "link", link)
    assert texts(mark(tables, table, "heel", 1).rows) == [("heel", 1)]
    assert sorted(held(table)) == [("heel", 1)]


def test_a_late_line_in_a_table_that_was_replaced_is_taken_in(table: Path, tables, monkeypatch) -> None:
    mark(tables, table, "heel", 1)
    clock = time.monotonic
    with table.open("a") as hand:
        mark(tables, table, "toe", 3)
        tables.stamp(table)
        monkeypatch.setattr(time, "monotonic", lambda: clock() + 10_000)
        tables.stamp(table)
        hand.write("hand,2\n")
        hand.flush()
        tables.stamp(table)
    assert sorted(held(table)) == [("hand", 2), ("heel", 1), ("toe", 3)]


def test_watched_tables_are_bounded(table: Path, tables, monkeypatch) -> None:
    for t in range(40):
        mark(tables, table, "heel", t)
    assert len(tables._watched) == _label_table._MOST_WATCHED <= 32
    monkeypatch.setattr(_label_table, "_MOST_WATCHED_BYTES", 10)
    mark(tables, table, "heel", 40)
    assert len(tables._watched) == 1


def test_a_program_that_holds_its_table_open_is_heard_however_often_the_page_saves(table: Path, tables) -> None:
    mark(tables, table, "heel", 0)
    with table.open("a") as hand:
        for t in range(1, 40):
            hand.write(f"hand,{t}\n")
            hand.flush()
            mark(tables, table, "heel", t)
            tables.stamp(table)
    assert held(table) == Counter((label, t) for label in ("hand", "heel") for t in range(40)) - Counter([("hand", 0)])


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EDQUOT, errno.EMFILE, errno.ENFILE])
def test_watched_tables_make_room_on_a_full_disk(code: int, table: Path, tables, monkeypatch) -> None:
    mark(tables, table, "heel", 0)
    new = _label_table._new_file
    with table.open("a") as hand:
        for t in range(1, 9):
            mark(tables, table, "heel", t)
        hand.write("hand,9\n")
        hand.flush()

        def full(*of):
            if len(tables._watched) > 3:
                raise OSError(code, os.strerror(code))
            return new(*of)

        monkeypatch.setattr(_label_table, "_new_file", full)
        mark(tables, table, "heel", 10)
        tables.stamp(table)
    assert sorted(held(table)) == [("hand", 9), *(("heel", t) for t in range(9)), ("heel", 10)]
    monkeypatch.setattr(_label_table, "_new_file", no_space)
    with pytest.raises(ProblemError, match=r"cannot be saved: no space left"):
        mark(tables, table, "toe", 11)


def test_saving_needs_few_descriptors(table: Path, tables) -> None:
    limit = resource.getrlimit(resource.RLIMIT_NOFILE)
    # Twelve are free: other files of this process may lie between them.
    free = [os.open(os.devnull, os.O_RDONLY) for _ in range(12)]
    for descriptor in free:
        os.close(descriptor)
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(free) + 1, limit[1]))
    try:
        for t in range(30):
            mark(tables, table, "heel", t)
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, limit)
    assert len(held(table)) == 30


def test_a_lock_that_is_no_file_is_refused_at_once(table: Path, tables) -> None:
    os.mkfifo(table.with_name(".taxel-labels.lock"))
    with pytest.raises(ProblemError, match=r"taxel-labels.lock: the lock of tables must be a regular file"):
        mark(tables, table, "heel", 1)


def together(calls) -> list:
    """Make calls in a thread each; return what they returned or raised."""
    found: list = []

    def call(one) -> None:
        try:
            found.append(one())
        except Exception as error:
            found.append(error)

    threads = [threading.Thread(target=call, args=(one,)) for one in calls]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return found


def slow_disk(monkeypatch) -> None:
    sync = os.fsync
    monkeypatch.setattr(os, "fsync", lambda descriptor: (time.sleep(0.03), sync(descriptor)))
    monkeypatch.setattr(_label_lock, "_WITHIN_S", 0.5)


def test_the_tables_of_one_server_wait_for_each_other_as_long_as_it_takes(tmp_path: Path, tables, monkeypatch) -> None:
    slow_disk(monkeypatch)
    places = [tmp_path / f"{k}.notes.csv" for k in range(12)]
    found = together([lambda place=place: mark(tables, place, "heel", 1) for place in places])
    assert not [one for one in found if isinstance(one, Exception)]
    assert [held(place) for place in places] == [Counter({("heel", 1): 1})] * 12


def test_another_server_gets_the_lock_between_the_tables_of_one_that_queue(tmp_path: Path, tables, monkeypatch) -> None:
    slow_disk(monkeypatch)
    child = os.fork()
    if not child:
        for k in range(10):
            mark(LabelTables(), tmp_path / "other.notes.csv", "heel", k)
        os._exit(0)
    ends, failed = [], []

    def marks(place: Path) -> None:
        while not ends:
            try:
                mark(tables, place, "toe", time.monotonic_ns() % 10**9)
            except ProblemError as error:
                failed.append(error)

    writers = [threading.Thread(target=marks, args=(tmp_path / f"{k}.notes.csv",)) for k in range(4)]
    for writer in writers:
        writer.start()
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    ends.append(True)
    for writer in writers:
        writer.join()
    assert (code, failed) == (0, [])
    assert len(held(tmp_path / "other.notes.csv")) == 10


def test_reading_waits_for_no_lock(table: Path, tables, monkeypatch) -> None:
    mark(tables, table, "heel", 1)
    monkeypatch.setattr(_label_lock, "_WITHIN_S", 0.1)
    with open(table.with_name(".taxel-labels.lock")) as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        assert texts(tables.read(table, OWN).rows) == [("heel", 1)]
        with pytest.raises(ProblemError, match="another program holds this lock; nothing was saved"):
            mark(tables, table, "toe", 2)


def test_a_table_that_is_written_while_it_is_read_is_in_no_conflict(table: Path, tables, monkeypatch) -> None:
    mark(tables, table, "heel", 1)
    known, once = _label_table._acknowledged, iter([True])

    def late(*one):
        if next(once, False):
            mark(LabelTables(), table, "toe", 2)
        return known(*one)

    monkeypatch.setattr(_label_table, "_acknowledged", late)
    read = tables.read(table, OWN)
    assert texts(read.rows) == [("heel", 1), ("toe", 2)]
    assert not read.conflict


@pytest.mark.parametrize("new", [False, True])
def test_what_was_acknowledged_is_readable_by_those_who_may_read_the_table(new: bool, table: Path, tables) -> None:
    if new:
        mark(tables, table, "toe", 1)
    else:
        table.write_text("label,t_us\nheel,1\n")
    table.chmod(0o600)
    mark(tables, table, "toe", 2)
    assert table.with_name(SAVED).stat().st_mode & 0o777 == 0o600 == table.stat().st_mode & 0o777


def test_a_table_stays_with_its_group_where_the_user_is_in_it(table: Path, tables, monkeypatch) -> None:
    """The group is asked for on the new file before its permissions are set; another user's group cannot be given."""
    table.write_text("label,t_us\n")
    table.chmod(0o664)
    if os.getuid() == 0:
        os.chown(table, -1, 3000)
    group, asked, give = table.stat().st_gid, [], os.fchown

    def fchown(descriptor: int, user: int, of: int) -> None:
        asked.append((user, of, os.fstat(descriptor).st_mode & 0o070))
        give(descriptor, user, of)

    monkeypatch.setattr(os, "fchown", fchown)
    mark(tables, table, "heel", 1)
    assert set(asked) == {(-1, group, 0)}
    for one in (table, table.with_name(SAVED)):
        assert (one.stat().st_gid, one.stat().st_mode & 0o777) == (group, 0o664)

    def refused(*_: object) -> None:
        raise PermissionError(errno.EPERM, os.strerror(errno.EPERM))

    monkeypatch.setattr(os, "fchown", refused)
    mark(tables, table, "toe", 2)
    assert sorted(held(table)) == [("heel", 1), ("toe", 2)]
