"""Tables of other programs open as they look, by one line that says how; the printed layout opens them again."""

from __future__ import annotations

import gzip
import json
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from refusal import refused

import taxel
from taxel import Array, Events, FormatError, Frames
from taxel._base.errors import Place
from taxel.formats.layout import of_layout
from taxel.formats.table import read_table

from .tables import frames, layouts, opened, opened_by

JSON_AXES = '{"ts": 0.1, "left": [[1, 2, 30], [4, 5, 60]]}\n{"ts": 0.2, "left": [[1, 2, 31], [4, 5, 61]]}\n'
AXIS_LAYOUTS = ['axis = "z"', 'axis = "all"', 'axis = "shear"', 'axis = "xyz"']
SIDES = (
    "x\n,L::heel,L,,R::heel,R,,\nTime[secs],Force[N],Force[N],Time[secs],Force[N],Force[N],\n"
    "0.0,1,1,0.0,2,2,,\n0.1,1,1,0.1,-1,-,,\n"
)
ROWS: dict[str, tuple[str, list[int], list[list[float]]]] = {
    "torn": ("t_ms,a,b\n0,1,2\n10,1,2\n20,1,2\n30,5", [0, 10_000, 20_000], [[1, 2]] * 3),
    "odd": ("t_ms,a,b\n0,1,2\n10,1\n20,1,2\nSensor ready\n30,1,3\n", [0, 20_000, 30_000], [[1, 2], [1, 2], [1, 3]]),
    "again": (
        "t_ms,a\n0,1\n10,2\n20,3\nt_ms,a\n0,4\n10,5\n20,6\n",
        [*range(0, 60_000, 10_000)],
        [[k] for k in range(1, 7)],
    ),
    "brackets": ('t,p\n0.00,"[3, 4, 5, 6]"\n0.01,"[3, 9, 5, 6]"\n', [0, 10_000], [[3, 4, 5, 6], [3, 9, 5, 6]]),
    "arrow": (
        "12:30:00.000 -> 3,4,5\n12:30:00.010 -> 3,9,5\n",
        [45_000_000_000, 45_000_010_000],
        [[3, 4, 5], [3, 9, 5]],
    ),
    "swapped": ("time_ms,a\n0,1\n10,2\n30,4\n20,3\n40,5\n", [*range(0, 50_000, 10_000)], [[1], [2], [3], [4], [5]]),
    "rounded": ("time_ms,a\n0,1\n10,2\n10,3\n20,4\n", [0, 10_000, 15_000, 20_000], [[1], [2], [3], [4]]),
    "wrap": ("time_us,a\n4294957296,1\n0,2\n10000,3\n", [4_294_957_296, 4_294_967_296, 4_294_977_296], [[1], [2], [3]]),
    "midnight": (
        "Uhrzeit,a\n23:59:59.9,1\n00:00:00.0,2\n00:00:00.1,3\n",
        [86_399_900_000, 86_400_000_000, 86_400_100_000],
        [[1], [2], [3]],
    ),
    "time last": (
        "5 1624904203.26\n6 1624904203.27\n9 1624904203.28\n",
        [1_624_904_203_260_000, 1_624_904_203_270_000, 1_624_904_203_280_000],
        [[5], [6], [9]],
    ),
    "rostopic": (
        "%time,field.header.seq,field.header.stamp,field.data0,field.data1\n"
        "1600000000000000000,1,1600000000000000001,3,4\n1600000000010000000,2,1600000000010000001,3,5\n",
        [1_600_000_000_000_000, 1_600_000_000_010_000],
        [[3, 4], [3, 5]],
    ),
    "states": (
        "time_ms,s0,s1,slipped\n0,3,4,0\n10,3,5,100\n20,3,4,100\n",
        [0, 10_000, 20_000],
        [[3, 4], [3, 5], [3, 4]],
    ),
    "sides": (SIDES, [0, 100_000], [[1, 1, 2, 2], [1, 1, -1, np.nan]]),
    "empty column": ("t_ms,a,b,c\n0,1,,3\n10,1,,3\n20,2,,4\n", [0, 10_000, 20_000], [[1, 3], [1, 3], [2, 4]]),
    "units behind": (
        "time,p1,p2\n0 ms,41 N,86.5N\n10ms,28 N,11N\n20 ms,66N,-76e-1 N\n",
        [0, 10_000, 20_000],
        [[41, 86.5], [28, 11], [66, np.float32(-7.6)]],
    ),
    "units behind decimal commas": (
        "t;F\n0,0 s;1,5 N\n0,1 s;1,75 N\n0,2 s;2 N\n",
        [0, 100_000, 200_000],
        [[1.5], [1.75], [2]],
    ),
    "half days": (
        "Time,a\n1/2/1970 11:59:59.9 AM,1\n1/2/1970 12:00:00 PM,2\n1/2/1970 1:00:00 pm,3\n",
        [129_599_900_000, 129_600_000_000, 133_200_000_000],
        [[1], [2], [3]],
    ),
    "German": (
        "Messung 1\nEinheit;kPa\n\nZeit [s];T1;T2;T3\n0,00;1,5;2;3\n0,01;;4;7\n",
        [0, 10_000],
        [[1.5, 2, 3], [np.nan, 4, 7]],
    ),
    "German, 1 Hz, one taxel": (
        "Zeit [s];Kraft [N]\n0;1,5\n1;2,5\n2;3,5\n",
        [0, 1_000_000, 2_000_000],
        [[1.5], [2.5], [3.5]],
    ),
    "dates": (
        "Zeit;a;b\n01.05.2024 10:00:00,25;1;2\n01.05.2024 10:00:00,26;3,5;4\n",
        [1_714_557_600_250_000, 1_714_557_600_260_000],
        [[1, 2], [3.5, 4]],
    ),
    "another unit": ("t [s]\tleft (N)\tright (N)\tA [g]\n0\t1\t2\t.5\n.01\t1\t3\t.5\n", [0, 10_000], [[1, 2], [1, 3]]),
    "units below": ("time,a,b,c\n[ms],N,N,degC\n0,1,2,20\n10,3,4,20\n", [0, 10_000], [[1, 2], [3, 4]]),
    "an index of pandas": (",t_s,a,total\n0,0.0,1,1\n1,0.1,3,3\n", [0, 100_000], [[1], [3]]),
    "a list a line": (
        "[0, 3, 4]\n[10, 3, 5]\n" + "".join(f"[{k}, 3, 6]\n" for k in range(20, 90, 10)),
        [*range(0, 90_000, 10_000)],
        [[3, 4], [3, 5]] + [[3, 6]] * 7,
    ),
    "a unit names the time": ("ms,fsr,battery\n0,1,87\n20,2,87\n40,3,86\n", [0, 20_000, 40_000], [[1], [2], [3]]),
    "seconds and nanoseconds": (
        '{"stamp": {"sec": 1700000000, "nanosec": 900000000}, "p": [3, 4]}\n'
        '{"stamp": {"sec": 1700000001, "nanosec": 0}, "p": [3, 5]}\n',
        [1_700_000_000_900_000, 1_700_000_001_000_000],
        [[3, 4], [3, 5]],
    ),
    "a unit of time in any language": ("時間(ms),指1\n0,3\n20,4\n", [0, 20_000], [[3], [4]]),
    "a mark of a comment": ("% time  F1  a\n% s  N  m/s2\n0.0  1  9\n0.1  2  9\n", [0, 100_000], [[1], [2]]),
    "a counter of any name": (
        "campione|tempo_s|a\n" + "".join(f"{k}|{k / 10}|{k % 3}\n" for k in range(20)),
        [*range(0, 2_000_000, 100_000)],
        [[k % 3] for k in range(20)],
    ),
    "a reading a line": (
        "t_s,sensor,value\n0,heel,3\n0,toe,4\n0.1,toe,6\n0.1,heel,5\n",
        [0, 100_000],
        [[3, 4], [5, 6]],
    ),
    "a reading a line, taxel by taxel": (
        "t_s,sensor,value\n0,heel,3\n0.1,heel,5\n0,toe,4\n0.1,toe,6\n",
        [0, 100_000],
        [[3, 4], [5, 6]],
    ),
    "a reading a line by row and column": (
        "t_ms,row,col,value\n"
        + "".join(f"{10 * k},{i},{j},{6 * k + 3 * i + j}\n" for k in range(2) for j in range(3) for i in range(2)),
        [0, 10_000],
        [[*range(6)], [*range(6, 12)]],
    ),
    "taxels by number": (
        "t_ms,taxel_id,force_mN\n" + "".join(f"{10 * k},{j},{k + j}\n" for k in range(4) for j in range(20)),
        [0, 10_000, 20_000, 30_000],
        [[k + j for j in range(20)] for k in range(4)],
    ),
    "a rule below the names": ("Time(s)  F(N)\n-------  ----\n0.0  1\n0.1  2\n", [0, 100_000], [[1], [2]]),
    "the word time in a name": (
        "PacketCounter\tSampleTimeFine\ta\n65534\t0\t7\n65535\t20\t8\n0\t40\t9\n",
        [0, 20_000, 40_000],
        [[7], [8], [9]],
    ),
    "a clock in whole seconds and one in ms": (
        "LABEL,Time,Millis,F1\n" + "".join(f"DATA,10:00:0{k // 4},{250 * k},{k % 3}\n" for k in range(9)),
        [250_000 * k for k in range(9)],
        [[k % 3] for k in range(9)],
    ),
    "times of ROS in two columns": (
        "sec,nsec,p\n" + "".join(f"7,{k}00000000,{k % 3}\n" for k in range(9)),
        [7_000_000 + 100_000 * k for k in range(9)],
        [[k % 3] for k in range(9)],
    ),
    "a colon behind the time": (
        "".join(f"0.{k}: Force: {k}.5 N, 2 N\n" for k in range(9)),
        [100_000 * k for k in range(9)],
        [[k + 0.5, 2] for k in range(9)],
    ),
    "columns of another unit, and a sum": (
        "Zeit;Ferse;Knie (°);Total Force (N)\n0,00;1;2,5;1\n0,01;3;2,6;3\n",
        [0, 10_000],
        [[1], [3]],
    ),
    "milliseconds behind a comma": (
        "".join(f"2024-05-01 10:00:0{k // 4},{250 * (k % 4):03},{k % 3}\n" for k in range(9)),
        [1_714_557_600_000_000 + 250_000 * k for k in range(9)],
        [[k % 3] for k in range(9)],
    ),
    "numbers as texts have them": (
        "t_ms;a;b\n0;1 200,5;\N{MINUS SIGN}3\n10;1 201,5;\N{MINUS SIGN}4,5\n20;13 202,5;6\n",
        [0, 10_000, 20_000],
        [[1200.5, -3], [1201.5, -4.5], [13202.5, 6]],
    ),
    "cells without a value": (
        "t_ms,a,b\n" + "".join(f"{10 * k},{('#N/A', 'inf', '?', '#DIV/0!', 1)[k % 5]},{k}\n" for k in range(9)),
        [10_000 * k for k in range(9)],
        [[1 if k % 5 == 4 else np.nan, k] for k in range(9)],
    ),
    "a cell that is no number is missing": (
        "t_ms,a,b\n" + "".join(f"{10 * k},{'wet' if k == 7 else k % 4},{k % 3}\n" for k in range(30)),
        [10_000 * k for k in range(30)],
        [[np.nan if k == 7 else k % 4, k % 3] for k in range(30)],
    ),
    "empty lines of a spreadsheet": (
        "t_ms;a;b\n0;1;2\n10;1;3\n20;2;3\n" + ";;\n" * 9,
        [0, 10_000, 20_000],
        [[1, 2], [1, 3], [2, 3]],
    ),
    "numbers above frames": (
        "name,,\n3,,\n,,\nFrame 0 (0.00 ms),,\n0,1,2\n0,1,3\n,,\nFrame 1 (2.00 ms),,\n0,1,2\n0,1,4\n",
        [0, 2000],
        [[0, 1, 2, 0, 1, 3], [0, 1, 2, 0, 1, 4]],
    ),
    "days of a spreadsheet": (
        "time,a\n" + "".join(f"{45413 + k / 86400:.8f},{k % 3}\n" for k in range(4)),
        [1_714_521_600_000_000, 1_714_521_600_999_648, 1_714_521_602_000_160, 1_714_521_602_999_808],
        [[0], [1], [2], [0]],
    ),
    "days of MATLAB": (
        "datenum,a\n" + "".join(f"{739373 + k / 4},{k % 3}\n" for k in range(3)),
        [1_714_521_600_000_000 + 21_600_000_000 * k for k in range(3)],
        [[0], [1], [2]],
    ),
    "a time that repeats before a pause": (
        "t_ms,a\n0,1\n10,1\n20,1\n20,2\n5000,1\n5010,1\n",
        [0, 10_000, 20_000, 30_000, 5_000_000, 5_010_000],
        [[1], [1], [1], [2], [1], [1]],
    ),
    "separators at the end": ("t_s,a,b\n0,1,2,\n1,3,4,\n", [0, 1_000_000], [[1, 2], [3, 4]]),
}


@pytest.mark.parametrize("kind", ROWS)
def test_a_table_opens_without_a_layout(tmp_path: Path, kind: str) -> None:
    text, t, values = ROWS[kind]
    found = frames(opened(tmp_path, text))
    assert found[0] == t
    np.testing.assert_array_equal(found[1], values)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (ROWS["torn"][0], ["separated by commas", "'t_ms' in ms", "1 line cut off at the end (line 5)"]),
        (ROWS["odd"][0], ["1 line with too few cells (line 3)", "1 line of text (line 5)"]),
        (ROWS["rounded"][0], ["1 time repeated, spread evenly"]),
        (ROWS["swapped"][0], ["1 line out of order, sorted by time"]),
        (ROWS["wrap"][0], ["times wrap 1 time"]),
        (ROWS["again"][0], ["times begin again 1 time"]),
        (ROWS["states"][0], ["slipped left out: labels; label_column = 'slipped' reads them"]),
        (ROWS["sides"][0], ["unit N", "Time[secs] left out: another time"]),
        (ROWS["empty column"][0], ["b left out: empty"]),
        (ROWS["German"][0], ["2 frames of 1 x 3 taxels", "semicolons", "decimal commas", "'Zeit [s]' in s"]),
        (ROWS["rostopic"][0], ["field.header.seq left out: a counter", "field.header.stamp left out: another time"]),
        (ROWS["another unit"][0], ["A [g] left out: in g"]),
        (
            "t_ms,heel_lat,heel_med,gps_lat\n0,1,2,50.1\n10,1,3,50.2\n20,2,2,50.3\n",
            ["1 x 2 taxels", "gps_lat left out: another quantity"],
        ),
    ],
)
def test_one_line_says_how_it_was_read_and_what_was_left_out(tmp_path: Path, text: str, words: list[str]) -> None:
    said = opened(tmp_path, text).said
    for word in words:
        assert word in said


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("time,a\n0,1\n1,2\n2,3\n", ["time_unit = ", ""]),
        ("0,5\n0,7\n0,9\n", ["", 'decimal = ","']),
        ("x,y,p,t\n1,2,1,100\n3,4,0,230\n5,6,1,400\n", ['time_unit = "us"', 'time_unit = "ms"']),
        ("7,5,1\n2,9,4\n4,4,2\n", ["", "frame_lines = 3"]),
        (",0,1\n" + "".join(f"{k},{k % 3},{k % 4}\n" for k in range(9)), ["skip_lines = 1"] * 3),
        ("01 10 20\n02 11 21\n", ["", 'lines = "hex"']),
        ("0,0,left,1,2\n5,1,right,8,9\n10,0,left,1,2\n", ["by = 3", "leave_out = [2, 3]"]),
        ("t_ms,hand,a\n0,1,5\n10,2,7\n20,1,5\n", ['by = "hand"', 'leave_out = ["hand"]']),
        ("t,l0_x,l0_y,l0_z,l1_x,l1_y,l1_z\n0,1,2,30,4,5,60\n", AXIS_LAYOUTS),
        (JSON_AXES, AXIS_LAYOUTS),
        ("t_ms;a;b\n0;0,5;0.513\n10;0,6;0.5\n", ['leave_out = ["a"]']),
        ("t_ms,a,b\n" + "".join(f"{k},{k % 3},{k % 20} # ok\n" for k in range(30)), ['leave_out = ["b"]']),
        ("time,a\n0:10,1\n0:20,2\n0:30,1\n", ['time_unit = "iso"']),
        (
            "epoch,a\n" + "".join(f"{1717225200123 + k // 2 * 20},{k}\n" for k in range(9)),
            ['time_column = "epoch"', "frame_lines = 2"],
        ),
        ("t_ms,a [N],b [V]\n0,1,2\n10,3,4\n", None),
        ("t_ms,a [N],b [kPa]\n0,1,2\n10,3,4\n", ['unit = "N"', 'unit = "kPa"']),
        ("t_ms,a\n" + "0,1\n0,2\n10,3\n10,4\n20,5\n20,6\n30,7\n30,8\n", ["", "frame_lines = 2"]),
    ],
)
def test_two_readings_that_fit_about_equally_are_printed(tmp_path: Path, text: str, expected: list[str] | None) -> None:
    if expected is None:
        opened(tmp_path, text)
        return
    found = layouts(tmp_path, text)
    if expected == ["time_unit = ", ""]:
        assert {'time_unit = "ms"' in layout for layout in found} == {True, False}
        return
    assert len(found) == len(expected)
    for layout, words in zip(found, expected, strict=True):
        assert words in layout


def test_rows_of_one_frame_are_asked(tmp_path: Path) -> None:
    matrix = np.random.default_rng(1).integers(0, 255, (28, 56))
    np.savetxt(tmp_path / "m.csv", matrix, "%03d", ",")
    text = (tmp_path / "m.csv").read_text()
    each, together = layouts(tmp_path, text)
    assert frames(opened(tmp_path, text, each))[1] == matrix.tolist()
    one = opened(tmp_path, text, together).sources[""]
    assert isinstance(one, Frames)
    assert one.values.tolist() == [matrix.tolist()]


AXES = {"x": [[1, 4]], "y": [[2, 5]], "z": [[30, 60]], "shear": [[np.hypot(1, 2), np.hypot(4, 5)]]}
AXES |= {"xyz": [[1, 2, 30, 4, 5, 60]]}


@pytest.mark.parametrize("axis", [*AXES, "all"])
def test_one_axis_of_taxels_with_three_or_each_as_a_source(tmp_path: Path, axis: str) -> None:
    text = "t,l0_x,l0_y,l0_z,l1_x,l1_y,l1_z\n0,1,2,30,4,5,60\n"
    found = opened(tmp_path, text, f'axis = "{axis}"\n[table]\ntime_column = "t"\n')
    assert list(found.sources) == (["x", "y", "z"] if axis == "all" else [""])
    for name in found.sources:
        np.testing.assert_allclose(frames(found, name)[1], AXES[name or axis])
        names = found.sources[name].array.names
        assert names == (("l0_x", "l0_y", "l0_z", "l1_x", "l1_y", "l1_z") if axis == "xyz" else ("l0", "l1"))


def test_columns_of_a_pattern_are_kept(tmp_path: Path) -> None:
    found = opened(tmp_path, "t,l0_x,l0_z,l1_z\n0,1,30,60\n", '[table]\ntime_column = "t"\nkeep = "l*_z"\n')
    assert frames(found) == ([0], [[30, 60]])
    assert found.lost == ("columns that are not taxels: l0_x",)


def test_a_column_that_is_one_sensor_s_at_first_and_another_s_below_is_asked(tmp_path: Path) -> None:
    lines = [f"{k / 100},{name},{k % 7}\n" for name in ("heel", "toe") for k in range(9000)]
    by, taxel, _ = layouts(tmp_path, "t_s,sensor,value\n" + "".join(lines))
    assert 'by = "sensor"' in by
    found = opened(tmp_path, "t_s,sensor,value\n" + "".join(lines), taxel)
    assert found.sources[""].array.names == ("heel", "toe")
    assert frames(found)[1] == [[k % 7] * 2 for k in range(9000)]
    with refused(FormatError, place=Place("a.csv")):
        opened(tmp_path, "t_s,sensor,value\n0,heel,3\n0,heel,4\n", taxel)


def test_taxels_by_row_and_column_are_a_grid(tmp_path: Path) -> None:
    found = opened(tmp_path, ROWS["a reading a line by row and column"][0])
    assert found.sources[""].array.shape == (2, 3)


def test_each_sensor_has_its_own_times(tmp_path: Path) -> None:
    text = "t_ms,trial,a\n0,1,5\n10,1,6\n20,1,7\n0,2,8\n10,2,9\n20,2,4\n"
    by, *_ = layouts(tmp_path, text)
    found = opened(tmp_path, text, by)
    assert frames(found, "1") == ([0, 10_000, 20_000], [[5], [6], [7]])
    assert frames(found, "2") == ([0, 10_000, 20_000], [[8], [9], [4]])


def test_times_rounded_to_seconds_are_spread_at_one_rate(tmp_path: Path) -> None:
    text = "time,a\n" + "".join(f"12:00:{k // 10:02},{k % 7}\n" for k in range(30))
    rounded, _ = layouts(tmp_path, text)
    assert np.diff(frames(opened(tmp_path, text, rounded))[0]).tolist() == [100_000] * 29


ROWS_OF_JSON = [{"t": k / 50, "p": [k, 7]} for k in range(9)]


@pytest.mark.parametrize("indent", [None, 1])
@pytest.mark.parametrize(
    "content",
    [ROWS_OF_JSON, {"rate": 50, "frames": ROWS_OF_JSON}, {key: [row[key] for row in ROWS_OF_JSON] for key in "tp"}],
    ids=["rows", "rows within", "columns"],
)
def test_a_document_of_json_is_the_rows_in_it(tmp_path: Path, indent: int | None, content: object) -> None:
    document = json.dumps(content, indent=indent)
    assert frames(opened(tmp_path, document, name="a.json")) == (
        [20_000 * k for k in range(9)],
        [[k, 7] for k in range(9)],
    )


def test_a_column_becomes_labels_where_its_value_changes(tmp_path: Path) -> None:
    text = "t_ms,a,slipped,phase\n0,3,0,rest\n10,4,0,touch\n20,5,1,touch\n30,5,0,\n"
    for column, labels in (
        ("slipped", (("slipped 1", 20_000), ("slipped 0", 30_000))),
        ("phase", (("touch", 10_000),)),
    ):
        other = ({"slipped", "phase"} - {column}).pop()
        layout = f'[table]\ntime_column = 1\ntime_unit = "ms"\nlabel_column = "{column}"\nleave_out = ["{other}"]\n'
        found = opened(tmp_path, text, layout)
        assert found.labels == labels
        assert frames(found)[1] == [[3], [4], [5], [5]]


def test_a_column_of_labels_is_chosen_by_an_option_and_named_where_it_is_a_channel(tmp_path: Path) -> None:
    random = np.random.default_rng(1)
    slipped = [int(k % 100 >= 50) for k in range(1200)]
    rows = (f"{10 * k},{random.integers(9) + 90 * slipped[k]},{random.integers(9)},{slipped[k]}\n" for k in range(1200))
    (tmp_path / "a.csv").write_text("t_ms,a,b,slipped\n" + "".join(rows))
    recording = taxel.open(tmp_path / "a.csv", label_column="slipped")
    assert recording.array.names == ("a", "b")
    assert {note.text for note in recording.notes} == {"slipped 0", "slipped 1"}
    assert [note.t for note in recording.notes] == [500_000 * k for k in range(1, 24)]
    layout = tmp_path / "all.layout.toml"
    layout.write_text('[table]\ntime_column = 1\ntime_unit = "ms"\nleave_out = []\n')
    events = [{"slip": [note.t for note in recording.notes if note.text == "slipped 1"]}]
    steps = list[str]()
    for late in (0, 30_000):
        late_events = [{"slip": [t + late for t in events[0]["slip"]]}]
        opened_all = taxel.open(tmp_path / "a.csv", layout=layout)
        steps.clear()
        warned = taxel.train(opened_all, late_events, progress=lambda step, *_: steps.append(step)).warnings
        assert any("slipped alone changes with the labels" in line for line in warned)
        # It is said before the training begins.
        assert "slipped alone changes with the labels" in steps[0]
    assert not any("with the labels" in line for line in taxel.train(recording, events).warnings)
    np.save(tmp_path / "b.npy", np.zeros((9, 2)))
    with refused(taxel.ProblemError, "label_column"):
        taxel.open(tmp_path / "b.npy", layout=layout, label_column="slipped")


@pytest.mark.parametrize(
    ("text", "layout", "line"),
    [
        ("t_ms,a,b\n0,1,2\n10\n20\n30\n40,1,2\n50,1,3\n60,1,3\n", None, 3),
        ("t_ms,a\n0,1\n10,x\n20,y\n30,z\n40,1\n", "[table]\ntime_column = 1\n", None),
        ("a,b\n1,2\n", "[table]\ncolumns = ['a', 'b', 'c']", 1),
        ("a b c\nd e f\n", None, None),
        ("t_ms;a\n0;1,5\n10;1.234,5\n20;2,5\n", "[table]\nseparator = ';'\ndecimal = ','\ntime_column = 1\n", 3),
        ("t_s,a\n" + "0.1,1\n0.2,2\n" * 5 + "t_s,a,b\n" + "0.3,1,2\n0.4,1,2\n" * 5, None, 13),
        ("", None, None),
        ("1,2\n3,4\n", "[table]\nskip_lines = 9", None),
        ("1,2\n3,4\n", "[table]\ntime_column = 3", None),
        ("t,a\n0,1\n", "[table]\nleave_out = ['b']", None),
        ("t,a\n0,1\n", "[table]\nseparator = ';'", 1),
        ("t_s,a\n0,1e39\n1,2\n", None, 2),
        ("t_s,a\n0,1\n9e99,2\n", None, None),
        ("1,2\n3,4\n\n5,6\n", "[table]\nseparator = ','\nframe_lines = 3", 4),
        ('{"a": {"t": 0, "p": [1, 2]}, "b": {"t": 1, "p": [3, 4]}}\n', None, None),
        ("t_ms,a\n" + "1.71E+12,1\n1.71E+12,2\n" * 10, None, None),
        ('t,p\n0.0,"[1 2 3 ... 7 8 9]"\n0.1,"[2 2 3 ... 7 8 9]"\n', None, 2),
        ("t_ms,a\n" + "0,1\n10,x\n" * 9, None, None),
        ("time,a\n01/02/2024 10:00:00,1\n01/02/2024 10:00:01,2\n", None, None),
    ],
)
def test_what_is_no_table_or_another_one_than_its_layout_says_is_refused(
    tmp_path: Path, text: str, layout: str | None, line: int | None
) -> None:
    with refused(FormatError, place=Place("a.csv", line)):
        opened(tmp_path, text, layout)


def test_a_file_that_changes_while_it_is_read_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t_ms,a\n0,1\n10,2\n")

    def grows(*given: Any) -> Any:
        found = read_table(*given)
        path.write_text(path.read_text() + "20,3\n")
        return found

    monkeypatch.setattr("taxel.recording.kinds.read_table", grows)
    with pytest.raises(FormatError, match=r"a\.csv: the file changed while it was read"):
        taxel.open(path)
    monkeypatch.undo()
    assert len(taxel.open(path).frames()) == 3


def test_a_size_that_lines_with_times_do_not_have_is_refused(tmp_path: Path) -> None:
    (tmp_path / "layout.toml").write_text("rows = 3\ncolumns = 4\n")
    (tmp_path / "a.csv").write_text("t_ms,a,b\n0,1,2\n10,3,4\n20,5,6\n")
    (tmp_path / "b.csv").write_text("1,2\n3,4\n5,6\n")
    for name in ("a.csv", "b.csv"):
        with pytest.raises(FormatError, match=name.replace(".", r"\.")):
            taxel.open(tmp_path / name)


def test_half_a_frame_is_never_read(tmp_path: Path) -> None:
    text = "".join(f"Frame {k} ({k} ms)\n1 2\n3 {k}\n" for k in range(30))
    found = opened(tmp_path, text.replace("3 5\n", "3\n") + "Frame 30 (30 ms)\n1 2\n")
    assert "2 frames left out: not 2 lines" in found.said
    assert frames(found)[0] == [1000 * k for k in range(30) if k != 5]
    assert frames(found)[1] == [[1, 2, 3, k] for k in range(30) if k != 5]


def test_a_letter_in_latin_1_far_below(tmp_path: Path) -> None:
    rows = "".join(f"{k},{k % 9},ok\n" for k in range(0, 200_000, 10))
    found = opened(tmp_path, f"t_ms,a,note\n{rows}200000,3,müde\n".encode("latin-1"))
    assert len(found.sources[""]) == 20_001
    marked = "".join(f"t:{k} a:{k % 9}\n" for k in range(0, 200_000, 10))
    found = opened(tmp_path, f"{marked}t:200000 a:3 müde\n".encode("latin-1"))
    assert len(found.sources[""]) == 20_000


@pytest.mark.parametrize("code", ["utf-16-le", "utf-16-be"])
def test_utf_16_without_its_mark_and_damaged_gzip_are_refused(tmp_path: Path, code: str) -> None:
    with refused(FormatError, place=Place("a.csv", byte=0 if code.endswith("be") else 1)):
        opened(tmp_path, "time,a\n0,1\n".encode(code))
    with refused(FormatError, place=Place("b.csv.gz")):
        opened(tmp_path, gzip.compress(b"t_s,a\n" + b"0,1\n" * 9999)[:40], name="b.csv.gz")


#: How two sensors write a line each in turn, and the sources that they are.
IN_TURN = {
    "keys": ("{t},L:{a},2\n{u},R:900,{b}\n", ("L", "R")),
    "JSON": ('{{"t":{t},"left":[{a},2]}}\n{{"t":{u},"right":[900,{b}]}}\n', ("left", "right")),
    "one more value": ("t:{t} thumb:{a} 2\nt:{u} palm:900 {b} 7\n", ("thumb", "palm")),
    "prefixes": ("left: {t},{a},2\nright: {u},900,{b}\n", ("left", "right")),
}


@given(
    kind=st.sampled_from([*IN_TURN]),
    rows=st.lists(st.tuples(st.integers(0, 9), st.integers(0, 900)), min_size=12, max_size=40),
    odd=st.booleans(),
)
def test_sensors_that_lines_name_are_sources(
    kind: str, rows: list[tuple[int, int]], odd: bool, tmp_path_factory: pytest.TempPathFactory
) -> None:
    line, names = IN_TURN[kind]
    lines = [line.format(t=20 * k, u=20 * k + 5, a=a, b=b) for k, (a, b) in enumerate(rows)]
    text = "".join([*lines[:5], *["Sensor ready\n"] * odd, *lines[5:]])
    layout = '[table]\ntime_column = 1\ntime_unit = "ms"\n'
    found = opened(tmp_path_factory.mktemp("turns"), text, layout)
    assert set(found.sources) == {*names}
    for at, (name, begin) in enumerate(zip(names, (0, 5000), strict=True)):
        t, values = frames(found, name)
        assert t == [begin + 20_000 * k for k in range(len(rows))]
        assert [row[at] for row in values] == [row[at] for row in rows]


def test_lines_that_name_one_sensor_or_a_state_now_and_then_are_of_one(tmp_path: Path) -> None:
    text = "".join(f"t:{10 * k} a:{k % 7} b:{k % 5}\n" + "battery: 87\n" * (k % 20 == 9) for k in range(60))
    assert list(opened(tmp_path, text, '[table]\ntime_unit = "ms"\n').sources) == [""]


def test_sheets_with_the_same_columns_are_sources(tmp_path: Path) -> None:
    pytest.importorskip("openpyxl")
    path = tmp_path / "a.xlsx"
    with pd.ExcelWriter(path) as book:
        for name, more in (("walk", 0), ("run", 9)):
            sheet = pd.DataFrame({"t_s": np.arange(30) / 50, "a": np.arange(30) % 7 + more})
            sheet.to_excel(book, sheet_name=name, index=False)
        pd.DataFrame({"subject": ["A"], "age": [31]}).to_excel(book, sheet_name="about", index=False)
    found = opened_by(read_table, path, None)
    assert list(found.sources) == ["walk", "run"]
    assert frames(found, "run")[1] == [[k % 7 + 9] for k in range(30)]
    assert "other sheets: about" in found.lost
    found = opened_by(read_table, path, '[table]\nsheet = "run"\n')
    assert frames(found)[1][0] == [9]
    with refused(FormatError, place=Place("a.xlsx")):
        opened_by(read_table, path, '[table]\nsheet = "jump"\n')


def test_parquet_is_read_as_it_is_typed(tmp_path: Path) -> None:
    """Lists in cells too, also of lists, in full."""
    random = np.random.default_rng(1)
    grid, row = random.random((9, 20, 30)).astype(np.float32), random.integers(0, 9, (9, 1200))
    table = pd.DataFrame({"timestamp": np.arange(9) / 30, "frame_index": range(9), "slip": [False, True] * 4 + [True]})
    table["palm"], table["thumb"] = [frame.tolist() for frame in grid], list(row)
    pytest.importorskip("pyarrow")
    table.to_parquet(tmp_path / "a.parquet")
    found = opened_by(read_table, tmp_path / "a.parquet", None)
    t, values = frames(found)
    assert t == [round(k * 1e6 / 30) for k in range(9)]
    np.testing.assert_array_equal(values, np.column_stack([grid.reshape(9, -1), row]))
    assert "frame_index left out: a counter" in found.said
    again = opened_by(read_table, tmp_path / "a.parquet", of_layout(found.layout))
    assert again.sources == found.sources


@pytest.mark.parametrize("ending", [".xlsx", ".parquet"])
@pytest.mark.parametrize("dates", [False, True])
def test_spreadsheets_and_parquet_open(tmp_path: Path, ending: str, dates: bool) -> None:
    begin = datetime(2024, 5, 1, 10, 0, 0)
    times = [begin + timedelta(milliseconds=10 * k) if dates else k / 100 for k in range(12)]
    table = pd.DataFrame({"time": times, "Ferse [N]": np.arange(12) / 4, "b [N]": range(12), "note": "ok"})
    pytest.importorskip({".xlsx": "openpyxl", ".parquet": "pyarrow"}[ending])
    path = tmp_path / f"a{ending}"
    table.to_excel(path, index=False) if ending == ".xlsx" else table.to_parquet(path)
    found = opened_by(read_table, path, None)
    t, values = frames(found)
    assert np.diff(t).tolist() == [10_000] * 11
    assert t[0] == (1_714_557_600_000_000 if dates else 0)
    assert values == [[k / 4, k] for k in range(12)]
    if ending == ".parquet" and dates:
        # Times that are the index, which has no name.
        named = tmp_path / "b.parquet"
        table.set_index("time").rename_axis(None).to_parquet(named)
        assert frames(opened_by(read_table, named, None)) == (t, values)
    assert "note left out: texts" in found.said
    again = opened_by(read_table, path, of_layout(found.layout))
    assert again.sources == found.sources


def test_a_table_of_events_opens_as_events(tmp_path: Path) -> None:
    found = opened(tmp_path, "x,y,p,t_us\n1,2,1,10\n3,4,0,10\n5,6,1,30\n")
    expected = Events([10, 10, 30], [1, 3, 5], [2, 4, 6], [True, False, True], array=Array.thesis())
    assert found.sources == {"": expected}
    assert "64 x 64 taxels assumed" in found.said
