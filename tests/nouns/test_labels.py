"""Reference events find their recording, and its own clock."""

import json
from pathlib import Path

import numpy as np
import pytest
from refusal import refused

import taxel
from taxel import _core
from taxel._base.errors import Place
from taxel.labels import TURN_US

ARRAY = {"rows": 64, "columns": 64, "pitch_mm": 2.67, "name": "thesis 64x64"}
BEGAN_NS = 1_700_000_000_000_000_000


def record(path: Path, begins_us: int, seconds: float = 20.0, pace: float = 1.0) -> taxel.Recording:
    """Write what a host hears from `begins_us` on of a board whose time 0 was at BEGAN_NS: a change each 10 ms.

    A sender too busy for its own clock keeps a `pace` below 1.
    """
    writer = _core.RecordingWriter(path, json.dumps({"array": ARRAY}), "none", True)
    t = np.arange(begins_us, begins_us + int(seconds * 1e6), 10_000)
    for k, one in enumerate(t.tolist()):
        event = taxel.Events([one], [1], [2], [True], array=taxel.Array.thesis(), intensity=[40 + k % 2])
        late_ns = 40_000 + 1_000 * (k % 7)
        writer.datagram(BEGAN_NS + round(one * 1000 / pace) + late_ns, k, taxel.wire.encode(event))
    writer.finish("{}")
    return taxel.open(path)


def table(path: Path, times: list[int], *, host: bool, pace: float = 1.0) -> taxel.Labels:
    rows = [f"tick,{t}" + f",{BEGAN_NS + round(1000 * t / pace)}" * host for t in times]
    path.write_text("\n".join(["label,t_us" + ",host_ns" * host, *rows]) + "\n")
    return taxel.Labels(path)


@pytest.mark.parametrize("begins_us", [0, 2_000_000, 6_553_500, 7_000_000, 40_000_000, 3_600_000_000])
def test_host_time_settles_how_many_turns_a_recording_is_behind_the_board(tmp_path: Path, begins_us: int) -> None:
    recording = record(tmp_path / "walk.mcap", begins_us)
    happened = [begins_us + offset for offset in (0, 10_000, 6_550_000, 13_110_000, 19_990_000)]
    found = table(tmp_path / "labels.csv", happened, host=True).times(recording)["tick"]
    assert set(found.tolist()) <= set(recording.events.t.tolist())
    assert found[0] == recording.events.t[0] == begins_us % TURN_US
    np.testing.assert_array_equal(np.diff(found), np.diff(happened))
    # A table of trials is read by the same rule, and needs no name where there is one recording.
    trials = taxel.information.read_trials(tmp_path / "labels.csv", [recording], window_ms=5.0)
    assert [trial.start_us for trial in trials] == found.tolist()


@pytest.mark.parametrize("pace", [0.24, 0.64, 1.5])
@pytest.mark.parametrize("begins_us", [0, 40_000_000])
def test_labels_find_the_recording_of_a_sender_that_did_not_keep_pace(
    tmp_path: Path, begins_us: int, pace: float
) -> None:
    recording = record(tmp_path / "walk.mcap", begins_us, pace=pace)
    # Just before the first and after the last datagram, and between them.
    happened = [begins_us + offset for offset in (-200_000, 0, 10_000, 6_555_000, 13_110_000, 19_990_000, 20_100_000)]
    found = table(tmp_path / "labels.csv", happened, host=True, pace=pace).times(recording)["tick"]
    assert found[1] == recording.events.t[0] == begins_us % TURN_US
    np.testing.assert_array_equal(np.diff(found), np.diff(happened))


def test_labels_of_another_run_are_refused(tmp_path: Path) -> None:
    recording = record(tmp_path / "walk.mcap", 0, 2.0)
    (tmp_path / "labels.csv").write_text(f"label,t_us,host_ns\ntick,100000,{BEGAN_NS + 3_000_000_000}\n")
    with refused():
        taxel.Labels(tmp_path / "labels.csv").times(recording)
    with refused():
        taxel.information.read_trials(tmp_path / "labels.csv", [recording], window_ms=5.0)


def noted(folder: Path, rows: str) -> list[tuple[str, int]]:
    """Return the notes of a recording with two of its own, beside which these labels lie."""
    frames = taxel.Frames(np.zeros((100, 2, 2)), np.arange(100) * 10_000, unit="N", array=taxel.Array(2, 2))
    (folder / "own.notes.csv").write_text("label,t_us\nheel,300000\ntoe,500000\n")
    taxel.convert(frames, folder / "own.npz")
    taxel.convert(taxel.open(folder / "own.npz"), folder / "mat.mcap")
    (folder / "mat.notes.csv").write_text(rows)
    return [(note.text, note.t or 0) for note in taxel.open(folder / "mat.mcap").notes]


@pytest.mark.parametrize(
    ("rows", "left"),
    [
        ("label,t_us\nheel,310000\n", [("heel", 300_000), ("toe", 500_000), ("heel", 310_000)]),
        ("label,t_us,replaces_us\nheel,310000,300000\n", [("toe", 500_000), ("heel", 310_000)]),
        ("label,t_us,replaces_us\nball,300000,300000\n", [("toe", 500_000), ("ball", 300_000)]),
        ("label,t_us,replaces_us\n,300000,300000\ntoe,500000,500000\n", [("toe", 500_000)]),
        ("label,t_us,replaces_us\nheel,310000,\n", [("heel", 300_000), ("toe", 500_000), ("heel", 310_000)]),
        ("label,t_us,replaces_us\nheel,310000,299999\n", [("heel", 300_000), ("toe", 500_000), ("heel", 310_000)]),
    ],
)
def test_a_label_replaces_a_note_of_the_recording_and_one_without_a_name_removes_it(
    tmp_path: Path, rows: str, left: list[tuple[str, int]]
) -> None:
    assert noted(tmp_path, rows) == left


def test_labels_in_a_sheet_are_read(tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("openpyxl")
    pandas.DataFrame({"label": ["Fuß auf", "Abheben"], "t_s": [0.21, 2]}).to_excel(tmp_path / "a.xlsx", index=False)
    rows = taxel.Labels(tmp_path / "a.xlsx").rows
    assert [(row.text, row.t) for row in rows] == [("Fuß auf", 210_000), ("Abheben", 2_000_000)]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("label,t_us,host_ns\na,5,soon\n", 2),
        ("label,t_us,host_ns\na,5,-1\n", 2),
        ("label,t_us,t_us\na,5,5\n", 1),
        ("label,host_ns\na,5\n", 1),
        # A row that replaces nothing.
        ("label,t_us,replaces_us\n,5,\n", 2),
        ("label,t_us,replaces_us\na,5,x\n", 2),
        ("t_s,label\n0:0x,auf\n", 2),
        ('t_s,label\n"0,21",auf\n', 2),
        ("t_s,label\nnan,auf\n", 2),
        ("t_s,what,comment\n1,auf,late\n", 1),
        ("start;label\n1;auf\n", 1),
        ("# my labels\nlabel,t_us\n", 1),
        ("t_s;label\n1\n", 2),
    ],
)
def test_a_table_that_makes_no_sense_is_named(tmp_path: Path, text: str, line: int) -> None:
    place = tmp_path / "labels.csv"
    place.write_text(text)
    with refused(taxel.FormatError, place=Place("labels.csv", line=line)):
        taxel.Labels(place)
