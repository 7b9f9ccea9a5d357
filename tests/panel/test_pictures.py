"""Recordings of pictures in the panel: all that taxel opens, at their rate, in their unit, as a client sees them."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from formats.making import write_gaitpdb, write_icub, write_pedar, write_tekscan
from panel.protocol import Client, head, section

import taxel
from taxel import Array, Frames
from taxel.live import Panel
from taxel.live import _shown_files as shown_files
from taxel.recording.opening import open_joined

UNKNOWN = 65_535


def opened(page, name, **more):
    """Open a recording; return what the server said of it, and the picture shown at a time."""
    assert page.ask("open", name=name, **more)["type"] == "done"
    return page.since_asked("opened", name=name)


def values_at(page, about, t_us):
    """Return the values that the client draws at a time, in the unit of the file; NaN where one is missing."""
    assert page.ask("seek", t_us=t_us)["type"] == "done"
    page.send(type="credit", n=2)
    while True:
        picture = page.until("picture")
        found = head(picture)[0]
        if found["t_us"] == t_us:
            break
    ticks = section(picture, 0, "<u2").reshape(found["rows"], found["columns"]).astype(float)
    ticks[ticks == UNKNOWN] = np.nan
    of = about["pictures"]
    return (ticks - of["zero"]) * of["step"], picture


def frames_of(fractions=True):
    draw = np.random.default_rng(5)
    values = draw.random((300, 4, 3)) * 90 * (draw.random((300, 4, 3)) > 0.4)
    values[40:50, 1, 1] = np.nan if fractions else 0
    values = values if fractions else np.floor(values)
    return Frames(values, np.arange(300) * 10_000 + 7, unit="kPa", array=Array(4, 3, name="mat"))


@pytest.mark.parametrize("ending", [".mcap", ".npz", ".h5", ".csv"])
def test_a_picture_of_any_kind_of_file_is_shown_in_its_unit(tmp_path, ending):
    frames, file = frames_of(ending != ".csv"), tmp_path / f"mat{ending}"
    taxel.convert(frames, file)
    with Panel(file) as panel, Client(panel) as page:
        about = opened(page, file.name)
        of = about["pictures"]
        assert (of["count"], of["unit"], of["picture_us"]) == (300, "counts" if ending == ".csv" else "kPa", None)
        assert (about["start_us"], about["stop_us"]) == (7, 2_990_007)
        assert of["step"] == 1 if ending == ".csv" else 0 < of["step"] < 0.002
        for k in (0, 3, 45, 299):
            values, picture = values_at(page, about, int(frames.t[k]))
            assert np.allclose(
                values, frames.values[k], atol=0.51 * of["step"] if of["step"] != 1 else 0, equal_nan=True
            )
            assert head(picture)[0]["events"] == k + 1
        # Between two pictures the earlier one is shown; a step goes to the next.
        values, _ = values_at(page, about, 15_000)
        assert np.allclose(values, frames.values[1], atol=of["step"])
        assert page.ask("step", frames=1)["type"] == "done"
        assert page.since_asked("transport", state="paused")["t_us"] == 20_007
        page.send(type="overview")
        overview = page.until("overview")
        assert overview["events"] == []
        assert max(overview["force"]) * of["step"] == pytest.approx(
            np.nansum(frames.values, axis=(1, 2)).max(), rel=1e-3
        )
        assert page.ask("encode", encoder={"name": "fa1"})["type"] == "refused"


def test_both_feet_stand_side_by_side(tmp_path):
    file = write_pedar(tmp_path)
    [both] = open_joined(file)
    left, right = (both.sources[foot].frames() for foot in ("left", "right"))
    columns = left.array.columns
    with Panel(file) as panel, Client(panel) as page:
        about = opened(page, file.name)
        places = about["pictures"]["sources"]
        assert [(one["name"], one["left"]) for one in places] == [("left", 0), ("right", columns + 1)]
        assert about["array"]["exists"] == "1" * columns + "0" + "1" * right.array.columns
        values, _ = values_at(page, about, int(left.t[30]))
        assert np.allclose(values[0, :columns], left.values[30, 0], atol=about["pictures"]["step"])
        assert np.isnan(values[0, columns])
        assert np.allclose(values[0, columns + 1 :], right.values[30, 0], atol=about["pictures"]["step"])
        # A label with a source is of that foot, one without of both.
        assert page.ask("mark", label="heel", t_us=50_000, source="left")["type"] == "done"
        assert page.ask("mark", label="turn", t_us=90_000)["type"] == "done"
        assert page.ask("cut", start_us=0, stop_us=100_000, name="cut.mcap")["type"] == "done"
    assert (tmp_path / "walk.notes.csv").read_text() == "label,t_us,source\nheel,50000,left\nturn,90000,\n"
    again = taxel.open(file)
    said = [[note.text for note in one.notes if note.text in ("heel", "turn")] for one in again]
    assert said == [["heel", "turn"], ["turn"]]
    part = taxel.open(tmp_path / "cut.mcap")
    assert part.sources["right"].frames() == right.between(0, 100_000)


def test_pictures_without_times_are_numbered(tmp_path):
    frames = Frames(np.arange(12.0).reshape(4, 1, 3), np.arange(4), array=Array(1, 3))
    trial = taxel.open(write_icub(tmp_path))[0]._contents
    taxel.convert(taxel.Recording(trial.but(frames=frames, array=frames.array)), tmp_path / "grasp.npz")
    with Panel(tmp_path / "grasp.npz") as panel, Client(panel) as page:
        about = opened(page, "grasp.npz")
        us = about["pictures"]["picture_us"]
        assert (about["start_us"], about["stop_us"]) == (0, 3 * us)
        values, _ = values_at(page, about, 2 * us)
        assert np.array_equal(values[0], [6, 7, 8])
        assert page.ask("mark", label="slip", t_us=2 * us + 5)["type"] == "done"
        assert page.since_asked("labels")["labels"][0]["t_us"] == 2 * us
        assert page.ask("cut", start_us=us, stop_us=3 * us, name="part.npz")["type"] == "done"
    assert (tmp_path / "grasp.notes.csv").read_text() == "label,t_us\nslip,2\n"
    assert [note.t for note in taxel.open(tmp_path / "grasp.npz").notes if note.text == "slip"] == [2]
    part = taxel.open(tmp_path / "part.npz")
    assert not part.timed
    assert part.frames().t.tolist() == [1, 2]


def test_a_file_of_several_trials_shows_each(tmp_path):
    file = write_icub(tmp_path, trials={1: 242 - np.arange(180).reshape(3, 60) // 9, 2: np.full((2, 60), 200)})
    with Panel(file) as panel, Client(panel) as page:
        about = opened(page, file.name)
        assert (about["pictures"]["trial"], about["pictures"]["trials"]) == ("ball/1", ["ball/1", "ball/2"])
        about = opened(page, file.name, trial="ball/2")
        assert (about["pictures"]["trial"], about["pictures"]["count"]) == ("ball/2", 2)
        values, _ = values_at(page, about, 0)
        assert np.array_equal(values, np.full((5, 12), 55))
        assert page.ask("open", name=file.name, trial="ball/9")["type"] == "refused"
        answer = page.ask("mark", label="slip", t_us=0)
        assert "holds several trials" in answer["reason"]


def test_events_of_a_table_are_shown_as_those_of_a_board(tmp_path):
    events = taxel.Events([0, 30_000], [1, 2], [0, 0], [True, True], array=Array(1, 4), intensity=[10, 40])
    taxel.convert(events, tmp_path / "events.npz")
    with Panel(tmp_path / "events.npz") as panel, Client(panel) as page:
        about = opened(page, "events.npz")
        assert about["pictures"] is None
        assert about["events"] == 2
        temporary = panel._requests._files._folder.name
    assert not Path(temporary).exists()


def test_a_folder_opens_on_its_first_recording(tmp_path):
    for name in ("step10.npz", "step2.npz"):
        taxel.convert(frames_of(), tmp_path / name)
    (tmp_path / "labels.csv").write_text("recording,label,t_us\n")
    with Panel(tmp_path) as panel, Client(panel) as page:
        assert page.until("hello")["open"] == "step2.npz"
        assert sorted(file["name"] for file in page.until("recordings")["files"]) == ["step10.npz", "step2.npz"]


def test_a_large_table_is_shown_from_its_beginning_and_then_whole(tmp_path, monkeypatch):
    file = write_gaitpdb(tmp_path)
    monkeypatch.setattr(shown_files, "_LARGE", 1000)
    monkeypatch.setattr(shown_files, "_BEGINNING", file.stat().st_size // 3)
    reading = shown_files.ShownFiles.opened

    def slowly(self, path, trial):
        time.sleep(2.5)
        return reading(self, path, trial)

    monkeypatch.setattr(shown_files.ShownFiles, "opened", slowly)
    [whole] = open_joined(file)
    pictures = sum(len(one.frames()) for one in whole.sources.values())
    with Panel(file) as panel, Client(panel) as page:
        first = opened(page, file.name)
        assert 0 < first["pictures"]["count"] < pictures / 2
        assert first["pictures"]["left_s"] > 0
        share = page.until("loading", name=file.name)["share"]
        assert 0 < share < 1
        then = page.until("opened", name=file.name)
        assert (then["pictures"]["count"], then["pictures"]["left_s"]) == (pictures, None)
        assert page.until("transport")["t_us"] == first["start_us"]


def test_what_is_no_recording_is_refused_at_once(tmp_path):
    (tmp_path / "notes.txt").write_text("bread, milk\n")
    with pytest.raises(taxel.FormatError, match="no recording"):
        Panel(tmp_path / "notes.txt")
    (tmp_path / "empty").mkdir()
    with pytest.raises(taxel.ProblemError, match="holds no recording"):
        Panel(tmp_path / "empty")


def test_the_health_of_pictures_names_the_places_that_are_shown(tmp_path):
    file = write_tekscan(tmp_path)
    with Panel(file) as panel, Client(panel) as page:
        opened(page, file.name)
        assert page.ask("health")["type"] == "done"
        assert page.since_asked("health")["source"] == file.name
