"""What is printed of a drawn table without a layout opens it: its values, its times, its rows and columns."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import taxel
from taxel import FormatError

from .tables import table

UNITS_HZ = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
CODES = ["utf-8", "utf-8-sig", "utf-16", "latin-1"]


def pasted(folder: Path, content: bytes) -> Any:
    """Open a table by the layout that its refusal prints."""
    place = folder / "a.csv"
    place.write_bytes(content)
    with pytest.raises(FormatError) as refused:
        taxel.open(place)
    (folder / "a.layout.toml").write_text(str(refused.value).partition("\n")[2])
    return taxel.open(place)


@st.composite
def tables(draw: st.DrawFn) -> tuple[bytes, np.ndarray, np.ndarray | None, tuple[str, ...] | None]:
    """Draw the bytes of a table, its frames, its times (us), and the names of its taxels."""
    separator, decimal = draw(
        st.sampled_from([(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ","), (" ", ".")])
    )
    rows, columns = draw(st.sampled_from([(1, 1), (1, 2), (1, 7), (4, 4), (5, 5), (16, 16)]))
    lines = draw(st.sampled_from([1, rows]))
    rate_hz = draw(st.sampled_from([1.0, 3.0, 10.0, 50.0, 100.0, 150.0, 1000.0, 5000.0]))
    unit = draw(st.sampled_from(list(UNITS_HZ)))
    timed = draw(st.booleans()) or rows * columns == 1
    has_names = lines == 1 and draw(st.booleans())
    states_unit = has_names and draw(st.booleans())
    # A guess of the unit needs a recording of some seconds.
    count = 40 if states_unit or not timed else int(min(max(3 * rate_hz, 25), 15_000))
    if rows * columns > 25:
        count, timed = 40, timed and states_unit
    random = np.random.default_rng(draw(st.integers(0, 99)))
    values = np.round(random.random((count, rows, columns)) * 50, 2)
    step = UNITS_HZ[unit] / rate_hz
    decimals = 0 if unit in ("us", "ns") else 6
    times = [f"{k * step:.{decimals}f}" for k in range(count)]
    names = [f"{word} ä" for word in ("Zehe", "Ferse", "Ballen", "Mitte", "Rand", "Spann", "Knöchel")][: rows * columns]
    names = names if rows == 1 else [f"{word}{k}" for word in ["S"] for k in range(rows * columns)]
    if separator == " ":
        names = [name.replace(" ", "_") for name in names]
    time_name = "Zeit" if not states_unit else f"Zeit_{unit}"
    text = separator.join([time_name] * timed + names) + "\n" if has_names else ""
    for k, frame in enumerate(values):
        for row in frame.reshape(lines, -1):
            cells = [times[k]] * timed + [f"{value:.2f}" for value in row]
            text += separator.join(cells).replace(".", decimal) + "\n"
        if lines > 1 and not timed:
            text += "\n"
    t = np.rint([float(at) / UNITS_HZ[unit] * 1e6 for at in times]).astype(np.int64) if timed else None
    is_named = has_names and rows * columns < 25
    shape = (1, rows * columns) if is_named else (rows, columns)
    return (
        text.encode(draw(st.sampled_from(CODES))),
        values.reshape(-1, *shape),
        t,
        tuple(names) if has_names and rows == 1 else None,
    )


@given(tables())
def test_a_drawn_table_opens_by_the_layout_that_is_printed_of_it(drawn: Any) -> None:
    content, values, t, names = drawn
    with tempfile.TemporaryDirectory() as folder:
        recording = pasted(Path(folder), content)
        frames = recording.frames()
        np.testing.assert_allclose(frames.values, values, rtol=1e-6)
        assert recording.timed == (t is not None)
        if t is not None:
            np.testing.assert_allclose(frames.t, t, atol=1)
        if names is not None:
            assert recording.array.names == names


@given(
    st.sampled_from(["x,y,p,t", "t,x,y,p", "t x y p", "timestamp;x;y;polarity"]),
    st.booleans(),
    st.sampled_from([(0, 1), (-1, 1)]),
    st.sampled_from([(1, 1), (480, 640), (720, 1280)]),
    st.sampled_from(CODES),
)
def test_drawn_events_open_by_the_layout_that_is_printed_of_them(order, named, polarities, size, code) -> None:
    separator = next(mark for mark in ",; " if mark in order)
    columns = order.split(separator)
    named = named or ";" in order
    random = np.random.default_rng(len(order))
    x, y = random.integers(0, size[1], 300), random.integers(0, size[0], 300)
    p, t = random.integers(0, 2, 300), np.sort(random.integers(0, 1_000_000, 300))
    by_name = {"x": x, "y": y, "t": t, "timestamp": t}
    cells = [by_name.get(name, np.array(polarities)[p]) for name in columns]
    text = (order + "\n") * named + "".join(separator.join(map(str, row)) + "\n" for row in zip(*cells, strict=True))
    with tempfile.TemporaryDirectory() as folder:
        recording = pasted(Path(folder), text.encode(code))
        assert recording.has_events
        for name, column in zip("txyp", (t, x, y, p), strict=True):
            np.testing.assert_array_equal(getattr(recording.events, name), column)
        sized = taxel.open(Path(folder) / "a.csv", array=taxel.Array(800, 1300))
        assert sized.array.shape == (800, 1300)


@pytest.mark.parametrize(
    ("text", "layout", "said"),
    [
        ("1 2\n3 4\n\n5 6\n\n7 8\n9 1\n", 'frame_end = "blank"', "line 4: the frame has 1 line; must have 2, like the"),
        ("1 2\n3 4\n\n5 6\n7 8\n9 1\n", 'frame_end = "blank"', "line 4: the frame has 3 lines; must have 2"),
        ("1 2\n3 4\n5 6\n\n7 8\n9 1\n", "frame_lines = 2", "line 4: an empty line follows 1 line of a frame"),
        ("1 2\n3 4\n\n1 2\n3 x\n", 'frame_end = "blank"', "line 5: column 2 is 'x', not a number"),
        ("0 2\n0 4\n\n0 2\n0 3\n", "frame_lines = 2\ntime_column = 1", "line 4: time 0 s is not after"),
        (
            "86399.96 2 3\n0.04 4 3\n",
            "time_column = 1",
            r"time 0\.04 s is not after 86399\.96 s, the time before it; times of day begin again at",
        ),
        ("1714562289.75 2 3\n1714562289.73 4 3\n", "time_column = 1", r"562289\.73 s is not after \d+\.75 s"),
        ("1 2\n3 4\n", "rows = 2\ncolumns = 2\n[table]", "2 columns; .* states 2 x 2 taxels; if 2 lines are"),
        ("1 2\n", 'frame_lines = 2\nframe_end = "blank"', "frame_end is given together with frame_lines: give "
        "only one"),
        ("1 2\n", 'frame_end = "line"', "frame_end is 'line': must be one of 'blank'"),
        ("1 2\n", 'decimal = " "', "decimal is ' ': must be"),
        ("1 2\n", "events = true", "events is true: the table must have a time_column"),
        ("1 2 3\n", 'events = true\ntime_column = 1', "the columns other than the time are column 2, column 3; must "
        "be x, y, p for events"),
        ("1 2 3 4\n", 'columns = ["t"]', "line 1: 4 columns, but the layout states 1 name"),
    ],
)  # fmt: skip
def test_frames_and_events_that_do_not_fit_their_layout_are_refused(tmp_path: Path, text, layout, said) -> None:
    lines = (
        layout.replace("[table]", '[table]\nseparator = " "')
        if "[table]" in layout
        else f'[table]\nseparator = " "\n{layout}'
    )
    with pytest.raises(FormatError, match=said):
        table(tmp_path, text, lines)


@pytest.mark.parametrize(("row", "said"), [
    ("1,2,2,3", "line 3: p is 2; must be 0 or 1, or -1 or 1"), ("1.5,2,1,3", "line 3: x is 1.5; must be"),
    ("1,70000,1,3", "line 3: y is 70000"), ("1,2,1,0", "line 3: time 0 s is before"),
])  # fmt: skip
def test_an_event_that_is_none_is_named_by_its_line(tmp_path: Path, row: str, said: str) -> None:
    layout = '[table]\ncolumns = ["x", "y", "p", "t"]\ntime_column = "t"\ntime_unit = "us"\nevents = true\n'
    with pytest.raises(FormatError, match=said):
        table(tmp_path, f"1,2,1,1\n1,2,0,2\n{row}\n", layout)


def test_a_last_frame_without_all_lines_is_left_out_and_said(tmp_path: Path) -> None:
    recording = table(
        tmp_path, "1,2\n3,4\n,\n5,6\n7,8\n,\n9,9\n", 'rows = 2\ncolumns = 2\n[table]\nframe_end = "blank"\n'
    )
    assert recording.frames().values.tolist() == [[[1, 2], [3, 4]], [[5, 6], [7, 8]]]
    assert recording.lost == ("lines at the end that are not a whole frame: 1 of 2",)


@pytest.mark.parametrize("skip_lines", [0, 1, 2, 3])
def test_a_skipped_frame_is_refused(tmp_path: Path, skip_lines: int) -> None:
    text = "when,a,b\n2024-05-01T10:00:00,1,2\n2024-05-01T10:00:01,3,4\n2024-05-01T10:00:02,5,6\n"
    layout = f'[table]\nskip_lines = {skip_lines}\ntime_column = 1\ntime_unit = "iso"\n'
    if skip_lines < 2:
        assert len(table(tmp_path, text, layout).frames()) == 3
        return
    said = f"line {skip_lines}: the layout skips the frame at '2024-05-01T10:00:0{skip_lines - 2}': skip_lines is"
    with pytest.raises(FormatError, match=f"{said} {skip_lines}; must be at most {skip_lines - 1}"):
        table(tmp_path, text, layout)


@pytest.mark.parametrize("header", ["t_us;x;y;p\n", "t_us\tx\ty\tp\n"])
@pytest.mark.parametrize("code", CODES)
def test_a_table_of_taxel_that_a_spreadsheet_saved_opens(tmp_path: Path, header: str, code: str) -> None:
    separator = header[4]
    (tmp_path / "a.csv").write_bytes((header + separator.join("5321") + "\n").encode(code))
    assert taxel.open(tmp_path / "a.csv").events.x.tolist() == [3]
    frames = f"t_us{separator}x0y0{separator}x1y0\n0{separator}1,5{separator}-2\n"
    (tmp_path / "b.csv").write_bytes(frames.encode(code))
    assert taxel.open(tmp_path / "b.csv").frames().values.tolist() == [[[1.5, -2.0]]]


@pytest.mark.parametrize("name", ["a.csv", "a.txt"])
def test_a_text_without_a_line_end_is_one_clear_line(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"1,2,3 " * 1_000_000)
    with pytest.raises(
        FormatError, match=f"^{name}, line 1: the line has more than 4194304 bytes; must have at most 4194304$"
    ):
        taxel.open(tmp_path / name)
