"""Tables of labels that several windows and other programs write at once, and programs that end in between."""

from __future__ import annotations

import json
import os
import random
import threading
import time
from collections import Counter
from pathlib import Path

import pytest

import taxel
from taxel import FormatError, ProblemError
from taxel.labels import Note
from taxel.live import _label_table
from taxel.live._label_join import Edit
from taxel.live._label_table import LabelTables

from .label_tables import OWN, SAVED, held, mark, texts


class Window(threading.Thread):
    """Somebody who marks, moves and deletes labels of their own at random."""

    def __init__(self, table: Path, seed: int, number: int, ends: float) -> None:
        super().__init__()
        self.table, self.name, self.ends = table, f"window {number}", ends
        self.tables, self.choose = LabelTables(), random.Random(seed + number)
        self.own: set[int] = set()
        self.error: BaseException | None = None

    def run(self) -> None:
        try:
            while time.monotonic() < self.ends:
                self.change()
                self.tables.stamp(self.table)
        except BaseException as error:
            self.error = error
            raise

    def change(self) -> None:
        t, kind = self.choose.randrange(10**9), self.choose.random()
        edit = Edit(None, Note(self.name, t))
        if kind > 0.6 and self.own:
            old = self.choose.choice(list(self.own))
            edit = Edit(Note(self.name, old), None if kind > 0.8 else edit.new)
        (outcome,), read = self.tables.change(self.table, OWN, [[edit]])
        assert not isinstance(outcome, str), outcome
        assert not read.conflict
        self.own -= {edit.old.t if edit.old else None}
        self.own |= {t} if edit.new else set()


def test_windows_and_a_hand_that_appends_lose_nothing(table: Path) -> None:
    seed = random.randrange(10**6)
    print("seed", seed)
    ends = time.monotonic() + 3.0
    windows = [Window(table, seed, number, ends) for number in range(3)]
    windows[0].change()
    for window in windows:
        window.start()
    hand = Counter()
    for k in range(10**6):
        if time.monotonic() > ends:
            break
        # Another program's line, at once or in two parts.
        with table.open("a") as file:
            file.write(f"hand,{k}")
            if k % 7 == 0:
                file.flush()
                time.sleep(0.01)
            file.write("\n")
        hand["hand", k] += 1
        time.sleep(0.003)
    for window in windows:
        window.join()
        assert window.error is None
        window.tables.close()
    assert held(table) == hand + Counter((window.name, t) for window in windows for t in window.own)
    assert not windows[0].tables.read(table, OWN).conflict


def test_a_program_that_is_quicker_than_the_exchange_keeps_its_text(table: Path, tables, monkeypatch) -> None:
    mark(tables, table, "heel", 1)
    exchange, times = _label_table._exchange, []

    def late(one: str, other: Path) -> bool:
        if len(times) < 3 and not times.append(0) and len(times) % 2:
            new = table.with_name("editor")
            new.write_text(table.read_text() + f"hand,{len(times)}\n")
            os.replace(new, table)
        return exchange(one, other)

    monkeypatch.setattr(_label_table, "_exchange", late)
    read = mark(tables, table, "toe", 2)
    assert texts(read.rows) == [("hand", 1), ("hand", 3), ("heel", 1), ("toe", 2)] == sorted(held(table))
    assert not read.conflict


def test_what_is_written_to_a_table_that_was_replaced_meanwhile_is_taken_in(table: Path, tables) -> None:
    mark(tables, table, "heel", 1)
    with table.open("a") as hand:
        hand.write("hand,2\n")
        mark(tables, table, "toe", 3)
        hand.flush()
        tables.stamp(table)
        assert sorted(held(table)) == [("hand", 2), ("heel", 1), ("toe", 3)]
        hand.write("hand,4\n")
    tables.close()
    assert sorted(held(table)) == [("hand", 2), ("hand", 4), ("heel", 1), ("toe", 3)]


def test_a_line_that_is_being_written_is_waited_for(table: Path, tables) -> None:
    table.write_text("label,t_us\n")
    with table.open("a") as hand:
        hand.write("heel,50")
        hand.flush()
        window = threading.Thread(target=mark, args=(tables, table, "toe", 3))
        window.start()
        time.sleep(0.3)
        hand.write("0000\n")
    window.join()
    assert sorted(held(table)) == [("heel", 500_000), ("toe", 3)]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (b"label,t_us\nheel,soon\n", "line 2: t_us is 'soon'"),
        (b"# my labels\nlabel,t_us\n", "line 1: column 'label' is missing"),
        (b'label,t_us\n"heel,1\n', "a quote is opened"),
        (
            "label,t_us\nheel,1\n".encode("utf-16") + b"\0",
            r"csv, line 3, byte 38: not text in UTF-16 \(truncated data\); save it as UTF-8",
        ),
        (b"label,t_us\r\nheel,1\r\nf\xfc\xdf,2\r\n", "csv, line 3, byte 21: not text in UTF-8 .*; save it as UTF-8"),
        (b"\xef\xbb\xbflabel,t_us\rf\xfc\xdf,2\r", "csv, line 2, byte 15: not text in UTF-8 .*; save it as UTF-8"),
    ],
)
def test_a_table_that_cannot_be_read_is_not_written(text: bytes, said: str, table: Path, tables) -> None:
    mark(tables, table, "heel", 1)
    table.write_bytes(text)
    os.utime(table, (1, 1))
    with pytest.raises(ProblemError, match=f"{said}.*nothing was saved: correct the table"):
        mark(tables, table, "toe", 2)
    assert table.read_bytes() == text
    for read in (lambda: tables.read(table, OWN), lambda: taxel.Labels(table)):
        with pytest.raises(FormatError, match=said):
            read()
    table.write_text("label,t_us\n")
    read = mark(tables, table, "ball", 3)
    assert texts(read.rows) == [("ball", 3)]
    assert texts(read.conflict.missing) == [("heel", 1)]


@pytest.mark.parametrize(
    ("text", "kept"),
    [
        (b"\xef\xbb\xbflabel,t_us\r\nheel,1\r\n", [("heel", 1)]),
        (b"label,t_us\nheel,1", [("heel", 1)]),
        (b"t_us,label,comment\n1,heel,late\n1,heel,early\n", [("heel", 1), ("heel", 1)]),
        (b"recording,label,t_us\nwalk,heel,1\nrun,heel,1\n,heel,1\n", [("heel", 1), ("heel", 1), ("heel", 1)]),
        (b"label,t_us,comment\n", []),
        (b"", []),
        (b"\xef\xbb\xbf\n", []),
    ],
)
def test_any_table_that_can_be_read_keeps_its_rows(text: bytes, kept, table: Path, tables) -> None:
    table.write_bytes(text)
    os.utime(table, (1, 1))
    read = mark(tables, table, "toe", 2)
    assert texts(read.rows) == [*kept, ("toe", 2)] == sorted(held(table).elements())
    assert (b"comment" in text) == (b"comment" in table.read_bytes())
    assert not tables.read(table, OWN).conflict


@pytest.mark.parametrize(
    ("text", "written"),
    [
        (b"t_us,label\n100,2\n", b"t_us,label\n7,toe\n100,2\n"),
        (b"label,t_us,source\nheel,1,\n", b"label,t_us,source\nheel,1,\ntoe,7,\n"),
        (b"host_ns,t_us,comment,,label\n,1,late,,heel\n", b"host_ns,t_us,comment,,label\n,1,late,,heel\n,7,,,toe\n"),
        (b"replaces_us, t_us ,label\n", b"replaces_us,t_us,label\n,7,toe\n"),
        (b"\xef\xbb\xbft_us,label\r\n1,heel\r\n", b"\xef\xbb\xbft_us,label\r\n1,heel\r\n7,toe\r\n"),
        (b"t_us,label\r1,heel\r", b"t_us,label\r1,heel\r7,toe\r"),
        (b'\xef\xbb\xbft_us,label\n1,"a\r\nb"\n', b'\xef\xbb\xbft_us,label\n1,"a\r\nb"\n7,toe\n'),
        (b"t_us;label;comment\n1;heel;1,5\n", b"t_us;label;comment\n1;heel;1,5\n7;toe;\n"),
        (
            "\ufefflabel\tt_us\r\nhéel\t1\r\n".encode("utf-16-be"),
            "\ufefflabel\tt_us\r\nhéel\t1\r\ntoe\t7\r\n".encode("utf-16-be"),
        ),
    ],
)
def test_a_table_keeps_its_columns_in_their_order_and_its_ends_of_lines(
    text: bytes, written: bytes, table: Path, tables
) -> None:
    table.write_bytes(text)
    os.utime(table, (1, 1))
    mark(tables, table, "toe", 7)
    assert table.read_bytes() == written
    # A label with columns of its own; the rows of a program that appends by the header that it wrote stay as they are.
    new = Note("ball", 9, source="left", at_ns=5)
    tables.change(table, OWN, [[Edit(None, new)]])
    head = table.read_bytes().splitlines()[0]
    assert head.startswith(written.splitlines()[0])
    assert new in tables.read(table, OWN).rows or b"comment" in text


def test_a_deleted_table_and_an_older_text_are_conflicts_that_last(table: Path, tables) -> None:
    mark(tables, table, "heel", 1)
    older = table.read_text()
    mark(tables, table, "toe", 2)
    tables.change(table, OWN, [[Edit(Note("heel", 1), Note("heel", 5))]])
    table.write_text(older + "hand,9\n")
    for again in (tables, LabelTables()):
        conflict = again.read(table, OWN).conflict
        assert texts(conflict.missing) == [("heel", 5), ("toe", 2)]
        assert texts(conflict.returned) == [("heel", 1)]
        assert texts(conflict.new) == [("hand", 9)]
        # Another label changes nothing in it.
        assert mark(again, table, "ball", 7).conflict == conflict
    read = tables.settle(table, OWN, conflict, restore=True)
    assert texts(read.rows) == [("ball", 7), ("hand", 9), ("heel", 5), ("toe", 2)]
    assert not read.conflict
    table.unlink()
    conflict = tables.read(table, OWN).conflict
    assert texts(conflict.missing) == [("ball", 7), ("heel", 5), ("toe", 2)]
    read = tables.settle(table, OWN, conflict, restore=False)
    assert not read.conflict
    assert not read.rows
    assert texts(mark(tables, table, "toe", 2).rows) == [("toe", 2)]


def test_only_what_was_seen_is_settled(table: Path, tables) -> None:
    mark(tables, table, "heel", 1)
    mark(tables, table, "toe", 2)
    table.write_text("label,t_us\ntoe,2\n")
    seen = tables.read(table, OWN).conflict
    table.write_text("label,t_us\n")
    read = tables.settle(table, OWN, seen, restore=False)
    assert texts(read.conflict.missing) == [("toe", 2)]


@pytest.mark.parametrize("request_", ["mark", "move", "delete"])
@pytest.mark.parametrize("step", range(6))
@pytest.mark.parametrize("older", [False, True])
def test_a_window_killed_at_any_step_leaves_its_change_whole_or_none(
    request_: str, step: int, older: bool, table: Path, tables
) -> None:
    """The steps are the calls that change the disk; another program may write before the next window reads."""
    mark(tables, table, "heel", 1)
    mark(tables, table, "toe", 2)
    edit = {"mark": Edit(None, Note("ball", 3)), "move": Edit(Note("toe", 2), Note("toe", 5))}.get(
        request_, Edit(Note("toe", 2), None)
    )
    child = os.fork()
    if not child:
        left = iter([*[None] * step, "dies"])

        def dies(function):
            def wrapped(*args, **how):
                if next(left, None) == "dies":
                    os._exit(9)
                return function(*args, **how)

            return wrapped

        for name in ("_save", "_exchange", "_sync_folder"):
            setattr(_label_table, name, dies(getattr(_label_table, name)))
        os.unlink = dies(os.unlink)
        Path.unlink = dies(Path.unlink)
        LabelTables().change(table, OWN, [[edit]])
        os._exit(0)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    assert code in (0, 9)
    if older:
        table.write_text("label,t_us\nheel,1\nhand,8\n")
    read = tables.read(table, OWN)
    assert not [file for file in table.parent.iterdir() if file.suffix == ".new"]
    before = {("heel", 1), ("toe", 2)}
    after = {"mark": before | {("ball", 3)}, "move": {("heel", 1), ("toe", 5)}}.get(request_, {("heel", 1)})
    found = set(texts(read.rows))
    if not older:
        assert found in (before, after)
        assert code or found == after
        assert not read.conflict
    else:
        known = set(texts(read.conflict.missing)) | {("heel", 1)}
        assert known & before | known & after == known
        assert ("toe", 2) in known or request_ != "mark"
        assert code or known == after
    read = tables.settle(table, OWN, read.conflict, restore=True)
    assert not read.conflict


def test_a_label_whose_deletion_was_not_done_is_acknowledged_as_before(table: Path, tables, monkeypatch) -> None:
    """The window is killed before it exchanges the table; another program writes it, with the label and without."""
    mark(tables, table, "heel", 1)
    mark(tables, table, "toe", 2)
    child = os.fork()
    if not child:
        monkeypatch.setattr(_label_table, "_exchange", lambda *_: os._exit(9))
        tables.change(table, OWN, [[Edit(Note("toe", 2), None)]])
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 9
    table.write_text("label,t_us\nheel,1\ntoe,2\nhand,8\n")
    mark(tables, table, "ball", 3)
    table.write_text("label,t_us\nheel,1\n")
    assert texts(tables.read(table, OWN).conflict.missing) == [("ball", 3), ("toe", 2)]


def test_a_file_system_that_cannot_exchange_files_is_written_too(table: Path, tables, monkeypatch) -> None:
    mark(tables, table, "heel", 1)
    monkeypatch.setattr(_label_table, "_exchange", lambda *_: False)
    sync, times = os.fsync, []

    def late(descriptor: int) -> None:
        if len(times) < 2 and not times.append(0):
            new = table.with_name("editor")
            new.write_text(table.read_text() + f"hand,{len(times)}\n")
            os.replace(new, table)
        sync(descriptor)

    monkeypatch.setattr(os, "fsync", late)
    read = mark(tables, table, "toe", 2)
    assert texts(read.rows) == [("hand", 1), ("hand", 2), ("heel", 1), ("toe", 2)] == sorted(held(table))
    hidden = [file.name for file in table.parent.iterdir() if file.name.startswith(f".{table.name}.")]
    assert hidden == [f".{table.name}.acknowledged"]


def test_what_was_acknowledged_is_damaged(table: Path, tables) -> None:
    mark(tables, table, "heel", 1)
    (table.parent / ".walk.notes.csv.acknowledged").write_text("[]")
    with pytest.raises(
        FormatError,
        match=r"damaged, so taxel does not know which labels it had confirmed.*delete this file to continue",
    ):
        mark(tables, table, "toe", 2)
    assert sorted(held(table)) == [("heel", 1)]


def test_another_recording_has_none_of_the_labels_of_a_deleted_one(table: Path, tables) -> None:
    recording = table.with_name("walk.mcap")
    recording.write_bytes(b"first")
    mark(tables, table, "heel", 1)
    # It runs: it grows.
    recording.write_bytes(b"first and more")
    table.unlink()
    assert texts(tables.read(table, OWN).conflict.missing) == [("heel", 1)]
    recording.unlink()
    assert texts(tables.read(table, OWN).conflict.missing) == [("heel", 1)]
    recording.write_bytes(b"another")
    assert not tables.read(table, OWN).conflict
    read = mark(tables, table, "toe", 2)
    assert texts(read.rows) == [("toe", 2)]
    assert not read.conflict


def test_recordings_of_one_stem_share_what_was_acknowledged(table: Path, tables) -> None:
    for ending in ("mcap", "asf"):
        table.with_name(f"walk.{ending}").write_bytes(ending.encode())
    mark(tables, table, "heel", 1)
    table.unlink()
    other = frozenset({"", "walk.asf", "walk"})
    assert texts(tables.read(table, other).conflict.missing) == [("heel", 1)]
    _, read = tables.change(table, other, [[Edit(None, Note("toe", 2))]])
    assert texts(read.conflict.missing) == [("heel", 1)]
    table.unlink()
    assert texts(tables.read(table, OWN).conflict.missing) == [("heel", 1), ("toe", 2)]


@pytest.mark.parametrize(
    "row",
    [
        ["x", 5, "", "", None, 10**30, []],
        ["x", 5, "", "", None, -5, []],
        ["x", 5, "", "", None, 1e30, []],
        ["x", float("inf"), "", "", None, 0, []],
        ["x", True, "", "", None, 0, []],
        ["x", None, "", "", None, 0, []],
        ["\ud800", 5, "", "", None, 0, []],
        ["x" * 10**6, 5, "", "", None, 0, []],
        [["x"], 5, "", "", None, 0, []],
        ["x", 5, 7, "", None, 0, []],
        ["x", 5],
    ],
    ids=range(11),
)
def test_what_no_table_has_was_not_acknowledged(row, table: Path, tables) -> None:
    saved = {"acknowledged": {"labels": [row], "deleted": [], "table": None}, "next": None}
    table.with_name(SAVED).write_text(json.dumps(saved))
    with pytest.raises(FormatError, match="damaged, so taxel does not know which labels"):
        tables.read(table, OWN)
    with pytest.raises(FormatError, match="damaged, so taxel does not know which labels"):
        mark(tables, table, "toe", 1)
    assert not table.exists()


def test_a_huge_file_beside_a_table_is_not_read(table: Path, tables) -> None:
    with table.with_name(SAVED).open("wb") as file:
        file.truncate(1 << 32)
    with pytest.raises(FormatError, match="more than 67108864 bytes"):
        tables.read(table, OWN)


@pytest.mark.parametrize("label", [" x ", "", "\n"])
def test_what_a_table_cannot_hold_is_not_restored(label: str, table: Path, tables) -> None:
    mark(tables, table, "heel", 1)
    before = table.read_text()
    saved = {"acknowledged": {"labels": [[label, 5, "", "", None, 0, []]], "deleted": [], "table": None}, "next": None}
    table.with_name(SAVED).write_text(json.dumps(saved))
    conflict = tables.read(table, OWN).conflict
    with pytest.raises(ProblemError, match="nothing was saved"):
        tables.settle(table, OWN, conflict, restore=True)
    assert table.read_text() == before


@pytest.mark.parametrize("by_hand", [False, True])
def test_what_came_out_for_a_table_when_its_writer_was_killed_is_kept(by_hand: bool, table: Path, tables) -> None:
    """The text that came out is another program's, which was quicker, or that which was read."""
    mark(tables, table, "heel", 1)
    child = os.fork()
    if not child:
        exchange = _label_table._exchange

        def late(one: str, other: Path) -> bool:
            if by_hand:
                new = table.with_name("editor")
                new.write_text("label,t_us\nheel,1\nhand,9\n")
                os.replace(new, table)
            exchange(one, other)
            os._exit(9)

        _label_table._exchange = late
        mark(LabelTables(), table, "toe", 2)
    os.waitpid(child, 0)
    assert [file for file in table.parent.iterdir() if file.suffix == ".new"]
    read = tables.read(table, OWN)
    assert ("hand", 9) in texts(read.rows) if by_hand else texts(read.rows) == [("heel", 1), ("toe", 2)]
    assert {("heel", 1)} <= set(texts(read.rows))
    assert not [file for file in table.parent.iterdir() if file.suffix == ".new"]


def test_a_conflict_is_settled_once(table: Path, tables) -> None:
    mark(tables, table, "heel", 1)
    table.write_text("label,t_us\n")
    seen = tables.read(table, OWN).conflict
    tables.settle(table, OWN, seen, restore=True)
    with pytest.raises(ProblemError, match="this conflict is over"):
        LabelTables().settle(table, OWN, seen, restore=False)
    assert sorted(held(table)) == [("heel", 1)]


def test_a_label_moved_or_renamed_onto_an_equal_one_is_one(table: Path, tables) -> None:
    mark(tables, table, "heel", 1)
    mark(tables, table, "heel", 2)
    mark(tables, table, "toe", 1)
    for old in (Note("heel", 2), Note("toe", 1)):
        tables.change(table, OWN, [[Edit(old, Note("heel", 1))]])
    assert texts(tables.read(table, OWN).rows) == [("heel", 1)]
    table.write_text("label,t_us\n")
    assert texts(tables.read(table, OWN).conflict.missing) == [("heel", 1)]


def test_a_table_of_the_future_is_not_waited_for(table: Path, tables) -> None:
    table.write_text("label,t_us\nheel,1")
    os.utime(table, (time.time() + 10**6,) * 2)
    begun = time.monotonic()
    assert texts(tables.read(table, OWN).rows) == [("heel", 1)]
    assert time.monotonic() - begun < _label_table._WHOLE_WITHIN_S


def test_deletions_are_remembered(table: Path, tables) -> None:
    edits = [Edit(None, Note("heel", 0)), *(Edit(Note("heel", t), Note("heel", t + 1)) for t in range(2000))]
    tables.change(table, OWN, [edits])
    tables.change(table, OWN, [[Edit(Note("heel", 2000), None)]])
    table.write_text("label,t_us\nheel,0\n")
    assert texts(tables.read(table, OWN).conflict.returned) == [("heel", 0)]
