"""Tables of labels that windows, servers and other programs write at once: nothing that was acknowledged is lost."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from filelock import FileLock
from hypothesis import example, given
from hypothesis import strategies as st

import taxel
from taxel import FormatError, ProblemError
from taxel.labels import Note
from taxel.panel import label_file as _label_file
from taxel.panel.label_file import LOCK, Edit, LabelFile

OWN = frozenset({"", "walk.mcap", "walk"})

#: The first time of a recording whose clock counts from 1970, us.
BEGIN = 1_741_947_667_480_000


@pytest.fixture
def table(tmp_path: Path) -> Path:
    return tmp_path / "walk.notes.csv"


def mark(table: Path, label: str, t: int, **of_file) -> None:
    LabelFile(table, OWN, **of_file).change([(None, Note(label, t))])


def held(table: Path) -> list[tuple[str, int]]:
    return sorted((row.text, row.t or 0) for row in taxel.Labels(table).rows)


NOTES = st.builds(
    Note,
    st.sampled_from(["heel", "toe"]),
    st.integers(0, 3),
    source=st.sampled_from(["", "left"]),
    others=st.sampled_from([(("comment", ""),), (("comment", "late"),)]),
)
LATE = Note("heel", 0, others=(("comment", "late"),))
REQUESTS = st.lists(st.tuples(st.none() | NOTES, st.none() | NOTES).filter(any), min_size=1, max_size=3)


def key(note: Note) -> tuple[object, ...]:
    return note.text, note.t, note.source


def carried_out(rows: list[Note], request: list[Edit]) -> list[Note] | None:
    """Return what a request makes of a table; None where a row is not there."""
    rows = list(rows)
    for old, new in request:
        taken = next((row for row in rows if old is not None and key(row) == key(old)), None)
        if old is not None:
            if taken is None:
                return None
            rows.remove(taken)
        if new is not None and key(new) not in map(key, rows):
            rows.append(new if taken is None else replace(new, others=taken.others))
    return rows


@given(
    st.lists(NOTES, max_size=6, unique_by=key),
    st.lists(REQUESTS, max_size=5),
    st.sampled_from([(0, 1.0), (BEGIN, 1.0), (0, 10_000.0)]),
)
@example([], [[(None, LATE), (LATE, None), (replace(LATE, t=3), None)]], (0, 1.0))
def test_a_change_is_made_on_the_table_as_it_is_now_whole_or_not_at_all_and_taken_back(before, requests, times) -> None:
    begin_us, unit_us = times
    with TemporaryDirectory() as folder:
        table, rows = Path(folder) / "walk.notes.csv", list(before)
        lines = (f"{row.text},{row.t},{row.source},{row.others[0][1]}\n" for row in rows)
        table.write_text("".join(["label,t_us,source,comment\n", *lines]))
        file = LabelFile(table, OWN, begin_us, unit_us)

        def shown(row: Note | None) -> Note | None:
            return None if row is None else replace(row, t=begin_us + round((row.t or 0) * unit_us))

        for k, request in enumerate(requests):
            # Another program's row.
            with table.open("a") as hand:
                hand.write(f"hand,{k},,\n")
            rows.append(Note("hand", k, others=(("comment", ""),)))
            wanted = carried_out(rows, request)
            asked = [(shown(old), shown(new)) for old, new in request]
            if wanted is None:
                with pytest.raises(ProblemError):
                    file.change(asked)
                found = file.read()
            else:
                inverse, _ = file.change(asked)
                back, undone = file.change(inverse)
                assert Counter(undone) == Counter(map(shown, rows))
                _, found = file.change(back)
                rows = wanted
            assert Counter(found) == Counter(file.read()) == Counter(map(shown, rows))


@pytest.mark.parametrize(
    ("times", "relative"),
    [([], False), ([210_000], True), ([BEGIN + 210_000], False), ([210_000, BEGIN + 500_000], True)],
)
def test_a_mark_is_written_as_the_table_counts_and_no_other_row_is_touched(times, relative: bool, table: Path) -> None:
    table.write_text("label,t_us,replaces_us\n" + "".join(f"heel,{t},\n" for t in times))
    file = LabelFile(table, OWN, BEGIN)
    new = Note("toe", BEGIN + 700_000, replaces=BEGIN + 600_000)
    _, rows = file.change([(None, new)])
    assert [row.t for row in rows] == [*sorted(t % BEGIN + BEGIN for t in times), new.t]
    assert rows == file.read()
    written = {row.text: (row.t, row.replaces) for row in taxel.Labels(table).rows}
    assert written["toe"] == ((700_000, 600_000) if relative else (new.t, new.replaces))
    assert sorted(t for name, t in held(table) if name == "heel") == times


def test_a_label_for_a_note_and_its_removal_replace_each_other(table: Path) -> None:
    file, label, removal = LabelFile(table, OWN), Note("heel", 5, replaces=4), Note("", 5, replaces=4)
    file.change([(None, label)])
    assert file.change([(label, removal)])[1] == (removal,)
    inverse, rows = file.change([(None, Note("toe", 6, replaces=4))])
    assert rows == (Note("toe", 6, replaces=4),)
    assert file.change(inverse)[1] == (removal,)


@pytest.mark.parametrize(
    ("text", "written"),
    [
        (b"t_us,label\n100,2\n", b"t_us,label\n7,toe\n100,2\n"),
        (b"host_ns,t_us,comment,,label\n,1,late,,heel\n", b"host_ns,t_us,comment,,label\n,1,late,,heel\n,7,,,toe\n"),
        (b"\xef\xbb\xbft_us,label\r\n1,heel\r\n", b"\xef\xbb\xbft_us,label\r\n1,heel\r\n7,toe\r\n"),
        (b"t_us,label\n2,f\xfc\xdf\n", b"t_us,label\n2,f\xfc\xdf\n7,toe\n"),
        (b"t_us,label,by\n2,a,M\xfc\xe4\n2,\x81,\n", b"t_us,label,by\n2,a,M\xfc\xe4\n2,\x81,\n7,toe,\n"),
        (b"t_us;label;comment\n1;heel;1,5\n", b"t_us;label;comment\n1;heel;1,5\n7;toe;\n"),
        (b"recording,label,t_us\nwalk,heel,1\nrun,b,1\n", b"recording,label,t_us\nwalk,heel,1\nrun,b,1\n,toe,7\n"),
        ("\ufefflabel\tt_us\r\nhéel\t1\r\n".encode("utf-16-be"),
         "\ufefflabel\tt_us\r\nhéel\t1\r\ntoe\t7\r\n".encode("utf-16-be")),
    ],
)  # fmt: skip
def test_a_table_keeps_its_columns_separators_encoding_permissions_and_link(
    text: bytes, written: bytes, table: Path
) -> None:
    real = table.parent / "store" / "x.csv"
    real.parent.mkdir()
    real.write_bytes(text)
    real.chmod(0o640)
    table.symlink_to(real)
    mark(table, "toe", 7)
    assert (table.is_symlink(), real.read_bytes(), real.stat().st_mode & 0o777) == (True, written, 0o640)


@pytest.mark.parametrize("text", [b"label,t_us\nheel,soon\n", b"# my labels\nlabel,t_us\n", b"\xff\xfet_us,label\n"])
def test_a_table_that_cannot_be_read_is_not_written(text: bytes, table: Path) -> None:
    table.write_bytes(text)
    with pytest.raises(ProblemError):
        mark(table, "toe", 2)
    with pytest.raises(FormatError):
        LabelFile(table, OWN).read()
    assert table.read_bytes() == text


def test_what_another_program_saves_while_a_change_is_made_is_in_the_table(table: Path, monkeypatch) -> None:
    mark(table, "heel", 1)
    save, times = _label_file.write_whole, []

    def late(*of, **how):
        if len(times) < 2:
            times.append(len(times))
            table.write_text(table.read_text() + f"hand,{len(times)}\n")
        return save(*of, **how)

    monkeypatch.setattr(_label_file, "write_whole", late)
    mark(table, "toe", 2)
    assert held(table) == [("hand", 1), ("hand", 2), ("heel", 1), ("toe", 2)]


def test_a_lock_that_another_program_holds_stops_changes_and_not_reading(table: Path, monkeypatch) -> None:
    mark(table, "heel", 1)
    monkeypatch.setattr(_label_file, "_LOCKED_S", 0.1)
    with FileLock(table.with_name(LOCK)):
        assert [row.text for row in LabelFile(table, OWN).read()] == ["heel"]
        with pytest.raises(ProblemError):
            mark(table, "toe", 2)
    assert held(table) == [("heel", 1)]
