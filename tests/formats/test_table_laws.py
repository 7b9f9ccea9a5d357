"""Tables that are drawn are read as they were written, or asked about; printed layouts read them again."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taxel._base.header_table import HeaderTable
from taxel.formats.form import Form
from taxel.formats.layout import Layout, Table
from taxel.formats.line_fits import Fit
from taxel.formats.lines import KINDS, Line, read_line
from taxel.formats.table_columns import Draft
from taxel.formats.times import repaired

from .tables import frames, layouts, opened

#: Separators, decimal marks, and marks between thousands.
FORMS = [
    *((separator, ".", thousands) for separator in ",;\t" for thousands in ("", ",", "'")),
    *((separator, ",", thousands) for separator in ";\t" for thousands in ("", ".", "\N{NO-BREAK SPACE}")),
    (",", ",", "."),
]
NUMBERS = st.floats(-1e6, 1e6, width=32).map(lambda value: round(value, 3))


def written(number: str, decimal: str, thousands: str, separator: str) -> str:
    """Return a number like 1,234.5 with other marks, in quotes where one of them is the separator."""
    text = number.replace(".", "\n").replace(",", thousands).replace("\n", decimal)
    return f'"{text}"' if separator in text else text


WRITERS: dict[str, Callable[[list[str], list[float], list[list[float]]], str]] = {
    "json": lambda names, t, rows: "".join(
        json.dumps({"t": a, "p": row} if len(row) > 1 else {"t": a, names[0]: row[0]}) + "\n"
        for a, row in zip(t, rows, strict=True)
    ),
    "brackets": lambda names, t, rows: "".join(f"{a} -> {row}\n" for a, row in zip(t, rows, strict=True)),
    "names": lambda names, t, rows: "".join(
        f"t:{a} " + " ".join(f"{name}={value}" for name, value in zip(names, row, strict=True)) + "\n"
        for a, row in zip(t, rows, strict=True)
    ),
}


@given(
    data=st.data(),
    form=st.sampled_from([*FORMS, *WRITERS]),
    taxels=st.integers(1, 6),
    count=st.integers(8, 30),
    step_ms=st.sampled_from([5, 10, 20, 100]),
    unit=st.sampled_from(["s", "ms"]),
    odd=st.sampled_from(["", "Sensor ready", "again", "torn"]),
    code=st.sampled_from(["utf-8", "utf-16", "latin-1"]),
)
def test_what_was_written_is_read_and_the_printed_layout_reads_it_again(
    tmp_path_factory: pytest.TempPathFactory,
    data: st.DataObject,
    form: Any,
    taxels: int,
    count: int,
    step_ms: int,
    unit: str,
    odd: str,
    code: str,
) -> None:
    rows = data.draw(st.lists(st.lists(NUMBERS, min_size=taxels, max_size=taxels), min_size=count, max_size=count))
    t = [step_ms * k / (1000 if unit == "s" else 1) for k in range(count)]
    names = [f"Zehe{k}ß" for k in range(taxels)]
    if isinstance(form, str):
        head, lines = "", WRITERS[form](names, t, rows).splitlines()
    else:
        separator, *marks = form
        head = separator.join([f"Zeit [{unit}]", *names]) + "\n"
        lines = [
            separator.join(written(f"{v:,}", *marks, separator) for v in (a, *row))
            for a, row in zip(t, rows, strict=True)
        ]
    if odd:
        at = data.draw(st.integers(2, count - 1))
        lines.insert(at, head.rstrip("\n") or odd if odd == "again" else odd)
        lines = [*lines[:at], *lines[at + 1 :], lines[0][:1]] if odd == "torn" else lines
    text = (head + "\n".join(lines) + "\n" * (odd != "torn")).encode(code)
    found = opened(tmp_path_factory.mktemp("drawn"), text)
    times, values = frames(found)
    assert times == [1000 * step_ms * k for k in range(count)]
    np.testing.assert_array_equal(values, np.array(rows, np.float32))


#: Columns that are no taxels, by what they are: a name, and the cell of a line.
BESIDE: dict[str, tuple[str, Callable[[int], str]]] = {
    "a counter": ("seq", str),
    "labels": ("slipped", lambda k: str(k // 7 % 2)),
    "another quantity": ("Battery [%]", lambda k: str(87 - k % 3)),
    "a remark": ("note", lambda k: "ok" if k % 9 else "wet"),
    "empty": ("spare", lambda k: ""),
}
BEGIN = datetime(2024, 5, 1, 10, 0, 0)
EPOCH_US = 1_714_557_600_000_000
#: How a time in us after the beginning is written, by the name of its column, and that of the beginning, us.
TIMES: dict[str, tuple[str, int, Callable[[int], str]]] = {
    "s": ("Zeit [s]", 0, lambda us: f"{us / 1e6:.3f}"),
    "ms": ("time_ms", 0, lambda us: f"{us / 1e3:g}"),
    "us": ("micros", 0, str),
    "min": ("Zeit [min]", 0, lambda us: f"{us / 60e6:.9f}"),
    "minutes and seconds": ("Elapsed", 0, lambda us: f"{us // 60_000_000:02}:{us / 1e6 % 60:06.3f}"),
    "epoch": ("t", EPOCH_US, lambda us: f"{(EPOCH_US + us) / 1e6:.3f}"),
    "iso": ("timestamp", EPOCH_US, lambda us: (BEGIN + timedelta(microseconds=us)).isoformat(timespec="milliseconds")),
    "day": ("Uhrzeit", 36_000_000_000, lambda us: (BEGIN + timedelta(microseconds=us)).strftime("%H:%M:%S.%f")),
    "ms behind a colon": (
        "time",
        36_000_000_000,
        lambda us: f"10:{us // 60_000_000:02}:{us // 1_000_000 % 60:02}:{us // 1000 % 1000:03}",
    ),
    "year first": ("time", EPOCH_US, lambda us: (BEGIN + timedelta(microseconds=us)).strftime("%Y/%m/%d %H:%M:%S.%f")),
    "month by name": (
        "time",
        EPOCH_US,
        lambda us: (BEGIN + timedelta(microseconds=us)).strftime("%d-%b-%Y %H:%M:%S.%f"),
    ),
    "German": ("Zeit", EPOCH_US, lambda us: (BEGIN + timedelta(microseconds=us)).strftime("%d.%m.%Y %H:%M:%S.%f")),
}


@st.composite
def whole_tables(draw: st.DrawFn) -> tuple[str, list[int], list[list[float]]]:
    """Draw a table of a time, taxels and other columns in any order, its times and its readings."""
    count, taxels, step_us = draw(st.integers(24, 40)), draw(st.integers(2, 4)), draw(st.sampled_from([5000, 20_000]))
    rows = draw(st.lists(st.lists(NUMBERS, min_size=taxels, max_size=taxels), min_size=count, max_size=count))
    name, begin, write = TIMES[draw(st.sampled_from([*TIMES]))]
    separator, decimal, thousands = draw(st.sampled_from(FORMS))
    columns = [(name, [write(step_us * k) for k in range(count)])]
    for k in range(taxels):
        cells = [written(f"{row[k]:,}", decimal, thousands, separator) for row in rows]
        columns.append((f"Zehe{k}", cells))
    beside = [BESIDE[kind] for kind in draw(st.sets(st.sampled_from([*BESIDE]), max_size=3))]
    columns += [(called, list(map(cell, range(count)))) for called, cell in beside]
    columns[0] = (
        name,
        [
            written(cell, decimal, thousands, separator) if name in ("Zeit [s]", "Zeit [min]", "t") else cell
            for cell in columns[0][1]
        ],
    )
    at = draw(st.permutations(range(len(columns))))
    order = [k for k in at if not 1 <= k <= taxels]
    place = draw(st.integers(0, len(order)))
    order[place:place] = range(1, taxels + 1)
    lines = [separator.join(columns[k][0] for k in order)]
    lines += [separator.join(columns[k][1][line] for k in order) for line in range(count)]
    t = [begin + step_us * k for k in range(count)]
    match draw(st.sampled_from(["", "again", "text", "torn", "swapped", "head"])):
        case "again":
            lines.insert(9, lines[0])
        case "text":
            lines.insert(9, "Sensor ready")
        case "torn":
            lines.append(lines[9][:1])
        case "swapped":
            lines[9], lines[10] = lines[10], lines[9]
        case "head":
            lines[:0] = ["Messung 7", ""]
    return "\n".join(lines) + "\n" * (lines[-1] != lines[9][:1]), t, rows


@given(drawn=whole_tables())
def test_a_table_with_other_columns_in_any_order_is_read_or_asked_and_its_layouts_read_it_again(
    drawn: tuple[str, list[int], list[list[float]]], tmp_path_factory: pytest.TempPathFactory
) -> None:
    text, t, rows = drawn
    found = frames(opened(tmp_path_factory.mktemp("drawn"), text))
    assert found[0] == t
    np.testing.assert_array_equal(found[1], np.array(rows, np.float32))


@given(
    values=st.lists(st.lists(st.integers(0, 9), min_size=6, max_size=6), min_size=4, max_size=9),
    above=st.sampled_from(["Frame {k} ({t:.2f} ms)", "frame {k}, t={t:g}ms", "t = {s:.2f}", "Bild {k} {t:g} ms"]),
    separator=st.sampled_from(", ;\t"),
)
def test_frames_of_lines_below_a_line_of_text_are_read_and_their_layout_reads_them_again(
    values: list[list[int]], above: str, separator: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    text = ""
    for k, frame in enumerate(values):
        lines = [separator.join(map(str, frame[begin : begin + 3])) for begin in (0, 3)]
        text += "\n".join([above.format(k=k, t=20 * k, s=k / 50), *lines]) + "\n"
    found = opened(tmp_path_factory.mktemp("drawn"), text)
    assert frames(found) == ([20_000 * k for k in range(len(values))], values)
    assert found.sources[""].array.shape == (2, 3)


@given(
    step=st.integers(1, 1000),
    before=st.integers(3, 20),
    after=st.integers(3, 20),
    into=st.integers(0, 999),
    bits=st.sampled_from([16, 32]),
)
def test_a_counter_that_was_full_goes_on(step: int, before: int, after: int, into: int, bits: int) -> None:
    """Also where the value behind the last one before that is missing."""
    t = 2**bits + into % step + step * np.delete(np.arange(-before, after), before)
    assert repaired(t % 2**bits).t.tolist() == t.tolist()


@given(t=st.lists(st.integers(-(2**40), 2**40), max_size=30))
def test_repaired_times_ascend_and_sound_ones_stay(t: list[int]) -> None:
    times = np.array(t, np.int64)
    found = repaired(times)
    assert (np.diff(found.t) > 0).all()
    assert len(found.t) == len(t)
    ascending = np.unique(times)
    assert repaired(ascending).t.tolist() == ascending.tolist()
    assert repaired(ascending).said == ()


@given(line=st.text(max_size=60), kind=st.sampled_from(KINDS), decimal=st.sampled_from(".,"))
def test_any_line_has_cells_with_a_name_each_or_is_none(line: str, kind: str, decimal: str) -> None:
    found = read_line(line, kind, ";", decimal)
    assert found is None or len(found.cells) == len(found.names)


@pytest.mark.parametrize(
    ("separator", "line", "first"),
    [
        (",", '"1,{a}"|"1.234,{b}"', [1.0, 1234.0]),
        (",", '"1,200"|"2,10{b}.5"', [1200.0, 2100.5]),
        (";", "98{b}|1.23{a},5", [980.0, 1230.5]),
        (",", '"1,200"|"2,10{b}"', ["1.2", "1200"]),
        (";", "1.200|2.10{b}", ["1.2", "1200"]),
        ("\t", "1,200|2,10{b}", ["1.2", "1200"]),
        (";", "{c:,}|5", ["970", "970"]),
        (",", '"1,200"|{b}.5', ["1200"]),
    ],
)
def test_thousands_are_read_where_marks_show_them_and_asked_about_where_they_may_be_decimals(
    tmp_path: Path, separator: str, line: str, first: list[Any]
) -> None:
    lines = [f"{10 * k}|{line.format(a=k % 7, b=k % 5, c=970 + 7 * k)}" for k in range(20)]
    text = "\n".join(["time_ms|a|b", *lines, ""]).replace("|", separator)
    if isinstance(first[0], float):
        assert frames(opened(tmp_path, text))[1][0] == first
    else:
        found = [frames(opened(tmp_path, text, layout))[1][0][0] for layout in layouts(tmp_path, text)]
        np.testing.assert_allclose(found, [float(value) for value in first])


def called_each(names: tuple[str, ...]) -> object:
    line = Line(("1",) * len(names), names)
    fit = Fit("plain", ",", ".", None, [(0, line)], [0], ["number"] * len(names), 1.0, 1.0)
    draft = Draft(fit, Table(), names, names, Layout(Path("a.csv")))
    return [draft.called(k) for k in range(len(names))]


@pytest.mark.parametrize(
    "work",
    [
        called_each,
        lambda names: HeaderTable.read("a.csv", [",".join(names)]),
        lambda names: Form(Table(leave_out=list(names[1::2])), names).columns,
    ],
    ids=["names in layouts", "header", "columns left out"],
)
def test_what_is_asked_of_each_column_looks_at_no_other(work: Callable[[tuple[str, ...]], object]) -> None:
    """Eight times as many columns take no more than some eight times as long, not 64 times."""

    def seconds(count: int) -> float:
        names, least = tuple(f"sensor {k:06}" for k in range(count)), math.inf
        for _ in range(3):
            begun = time.process_time()
            work(names)
            least = min(least, time.process_time() - begun)
        return least

    assert seconds(16_000) < 24 * seconds(2000)
