"""One layout file says what a recording lacks: read, applied, and refused in one clear line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from draws import mixed
from hypothesis import given, settings
from hypothesis import strategies as st
from shell import run

import taxel
from taxel import Array, Events, FormatError, Frames, Places
from taxel.formats.layout import Layout

from .making import write_pedar
from .tables import VALUES, lines, table


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


@pytest.mark.parametrize(
    ("time", "shape"),
    mixed([None, 1, "zeit"], ["", "rows = 2\ncolumns = 3\n", "rows = 1\ncolumns = 6\npitch_mm = 5\n"]),
)
def test_taxels_keep_the_names_of_their_columns(tmp_path: Path, time: int | str | None, shape: str) -> None:
    names = ["Daumen", '"Handfläche"', "", "x3y5", "a", "a"]
    called = ("Daumen", "Handfläche", "", "x3y5", "a", "a")
    rows = VALUES if time is None else np.column_stack([[0.0, 0.1, 0.2], VALUES])
    text = ",".join([*(["zeit"] if time else []), *names]) + "\n" + lines(rows)
    (tmp_path / "step.csv").write_bytes(text.encode("latin-1"))
    column = "" if time is None else f"time_column = {time!r}\n".replace("'", '"')
    (tmp_path / "step.layout.toml").write_text(f"{shape}[table]\n{column}frame_lines = 1\n")
    recording = taxel.open(tmp_path / "step.csv")
    assert recording.array.names == called
    for ending in (".mcap", ".npz", ".h5"):
        taxel.convert(recording, tmp_path / f"step2{ending}")
        assert taxel.open(tmp_path / f"step2{ending}").array.names == called
    shown = run("info", tmp_path / "step2.mcap").stdout
    assert "names               Daumen, Handfläche, , x3y5, a, a\n" in shown


@pytest.mark.parametrize(
    ("array", "code"), mixed([None, Array(1, 3), Array(3, 1, pitch_mm=2.0)], ["utf-8", "utf-8-sig", "latin-1"])
)
def test_channels_of_our_own_table_keep_their_names(tmp_path: Path, array: Array | None, code: str) -> None:
    (tmp_path / "a.csv").write_bytes("t_us,Daumen,Handfläche,c\n0,1,2,3\n10,4,5,6\n".encode(code))
    recording = taxel.open(tmp_path / "a.csv", array=array)
    assert recording.array.names == ("Daumen", "Handfläche", "c")
    assert recording.frames().array.names == recording.array.names
    (tmp_path / "b.csv").write_text("t_us,x0y0,x1y0\n0,1,2\n")
    assert taxel.open(tmp_path / "b.csv").array.names is None


def test_frames_that_would_come_after_the_times_of_files_are_refused(tmp_path: Path) -> None:
    table(tmp_path, lines(np.ones((5, 6))), "rate_hz = 1e-9")
    with pytest.raises(
        FormatError, match=r"rate_hz is 1e-09: the time of frame 9 would be 9e\+09 s; must be within 142 years"
    ):
        table(tmp_path, lines(np.ones((10, 6))), "rate_hz = 1e-9")


def test_readings_whose_difference_no_frame_holds_are_named(tmp_path: Path) -> None:
    with pytest.raises(
        FormatError, match=r"step\.layout\.toml: falls is -3.*, but step.* contains 3.*does not fit 32 bits"
    ):
        table(tmp_path, lines(np.full((3, 6), 3.0e38)), "falls = -3e38\nrate_hz = 100")


@pytest.mark.parametrize("falls", ["", "falls = true\n", "falls = 300\n"])
def test_values_that_fall_as_the_layout_turns_them_name_it(tmp_path: Path, falls: str) -> None:
    values = np.random.default_rng(1).integers(0, 3, (400, 6)).astype(float)
    for k in range(60, 360, 100):
        values[k : k + 10, 1:3] += 200 if falls else -200
    rows = np.column_stack([np.arange(400) / 100, values])
    table(tmp_path, lines(rows), f"{falls}[table]\ntime_column = 1\n")
    shown = run("info", tmp_path / "step.txt").stdout
    of_it = (
        "after a layout inverted them: if the values need no inversion, remove the line 'falls = ...' from it"
        if falls
        else "write falls = true in a layout file, "
    )
    assert of_it in shown


@pytest.mark.parametrize(("at", "named"), [((3, 1, 2), "frame 3, row 1, column 2"), ((3, 5), "frame 3, taxel 5")])
@pytest.mark.parametrize("value", [np.inf, -1e39])
def test_a_value_that_does_not_fit_names_its_place(tmp_path: Path, at: Any, named: str, value: float) -> None:
    values = np.zeros((5, 2, 3) if len(at) == 3 else (5, 6))
    values[at] = value
    np.save(tmp_path / "a.npy", values)
    axes = "time taxel" if values.ndim == 2 else "time row column"
    (tmp_path / "a.layout.toml").write_text(f'rate_hz = 10\n[data]\naxes = "{axes}"\n')
    with pytest.raises(FormatError, match=rf"a\.npy.*{named}: must fit 32 bits"):
        taxel.open(tmp_path / "a.npy")


def test_a_given_sensor_lays_out_arrays_of_somebody_else_and_another_is_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", VALUES)
    (tmp_path / "a.layout.toml").write_text('rate_hz = 10\n[data]\naxes = "time taxel"\n')
    for array in (Array(2, 3), Array(2, 3, 4.5), Array(1, 6, 4.5)):
        opened = taxel.open(tmp_path / "a.npy", array=array)
        assert (opened.array.shape, opened.array.pitch_mm) == (array.shape, array.pitch_mm)
        np.testing.assert_array_equal(opened.frames().values.reshape(3, 6), VALUES.astype(np.float32))
    with pytest.raises(taxel.ProblemError, match=r"array has 5 x 1 taxels; the frames of .*a\.npy have 1 x 6"):
        taxel.open(tmp_path / "a.npy", array=Array(5, 1))
    with pytest.raises(taxel.ProblemError, match="array is '2x3'"):
        taxel.open(tmp_path / "a.npy", array="2x3")


def test_a_layout_names_a_data_set_in_a_group_by_its_path(tmp_path: Path) -> None:
    import h5py

    with h5py.File(tmp_path / "a.h5", "w") as h5:
        for run, more in (("run1", 0), ("run2", 1)):
            h5[f"{run}/pressure"], h5[f"{run}/when"] = VALUES.reshape(3, 2, 3) + more, [0.0, 0.25, 0.75]
    layout = tmp_path / "a.layout.toml"
    for array, time in (("run2/pressure", "run2/when"), ("/run2/pressure", "/run2/when")):
        layout.write_text(f'[data]\narray = "{array}"\ntime = "{time}"\n')
        recording = taxel.open(tmp_path / "a.h5")
        np.testing.assert_array_equal(recording.frames().values, VALUES.reshape(3, 2, 3).astype(np.float32) + 1)
        assert recording.frames().t.tolist() == [0, 250_000, 750_000]
        assert recording.lost == ("other arrays of the file: run1/pressure, run1/when",)
    layout.write_text('[data]\narray = "forces"\n')
    with pytest.raises(FormatError, match=r"no array forces, .*; its arrays are pressure \(3 x 2 x 3\), when"):
        taxel.open(tmp_path / "a.h5")


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


@pytest.mark.parametrize(
    ("layout", "match"),
    [
        ("pich_mm = 3", "pich_mm is not known: must be one of rows, columns, pitch_mm"),
        ("[table]\nsep = ';'", r"table\.sep is not known: must be one of separator, decimal, skip_lines"),
        ("[ros]\ntopics = 'a'", r"ros\.topics is not known"),
        ("rows = 2", "rows and columns: give both or neither"),
        ("rows = 2\ncolumns = 4\n[table]\ntime_column = 0", "2 x 4 taxels"),
        ("rows = 'two'\ncolumns = 3", "rows"),
        ("pitch_mm = -1", "pitch_mm is -1: must be above 0"),
        ("pitch_mm = 2\n[places]\nx = [1]\ny = [1]", "both given"),
        ("[places]\nx = [1, 2]\ny = [1, 2]\n[table]\ntime_column = 0", "must be"),
        ("[places]\nx = [1, 2]", r"\[places\]: y is missing"),
        ("[source]\nbaud = 9600", r"\[source\]: place is missing"),
        ("side = 'up'", "side"),
        ("heel = 'left'", "heel"),
        ("falls = 'yes'", "falls"),
        ("falls = 1e300", r"falls is .*: must be from -3.40282e\+38 to 3.40282e\+38"),
        ("unit = ''", "unit"),
        ("rate_hz = 0", r"rate_hz is 0: must be from 1e-09 to 1e\+06"),
        ("zeros_before_s = 0", "zeros_before_s is 0: must be from 1e-06 to 60"),
        ("table = 3", "table"),
        ("[table]\nseparator = ', '", "separator is ', ': must be one character"),
        ("[table]\nskip_lines = 40", "no line of numbers"),
        ("[table]\ntime_column = 'when'", "column 'when' of time_column is missing"),
        ("[table]\ntime_column = 9", "time_column is 9, but there are 6 columns"),
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
        (Frames(VALUES[:, None], [0, 1, 2]), "rows = 2\ncolumns = 4", "states 2 x 4 taxels; the recording has 1 x 6"),
        (
            Frames(VALUES.reshape(3, 2, 3), [0, 1, 2]),
            "rows = 3\ncolumns = 2",
            "states 3 x 2 taxels; the file states 2 x 3",
        ),
        (Frames(VALUES[:, None], [0, 1, 2], unit="N"), "unit = 'kPa'", "states the unit kPa, but one.npz is in N"),
        (
            Frames(VALUES[:, None], [0, 10_000, 20_000]),
            "rate_hz = 50",
            "states 50 Hz, but the times of one.npz give 100 Hz",
        ),
        (Frames(VALUES[:, None], [0, 1, 2], array=Array(1, 6, 3.0)), "pitch_mm = 4", "the file states 3 mm apart"),
    ],
)
def test_a_layout_that_contradicts_the_file_is_refused_where_it_is_given(
    tmp_path: Path, frames: Frames, layout: str, match: str
) -> None:
    taxel.convert(frames, tmp_path / "one.npz")
    (tmp_path / "layout.toml").write_text(layout)
    with pytest.raises(FormatError, match=match):
        taxel.open(tmp_path / "one.npz", layout=tmp_path / "layout.toml")
    # One that only lies beside it fills what is missing.
    assert taxel.open(tmp_path / "one.npz").frames() == frames


@pytest.mark.parametrize("falls", ["true", "10"])
def test_a_recording_that_is_converted_beside_its_layout_is_turned_once(tmp_path: Path, falls: str) -> None:
    (tmp_path / "layout.toml").write_text(f'falls = {falls}\nrate_hz = 100\nunit = "N"\nheel = "top"\nside = "left"\n')
    (tmp_path / "step.txt").write_text(lines(VALUES))
    recording = taxel.open(tmp_path / "step.txt")
    np.testing.assert_array_equal(
        recording.frames().values[:, 0], (float(falls != "true" and falls) - VALUES).astype("f4")
    )
    for name in ("again", "and_again"):
        taxel.convert(recording, tmp_path / f"{name}.mcap")
        recording, before = taxel.open(tmp_path / f"{name}.mcap"), recording
        assert recording.frames() == before.frames()
        assert (recording.side, recording.heel, recording.timed) == ("left", "top", True)
    # The same again is no contradiction, another number is.
    given = tmp_path / "given.toml"
    given.write_text(f"falls = {falls}\n")
    assert taxel.open(recording.path, layout=given).frames() == recording.frames()
    for other in ("false", "255"):
        given.write_text(f"falls = {other}\n")
        was = falls.replace("true", "0")
        with pytest.raises(
            FormatError,
            match=f"states falls = {other}, but the readings of .* were already inverted with falls = {was}",
        ):
            taxel.open(recording.path, layout=given)
    given.write_text('heel = "bottom"\n')
    with pytest.raises(FormatError, match=r"states heel bottom, but .* states top"):
        taxel.open(recording.path, layout=given)


def test_turned_readings_are_not_written_where_a_layout_would_turn_them_again(tmp_path: Path) -> None:
    recording = table(tmp_path, lines(VALUES), "falls = true\nrate_hz = 100")
    for ending in ("csv", "npz", "h5"):
        with pytest.raises(
            taxel.ProblemError, match=rf"inverted already, which a \.{ending} cannot state, and .*step\.layout\.toml"
        ):
            taxel.convert(recording, tmp_path / f"step.{ending}")
        [lost] = taxel.convert(recording, tmp_path / f"other.{ending}")
        assert "that readings were inverted" in lost


def test_a_layout_for_tables_says_nothing_of_a_board_s_recording_in_the_same_folder(tmp_path: Path) -> None:
    events = Events([0], [1], [1], [True], array=Array(2, 2), intensity=[7])
    taxel.convert(events, tmp_path / "touch.mcap")
    (tmp_path / "layout.toml").write_text("rows = 2\ncolumns = 3\nfalls = true\nrate_hz = 100\nunit = 'N'\n")
    assert taxel.open(tmp_path / "touch.mcap").events == events
    with pytest.raises(FormatError, match="states 2 x 3 taxels"):
        taxel.open(tmp_path / "touch.mcap", layout=tmp_path / "layout.toml")


def test_a_layout_for_another_count_of_channels_of_a_trial_is_refused(tmp_path: Path) -> None:
    write_pedar(tmp_path)
    (tmp_path / "layout.toml").write_text("[places]\nx = [1, 2]\ny = [1, 2]\n")
    with pytest.raises(FormatError, match=r"layout\.toml: .*must be \(1, 5\), one per taxel"):
        taxel.open_all(tmp_path)


def test_a_layout_is_found_by_the_recording_s_name_first(tmp_path: Path) -> None:
    for name in ("walk.layout.toml", "layout.toml"):
        (tmp_path / name).write_text("")
    assert Layout.beside(tmp_path / "walk.csv.gz") == tmp_path / "walk.layout.toml"
    assert Layout.beside(tmp_path / "run.csv") == tmp_path / "layout.toml"


def test_arrays_that_a_layout_names_are_read_also_where_they_have_names_of_taxel(tmp_path: Path) -> None:
    p = np.arange(12.0).reshape(3, 2, 2)
    np.savez(tmp_path / "a.npz", t=[0, 10, 20], p=p)
    (tmp_path / "layout.toml").write_text('[data]\narray = "p"\ntime = "t"\ntime_unit = "ms"\n')
    opened = taxel.open(tmp_path / "a.npz").frames()
    assert opened.values.tolist() == p.tolist()
    assert opened.t.tolist() == [0, 10_000, 20_000]
    # What taxel wrote is its own, whatever a layout for its folder says.
    events = taxel.Events([0], [1], [1], [True], array=taxel.Array(2, 2))
    taxel.convert(events, tmp_path / "b.npz")
    assert taxel.open(tmp_path / "b.npz").events == events


@pytest.mark.parametrize("begin_us", [0, 1_795_000_000_000_000])
@settings(max_examples=settings.default.max_examples // 2, deadline=None)
@given(step=st.integers(100, 50_000), count=st.integers(2, 20), seconds=st.floats(1e-3, 0.2))
def test_zeros_come_before_a_first_frame_that_is_loaded_and_once(
    begin_us: int, step: int, count: int, seconds: float, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("trials")
    (folder / "layout.toml").write_text(f"zeros_before_s = {seconds!r}\n")
    loaded = Frames(1.0 + np.arange(count)[:, None, None], begin_us + step * np.arange(count), unit="counts")
    unloaded = Frames(np.arange(count, dtype=float)[:, None, None], loaded.t, unit="counts")
    for name, frames in (("loaded", loaded), ("unloaded", unloaded)):
        taxel.convert(frames, folder / f"{name}.npz")
    assert taxel.open(folder / "unloaded.npz").frames() == unloaded
    led = taxel.open(folder / "loaded.npz")
    before = len(led.frames()) - count
    assert before == max(1, round(seconds * 1e6 / step))
    assert led.frames()[before:] == loaded
    assert not led.frames().values[:before].any()
    assert set(np.diff(led.frames().t).tolist()) == {step}
    taxel.convert(led, folder / "again.npz")
    assert taxel.open(folder / "again.npz").frames() == led.frames()


def test_a_training_on_trials_that_begin_loaded_at_a_label_names_zeros_before(tmp_path: Path) -> None:
    values = np.zeros((60, 4, 4))
    values[:30, 1:3, 1:3] = 9.0
    frames = Frames(values, 10_000 * np.arange(60), unit="N", array=taxel.Array(4, 4))
    labels = []
    for name in "abcd":
        taxel.convert(frames, tmp_path / f"{name}.npz")
        labels.append({"contact": [0], "lift": [300_000]})
    warned = taxel.train(taxel.open_all(tmp_path), labels).warnings
    assert any(line.startswith("4 of 4 recordings begin loaded, at a label") for line in warned)
    (tmp_path / "layout.toml").write_text("zeros_before_s = 0.6\n")
    led = taxel.train(taxel.open_all(tmp_path), labels)
    assert led.score.found == 8
    assert not any("begin loaded" in line for line in led.warnings)


def test_zeros_before_frames_without_times_or_before_events_are_refused(tmp_path: Path) -> None:
    with pytest.raises(
        FormatError, match=r"zeros_before_s needs times, but \S+ has none; to give times, write rate_hz"
    ):
        table(tmp_path, lines(np.ones((5, 6))), "zeros_before_s = 0.5\n[table]\ntime_column = 0")
    events = taxel.Events([0, 200], [3, 4], [5, 5], [True, False], array=taxel.Array(8, 8))
    taxel.convert(events, tmp_path / "board.mcap")
    (tmp_path / "given.toml").write_text("zeros_before_s = 0.5")
    with pytest.raises(FormatError, match=r"contains events; .* and zeros_before_s are only for frames"):
        taxel.open(tmp_path / "board.mcap", layout=tmp_path / "given.toml")
