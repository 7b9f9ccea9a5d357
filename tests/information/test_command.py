"""`taxel information`, as a lab would use it."""

import json

import numpy as np
import pytest
import shell

import taxel
from taxel.information import read_trials
from taxel.labels import Note, beside, text_with

from .touches import GOOD, folder, ordered

pytestmark = pytest.mark.usefixtures("undrawn")

COARSE = ["--draws", "1", "--shuffles", "3", "--taxels", "1"]
QUICK = ["--window-ms", "60", "--periods", "1,10", "--windows", "10", *COARSE]


def run(*arguments):
    return shell.run("information", *arguments)


@pytest.mark.usefixtures("drawn")
def test_a_recording_and_its_table_give_figures_and_a_page(tmp_path):
    recording, labels = folder(tmp_path, 60)
    page = tmp_path / "page.html"
    done = run(recording, "--labels", labels, *QUICK, "--report", page)
    assert done.returncode == 0, done.stderr
    said = done.stdout
    assert "60 trials, 2 labels x" in said
    assert "full: 1 ms, 2 taxels, to 60 ms: 1.00 of 1.00 bits" in said
    assert said.splitlines()[4].startswith("in brackets: the range of the bits in 95 % of new draws of these trials")
    assert "<- cheapest" in said
    assert "10 ms " in said
    assert "wire version" in said
    text = page.read_text()
    assert text.count('<div class="picture"><svg') == 1
    assert "keeps 95 % of the full bits?" in text
    assert "{{" not in text
    again = run(recording, "--labels", labels, *QUICK, "--report", page)
    assert "exists already" in again.stderr
    assert page.read_text() == text


def test_a_page_is_written_only_where_it_is_asked_for(tmp_path, monkeypatch):
    recording, labels = folder(tmp_path, 24)
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    done = run(recording, "--labels", labels, *QUICK)
    assert done.returncode == 0, done.stderr
    assert sorted(tmp_path.rglob("*")) == before


def note(recording, labels):
    """Write notes (label, us) beside a recording."""
    beside(recording).write_text(text_with([Note(label, t, 0) for label, t in labels]))


def test_notes_are_trials_as_rows_of_a_table_are(tmp_path):
    recording, labels = folder(tmp_path, 24)
    rows = [line.split(",")[1:] for line in labels.read_text().splitlines()[1:]]
    asked = [*QUICK, "--json"]
    expected = json.loads(run(recording, "--labels", labels, *asked).stdout)
    done = run(recording, "--labels", "notes", *asked)
    assert done.returncode == 2
    assert f"{recording}: has no notes; leave it out, or give a table of trials" in done.stderr
    note(recording, [(label, int(t)) for t, label in rows])
    assert json.loads(run(recording, "--labels", "notes", *asked).stdout) == expected
    done = run(recording, "--labels", "notes")
    assert "--window-ms: must say how long the trials are that notes begin" in done.stderr
    note(recording, [("left first", int(rows[0][0])), ("right first", int(rows[0][0]) + 100)])
    done = run(recording, "--labels", "notes", *asked)
    assert f"note at {int(rows[0][0]) + 100} us begins 0.1 ms after note at {rows[0][0]} us" in done.stderr
    note(recording, [("left first", 10**12), ("right first", 100_000)])
    assert "is outside touches.npz" in run(recording, "--labels", "notes", *asked).stderr


def test_without_labels_a_recording_is_a_trial_and_its_folder_the_label(tmp_path):
    events, rows = ordered(24)
    for k, (start, label) in enumerate(rows):
        place = tmp_path / label.replace(" ", "-")
        place.mkdir(exist_ok=True)
        taxel.convert(events.between(start, start + 200_000), place / f"{k}.npz")
    recordings = sorted(tmp_path.glob("*/*.npz"))
    done = run(*recordings, *QUICK, "--folds", 4, "--json")
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert set(said["labels"]) == {"left-first", "right-first"}
    assert said["full"]["bits"] > 0.8


def test_fewer_groups_than_folds_are_the_folds(tmp_path):
    events, _ = ordered(24)
    taxel.convert(events, tmp_path / "touches.npz")
    (tmp_path / "labels.csv").write_text(GOOD)
    few = ("--draws", 1, "--shuffles", 1, "--taxels", 1, "--periods", 5, "--folds", 30)
    assert run(tmp_path / "touches.npz", "--labels", tmp_path / "labels.csv", *few).returncode == 0


def test_groups_are_read_and_other_columns_are_not(tmp_path):
    events, _ = ordered(4)
    taxel.convert(events, tmp_path / "touches.npz")
    (tmp_path / "labels.csv").write_text(
        "label,radius,recording,t_us,group,stop_us\nball,25,touches.npz,100000,monday,200000\n"
        "edge,35,touches.npz,500000,tuesday,\n"
    )
    trials = read_trials(tmp_path / "labels.csv", [taxel.open(tmp_path / "touches.npz")], window_ms=50)
    assert [(t.label, t.start_us, t.stop_us, t.group) for t in trials] == [
        ("ball", 100_000, 200_000, "monday"),
        ("edge", 500_000, None, "tuesday"),
    ]
    assert np.array_equal(trials[0].source.t, events.t)


def test_numbered_frames_are_refused_until_a_rate_is_given(tmp_path):
    rng = np.random.default_rng(4)
    (tmp_path / "hand").mkdir()
    (tmp_path / "hand" / "layout.toml").write_text("rows = 2\ncolumns = 2\n")
    grasps = tmp_path / "hand" / "grasps.csv"
    pressed = np.repeat(np.arange(40) % 2, 10)[:, None] * rng.integers(20, 60, (400, 4))
    np.savetxt(grasps, pressed, fmt="%d", delimiter=",", header="a,b,c,d", comments="")
    recording = taxel.open(grasps)
    assert not recording.timed
    (tmp_path / "l.csv").write_text("t_us,label\n" + "".join(f"{200_000 * k},{'ab'[k % 2]}\n" for k in range(20)))
    for labels in (("--labels", tmp_path / "l.csv"), ("--labels", "notes"), ()):
        refused = run(grasps, *labels, *QUICK)
        assert refused.returncode == 2
        assert "rate_hz" in refused.stderr
    (tmp_path / "hand" / "layout.toml").write_text("rows = 2\ncolumns = 2\nrate_hz = 100\n")
    given = ("--labels", tmp_path / "l.csv", "--window-ms", 100, "--periods", 10, "--windows", 50, "--folds", 2)
    done = run(grasps, *given, *COARSE)
    assert done.returncode == 0, done.stderr
    assert "20 trials" in done.stdout
