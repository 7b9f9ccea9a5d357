"""Frames, streams of numbers, several sources and bags, cut, merged, converted and put on a clock at random.

What each should hold is reckoned beside it, array by array.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
from draws import seeds
from formats import bags
from numpy.typing import NDArray

import taxel
from taxel import Array, Frames, Note, _core
from taxel.recording.contents import Contents, FrameSource, RecordedSource, alone, source_from
from taxel.recording.once import known
from taxel.recording.sections import Losses, Marks, Origin, Sensor

#: The kinds of files that hold frames.
KINDS = (".mcap", ".npz", ".h5", ".csv")
BEGAN = 1_700_000_000_000_000_000


@dataclass
class Model:
    """What one source should hold."""

    t: NDArray[np.int64]
    values: NDArray[np.float32]
    unit: str = "counts"
    side: str = ""
    heel: str = ""
    turned: float | None = None
    columns: list[str] | None = None
    notes: list[tuple[str, int | None]] = field(default_factory=list)
    found: list[tuple[str, int, int]] = field(default_factory=list)
    clock: bool = False
    samples: bool = False
    #: Words that the lines in `lost` must contain from now on.
    lost: frozenset[str] = frozenset()

    def within(self, a: float, b: float) -> Model:
        """Return the part of ``a <= t < b``."""
        inside, bare = (self.t >= a) & (self.t < b), sum(t is None for _, t in self.notes)
        return replace(
            self,
            t=self.t[inside],
            values=self.values[inside],
            notes=[note for note in self.notes if note[1] is not None and a <= note[1] < b],
            found=[one for one in self.found if a <= one[1] < b],
            lost=self.lost | ({"without a time"} if bare else set()),
        )

    def cropped(self, x: slice, y: slice) -> Model:
        """Return the part within a rectangle."""
        if self.values[:, y, x].shape == self.values.shape:
            return self
        return replace(
            self,
            values=self.values[:, y, x],
            columns=self.columns and self.columns[x],
            samples=False,
            lost=self.lost | ({"the lines of the stream as received"} if self.samples else set()),
        )

    def merged(self, at: int, name: str) -> Model:
        """Return both sides of a time, merged again, with a note with its name where each begins."""
        sides = [self.within(-np.inf, at), self.within(at, np.inf)]
        both = replace(sides[0], t=self.t, values=self.values, samples=False)
        both.notes = [(name, int(side.t[0]) if len(side.t) else 0) for side in sides]
        both.notes += [note for side in sides for note in side.notes]
        both.found = sides[0].found + sides[1].found
        both.lost |= {"the lines of the stream as received"} if self.samples else set()
        return both

    def through(self, kind: str) -> tuple[Model, set[str]]:
        """Return what a file of a kind gives back, and the words that converting must say."""
        said = {"the lines of the stream as received"} if self.samples and kind != ".mcap" else set()
        said |= {"arrival times"} if self.clock and (kind != ".mcap" or not self.samples) else set()
        if kind != ".csv":
            samples = self.samples and kind == ".mcap"
            return replace(self, clock=samples, samples=samples, lost=self.lost | said), said
        words = {
            "the unit": self.unit != "counts", "the side": self.side, "where the heel is": self.heel,
            "the fact that the readings were inverted": self.turned is not None,
            "the names of the columns": self.columns,
            "note": self.notes, "detection": self.found,
        }  # fmt: skip
        said |= {word for word, there in words.items() if there}
        return Model(self.t, self.values), said


def insole(folder: Path) -> tuple[taxel.Recording, dict[str, Model]]:
    """Frames of one foot in kPa, turned, with notes and detections, from a file."""
    model = some_feet("left")["left"]
    taxel.convert(taxel.Recording(Contents.single(source_of("left", model))), folder / "insole.npz")
    return taxel.open(folder / "insole.npz"), {"board": model}


def two_feet(folder: Path) -> tuple[taxel.Recording, dict[str, Model]]:
    """Both feet as sources of one file."""
    models = some_feet("left", "right")
    taxel.convert(taxel.Recording(alone({n: source_of(n, model) for n, model in models.items()})), folder / "feet.mcap")
    return taxel.open(folder / "feet.mcap"), models


def some_feet(*names: str) -> dict[str, Model]:
    random, models = np.random.default_rng(len(names)), {}
    for k, name in enumerate(names):
        values = random.integers(0, 900, (40, 3, 5)).astype(np.float32) / np.float32(4)
        notes: list[tuple[str, int | None]] = [("heel", 50_000), ("toe", 210_000), ("cough", None)]
        found = [("contact", 60_000, 61_000), ("lift", 250_000, 252_000)]
        models[name] = Model(np.arange(40) * 10_000 + k, values, "kPa", name, "top", 255.0, None, notes, found)
    return models


def source_of(name: str, model: Model) -> RecordedSource:
    label, t, known_us = zip(*model.found, strict=True)
    marks = Marks(
        notes=known(tuple(Note(text, at) for text, at in model.notes)),
        detections=known(taxel.Detections(list(label), list(t), list(known_us))),
    )
    frames = Frames(model.values, model.t, unit=model.unit, array=Array(3, 5, 5.0, name="sole"))
    origin = Origin(Path("feet"), f"feet {name}", "pedar", name, "an amplifier")
    sensor, losses = (
        Sensor(frames.array, model.side, model.heel),
        Losses(verdict=known(taxel.Verdict.from_dict({"status": "complete", "text": "nothing lost"}))),
    )
    return source_from(frames, origin, turned=model.turned, sensor=sensor, marks=marks, losses=losses)


def bag(folder: Path, *topics: str) -> tuple[taxel.Recording, dict[str, Model]]:
    """Topics of a ROS bag."""
    random = np.random.default_rng(8)
    values = {topic: random.integers(0, 9, (30, 1, 4)).astype(np.float32) for topic in topics}
    messages = [
        (f"/{topic}", bags.HAND, 10.0 * k + 2, 10.0 * k, bags.hand(values[topic][k].ravel().tolist(), [2.0]))
        for k in range(30)
        for topic in topics
    ]
    path = bags.write(folder / "grasp.bag", messages)
    opened = taxel.open(path, topic=[f"/{topic}" for topic in topics], field="thumb")
    t = bags.BEGIN_NS // 1000 + np.arange(30) * 10_000
    return opened, {topic: Model(t, values[topic], "as sent") for topic in topics}


def stream(folder: Path) -> tuple[taxel.Recording, dict[str, Model]]:
    """A stream of numbers with arrival times."""
    described = {"columns": ["t_us", "ax", "ay"], "time": "t_us", "unit_us": 1.0}
    header = {"array": Array(1, 2, name="imu")._geometry(), "name": "imu", "stream": described, "source": "serial"}
    writer = _core.RecordingWriter(folder / "imu.mcap", json.dumps(header), "none", True)
    own, random = np.arange(200) * 1000.0, np.random.default_rng(3)
    rows = random.integers(0, 9, (200, 2)).astype(float)
    lines = np.column_stack([own, rows]).reshape(-1)
    writer.samples((BEGAN + own * 1000).astype(np.int64), np.arange(200, dtype=np.uint64), lines)
    writer.finish(json.dumps({"received": 200}))
    values = rows.astype(np.float32)[:, None]
    model = Model(own.astype(np.int64), values, "as sent", columns=["ax", "ay"], clock=True, samples=True)
    return taxel.open(folder / "imu.mcap"), {"imu": model}


MAKERS: dict[str, Callable[[Path], tuple[taxel.Recording, dict[str, Model]]]] = {
    "insole": insole,
    "two feet": two_feet,
    "bag": lambda folder: bag(folder, "palm"),
    "bag of two": lambda folder: bag(folder, "palm", "finger"),
    "stream": stream,
}


def same(recording: taxel.Recording, m: Model, where: str) -> None:
    __tracebackhide__ = True
    frames = recording.frames()
    np.testing.assert_array_equal(frames.t, m.t, where)
    np.testing.assert_array_equal(frames.values, m.values, where)
    assert (frames.unit, recording.side, recording.heel, recording.timed) == (m.unit, m.side, m.heel, True), where
    one = recording._contents.main
    assert isinstance(one, FrameSource)
    assert one.frame_table.turned == m.turned, where
    assert (recording.columns if recording.is_stream else None) == m.columns, where
    assert sorted((n.text, str(n.t)) for n in recording.notes) == sorted((text, str(t)) for text, t in m.notes), where
    assert [(d.label, d.t, d.known) for d in recording.detections] == m.found, where
    assert (recording.clock is not None and len(recording.clock.board_us) > 0) == (m.clock and len(m.t) > 0), where
    for word in m.lost:
        assert any(word in line for line in recording.lost), f"{where}: nothing says {word}: {recording.lost}"


def check(recording: taxel.Recording, models: dict[str, Model], where: str) -> None:
    __tracebackhide__ = True
    sources = recording.sources
    assert list(sources) == list(models), where
    for name, model in models.items():
        same(sources[name], model, f"{where}, {name}")
    if len(models) > 1:
        with pytest.raises(taxel.ProblemError, match=f"contains {len(models)} sources"):
            recording.frames()


@pytest.mark.parametrize("maker", MAKERS)
@pytest.mark.parametrize("seed", seeds(60, quick=2))
def test_in_any_chain_of_steps_frames_and_what_is_beside_them_stay_or_are_said_to_be_lost(  # noqa: PLR0912, PLR0915
    tmp_path: Path, maker: str, seed: int
) -> None:
    draw = np.random.default_rng(seed)
    recording, models = MAKERS[maker](tmp_path)
    where = maker
    check(recording, models, where)
    for k in range(1, int(draw.integers(3, 7))):
        several = len(models) > 1
        name, m = next(iter(models.items()))
        low, high = (int(m.t[0]), int(m.t[-1])) if len(m.t) else (0, 1)
        match draw.choice(["slice", "cut", "merge", "notes", "clock", "pick", "pick", *KINDS, ".mcap"]):
            case "slice":
                a, b = sorted(draw.integers(low - 10, high + 10, 2).tolist())
                recording, where = recording.between(a, b), f"{where}; between {a} {b}"
                models = {of: one.within(a, b) for of, one in models.items()}
            case "cut":
                rows, columns = m.values.shape[1:]
                x, y = (slice(*sorted(draw.choice(n + 1, 2, replace=False).tolist())) for n in (columns, rows))
                where = f"{where}; cut {x} {y}"
                if several and m.cropped(x, y) is not m:
                    with pytest.raises(taxel.ProblemError, match="contains 2 sources"):
                        taxel.cut(recording, columns=x, rows=y)
                    continue
                [recording] = taxel.cut(recording, columns=x, rows=y)
                models = {name: m.cropped(x, y)} if not several else models
            case "merge":
                at = int(draw.integers(low, high + 2))
                parts, where = (
                    [recording.between(-np.inf, at), recording.between(at, np.inf)],
                    f"{where}; merge at {at}",
                )
                if several:
                    with pytest.raises(taxel.ProblemError, match="contains 2 sources"):
                        taxel.merge(parts)
                    continue
                models = {"board": m.merged(at, recording.name)}
                recording = taxel.merge(parts)
            case "notes":
                if not several:
                    recording, where = recording.with_notes([Note(f"n{k}", k)]), f"{where}; notes"
                    models = {name: replace(m, notes=[*m.notes, (f"n{k}", k)])}
            case "clock":
                if recording.is_slice or recording.is_on_clock:
                    continue
                if not m.clock or not len(m.t):
                    with pytest.raises(taxel.ProblemError, match="has no arrival times, so its clock is not known"):
                        recording.on_clock("host")
                    continue
                recording, where = recording.on_clock("host"), f"{where}; on_clock"
                t = recording.frames().t
                assert np.abs(t - t[0] - (m.t - m.t[0])).max() <= 2, where
                # The fit of the clock is exact to 2 us only, so the model continues with the times that taxel computed.
                said = {"the lines of the stream as received"} if m.samples else set()
                notes = [(n.text, n.t) for n in recording.notes]
                models = {name: replace(m, t=t, notes=notes, samples=False, lost=m.lost | said)}
            case "pick":
                name = str(draw.choice(list(models)))
                where = f"{where}; of {name}"
                if several:
                    # What the file holds beside it is not in the recordings that are made of it.
                    taxel.convert(recording.sources[name], file := tmp_path / f"{k}.npz")
                    models = {"board": models[name].through(".npz")[0]}
                    models["board"].lost |= {f"the source {other}" for other in recording.sources if other != name}
                    recording = taxel.open(file)
            case kind:
                file, where = tmp_path / f"{k}{kind}", f"{where}; to {kind}"
                if several and kind != ".mcap":
                    with pytest.raises(taxel.ProblemError, match="contains 2 sources"):
                        taxel.convert(recording, file)
                    continue
                whose = {"the clock of the times"} if recording.is_on_clock else set()
                lost = taxel.convert(recording, file)
                after = {of: one.through(kind) for of, one in models.items()}
                for word in {word for _, words in after.values() for word in words} | whose | m.lost:
                    assert any(word in line for line in lost), f"{where}: {word} is not in {lost}"
                keeps = kind == ".mcap" and (several or not m.samples or name)
                models = {of if keeps else "board": one for of, (one, _) in after.items()}
                again = taxel.open(file, array=recording.array if kind == ".csv" else None)
                recording, models = again, dict(zip(again.sources, models.values(), strict=True))
                if kind != ".csv":
                    assert list(recording.lost) == lost, where
        check(recording, models, where)


def test_of_a_board_beside_a_stream_each_has_its_own_clock_until_they_share_one(tmp_path: Path) -> None:
    board = {"array": Array(4, 4)._geometry()}
    header = board | {"sources": [{"name": "imu", "array": Array(1, 1)._geometry(), "stream": {"columns": ["ax"]}}]}
    writer = _core.RecordingWriter(tmp_path / "both.mcap", json.dumps(header), "none", False)
    imu = writer.track("imu")
    for k in range(30):
        event = taxel.Events([k * 1000], [1], [2], [k % 2 == 0], array=Array(4, 4), intensity=[60 + k])
        writer.datagram(BEGAN + k * 1_000_000, k, taxel.wire.encode(event))
        imu.samples(np.array([BEGAN + k * 1_000_000]), np.array([k], np.uint64), np.array([float(k)]))
    imu.end(json.dumps({"received": 30}))
    writer.finish(json.dumps({"received": 30}))
    both = taxel.open(tmp_path / "both.mcap")
    host = both.on_clock("host")
    for seed in range(20):
        a, b = sorted(np.random.default_rng(seed).integers(-2000, 32_000, 2).tolist())
        part, shared = both.between(a, b), host.between(a + BEGAN // 1000, b + BEGAN // 1000)
        expected = [k for k in range(30) if a <= 1000 * k < b]
        assert (part.events.intensity - 60).tolist() == expected
        with pytest.raises(taxel.ProblemError, match=r"the sources \(board, imu\) have different clocks"):
            _ = part.sources
        assert (shared.events.intensity - 60).tolist() == expected
        assert shared.sources["imu"].frames().values.ravel().tolist() == expected
        for one in (part, shared):
            lost = taxel.convert(one, tmp_path / f"{seed}.npz")
            assert {"the source imu"} <= set(lost)
            assert taxel.open(tmp_path / f"{seed}.npz").events.intensity.tolist() == [60 + k for k in expected]
            (tmp_path / f"{seed}.npz").unlink()


def test_frames_of_both_feet_are_written_at_the_rate_that_is_asked_for(tmp_path: Path) -> None:
    feet, models = two_feet(tmp_path)
    assert taxel.convert(feet, tmp_path / "slow.mcap", frames_hz=20) == list(feet.lost)
    for name, one in taxel.open(tmp_path / "slow.mcap").sources.items():
        assert one.frames() == feet.sources[name].frames(20)
        assert len(one.frames()) == 8 < len(models[name].t)
