"""Recordings of frames in the panel: all that taxel opens, at their rate, in their unit, as a client sees them."""

from __future__ import annotations

import numpy as np
import pytest
from formats.making import write_icub, write_pedar
from panel.protocol import (
    UNKNOWN,
    Client,
    head,
    held_in,
    opened,
    section,
    values_at,
)

import taxel
from taxel import Array, Frames
from taxel.options import FullReading
from taxel.panel import Panel
from taxel.reading import Facts, InMemory
from taxel.recording.analysis.pressure import above_rest
from taxel.recording.analysis.rest import ticks_by_unit


def frames_of(fractions=True):
    draw = np.random.default_rng(5)
    values = draw.random((300, 4, 3)) * 90 * (draw.random((300, 4, 3)) > 0.4)
    values[40:50, 1, 1] = np.nan if fractions else 0
    values = values if fractions else np.floor(values)
    return Frames(values, np.arange(300) * 10_000 + 7, unit="kPa", array=Array(4, 3, name="mat"))


@pytest.mark.parametrize("ending", [".mcap", ".npz", ".h5", ".csv"])
def test_a_frame_of_any_kind_of_file_is_shown_in_its_unit(tmp_path, ending):
    frames, file = frames_of(ending != ".csv"), tmp_path / f"mat{ending}"
    taxel.convert(frames, file)
    with Panel(file) as panel, Client(panel) as page:
        about = opened(page, file.name)
        of = about["frames"]
        assert (of["count"], of["unit"], of["number_us"]) == (300, "counts" if ending == ".csv" else "kPa", None)
        assert (about["start_us"], about["stop_us"]) == (7, 2_990_007)
        assert of["step"] == 1 if ending == ".csv" else 0 < of["step"] < 0.002
        for k in (0, 3, 45, 299):
            values, frame = values_at(page, about, int(frames.t[k]))
            assert np.allclose(
                values, frames.values[k], atol=0.51 * of["step"] if of["step"] != 1 else 0, equal_nan=True
            )
            assert head(frame)[0]["events"] == k + 1
        # Between two frames the earlier one is shown; a step goes to the next.
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


def test_both_feet_stand_side_by_side(tmp_path):
    file = write_pedar(tmp_path)
    [both] = FullReading().open_trials(file)
    left, right = (both.sources[foot].frames() for foot in ("left", "right"))
    columns = left.array.columns
    with Panel(file) as panel, Client(panel) as page:
        about = opened(page, file.name)
        places = about["frames"]["sources"]
        assert [(one["name"], one["left"]) for one in places] == [("left", 0), ("right", columns + 1)]
        assert about["array"]["exists"] == "1" * columns + "0" + "1" * right.array.columns
        values, _ = values_at(page, about, int(left.t[30]))
        assert np.allclose(values[0, :columns], left.values[30, 0], atol=about["frames"]["step"])
        assert np.isnan(values[0, columns])
        assert np.allclose(values[0, columns + 1 :], right.values[30, 0], atol=about["frames"]["step"])
        # A label with a source is of that foot, one without of both.
        assert page.mark("heel", 50_000, source="left")["type"] == "done"
        assert page.mark("turn", 90_000)["type"] == "done"
        assert page.ask("cut", start_us=0, stop_us=100_000, name="cut.mcap")["type"] == "done"
    assert (tmp_path / "walk.notes.csv").read_text() == "label,t_us,source\nheel,50000,left\nturn,90000,\n"
    again = taxel.open(file).sources.values()
    assert [[note.text for note in one.notes] for one in again] == [["heel", "turn"], ["turn"]]
    part = taxel.open(tmp_path / "cut.mcap")
    assert part.sources["right"].frames() == right.between(0, 100_000)


def test_frames_without_times_are_numbered(tmp_path):
    frames = Frames(np.arange(12.0).reshape(4, 1, 3), np.arange(4), array=Array(1, 3))
    facts = Facts(path=tmp_path / "grasp.csv", array=frames.array, kind="icub", timed=False)
    taxel.convert(taxel.Recording.of(InMemory(facts, frames)), tmp_path / "grasp.npz")
    with Panel(tmp_path / "grasp.npz") as panel, Client(panel) as page:
        about = opened(page, "grasp.npz")
        us = about["frames"]["number_us"]
        assert (about["start_us"], about["stop_us"]) == (0, 3 * us)
        values, _ = values_at(page, about, 2 * us)
        assert np.array_equal(values[0], [6, 7, 8])
        assert page.mark("slip", 2 * us + 5)["type"] == "done"
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
        assert (about["frames"]["trial"], about["frames"]["trials"]) == ("ball/1", ["ball/1", "ball/2"])
        about = opened(page, file.name, trial="ball/2")
        assert (about["frames"]["trial"], about["frames"]["count"]) == ("ball/2", 2)
        values, _ = values_at(page, about, 0)
        assert np.array_equal(values, np.full((5, 12), 55))
        assert page.ask("open", name=file.name, trial="ball/9")["type"] == "refused"
        assert page.mark("slip", 0)["type"] == "done"
    assert (tmp_path / "ball.csv.notes.csv").read_text() == "label,t_us,recording\nslip,0,ball/2\n"
    assert [[note.text for note in one.notes] for one in taxel.open_all(file)] == [[], ["slip"]]


def test_what_is_no_recording_is_refused_at_once(tmp_path):
    (tmp_path / "notes.txt").write_text("bread, milk\n")
    with pytest.raises(taxel.FormatError, match="contains no table of numbers"):
        Panel(tmp_path / "notes.txt")
    (tmp_path / "empty").mkdir()
    with pytest.raises(taxel.ProblemError, match="contains no recording"):
        Panel(tmp_path / "empty")


def above_rest_of(page, about, t_us):
    """Return what the client draws above rest at a time, in the unit of the file."""
    _, frame = values_at(page, about, t_us)
    held = section(frame, 0, "<u2").astype(int)
    rests = [one for one in (section(shown, 5, "<u2") for shown in page.frames) if len(one)]
    above = np.where((held == UNKNOWN) | (rests[-1] == UNKNOWN), 0, held - rests[-1].astype(int))
    above[above <= about["frames"]["floor"]] = 0
    return above * about["frames"]["step"]


def test_frames_of_unknown_unit_are_above_the_rest_of_a_quiet_stretch_as_info_has_it(tmp_path):
    rng, t = np.random.default_rng(8), np.arange(400) * 10_000
    values = 60 + rng.normal(0, 0.1, (400, 6, 6)) + np.arange(400)[:, None, None] * 0.01
    values[200:260, 1:4, 1:4] += 70
    taxel.convert(Frames(values, t, unit="raw", array=Array(6, 6)), tmp_path / "mat.npz")
    recording = taxel.open(tmp_path / "mat.npz")
    over, floor, rest = above_rest(recording)
    assert rest.source == "quiet"
    with Panel(tmp_path / "mat.npz") as panel, Client(panel) as page:
        about = opened(page, "mat.npz")
        assert [one["rest"] for one in about["frames"]["sources"]] == ["quiet"]
        for k in (30, 150, 210, 255, 399):
            expected = np.where(over.values[k] >= floor, over.values[k], 0)
            shown = above_rest_of(page, about, int(t[k])).reshape(6, 6)
            # The rest of the page is that of a frame not long before, half a tick from it at most.
            assert shown == pytest.approx(expected, abs=0.6 / ticks_by_unit(recording.frames()) + 2e-3)
            assert head(page.frames[-1])[0]["flags"] & 96 == 64
        force, _ = max_and_column(page, about)
        assert force == pytest.approx(np.where(over.values >= floor, over.values, 0).sum(axis=(1, 2)).max(), rel=0.02)


def max_and_column(page, about):
    """Return the greatest sum of the overview, in the unit of the file, and its column."""
    page.send(type="overview")
    force = page.until("overview")["force"]
    return max(force) * about["frames"]["step"], int(np.argmax(force))


@pytest.mark.parametrize("column", [False, True])
def test_channels_have_a_curve_each(tmp_path, column):
    draw = np.random.default_rng(9)
    values = draw.uniform(0, 90, (2000, 1, 7)).round()
    values[400:800] = values[399]
    shape = (7, 1) if column else (1, 7)
    frames = Frames(values.reshape(-1, *shape), np.arange(2000) * 10_000, unit="N", array=Array(*shape))
    taxel.convert(frames, tmp_path / "insole.npz")
    with Panel(tmp_path / "insole.npz") as panel, Client(panel) as page:
        about = opened(page, "insole.npz")
        for t_us, column_us in ((3_000_000, 4_000), (7_000_000, 4_000), (15_000_000, 16_000), (15_004_000, 1_000)):
            assert page.ask("zoom", column_us=column_us)["type"] == "done"
            _, frame = values_at(page, about, t_us)
            while head(frame)[0]["column_us"] != column_us:
                frame = page.until("frame")
            of = head(frame)[0]
            curves = section(frame, 7, "<u2").reshape(-1, 7, 2)
            assert len(curves) == of["count"] > 100
            for number, curve in enumerate(curves, of["first"]):
                held = values[held_in(frames.t, number, column_us, t_us), 0]
                expected = np.stack([held.min(axis=0), held.max(axis=0)], axis=1)
                np.testing.assert_array_equal(curve * about["frames"]["step"], expected)
