"""Reference events find their recording, and its own clock."""

import csv
import json
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from refusal import refused

import taxel
from taxel import _core
from taxel._base.errors import Place
from taxel.labels import TURN_US
from taxel.panel.label_file import LabelFile
from taxel.recording.beside import is_label_table

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


def test_without_host_time_times_are_taken_as_they_are(tmp_path: Path) -> None:
    recording = record(tmp_path / "walk.mcap", 40_000_000)
    assert table(tmp_path / "labels.csv", [5, 40_000_000], host=False).times(recording)["tick"].tolist() == [
        5,
        40_000_000,
    ]


def test_labels_of_another_run_are_refused(tmp_path: Path) -> None:
    recording = record(tmp_path / "walk.mcap", 0, 2.0)
    (tmp_path / "labels.csv").write_text(f"label,t_us,host_ns\ntick,100000,{BEGAN_NS + 3_000_000_000}\n")
    with refused():
        taxel.Labels(tmp_path / "labels.csv").times(recording)
    with refused():
        taxel.information.read_trials(tmp_path / "labels.csv", [recording], window_ms=5.0)


def test_a_table_names_recordings_by_path_name_or_stem(tmp_path: Path) -> None:
    place = tmp_path / "labels.csv"
    place.write_text("t_us, label ,recording\n5,a,walk\n7,b,run.mcap\n9,c,/data/far.mcap\n3,a,walk\n")
    labels = taxel.Labels(place)
    assert labels.recordings == ("/data/far.mcap", "run.mcap", "walk")
    assert labels.named("some/walk.mcap") == "walk"
    assert labels.named("some/run.mcap") == "run.mcap"
    assert labels.named("/data/far.mcap") == "/data/far.mcap"
    assert labels.named("other.mcap") is None
    assert labels.times(record(tmp_path / "walk.mcap", 0, 0.1))["a"].tolist() == [3, 5]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("label,t_us,host_ns\na,5,soon\n", 2),
        ("label,t_us,host_ns\na,5,-1\n", 2),
        ("label,t_us,t_us\na,5,5\n", 1),
        ("label,host_ns\na,5\n", 1),
    ],
)
def test_a_table_that_makes_no_sense_is_named(tmp_path: Path, text: str, line: int) -> None:
    place = tmp_path / "labels.csv"
    place.write_text(text)
    with refused(taxel.FormatError, place=Place("labels.csv", line=line)):
        taxel.Labels(place)


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


def test_labels_beside_a_table_of_one_foot_name_it_by_its_side(tmp_path: Path) -> None:
    table = tmp_path / "walk.csv"
    table.write_text("time_s,l1,l2,r1,r2\n" + "".join(f"{k / 100},1,2,3,4\n" for k in range(100)))
    layout = tmp_path / "walk.layout.toml"
    (tmp_path / "walk.notes.csv").write_text("t_us,source,label\n100000,left,heel\n200000,right,heel\n300000,,both\n")
    (tmp_path / "labels.csv").write_text(
        "recording,source,label,t_us\nwalk.csv,left,toe,400000\nwalk.csv,right,toe,5\n"
    )
    for side, leave_out, t in (("left", [4, 5], [100_000, 300_000, 400_000]), ("right", [2, 3], [5, 200_000, 300_000])):
        layout.write_text(
            f'rows = 1\ncolumns = 2\nunit = "N"\nside = "{side}"\n[table]\ntime_column = "time_s"\ntime_unit = "s"\n'
            f"leave_out = {leave_out}\n"
        )
        assert sorted(note.t for note in taxel.open(table).notes if note.t is not None) == t


def test_a_replaced_note_is_that_of_its_source_alone(tmp_path: Path) -> None:
    place = tmp_path / "walk.notes.csv"
    place.write_text("label,t_us,source,replaces_us\nheel,5,left,4\ntoe,7,,\n,9,,9\n")
    labels = taxel.Labels(place)
    assert [(row.text, row.t, row.replaces) for row in labels.rows] == [("heel", 5, 4), ("toe", 7, None)]
    assert [row.replaces for row in labels.removed] == [9]
    walk = tmp_path / "walk.mcap"
    replaced = [labels._replaced(walk, side, "", "", lambda: 0) for side in ("left", "right")]
    assert replaced == [{4, 9}, {9}]


@pytest.mark.parametrize("cells", [",5,", "a,5,x"])
def test_a_row_that_replaces_nothing_is_refused(tmp_path: Path, cells: str) -> None:
    (tmp_path / "walk.notes.csv").write_text(f"label,t_us,replaces_us\n{cells}\n")
    with refused(taxel.FormatError, place=Place("walk.notes.csv", line=2)):
        taxel.Labels(tmp_path / "walk.notes.csv")


#: Rows of a table: label, time, source, recording and what two columns say that taxel does not know.
ROWS = st.lists(
    st.tuples(
        st.sampled_from(["heel", "toe"]), st.integers(0, 20), st.sampled_from(["", "left"]),
        st.sampled_from(["walk", "trial 2"]), st.sampled_from(["", "late", 'hit, "hard"']), st.sampled_from(["", "3"]),
    ),
    min_size=1, max_size=8, unique_by=lambda row: row[:4],
)  # fmt: skip


@given(ROWS, st.sampled_from(["none", "mark", "rename", "move", "delete"]), st.randoms(use_true_random=False))
def test_columns_that_taxel_does_not_know_stay_with_their_labels_on_the_page(rows, change: str, random) -> None:
    with TemporaryDirectory() as folder:
        place = Path(folder) / "walk.notes.csv"
        with place.open("w", newline="") as file:
            table = csv.writer(file)
            table.writerows([("label", "t_us", "source", "recording", "comment", "sure"), *rows])
        handler = LabelFile(place, frozenset({"", "walk.mcap", "walk"}))
        assert len(handler.read()) == len(rows)
        at = random.randrange(len(rows))
        left = [row if row[3] != "walk" else (*row[:3], "", *row[4:]) for row in rows]
        label, t, source, trial, *said = left[at]
        changed = {"rename": ("ball", t), "move": (label, 77)}.get(change, (label, t))
        old = taxel.Note(label, t, 0, trial, source)
        edit = (old, taxel.Note(*changed, 0, trial, source))
        if change == "mark":
            edit = (None, taxel.Note("ball", 5))
            left.append(("ball", 5, "", "", "", ""))
        elif change == "delete":
            edit = (old, None)
            del left[at]
        else:
            left[at] = (*changed, source, trial, *said)
        _, written = handler.change([] if change == "none" else [edit])
        assert sorted((row.text, row.t, row.source, row.recording) for row in written) == sorted(
            row[:4] for row in left
        )
        again = taxel.Labels(place).rows
        names = {"comment": "", "sure": ""}
        # A row of the table's own recording may have its name, or none.
        named = {"walk": ""}
        found = [
            (one.text, one.t, one.source, named.get(one.recording, one.recording), *(names | dict(one.others)).values())
            for one in again
        ]
        assert sorted(found) == sorted(left)


@pytest.mark.parametrize("code", ["utf-8", "utf-8-sig", "utf-16"])
@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_a_table_of_a_spreadsheet_is_the_one_with_commas(tmp_path: Path, separator: str, code: str) -> None:
    kg = '"1,5"' if separator == "," else "1,5"
    rows = [["recording", "label", "t_us", "Größe (kg)"], ["walk", "Fuß", "5", kg], ["", '"heel; or, toe\t"', "7", ""]]
    place = tmp_path / "labels.csv"
    place.write_bytes("".join(separator.join(row) + "\r\n" for row in rows).encode(code))
    assert [(row.text, row.t, row.recording, row.others) for row in taxel.Labels(place).rows] == [
        ("Fuß", 5, "walk", (("Größe (kg)", "1,5"),)),
        ("heel; or, toe", 7, "", (("Größe (kg)", ""),)),
    ]
    assert is_label_table(place)


@pytest.mark.parametrize("code", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
@pytest.mark.parametrize(
    ("rows", "separator", "times"),
    [
        ([["t_s", "Label"], ["0,21", "Fuß auf"], ["1,0000004", "Abheben"]], ";", [210_000, 1_000_000]),
        ([["label", "t_ms"], ["Fuß auf", "210,5"], ["Abheben", "1e3"]], "\t", [210_500, 1_000_000]),
        ([["side", "t_ms", "label"], ["1", "210.5", "Fuß auf"], ["2", "9", "Abheben"]], ",", [210_500, 9_000]),
        (
            [["onset", "duration", "trial_type"], ["0.5", "1", "Fuß auf"], ["2", "1", "Abheben"]],
            ",",
            [500_000, 2_000_000],
        ),
    ],
)
def test_a_table_of_another_program_is_read_by_the_names_of_its_columns(
    tmp_path: Path, rows: list[list[str]], separator: str, times: list[int], code: str
) -> None:
    place = tmp_path / "walk.csv"
    place.write_bytes("".join(separator.join(row) + "\r\n" for row in rows).encode(code))
    assert [(row.text, row.t) for row in taxel.Labels(place).rows] == list(
        zip(["Fuß auf", "Abheben"], times, strict=True)
    )


def test_labels_in_a_sheet_are_read(tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("openpyxl")
    pandas.DataFrame({"label": ["Fuß auf", "Abheben"], "t_s": [0.21, 2]}).to_excel(tmp_path / "a.xlsx", index=False)
    rows = taxel.Labels(tmp_path / "a.xlsx").rows
    assert [(row.text, row.t) for row in rows] == [("Fuß auf", 210_000), ("Abheben", 2_000_000)]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("t_s,label\n0:0x,auf\n", 2),
        ('t_s,label\n"0,21",auf\n', 2),
        ("t_s,label\nnan,auf\n", 2),
        ("t_s,what,comment\n1,auf,late\n", 1),
        ("start;label\n1;auf\n", 1),
        ("# my labels\nlabel,t_us\n", 1),
        ("t_s;label\n1\n", 2),
    ],
)
def test_a_table_of_another_program_without_times_or_labels_is_refused(tmp_path: Path, text: str, line: int) -> None:
    place = tmp_path / "labels.csv"
    place.write_text(text)
    with refused(taxel.FormatError, place=Place("labels.csv", line=line)):
        taxel.Labels(place)


def test_a_table_of_another_program_is_no_recording_of_its_folder(tmp_path: Path) -> None:
    made = record(tmp_path / "walk.mcap", 0, 1.0)
    (tmp_path / "Ereignisse.csv").write_text("t_s;label\n0,21;auf\n")
    assert is_label_table(tmp_path / "Ereignisse.csv")
    assert [each.path for each in taxel.open_all(tmp_path)] == [made.path]
    (tmp_path / "walk.notes.csv").write_text("t_s;label\n0,21;auf\n")
    assert [(note.text, note.t) for note in taxel.open(made.path).notes] == [("auf", 210_000)]
    # Numbers of two channels are one.
    (tmp_path / "two.csv").write_text("time,marker\n0.21,0\n")
    assert not is_label_table(tmp_path / "two.csv")
