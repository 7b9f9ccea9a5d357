"""Frames in a .mcap: to the last bit, by the official reader, of one sensor and of two feet; and without times."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from formats.making import write_icub, write_moticon, write_pedar
from shell import call

import taxel
from taxel import Array, Frames, Note, ProblemError, SpikeTrains
from taxel.detect import Example, Part, Recipe, judge
from taxel.detect.examples import frame_ms
from taxel.detect.folds import split
from taxel.encode import LevelCrossing
from taxel.reading import Facts, InMemory, Marks
from taxel.recording.frames import value_us
from taxel.tasks.labels import references

from .making import images


def bits(frames: Frames) -> np.ndarray:
    return frames.values.view(np.uint32)


def test_the_official_reader_decodes_every_frame(tmp_path: Path) -> None:
    cases = {
        "whole": ("16UC1", "<u2", [[0, 1, 2], [3, 65_535, 5]]),
        "gone": ("32FC1", "<f4", [[0, np.nan, 2.5], [3, 4, -5]]),
    }
    for name, (encoding, dtype, values) in cases.items():
        place, t = tmp_path / f"{name}.mcap", [-1_500_001, 7, 20_000_000]
        frames = Frames(np.array([values] * 3), t, unit="kPa", array=Array(2, 3, 5.0, name="mat"))
        taxel.convert(frames, place)
        found = images(place, "/frames/")
        assert [log for _, _, log, _ in found] == [0, 1_500_008_000, 21_500_001_000]
        for (topic, metadata, _, image), at in zip(found, t, strict=True):
            assert topic == "/frames/board"
            assert (metadata["unit"], metadata["source"], metadata["clock"]) == ("kPa", "board", "true")
            assert json.loads(metadata["array"])["columns"] == 3
            assert (image.width, image.height, image.encoding, image.step) == (
                3,
                2,
                encoding,
                3 * np.dtype(dtype).itemsize,
            )
            assert image.timestamp.seconds * 1_000_000 + image.timestamp.nanos // 1000 == at
            cells = np.frombuffer(image.data, dtype).reshape(2, 3)
            assert np.array_equal(cells, values, equal_nan=True)


def test_everything_beside_the_frames_is_kept(tmp_path: Path) -> None:
    array = Array(1, 2, name="channels")
    frames = Frames([[[1.0, 2.5]], [[3.0, 4.0]]], [0, 10_000], unit="N", array=array)
    marks = Marks(notes=(Note("heel", 5000), Note("bare")), detections=taxel.Detections(["lift"], [100], [200]))
    facts = Facts(
        path=tmp_path / "a",
        array=array,
        kind="npz",
        source="an amplifier",
        columns=("hip", "knee"),
        lost=("something",),
    )
    lost = taxel.convert(taxel.Recording.of(InMemory(facts, frames, marks)), tmp_path / "a.mcap")
    assert lost == ["something"]
    back = taxel.open(tmp_path / "a.mcap")
    assert back.frames() == frames
    assert [(note.text, note.t) for note in back.notes] == [("heel", 5000), ("bare", None)]
    assert (back.detections, back.columns, back.lost) == (marks.detections, ["hip", "knee"], ("something",))
    assert (back.source, back.verdict, back.remarks) == (
        "an amplifier",
        "losses unknown: the .npz does not record them",
        ("converted from a",),
    )
    assert not back.truncated


@pytest.mark.parametrize("make", [write_pedar, write_moticon])
def test_both_feet_of_a_file_become_sources_left_and_right(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], make: Callable[[Path], Path]
) -> None:
    file = make(tmp_path)
    trials = list(taxel.open(file).sources.values())
    assert [one.name.rsplit(" ")[-1] for one in trials] == ["left", "right"]
    assert call(capsys, "convert", file, tmp_path / "both.mcap")[0] == 0
    both = taxel.open(tmp_path / "both.mcap")
    assert list(both.sources) == ["left", "right"]
    with pytest.raises(ProblemError, match="contains 2 sources \\(left, right\\)"):
        both.frames()
    for one, label in zip(trials, ("left", "right"), strict=True):
        source = both.sources[label]
        assert source.frames() == one.frames()
        assert np.array_equal(bits(source.frames()), bits(one.frames()))
        assert [(note.text, note.t) for note in source.notes] == [(note.text, note.t) for note in one.notes]
        assert (source.name, source.title) == (f"both.mcap {label}", f"{tmp_path / 'both.mcap'} {label}")
        assert not source.truncated
    # The feet are interleaved by time in the file, and a cut of both is one of each.
    topics = [topic for topic, _, _, _ in images(tmp_path / "both.mcap", "/frames/")]
    assert set(topics) == {"/frames/left", "/frames/right"}
    stop = int(trials[0].frames().t[len(trials[0].frames()) // 2])
    [half] = taxel.cut(both, stop_us=stop)
    taxel.convert(half, tmp_path / "half.mcap")
    left = taxel.open(tmp_path / "half.mcap").sources["left"]
    assert left.frames() == trials[0].frames().between(-np.inf, stop)


def test_a_tare_in_which_something_lay_names_the_source(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    array, quiet = Array(6, 6), np.random.default_rng(4).integers(0, 3, (400, 6, 6)).astype(np.float32)
    pressed = quiet.copy()
    pressed[30:80, 1:4, 1:4] += 300
    feet = []
    for foot, values in (("left", quiet), ("right", pressed)):
        frames = Frames(values, np.arange(400) * 10_000, array=array)
        feet.append(InMemory(Facts(path=tmp_path / "a.asc", array=array, kind="pedar", label=foot), frames))
    taxel.convert(taxel.Recording.of(*feet), tmp_path / "a.mcap")
    code, _, errors = call(capsys, "info", tmp_path / "a.mcap", "--tare", "0.5")
    assert code == 0
    assert re.search(r"warning: tare is 0\.5: the beginning of .*a\.mcap right is not quiet but contains", errors)


def test_labels_are_of_one_source_or_of_all(tmp_path: Path) -> None:
    array = Array(1, 2)
    frames = Frames(np.ones((5, 1, 2)), np.arange(5) * 10_000, unit="N", array=array)
    feet = [
        InMemory(Facts(path=tmp_path / "walk.asc", array=array, kind="pedar", label=foot), frames)
        for foot in ("left", "right")
    ]
    taxel.convert(taxel.Recording.of(*feet), tmp_path / "walk.mcap")
    (tmp_path / "walk.notes.csv").write_text("label,t_us,source\nheel,10000,left\nturn,20000,\ntoe,30000,right\n")
    back = taxel.open(tmp_path / "walk.mcap")
    said = {name: [note.text for note in one.notes] for name, one in back.sources.items()}
    assert said == {"left": ["heel", "turn"], "right": ["turn", "toe"]}
    labels = taxel.Labels(tmp_path / "walk.notes.csv")
    assert sorted(labels.times(back.sources["right"])) == ["toe", "turn"]


def test_a_side_that_a_layout_states_names_the_source_of_labels(tmp_path: Path) -> None:
    np.savetxt(tmp_path / "P1.csv", np.column_stack([np.arange(50) / 100, np.ones((50, 2))]), delimiter=",")
    (tmp_path / "layout.toml").write_text(
        'rows = 1\ncolumns = 2\nunit = "N"\nside = "left"\n[table]\ntime_column = 1\ntime_unit = "s"\n'
    )
    rows = [("left", 10_000), ("right", 20_000), ("", 30_000), ("right", 40_000)]
    labels = tmp_path / "events.csv"
    labels.write_text("recording,source,label,t_us\n" + "".join(f"P1,{side},heel,{t}\n" for side, t in rows))
    with pytest.warns(UserWarning, match="left out 2 events of the right; the recording is of the left"):
        (events,) = references(labels, [taxel.open(tmp_path / "P1.csv")])
    assert events["heel"].tolist() == [10_000, 30_000]


# without times


def test_frames_without_times_say_so_everywhere(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = write_icub(tmp_path)
    file = file if file.is_file() else next(tmp_path.iterdir())
    opened = taxel.open_all(file)
    assert not any(one.timed for one in opened)
    assert call(capsys, "convert", file, tmp_path / "out")[0] == 0
    for ending in (".npz", ".h5", ".mcap"):
        taxel.convert(opened[0], tmp_path / f"one{ending}")
        assert not taxel.open(tmp_path / f"one{ending}").timed
    assert "that it has no times" in taxel.convert(opened[0], tmp_path / "one.csv")[-1]
    one = taxel.open(tmp_path / "one.mcap")
    assert images(tmp_path / "one.mcap", "/frames/")[0][1]["clock"] == "false"
    with pytest.raises(ProblemError, match="its frames have no times; give rate_hz"):
        LevelCrossing([100.0]).encode(one)
    with pytest.raises(ProblemError, match="their rate is unknown"):
        one.frames(50)
    code, said, _ = call(capsys, "info", tmp_path / "one.mcap")
    assert code == 0
    assert "the frames have only numbers" in said
    assert "at frame " in said
    assert " us" not in said
    assert " s)" not in said
    assert "frames/s" not in said
    timed = one.at_rate(40)
    assert timed.timed
    assert timed.frames().t.tolist() == [25_000 * k for k in range(len(one.frames()))]
    assert len(LevelCrossing([100.0]).encode(timed))
    with pytest.raises(ProblemError, match="the frames have times; a rate"):
        timed.at_rate(40)
    spikes = tmp_path / "spikes.npz"
    encode = ["encode", tmp_path / "one.mcap", spikes, "--encoder", "level_crossing", "--set", "levels=[100]"]
    assert "--rate-hz" in call(capsys, *encode)[2]
    assert call(capsys, "convert", tmp_path / "one.mcap", tmp_path / "timed.mcap", "--rate-hz", "40")[0] == 0
    encode[1] = tmp_path / "timed.mcap"
    assert call(capsys, *encode)[0] == 0


def test_the_feet_of_one_recording_share_a_fold() -> None:
    def example(group: str, shift: int) -> Example:
        times = [100_000 * k + shift for k in range(1, 9)]
        spikes = SpikeTrains.from_lists([[t / 1000 - 2 for t in times]], stop=1000.0)
        return Example(spikes, {"contact": times}, None, group)

    walks = [example(group, shift) for group in ("a", "b", "") for shift in (0, 30_000)]
    recipe = Recipe(LevelCrossing([1.0]), {"tau": 2.0, "ub": 2.0, "delay_ms": 1.0})
    found = judge(walks, recipe, 4)
    assert found.how == "whole recordings, 4 folds"
    with pytest.raises(ProblemError, match="must be at most 4, the number of recordings"):
        judge(walks, recipe, 5)
    for fold in split(walks, [Part(n) for n in range(6)], 4):
        train, test = ({walks[one.example].group for one in parts} - {""} for parts in (fold.train, fold.test))
        assert not train & test
    # The two feet of one walk: the same stretches of time of both.
    for fold in split(walks[:2], [Part(0), Part(1)], 3):
        assert len(fold.test) == 2
        assert fold.test[0][1:] == fold.test[1][1:]
        assert {one.example for one in fold.train} == {0, 1}


@pytest.mark.parametrize(("rows_hz", "values_hz"), [(39.0, 10.0), (100.0, 20.0), (100.0, 100.0)])
def test_the_rate_of_values_that_are_held_is_that_of_the_sensor(rows_hz: float, values_hz: float) -> None:
    t = np.rint(np.arange(600) * 1e6 / rows_hz).astype(np.int64)
    of_sensor = np.random.default_rng(1).integers(0, 900, (700, 1, 5))
    frames = Frames(of_sensor[np.floor(t / 1e6 * values_hz + 1e-6).astype(int)], t)
    assert 1e6 / value_us(frames) == pytest.approx(values_hz, rel=0.05)
    assert frame_ms(frames) == pytest.approx(1e3 / values_hz, rel=0.05)


def test_slow_changes_and_a_sensor_at_rest_are_not_held() -> None:
    ramp = np.floor(np.arange(600) / 7)[:, None, None]
    for values in (ramp, np.zeros((600, 1, 1)), ramp[:1], ramp[:0]):
        frames = Frames(values, 10_000 * np.arange(len(values)))
        assert value_us(frames) == (10_000 if len(values) > 1 else 0)
