"""A table or an array without a layout prints the one that reads it, as programs write them."""

from __future__ import annotations

import gzip
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import taxel
from taxel import FormatError
from taxel.recording.text_options import TextOptions

from .tables import VALUES, lines, table


def layout_said_of(place: Path) -> str:
    """Return the lines of a layout that the refusal of a file prints, checking the sentence before them."""
    with pytest.raises(FormatError) as caught:
        taxel.open(place)
    said, _, lines = str(caught.value).partition("\n")
    name = f"{place.name.removesuffix('.gz').rpartition('.')[0]}.layout.toml"
    assert ", not written by taxel; " in said
    assert f" in a layout file, {name} beside it or another file given as layout " in said
    assert said.endswith(" (docs/files.md):")
    return lines


def test_a_decimal_comma_that_no_layout_says_is_named(tmp_path: Path) -> None:
    said = r"step.txt, line 1: column 1 has a decimal comma \('0,00'\); write in a layout file: \[table\] decimal = ','"
    with pytest.raises(FormatError, match=said):
        table(tmp_path, "0,00\t1,5\n0,02\t2\n", '[table]\nseparator = "\t"\n')


@pytest.mark.parametrize(
    ("ending", "time", "flat"),
    [
        # A .h5 is opened in a process of its own.
        pytest.param(ending, time, flat, marks=pytest.mark.slow if ending == ".h5" and flat != (time is None) else ())
        for ending in (".npy", ".npz", ".h5")
        for time in (None, "time_ms", "timestamp")
        for flat in (True, False)
    ],
)
def test_arrays_without_a_layout_print_the_one_that_reads_them(
    tmp_path: Path, ending: str, time: str | None, flat: bool
) -> None:
    import h5py

    values, place = VALUES if flat else VALUES.reshape(3, 2, 3), tmp_path / f"a{ending}"
    arrays = {"palm": values} | ({} if time is None or ending == ".npy" else {time: np.array([0, 250, 750])})
    if ending == ".npy":
        np.save(place, values)
    elif ending == ".npz":
        np.savez(place, **arrays)
    else:
        with h5py.File(place, "w") as h5:
            h5.update({f"run1/{name}": array for name, array in arrays.items()})
    lines = layout_said_of(place)
    (tmp_path / "a.layout.toml").write_text(lines)
    recording = taxel.open(place)
    np.testing.assert_array_equal(recording.frames().values.reshape(3, 6), VALUES.astype(np.float32))
    assert recording.array.shape == ((1, 6) if flat else (2, 3))
    assert recording.timed == (len(arrays) > 1)
    if recording.timed:
        assert recording.frames().t.tolist() == [0, 250_000, 750_000]
    else:
        (tmp_path / "a.layout.toml").write_text(lines.replace("# rate_hz = 100", "rate_hz = 10"))
        assert taxel.open(place).frames().t.tolist() == [0, 100_000, 200_000]


@pytest.mark.parametrize("ending", [".npz", ".h5", "in group.h5"])
@pytest.mark.parametrize(
    ("rate", "unit"), [("fs", "unit"), ("Sampling Rate [Hz]", "Units"), ("frame_rate_hz", "pressure_unit")]
)
def test_the_rate_and_the_unit_that_a_file_of_arrays_states_are_those_of_the_layout(
    tmp_path: Path, ending: str, rate: str, unit: str
) -> None:
    import h5py

    place = tmp_path / f"a{ending}"
    if ending == ".npz":
        np.savez(place, **{"palm": VALUES, "hz": np.array(None), rate: 12.5, unit: "mmHg", "gain": 3.0})
    else:
        with h5py.File(place, "w") as h5:
            palm = h5.create_dataset("run1/palm", data=VALUES)
            (h5["run1"] if "group" in ending else h5).attrs[rate] = np.float32(12.5)
            palm.attrs[unit] = np.bytes_("mmHg") if "group" in ending else "mmHg"
            # Farther ones do not count, nor do lists and other things.
            h5.attrs.update({unit: "N", "gain": 3.0, "fps": [1.0, 2.0], "rate": "fast"})
    place.with_suffix(".layout.toml").write_text(layout_said_of(place))
    recording = taxel.open(place)
    assert recording.frames().t.tolist() == [0, 80_000, 160_000]
    assert recording.frames().unit == "mmHg"


@pytest.mark.parametrize(
    ("above", "rows", "hz"),
    [
        ("# rate 120 Hz\n# rows 2 columns 6\n", 2, 120),
        ("Abtastrate: 0,12 kHz\nZeilen;2\nSpalten;6\n", 2, 120),
        ("Sampling rate [Hz] = 120\nsensor 3 x 4 of 5 x 5 mm\n", 3, 120),
        # Several rates, and a size of other taxels, state nothing.
        ("rate 120 Hz\nfs 60\nrows 5 columns 6\n", None, None),
    ],
)
def test_the_rate_and_the_size_that_lines_above_a_table_state_are_those_of_the_layout(
    tmp_path: Path, above: str, rows: int | None, hz: int | None
) -> None:
    place = tmp_path / "step.txt"
    place.write_text(above + ("\t".join(["1.5"] * 12) + "\n") * 30)
    lines = layout_said_of(place).splitlines()
    assert (f"rows = {rows}" in lines) == (rows is not None)
    assert (f"rate_hz = {hz}  # stated above the table" in lines) == (hz is not None)


@pytest.mark.parametrize("name", ["mV", "Fz_mV", "Fz [mV]"])
def test_the_unit_in_the_name_of_a_column_is_that_of_the_layout(tmp_path: Path, name: str) -> None:
    place = tmp_path / "tap.csv"
    place.write_text(f"t_s,{name}\n" + "".join(f"{k / 1000},{4 + k % 3}\n" for k in range(30)))
    assert 'unit = "mV"' in layout_said_of(place).splitlines()


@pytest.mark.parametrize("separator", [",", ";", "\t", " "])
@pytest.mark.parametrize("mark", ["6.5", "", "NaN", "NA", "nan"])
@pytest.mark.parametrize("head", ["", "of a hand\n\n"])
@pytest.mark.parametrize("time", ["", "time (ms)", "t_s", "first"])
@pytest.mark.parametrize("ending", [".csv", ".txt", ".dat.gz"])
def test_tables_without_a_layout_print_the_one_that_reads_them(
    tmp_path: Path, separator: str, mark: str, head: str, time: str, ending: str
) -> None:
    if separator == " " and (not mark or " " in time):
        pytest.skip("cells by blanks are never empty, nor have they blanks")
    values = np.tile(VALUES, (7, 1))
    t = np.cumsum(np.arange(len(values)))
    cells = [[f"{cell:g}".replace("6.5", mark) for cell in row] for row in values]
    if time:
        cells = [[str(one), *row] for one, row in zip(t, cells, strict=True)]
    if time not in ("", "first"):
        cells = [[time, *"abcdef"], *cells]
    text, place = head + "".join(separator.join(row) + "\n" for row in cells), tmp_path / f"a{ending}"
    place.write_bytes(gzip.compress(text.encode()) if ending.endswith(".gz") else text.encode())
    (tmp_path / "a.layout.toml").write_text(layout_said_of(place))
    recording = taxel.open(place)
    expected = np.where((values == 6.5) & (mark != "6.5"), np.nan, values)
    np.testing.assert_array_equal(recording.frames().values[:, 0], expected.astype(np.float32))
    assert recording.timed == bool(time)
    expected_us = t * {"": 0, "t_s": 1e6}.get(time, 1e3) if time else np.arange(len(t))
    assert recording.frames().t.tolist() == expected_us.tolist()


TIMES = {
    "time (ms)": lambda t: f"{1000 * t:.0f}",
    "timestamp": lambda t: f"{1_714_557_600_000 + 1000 * t:.0f}",
    "time": lambda t: f"2024-05-01T10:00:{t:09.6f}",
    "date and time": lambda t: f"2024-05-01 12:00:{t:06.3f}+02:00",
    "clock": lambda t: f"00:00:{t:06.3f}",
}


@pytest.mark.parametrize("time", TIMES)
@pytest.mark.parametrize("units", [None, "[N]", "kPa"])
@pytest.mark.parametrize("ending", ["", ",", "rows"])
@pytest.mark.parametrize("more", ["", "index", "texts"])
@pytest.mark.parametrize("quoted", [False, True])
def test_tables_as_programs_write_them_open_by_the_layout_that_is_printed(
    tmp_path: Path, time: str, units: str | None, ending: str, more: str, quoted: bool
) -> None:
    values = np.tile(VALUES, (8, 1))
    t = np.arange(len(values)) / 50
    names, unit = [time, *"abcdef"], ["[ms]" if time == "timestamp" else "", *[str(units)] * 6]
    rows = [[TIMES[time](at), *map(str, row)] for at, row in zip(t, values, strict=True)]
    if more == "index":
        names, unit = ["", *names], ["", *unit]
        rows = [[str(k), *row] for k, row in enumerate(rows)]
    elif more == "texts":
        names, unit = [*names, "who", "note"], [*unit, "", ""]
        rows = [[*row, "left", "" if k % 3 else "a touch"] for k, row in enumerate(rows)]
    lines_of = [names, *([unit] if units is not None else []), *rows]
    if quoted:
        lines_of = [[f'"{cell}"' for cell in row] for row in lines_of]
    texts = [",".join(row) for row in lines_of]
    first = len(texts) - len(rows)
    texts = [line + "," * (ending == "," or (ending == "rows" and k >= first)) for k, line in enumerate(texts)]
    (tmp_path / "a.csv").write_text("\n".join(texts) + "\n")
    said = layout_said_of(tmp_path / "a.csv")
    (tmp_path / "a.layout.toml").write_text(said)
    recording = taxel.open(tmp_path / "a.csv")
    frames = recording.frames()
    np.testing.assert_array_equal(frames.values[:, 0], values.astype(np.float32))
    assert recording.array.names == tuple("abcdef")
    begin = {"time (ms)": 0, "clock": 0}.get(time, 1_714_557_600_000_000)
    np.testing.assert_allclose(frames.t - begin, t * 1e6, atol=1)
    assert frames.unit == ("counts" if units is None else units.strip("[]"))
    left = {"index": ("columns that are not taxels: column 1",), "texts": ("columns that are not taxels: who, note",)}
    assert recording.lost == left.get(more, ())


@pytest.mark.parametrize(
    ("head", "time", "names"),
    [
        ("Trial 1,,,\ntime,thumb,index\n", "{t}", ("thumb", "index")),
        ("Date,Time,thumb,index\n", "2024-05-01,10:00:0{t}", ("thumb", "index")),
        (",,\n", "{t}", None),
    ],
)
def test_titles_and_days_are_neither_names_nor_times(
    tmp_path: Path, head: str, time: str, names: tuple[str, ...] | None
) -> None:
    rows = [f"{time.format(t=k / 50)},{k},{2 * k}\n" for k in range(30)]
    (tmp_path / "a.csv").write_text(head + "".join(rows))
    (tmp_path / "a.layout.toml").write_text(layout_said_of(tmp_path / "a.csv"))
    recording = taxel.open(tmp_path / "a.csv")
    assert recording.array.names == names
    assert recording.frames().values[:, 0].tolist() == [[k, 2 * k] for k in range(30)]
    assert np.diff(recording.frames().t).tolist() == [20_000] * 29


@pytest.mark.parametrize("code", ["utf-8", "cp1252", "utf-16"])
@pytest.mark.parametrize("day", ["31.12.2023 23:59:{s},{ms:03d}", "31.12.2023T23:59:{s},{ms:03d}"])
def test_a_german_table_with_days_and_units_is_read_by_what_is_printed_of_it(
    tmp_path: Path, code: str, day: str
) -> None:
    rows = [f"{day.format(s=59, ms=10 * k)};{k},5;-{k},25\r\n" for k in range(30)]
    head = "Prüfer: Müller\r\n\r\nZeit;Ferse [N];Mittelfuß [N]\r\n"
    (tmp_path / "a.csv").write_bytes((head + "".join(rows)).encode(code))
    (tmp_path / "a.layout.toml").write_text(layout_said_of(tmp_path / "a.csv"), encoding="utf-8")
    recording = taxel.open(tmp_path / "a.csv")
    frames = recording.frames()
    assert (recording.array.names, frames.unit) == (("Ferse [N]", "Mittelfuß [N]"), "N")
    assert frames.values[:, 0].tolist() == [[k + 0.5, -k - 0.25] for k in range(30)]
    assert np.diff(frames.t).tolist() == [10_000] * 29
    assert frames.t[0] == 1_704_067_199_000_000


@pytest.mark.parametrize(
    ("text", "layout", "values"),
    [
        # A last channel that is dead, and lines that end in a separator.
        ("1,2,\n3,4,\n", 'rows = 1\ncolumns = 3\n[table]\nmissing = ""', [[1, 2, np.nan], [3, 4, np.nan]]),
        ("1,2,\n3,4,\n", "rows = 1\ncolumns = 2", [[1, 2], [3, 4]]),
        ("a,b\n*,*\n1,2\n", '[table]\nmissing = "*"', [[np.nan, np.nan], [1, 2]]),
        ('a,b\n1,"NA"\n3,4\n', """[table]\nmissing = '"NA"'""", [[1, np.nan], [3, 4]]),
        ('a,who\n1,"me, then you"\n2,""\n', '[table]\nleave_out = ["who"]', [[1], [2]]),
    ],
)
def test_cells_are_what_the_layout_says_of_them(tmp_path: Path, text: str, layout: str, values: list[Any]) -> None:
    np.testing.assert_array_equal(table(tmp_path, text, layout).frames().values[:, 0], values)


@pytest.mark.parametrize("at", [0, 3, 20])
@pytest.mark.parametrize("cell", ["inf", "ERR"])
def test_one_cell_that_is_no_number_hides_no_line_before_it(tmp_path: Path, at: int, cell: str) -> None:
    rows = [[f"{k / 50}", *"123"] for k in range(30)]
    rows[at + 2][2] = cell
    (tmp_path / "a.csv").write_text("time,a,b,c\n" + "".join(",".join(row) + "\n" for row in rows))
    said = layout_said_of(tmp_path / "a.csv")
    assert "skip_lines" not in said
    (tmp_path / "a.layout.toml").write_text(said)
    with pytest.raises(FormatError, match=rf"a\.csv, line {at + 4}: column 'b' is '{cell}'.*missing = '{cell}'"):
        taxel.open(tmp_path / "a.csv")
    (tmp_path / "a.layout.toml").write_text(f'{said}\nmissing = "{cell}"')
    assert taxel.open(tmp_path / "a.csv").frames().missing == 1


@pytest.mark.parametrize(
    ("layout", "match"),
    [
        ('leave_out = ["x"]', r"a\.csv: column 'x' is missing; the columns are time, a, who"),
        ("leave_out = [4]", r"a\.csv: leave_out is 4, but the table has 3 columns"),
        ("leave_out = [0]", "leave_out is 0: must be a whole number from 1"),
        ('leave_out = "who"', "leave_out is 'who': must be a list of columns"),
        (
            'leave_out = ["time", "who"]\ntime_column = "time"',
            "column 'time' is the time_column, but is also in leave_out",
        ),
        (
            'leave_out = ["who"]\ntime_column = "time"\ntime_unit = "iso"',
            r"line 3: time is 'noon'; must be like 2024-05-01T",
        ),
        ('leave_out = ["who"]', r"column 'time' contains times, as its name shows"),
        ('leave_out = ["time", "a"]', "line 2: column 'who' is 'me', not a number"),
    ],
)
def test_columns_and_times_that_do_not_fit_their_table_are_refused(tmp_path: Path, layout: str, match: str) -> None:
    (tmp_path / "a.csv").write_text("time,a,who\n10:00,1,me\nnoon,2,me\n")
    (tmp_path / "a.layout.toml").write_text(f"[table]\n{layout}\n")
    with pytest.raises(FormatError, match=match):
        taxel.open(tmp_path / "a.csv")


@pytest.mark.parametrize("code", ["utf-16-le", "utf-16-be"])
def test_a_table_in_utf_16_without_its_mark_says_how_to_save_it(tmp_path: Path, code: str) -> None:
    (tmp_path / "a.csv").write_bytes("time,a\n0,1\n".encode(code))
    with pytest.raises(
        FormatError,
        match=r"a\.csv, byte \d: this byte is zero; the file is UTF-16 without a byte-order mark: save it as UTF-8",
    ):
        taxel.open(tmp_path / "a.csv")


def test_a_line_with_too_few_cells_is_named_where_columns_are_left_out(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("time,a,b,who\n0,1,2,me\n1,2,me\n")
    (tmp_path / "a.layout.toml").write_text('[table]\ntime_column = "time"\nleave_out = ["who"]\n')
    with pytest.raises(FormatError, match=r"a\.csv, line 3: 3 cells; must have 4"):
        taxel.open(tmp_path / "a.csv")


def test_a_table_of_one_frame_without_a_layout_prints_no_rate(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("time,x,y\n1,2,3\n")
    said = layout_said_of(tmp_path / "a.csv")
    assert "frames/s" not in said
    (tmp_path / "a.layout.toml").write_text(said)
    frames = taxel.open(tmp_path / "a.csv").frames()
    assert (frames.values.tolist(), frames.t.tolist()) == ([[[2.0, 3.0]]], [1_000_000])


@pytest.mark.parametrize(
    ("names", "times", "said"),
    [
        (["Uhrzeit"], [["23:59:59.9"], ["00:00:00.1"]], '["Uhrzeit"]  # "Uhrzeit" contains times that do not ascend'),
        (
            ["Time"],
            [["11:59:59 PM"], ["12:00:00 AM"]],
            '["Time"]  # "Time" contains times in a form that taxel does not read',
        ),
        (["who"], [["me"], ["you"]], '["who"]'),
    ],
)
def test_times_that_are_left_out_are_told_why(
    tmp_path: Path, names: list[str], times: list[list[str]], said: str
) -> None:
    rows = [[*names, "a", "b"], *([*time, "1", "2"] for time in times)]
    (tmp_path / "a.csv").write_text("".join(",".join(row) + "\n" for row in rows))
    lines = layout_said_of(tmp_path / "a.csv")
    assert f"leave_out = {said}" in lines.splitlines()
    (tmp_path / "a.layout.toml").write_text(lines)
    assert len(taxel.open(tmp_path / "a.csv").frames()) == 2


def test_a_folder_of_tables_without_a_layout_says_the_same(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(lines(VALUES))
    (tmp_path / "read me.txt").write_text("of a hand")
    with pytest.raises(FormatError, match=r"a\.csv: contains a table of 6 columns, .*\nrows = 1\ncolumns = 6"):
        taxel.open_all(tmp_path)


def test_a_text_without_numbers_prints_no_layout(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("of a hand\n")
    with pytest.raises(FormatError, match=r"not a recording; taxel reads .* \(docs/files\.md\)$"):
        taxel.open(tmp_path / "a.txt")


def test_columns_of_another_unit_and_of_remarks_are_no_taxels(tmp_path: Path) -> None:
    names = ["Zeit [s]", "Ferse [N]", "Ballen [N]", "Zehe [N]", "Akku [%]", "Bemerkung"]
    rows = [[f"{k / 50}", f"{k}", "1", "2", "87", ""] for k in range(30)]
    place = tmp_path / "a.csv"
    place.write_text("".join(";".join(row) + "\n" for row in [names, *rows]))
    lines = layout_said_of(place)
    assert 'leave_out = ["Akku [%]", "Bemerkung"]' in lines
    (tmp_path / "a.layout.toml").write_text(lines)
    recording = taxel.open(place)
    assert (recording.array.names, recording.frames().unit) == (tuple(names[1:4]), "N")


@pytest.mark.parametrize(
    ("sides", "name"), [("LR", "{}{} [N]"), (("links", "rechts"), "{}_S{} [N]"), (("Left", "Right"), "{} {}")]
)
def test_two_sides_in_one_table_are_said_with_the_columns_of_each(tmp_path: Path, sides: str, name: str) -> None:
    names = ["time (s)", *(name.format(side, k) for side in sides for k in range(1, 4)), "who"]
    rows = [[f"{k / 50}", *"123456", "me"] for k in range(30)]
    place = tmp_path / "a.csv"
    place.write_text("".join(",".join(row) + "\n" for row in [names, *rows]))
    lines = layout_said_of(place)
    said = [line.partition(" side: ") for line in lines.splitlines() if " side: " in line]
    for (side, _, keys), asked, values in zip(said, sides, ([1, 2, 3], [4, 5, 6]), strict=True):
        assert side == f"# to read only the {asked.lower()}"
        columns, _, left = keys.partition(", ")
        (tmp_path / "a.layout.toml").write_text(
            "\n".join(
                left if line.startswith("leave_out") else columns if line.startswith("columns") else line
                for line in lines.splitlines()
            )
        )
        assert taxel.open(place).frames().values[0].tolist() == [values]
    place.write_text(place.read_text().replace(name.format(sides[1], 3), "other"))
    (tmp_path / "a.layout.toml").unlink()
    assert " side: " not in layout_said_of(place)


@pytest.mark.parametrize("above", ["Frame {k}", "Bild {k}", "Time {k},5 s"])
@pytest.mark.parametrize("between", ["", "\n"])
def test_frames_below_lines_of_text_are_read_by_what_is_printed(tmp_path: Path, above: str, between: str) -> None:
    values = np.arange(5 * 3 * 4).reshape(5, 3, 4) / 4
    frames = [
        f"{above.format(k=k)}\n" + "".join("\t".join(map(str, row)).replace(".", ",") + "\n" for row in frame) + between
        for k, frame in enumerate(values, 1)
    ]
    place = tmp_path / "a.txt"
    place.write_text("Export 3.1\nSensors:\t3 x 4\n\n" + "".join(frames))
    lines = layout_said_of(place)
    assert f'frame_begin = "{above[: above.index(" ")]}"' in lines
    (tmp_path / "a.layout.toml").write_text(lines)
    np.testing.assert_array_equal(taxel.open(place).frames().values, values)
    place.write_text("".join(frames[:2]) + frames[2].replace("8,0", "x"))
    (tmp_path / "a.layout.toml").write_text(lines.replace("skip_lines = 4", "skip_lines = 1"))
    line = 14 if between else 12
    with pytest.raises(FormatError, match=rf"a\.txt, line {line}: column 1 is 'x', not a number"):
        taxel.open(place)


def test_a_folder_of_arrays_without_times_needs_their_rate_alone(tmp_path: Path) -> None:
    for k in range(12):
        np.save(tmp_path / f"trial{k}.npy", np.full((5 + k, 3, 2), k))
    # Arrays of several sizes are read by what is printed of the first.
    (tmp_path / "layout.toml").write_text(layout_said_of(tmp_path / "trial0.npy").replace("# rate", "rate"))
    np.save(tmp_path / "larger.npy", np.zeros((5, 4, 2)))
    assert {each.array.shape for each in taxel.open_all(tmp_path)} == {(3, 2), (4, 2)}
    (tmp_path / "larger.npy").unlink()
    (tmp_path / "layout.toml").unlink()
    opened = TextOptions(rate_hz=40).open_trials(tmp_path)
    assert [(each.path.name, each.frames().values[0, 0, 0]) for each in opened] == [
        (f"trial{k}.npy", k) for k in range(12)
    ]
    assert [np.diff(each.frames().t).tolist() for each in opened] == [[25_000] * (4 + k) for k in range(12)]
    # A table says more than its rate: its layout is asked for.
    (tmp_path / "a.csv").write_text("a,b\n1,2\n3,4\n")
    with pytest.raises(FormatError, match="in a layout file, "):
        TextOptions(rate_hz=40).open_trials(tmp_path)


@pytest.mark.parametrize(
    ("line", "unit"),
    [
        ("Einheit;kPa", "kPa"),
        ("Unit of pressure: N/cm2", "N/cm2"),
        ("# Druckeinheit = N/cm²", "N/cm²"),
        ("Druck [mmHg]", "mmHg"),
        ("Force in N", "N"),
        ("Luftdruck [hPa];1013", None),
        ("Abtastrate [Hz];120", None),
        ("Time unit: ms", None),
    ],
)
def test_the_unit_above_a_table_and_the_rate_of_rounded_stamps_are_in_the_layout(
    tmp_path: Path, line: str, unit: str | None
) -> None:
    place = tmp_path / "sole.txt"
    rows = "".join(f"{k / 120:.4f};{k % 7};{k % 5}\n".replace(".", ",") for k in range(400))
    place.write_text(f"Export 4.2\n{line}\n\nZeit [s];Z001;Z002\n{rows}")
    said = layout_said_of(place)
    assert "# 120 frames/s" in said
    assert said.count("unit = ") - said.count("time_unit = ") == 1
    assert ("# unit = " in said) == (unit is None)
    (tmp_path / "sole.layout.toml").write_text(said)
    assert taxel.open(place).frames().unit == (unit or "counts")


@pytest.mark.parametrize("array", [(5, 7), [5, 7]])
def test_two_numbers_for_an_array_are_told_what_makes_one(tmp_path: Path, array: Any) -> None:
    np.save(tmp_path / "a.npy", np.ones((3, 35)))
    (tmp_path / "a.layout.toml").write_text("rate_hz = 100\n")
    with pytest.raises(taxel.ProblemError, match=r"must be an array, for example taxel\.Array\(5, 7\)"):
        taxel.open(tmp_path / "a.npy", array=array)


def test_a_table_of_times_and_texts_alone_is_no_recording(tmp_path: Path) -> None:
    place = tmp_path / "a.csv"
    place.write_text("Aufnahme;Zeit [s];Bemerkung;Ereignis\n" + "gang1;2,4;gut;heel\n" * 9)
    with pytest.raises(FormatError) as refused:
        taxel.open(place)
    assert "\n" not in str(refused.value)
