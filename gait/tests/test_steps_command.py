"""``taxel steps`` as a user calls it: what is written, what is read again, and what is refused in one line."""

import csv
import json

import numpy as np
import pytest
from panel.protocol import Client
from walking import STEP, STRIDE, contacts, two_feet, write

import taxel
from taxel.cli import main
from taxel.labels import rows_of, text_with
from taxel.panel import Panel

TABLES = ("steps.csv", "summary.csv", "symmetry.csv", "curves.csv", "report.html")


def run(*words):
    """Return the exit code of a command."""
    try:
        main(["steps", *map(str, words)])
    except SystemExit as ended:
        return ended.code
    return 0


def table(path, separator=","):
    lines = path.read_text().splitlines()
    about = [line for line in lines if line.startswith("#")]
    return about, list(csv.DictReader(lines[len(about) :], delimiter=separator))


@pytest.fixture
def walk(tmp_path):
    return write(tmp_path / "GaCo01_01.txt", *two_feet())


def test_a_walk_gives_tables_a_page_and_labels(walk, tmp_path, capsys):
    assert run(walk, "-o", tmp_path / "out") == 0
    assert {file.name for file in (tmp_path / "out").iterdir()} == {*TABLES, "GaCo01_01.steps.csv"}
    about, rows = table(tmp_path / "out" / "steps.csv")
    assert "# contact at 5 %, lift below 2.5 % of the way" in "\n".join(about)
    assert len(rows) == 78
    assert {float(row["stride_s"]) for row in rows if row["used"] == "yes"} == {STRIDE}
    _, summed = table(tmp_path / "out" / "summary.csv")
    stride = next(row for row in summed if row["measure"] == "stride_s" and row["foot"] == "left")
    own = [float(row["stride_s"]) for row in rows if row["used"] == "yes" and row["foot"] == "left"]
    assert float(stride["mean"]) == pytest.approx(np.mean(own))
    assert int(stride["n"]) == len(own)
    _, points = table(tmp_path / "out" / "curves.csv")
    assert [int(row["stance_pct"]) for row in points] == [*range(101), *range(101)]
    assert "78 steps" in capsys.readouterr().out


def test_what_is_empty_names_the_recordings_and_curves_name_their_load(tmp_path):
    t, left, right = two_feet()
    write(tmp_path / "GaCo01_01.txt", t, left, right)
    grid = np.stack([left, left], 1)[:, None] / np.array([10.0, 5.0])
    frames = taxel.Frames(grid, (1e6 * t).astype(np.int64), unit="kPa", array=taxel.Array(1, 2, pitch_mm=10.0))
    taxel.convert(frames, tmp_path / "grid.npz")
    assert run(tmp_path, "-o", tmp_path / "out") == 0
    about, _ = table(tmp_path / "out" / "steps.csv")
    assert "# empty: step_s: needs both feet, of grid" in about
    assert "# empty: contact_area_cm2: the area of a taxel is not known, of GaCo01_01" in about
    assert "# empty: cpei_pct: is measured on footprints of a plate" in about
    _, points = table(tmp_path / "out" / "curves.csv")
    assert {row["load"] for row in points} == {"force_N"}


def test_a_table_that_a_row_names_is_measured_beside_files_of_a_maker(tmp_path):
    t, left, right = two_feet()
    write(tmp_path / "GaCo01_01.txt", t, left, right)
    np.savetxt(tmp_path / "plain.csv", np.stack([t, left], 1), "%.4f", ",", header="time_s,N", comments="")
    (tmp_path / "recordings.csv").write_text("recording,person\nGaCo01_01,anna\nplain.csv,bo\n")
    assert run(tmp_path, "-o", tmp_path / "out") == 0
    _, rows = table(tmp_path / "out" / "steps.csv")
    assert {(row["recording"], row["person"]) for row in rows} == {("GaCo01_01", "anna"), ("plain", "bo")}


def test_without_a_folder_the_labels_are_beside_the_recording(walk, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run(walk) == 0
    assert (tmp_path / "GaCo01_01.steps.csv").exists()
    assert (tmp_path / "taxel-steps" / "steps.csv").exists()
    # They are no truth of the recording until they are named.
    assert not any(note.text == "lift" for note in taxel.open(walk).sources["left"].notes)


def test_decimal_commas(walk, tmp_path):
    run(walk, "-o", tmp_path / "out", "--decimal-comma")
    _, rows = table(tmp_path / "out" / "steps.csv", ";")
    assert rows[10]["contact_s"].count(",") == 1


def test_what_is_taken_out_or_moved_stays_so(walk, tmp_path):
    out = tmp_path / "out"
    run(walk, "-o", out)
    labels = out / "GaCo01_01.steps.csv"
    notes, columns = rows_of(labels, labels.read_text().splitlines())
    contacts_left = [note for note in notes if note.text == "contact" and note.source == "left"]
    gone, moved = contacts_left[9].t, contacts_left[20].t
    edited = [note for note in notes if not (note.source == "left" and gone <= note.t < gone + 900_000)]
    edited = [
        taxel.Note(n.text, n.t + 30_000, source=n.source, others=n.others) if n.t == moved and n.source == "left" else n
        for n in edited
    ]
    labels.write_text(text_with(edited, columns))
    for _ in range(3):
        run(walk, "-o", out, "--overwrite")
        _, rows = table(out / "steps.csv")
        left = [row for row in rows if row["foot"] == "left"]
        assert [row["step"] for row in left if row["used"] == "by hand"] == ["10"]
        assert float(left[20]["contact_s"]) == pytest.approx((moved + 30_000) / 1e6)


def test_what_the_page_takes_out_stays_out(walk, tmp_path):
    run(walk, "-o", tmp_path)
    with Panel(walk, labels="steps") as panel, Client(panel) as page:
        assert page.ask("open", name=walk.name)["type"] == "done"
        contacts_right = [row for row in page.labels() if (row["label"], row["source"]) == ("contact", "right")]
        assert page.remove(contacts_right[3])["type"] == "done"
    run(walk, "-o", tmp_path, "--overwrite")
    _, rows = table(tmp_path / "steps.csv")
    assert [(row["foot"], row["step"]) for row in rows if row["used"] == "by hand"] == [("right", "4")]


def test_a_cohort_by_names_with_weights_and_conditions(tmp_path):
    for person in ("GaCo01", "GaCo11"):
        for k in (1, 2):
            write(tmp_path / f"{person}_0{k}.txt", *two_feet(20.0))
    (tmp_path / "people.csv").write_text("person,weight_kg\nGaCo01,80\nGaCo11,\n")
    assert run(tmp_path, "-o", tmp_path / "out") == 0
    _, rows = table(tmp_path / "out" / "steps.csv")
    assert {(row["recording"], row["person"]) for row in rows} == {
        (f"{person}_0{k}", person) for person in ("GaCo01", "GaCo11") for k in (1, 2)
    }
    weights = {row["person"] for row in rows if row["max_force_pct_weight"]}
    assert weights == {"GaCo01"}
    (tmp_path / "recordings.csv").write_text("recording;person;condition\nGaCo01_01;GaCo01;slow\nGaCo01_02;GaCo01;fast")
    assert run(tmp_path, "-o", tmp_path / "two") == 2  # GaCo11's are named as left out
    _, summed = table(tmp_path / "two" / "summary.csv")
    assert {row["condition"] for row in summed} == {"slow", "fast"}


def test_a_folder_for_each_person(tmp_path):
    for person in ("anna", "bo"):
        (tmp_path / person).mkdir()
        write(tmp_path / person / "GaCo01_01.txt", *two_feet(20.0))
    assert run(tmp_path, "-o", tmp_path / "out") == 0
    _, rows = table(tmp_path / "out" / "steps.csv")
    assert {row["person"] for row in rows} == {"anna", "bo"}
    assert (tmp_path / "out" / "anna" / "GaCo01_01.steps.csv").exists()


def test_a_recording_that_fails_is_named_and_the_others_are_measured(tmp_path, capsys):
    write(tmp_path / "GaCo01_01.txt", *two_feet(20.0))
    (tmp_path / "GaCo02_01.txt").write_text("no numbers\n")
    (tmp_path / "people.csv").write_text("person\nGaCo01\nGaCo02\nGaCo03\n")
    assert run(tmp_path, "-o", tmp_path / "out") == 2
    said = capsys.readouterr().err.splitlines()
    assert any("GaCo02_01" in line for line in said)
    assert any("GaCo03" in line for line in said)
    about, _ = table(tmp_path / "out" / "steps.csv")
    assert sum(line.startswith("# not measured") for line in about) == 2


def test_a_run_that_was_stopped_goes_on(tmp_path, monkeypatch):
    for k in (1, 2, 3):
        write(tmp_path / f"GaCo0{k}_01.txt", *two_feet(20.0))
    (tmp_path / "people.csv").write_text("person\nGaCo01\nGaCo02\nGaCo03\n")
    from taxel_gait import command

    calls, whole = [], command.measure

    def stopped(entry, *rest):
        calls.append(entry.name)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return whole(entry, *rest)

    monkeypatch.setattr(command, "measure", stopped)
    assert run(tmp_path, "-o", tmp_path / "out") == 130
    assert not (tmp_path / "out" / "steps.csv").exists()
    assert run(tmp_path, "-o", tmp_path / "out") == 0
    assert calls == ["GaCo01_01", "GaCo02_01", "GaCo03_01", "GaCo03_01"]
    assert not (tmp_path / "out" / ".parts").exists()


def test_results_do_not_depend_on_the_number_of_processes(tmp_path):
    for k in (1, 2):
        write(tmp_path / f"GaCo0{k}_01.txt", *two_feet(20.0))
    run(tmp_path, "-o", tmp_path / "a")
    run(tmp_path, "-o", tmp_path / "b", "--jobs", 2)
    for name in TABLES:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def one_foot(path, starts):
    t, left, _ = two_feet(20.0, left=starts)
    frames = taxel.Frames(np.stack([left, left], 1)[:, None], np.rint(1e6 * t).astype(np.int64), unit="N")
    taxel.convert(frames, path)
    return path


def test_two_files_of_one_walk_need_a_common_clock(tmp_path, capsys):
    left = one_foot(tmp_path / "left.npz", contacts(0.5, 18))
    right = one_foot(tmp_path / "right.npz", contacts(1.0, 18))
    assert run(left, right, "-o", tmp_path / "no") == 2
    assert "--same-clock" in capsys.readouterr().err
    assert run(left, right, "--same-clock", "-o", tmp_path / "out", "--json") == 0
    assert json.loads(capsys.readouterr().out)["used"]["yes"] > 20
    _, rows = table(tmp_path / "out" / "steps.csv")
    assert {float(row["step_s"]) for row in rows if row["used"] == "yes"} == {STEP}
    assert {file.name for file in (tmp_path / "out").glob("*.steps.csv")} == {"left.steps.csv", "right.steps.csv"}


def test_both_feet_of_a_walk_in_a_cohort(tmp_path):
    one_foot(tmp_path / "L1.npz", contacts(0.5, 18))
    one_foot(tmp_path / "R1.npz", contacts(1.0, 18))
    one_foot(tmp_path / "L2.npz", contacts(0.5, 18))
    rows = ["recording,person,foot,walk", "L1,anna,left,first", "R1,anna,right,first", "L2,anna,left,"]
    (tmp_path / "recordings.csv").write_text("\n".join(rows))
    assert run(tmp_path, "--same-clock", "-o", tmp_path / "out") == 0
    _, table_of = table(tmp_path / "out" / "steps.csv")
    assert {row["step_s"] for row in table_of if row["used"] == "yes" and row["recording"] == "first"} == {"0.5"}
    assert {(row["foot"], row["step_s"]) for row in table_of if row["recording"] == "L2"} == {("left", "")}
    (tmp_path / "recordings.csv").write_text("\n".join([*rows[:2], "R1,bo,right,first"]))
    assert run(tmp_path, "--same-clock", "-o", tmp_path / "no") == 2


def test_one_foot_alone_says_why_cells_are_empty(tmp_path):
    run(one_foot(tmp_path / "left.npz", contacts(0.5, 18)), "--side", "left", "-o", tmp_path / "out")
    about, rows = table(tmp_path / "out" / "steps.csv")
    assert "# empty: step_s: needs both feet" in about
    assert {row["step_s"] for row in rows} == {""}
    assert {row["foot"] for row in rows} == {"left"}


def test_a_plate_is_no_insole(tmp_path, capsys):
    values = 40 + 700 * np.sin(np.pi * np.arange(60) / 66)[:, None, None] * np.ones((1, 4, 4))
    taxel.convert(taxel.Frames(values, np.arange(60) * 10_000, unit="N"), tmp_path / "plate.npz")
    run(tmp_path / "plate.npz", "-o", tmp_path / "out")
    assert "taxel footprint" in capsys.readouterr().err


def test_running_is_said_to_be_untried(tmp_path, capsys):
    # Each foot is on the ground for 0.6 of 1.6 s: there is no double support.
    t, left, right = two_feet(60.0, left=contacts(0.5, 30, 1.6), right=contacts(1.3, 30, 1.6))
    run(write(tmp_path / "GaCo01_01.txt", t, left, right), "-o", tmp_path / "out")
    assert "running was not tried" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "files"),
    [
        (["--definition", "percent:5"], {}),
        (["--side", "both"], {}),
        (["--definition", "percent:5,3", "--readout", "a.json"], {}),
        (["gone"], {}),
        (["--readout", "gone.json"], {}),
        ([], {"people.csv": "name\nx\n"}),
        ([], {"people.csv": "person,weight_kg\nGaCo01,heavy\n"}),
        ([], {"people.csv": "person\nNobody\n"}),
        ([], {"recordings.csv": "recording,person\nnone,x\n"}),
        ([], {"people.csv": "person\nGaCo01\n", "recordings.csv": "recording,person\nGaCo01_01,Bo\n"}),
    ],
)
def test_what_cannot_be_is_one_line(walk, tmp_path, capsys, words, files):
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    assert run(tmp_path, *words, "-o", tmp_path / "out") == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "out" / "steps.csv").exists()


def test_a_load_that_is_not_known_in_n_has_no_definition_in_n(tmp_path, capsys):
    t, left, _ = two_feet(20.0)
    taxel.convert(taxel.Frames(left[:, None, None], np.rint(1e6 * t).astype(np.int64), unit="raw"), tmp_path / "a.npz")
    assert run(tmp_path / "a.npz", "--definition", "newton:50,25", "-o", tmp_path / "out") == 2
    assert "newton:50,25" in capsys.readouterr().err


def test_tables_that_are_there_are_not_replaced_unasked(walk, tmp_path, capsys):
    run(walk, "-o", tmp_path / "out")
    before = (tmp_path / "out" / "steps.csv").read_bytes()
    capsys.readouterr()
    assert run(walk, "-o", tmp_path / "out", "--definition", "newton:50,25") != 0
    assert (tmp_path / "out" / "steps.csv").read_bytes() == before
