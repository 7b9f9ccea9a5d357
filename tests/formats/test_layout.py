"""One layout file says what a recording lacks: read, applied, and refused in one clear line."""

from __future__ import annotations

import gzip
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import taxel
from taxel import Array, Events, FormatError, Frames, Places
from taxel.formats.layout import Layout, packaged

from .making import write_gaitpdb

VALUES = np.array([[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], [6.5, 0.0, 1.0, 2.0, 3.0, 4.0], [9.0, 8.0, 7.0, 6.0, 5.0, 4.0]])


def table(folder: Path, text: str, layout: str, name: str = "step.txt") -> Any:
    (folder / name).write_text(text)
    (folder / f"{name.split('.', maxsplit=1)[0]}.layout.toml").write_text(layout)
    return taxel.open(folder / name)


def lines(values: np.ndarray, separator: str = ",") -> str:
    return "".join(separator.join(f"{v:g}" for v in row) + "\n" for row in values)


def test_a_table_is_read_as_its_layout_says(tmp_path: Path) -> None:
    text = "made by us\nand more\nat_ms;a;b;c;d;e;f\n" + lines(np.column_stack([[10, 20, 30], VALUES]), ";")
    layout = """
        rows = 2
        columns = 3
        pitch_mm = [7.62, 5.08]
        side = "left"
        heel = "bottom"
        unit = "kPa"
        [table]
        separator = ";"
        skip_lines = 2
        time_column = "at_ms"
        time_unit = "ms"
    """
    recording = table(tmp_path, text, layout)
    frames = recording.frames()
    np.testing.assert_array_equal(frames.values, VALUES.reshape(3, 2, 3).astype(np.float32))
    assert frames.t.tolist() == [10_000, 20_000, 30_000]
    assert (frames.unit, frames.array.pitch_mm, frames.array.shape) == ("kPa", (7.62, 5.08), (2, 3))
    assert (recording.side, recording.heel) == ("left", "bottom")


@pytest.mark.parametrize("separator", [",", ";", "\t", " ", "|"])
@pytest.mark.parametrize("named", [True, False])
def test_tables_of_any_separator_with_or_without_names(tmp_path: Path, separator: str, named: bool) -> None:
    head = separator.join("abcdef") + "\n" if named else ""
    layout = f"rate_hz = 50\n[table]\nseparator = {separator!r}".replace("'", '"').replace("\\t", "\\t")
    frames = table(tmp_path, head + lines(VALUES, separator), layout).frames()
    np.testing.assert_array_equal(frames.values[:, 0], VALUES.astype(np.float32))
    assert frames.t.tolist() == [0, 20_000, 40_000]
    assert frames.array.is_channels


def test_a_compressed_table_a_numbered_time_column_and_missing_cells(tmp_path: Path) -> None:
    text = lines(np.column_stack([VALUES[:, :2], [0.5, 1.0, 1.5], VALUES[:, 2:]])).replace("6.5", "NA")
    (tmp_path / "step.csv.gz").write_bytes(gzip.compress(text.encode()))
    (tmp_path / "layout.toml").write_text('[table]\ntime_column = 3\nmissing = "NA"\n')
    frames = taxel.open(tmp_path / "step.csv.gz").frames()
    expected = VALUES.copy()
    expected[1, 0] = np.nan
    np.testing.assert_array_equal(frames.values[:, 0], expected.astype(np.float32))
    assert frames.t.tolist() == [500_000, 1_000_000, 1_500_000]


def test_readings_that_fall_are_turned_once(tmp_path: Path) -> None:
    for falls, expected in (("true", -VALUES), ("10", 10 - VALUES), ("false", VALUES)):
        recording = table(tmp_path, lines(VALUES), f"falls = {falls}\nrate_hz = 100")
        np.testing.assert_array_equal(recording.frames().values[:, 0], expected.astype(np.float32))
    (tmp_path / "turned").mkdir()
    taxel.convert(recording, tmp_path / "turned" / "kept.npz")
    assert taxel.open(tmp_path / "turned" / "kept.npz").frames() == recording.frames()


def test_without_times_pictures_are_numbered(tmp_path: Path) -> None:
    assert table(tmp_path, lines(VALUES), "rows = 2\ncolumns = 3").frames().t.tolist() == [0, 1, 2]


@pytest.mark.parametrize("ending", [".npy", ".npz", ".h5"])
@pytest.mark.parametrize("flat", [True, False])
def test_arrays_of_somebody_else(tmp_path: Path, ending: str, flat: bool) -> None:
    values = (VALUES if flat else VALUES.reshape(3, 2, 3)).astype(np.int16)
    place = tmp_path / f"grasp{ending}"
    if ending == ".npy":
        np.save(place, values)
    elif ending == ".npz":
        np.savez(place, palm=values, other=np.zeros(2), when=[0.0, 0.25, 0.75])
    else:
        import h5py

        with h5py.File(place, "w") as h5:
            h5["palm"], h5["other"], h5["when"] = values, np.zeros(2), [0.0, 0.25, 0.75]
    data = "" if ending == ".npy" else '[data]\narray = "palm"\ntime = "when"\n'
    layout = tmp_path / "elsewhere.toml"
    layout.write_text(("rows = 2\ncolumns = 3\n" if flat else "") + ("rate_hz = 4\n" if not data else "") + data)
    frames = taxel.open(place, layout=layout).frames()
    np.testing.assert_array_equal(frames.values, values.reshape(3, 2, 3).astype(np.float32))
    assert frames.t.tolist() == ([0, 250_000, 750_000] if data else [0, 250_000, 500_000])


def test_a_layout_says_what_our_own_files_lack(tmp_path: Path) -> None:
    frames = Frames(VALUES[:, None], [0, 1, 2], array=Array(1, 6, name="foot"))
    taxel.convert(frames, tmp_path / "foot.npz")
    places = '[places]\nx = [0, 9, 1, 8, 2, 7]\ny = [0, 0, 5, 5, 9, 9]\nunit = "mm"\n'
    (tmp_path / "foot.layout.toml").write_text('rows = 3\ncolumns = 2\nunit = "N"\nrate_hz = 1000\n' + places)
    recording = taxel.open(tmp_path / "foot.npz")
    own = recording.frames()
    assert own.array == Array(3, 2, name="foot", places=Places([0, 9, 1, 8, 2, 7], [0, 0, 5, 5, 9, 9], unit="mm"))
    assert (own.unit, own.t.tolist(), own.centre().shape) == ("N", [0, 1000, 2000], (3, 2))
    events = Events([0], [1], [1], [True], array=Array(2, 2), intensity=[7])
    taxel.convert(events, tmp_path / "touch.npz")
    (tmp_path / "touch.layout.toml").write_text("pitch_mm = 4.5")
    assert taxel.open(tmp_path / "touch.npz").events.array.pitch_mm == 4.5


def test_a_folder_of_tables_opens_by_its_one_layout(tmp_path: Path) -> None:
    for name in ("step10.csv", "step2.csv"):
        (tmp_path / name).write_text(lines(VALUES))
    (tmp_path / "layout.toml").write_text("rows = 2\ncolumns = 3\nrate_hz = 10\n")
    (tmp_path / "labels.csv").write_text("recording,label,t_us\nstep2,contact,100000\n")
    opened = taxel.open(tmp_path)
    assert [one.name for one in opened] == ["step2.csv", "step10.csv"]
    assert [len(one.notes) for one in opened] == [1, 0]


def test_gaitpdb_comes_with_the_places_that_its_source_states(tmp_path: Path) -> None:
    left, right = taxel.open(write_gaitpdb(tmp_path))
    assert (left.side, right.side) == ("left", "right")
    for foot, sign in ((left, -1), (right, 1)):
        places = foot.array.places
        assert places is not None
        # Sensor 1 is the heel (y forwards is -800 there), sensor 8 the front.
        assert places.x.ravel().tolist() == [sign * x for x in (500, 700, 300, 700, 300, 700, 300, 500)]
        assert places.y.ravel().tolist() == [800, 400, 400, 0, 0, -400, -400, -800]
        assert (places.unit, foot.array.centre_unit) == (None, "places")
    assert packaged("gaitpdb").heel == "bottom"


@pytest.mark.parametrize(
    ("layout", "match"),
    [
        ("pich_mm = 3", "unknown key pich_mm; there are rows, columns, pitch_mm"),
        ("[table]\nsep = ';'", r"unknown key table\.sep; there are separator, skip_lines"),
        ("[ros]\ntopics = 'a'", r"unknown key ros\.topics"),
        ("[places]\nx = [1]\ny = [1]\nz = [1]", r"unknown key places\.z"),
        ("rows = 2", "rows and columns: give both or neither"),
        ("rows = 2\ncolumns = 4", "2 x 4 taxels"),
        ("rows = 2\ncolumns = 0", "columns"),
        ("rows = 'two'\ncolumns = 3", "rows"),
        ("pitch_mm = -1", "pitch_mm is -1: must be above 0"),
        ("pitch_mm = 2\n[places]\nx = [1]\ny = [1]", "both given"),
        ("[places]\nx = [1, 2]\ny = [1, 2]", "must be"),
        ("[places]\nx = [1, 2]", "missing"),
        ("side = 'up'", "side"),
        ("heel = 'left'", "heel"),
        ("falls = 'yes'", "falls"),
        ("unit = ''", "unit"),
        ("rate_hz = 0", "rate_hz is 0: must be above 0"),
        ("table = 3", "table"),
        ("[table]\nseparator = ', '", "separator is ', ': must be one character"),
        ("[table]\nskip_lines = 40", "no line after 40 skipped ones"),
        ("[table]\ntime_column = 'when'", "no column 'when' of times"),
        ("[table]\ntime_column = 9", "6 columns; time_column is 9"),
        ("rows = [", "not TOML"),
    ],
)
def test_a_layout_that_makes_no_sense_is_refused_in_one_line(tmp_path: Path, layout: str, match: str) -> None:
    with pytest.raises(FormatError, match=match) as refused:
        table(tmp_path, lines(VALUES), layout)
    assert "\n" not in str(refused.value)
    assert "step" in str(refused.value)


@pytest.mark.parametrize(
    ("frames", "layout", "match"),
    [
        (Frames(VALUES[:, None], [0, 1, 2]), "rows = 2\ncolumns = 4", "says 2 x 4 taxels; the recording holds 1 x 6"),
        (Frames(VALUES.reshape(3, 2, 3), [0, 1, 2]), "rows = 3\ncolumns = 2", "says 3 x 2 taxels; the file says 2 x 3"),
        (Frames(VALUES[:, None], [0, 1, 2], unit="N"), "unit = 'kPa'", "says unit kPa; one.npz is in N"),
        (Frames(VALUES[:, None], [0, 10_000, 20_000]), "rate_hz = 50", "says 50 Hz; the times of one.npz make 100 Hz"),
        (Frames(VALUES[:, None], [0, 1, 2], array=Array(1, 6, 3.0)), "pitch_mm = 4", "the file says 3 mm apart"),
    ],
)
def test_a_layout_that_contradicts_the_file_is_refused(tmp_path: Path, frames: Frames, layout: str, match: str) -> None:
    taxel.convert(frames, tmp_path / "one.npz")
    (tmp_path / "layout.toml").write_text(layout)
    with pytest.raises(FormatError, match=match):
        taxel.open(tmp_path / "one.npz")


def test_a_layout_for_another_count_of_channels_of_a_trial_is_refused(tmp_path: Path) -> None:
    write_gaitpdb(tmp_path)
    (tmp_path / "layout.toml").write_text("[places]\nx = [1, 2]\ny = [1, 2]\n")
    with pytest.raises(FormatError, match=r"layout\.toml: .*must be \(1, 8\), one a taxel"):
        taxel.open(tmp_path)


@pytest.mark.parametrize(
    ("write", "match"),
    [
        (lambda place: np.savez(place, a=np.zeros((2, 6)), b=np.zeros(3)), "holds a, b; say which in the layout"),
        (lambda place: np.savez(place, a=np.zeros(6)), "must be numbers of shape pictures x rows x columns"),
        (lambda place: np.savez(place, a=np.array([["x"] * 6])), "must be numbers"),
        (lambda place: np.savez(place, a=np.zeros((2, 5))), "says 2 x 3 taxels"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(tmp_path: Path, write: Any, match: str) -> None:
    write(tmp_path / "one.npz")
    (tmp_path / "layout.toml").write_text("rows = 2\ncolumns = 3\n")
    with pytest.raises(FormatError, match=match):
        taxel.open(tmp_path / "one.npz")


def test_a_layout_is_found_by_the_recording_s_name_first(tmp_path: Path) -> None:
    for name in ("walk.layout.toml", "layout.toml"):
        (tmp_path / name).write_text("")
    assert Layout.beside(tmp_path / "walk.csv.gz") == tmp_path / "walk.layout.toml"
    assert Layout.beside(tmp_path / "run.csv") == tmp_path / "layout.toml"
