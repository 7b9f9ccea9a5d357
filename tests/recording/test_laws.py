"""Laws of recordings: whatever is cut, merged, put on a clock or converted is what NumPy makes of the whole table."""

from __future__ import annotations

import pickle
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import taxel
from taxel import Array, Clock, Events, Frames, Note
from taxel.reading import Facts, InMemory, Marks
from taxel.recording.recording import Recording

from .making import record, some_events

QUIET = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
ROWS, COLUMNS = 5, 4
#: The board's clock runs 100 ppm slow, and begins so long after 1970.
BEGAN_NS, PPM = 1_700_000_000_000_000_000, 100


class Clocked(InMemory):
    """A source in memory whose clock is known."""

    def clock(self) -> Clock:
        board = np.arange(0, 3_000_000, 1000)
        return Clock(board, BEGAN_NS + board * (1000 + PPM // 1000) + board * PPM // 1000)


@dataclass(frozen=True)
class Model:
    """What a recording should hold, by NumPy on columns: of each row its time, place and values."""

    t: NDArray[np.int64]
    rows: NDArray[np.float64]
    notes: tuple[tuple[str, int], ...]
    shape: tuple[int, int] = (ROWS, COLUMNS)
    #: Columns of the rows that are x and y of events; frames have none.
    has_events: bool = True

    def between(self, start: float, stop: float) -> Model:
        inside = (self.t >= start) & (self.t < stop)
        notes = tuple(note for note in self.notes if start <= note[1] < stop)
        return replace(self, t=self.t[inside], rows=self.rows[inside], notes=notes)

    def region(self, left: int, right: int, top: int, bottom: int) -> Model:
        small = bottom - top, right - left
        if not self.has_events:
            values = self.rows.reshape(len(self.t), *self.shape)[:, top:bottom, left:right]
            return replace(self, rows=values.reshape(len(self.t), small[0] * small[1]), shape=small)
        x, y = self.rows[:, 0], self.rows[:, 1]
        inside = (x >= left) & (x < right) & (y >= top) & (y < bottom)
        moved = self.rows[inside] - [left, top, 0, 0]
        return replace(self, t=self.t[inside], rows=moved, shape=small)

    def later(self, us: int) -> Model:
        return replace(self, t=self.t + us, notes=tuple((text, t + us) for text, t in self.notes))


def rows_of(table: Events | Frames) -> NDArray[np.float64]:
    """Return the values of a table, a row for each event or frame; an absent intensity is NaN."""
    if isinstance(table, Frames):
        return table.values.reshape(len(table), table.array.rows * table.array.columns).astype(np.float64)
    ticks = np.full(len(table), np.nan) if table.intensity is None else np.where(table.present, table.intensity, np.nan)
    return np.column_stack([table.x, table.y, table.p, ticks]).astype(np.float64)


def check(recording: Recording, model: Model) -> None:
    """Compare a recording with what it should hold."""
    table = recording.events if model.has_events else recording.frames()
    assert recording.array.shape == table.array.shape == model.shape
    assert table.t.tolist() == model.t.tolist()
    np.testing.assert_array_equal(rows_of(table), model.rows)
    assert sorted((n.text, n.t) for n in recording.notes if n.text in "abc") == sorted(model.notes)


@st.composite
def recordings(draw: st.DrawFn) -> tuple[InMemory, Model]:
    """Draw a recording of events or of frames, with notes, and its model."""
    seed, count, has_events = draw(st.integers(0, 2**20)), draw(st.integers(0, 60)), draw(st.booleans())
    random = np.random.default_rng(seed)
    t = np.cumsum(random.integers(1, 40_000, count)).astype(np.int64)
    array = Array(ROWS, COLUMNS, 2.0, name="mat")
    table: Events | Frames
    if has_events:
        x, y, p = random.integers(0, COLUMNS, count), random.integers(0, ROWS, count), random.random(count) < 0.5
        present = random.random(count) < 0.8
        ticks = np.where(present, random.integers(0, 300, count), 0)
        table = Events(t, x, y, p, array=array, intensity=ticks, present=present)
    else:
        table = Frames(random.normal(0, 9, (count, ROWS, COLUMNS)), t, unit="N", array=array)
    last = int(t[-1]) if count else 0
    notes = tuple(Note(str(random.choice(list("abc"))), int(random.integers(0, last + 1))) for _ in range(4))
    notes = tuple({(note.text, note.t): note for note in notes}.values())
    facts = Facts(path=Path("drawn"), array=array, kind="drawn", side="left")
    model = Model(t, rows_of(table), tuple((n.text, int(n.t or 0)) for n in notes), has_events=has_events)
    return Clocked(facts, table, Marks(notes=notes)), model


STEPS = st.sampled_from(["between", "region", "on_clock", "convert", "cut and merge", "gap", "pickle", "export"])


@QUIET
@given(drawn=recordings(), steps=st.lists(STEPS, max_size=5), data=st.data())
def test_any_steps_give_what_numpy_makes_of_the_whole(
    tmp_path: Path, drawn: tuple[InMemory, Model], steps: list[str], data: st.DataObject
) -> None:
    reader, model = drawn
    recording = Recording.of(reader)
    for k, step in enumerate(steps):
        ends = st.floats(-1e4, 2.5e6) | st.integers(-(10**4), 2_500_000)
        first, last = sorted((data.draw(ends), data.draw(ends)))
        match step:
            case "between":
                recording, model = recording.between(first, last), model.between(first, last)
            case "region":
                (rows, columns), at = model.shape, st.integers(0, 4)
                left, top = data.draw(at) % columns, data.draw(at) % rows
                right, bottom = left + 1 + data.draw(at) % (columns - left), top + 1 + data.draw(at) % (rows - top)
                [recording] = taxel.cut(recording, columns=slice(left, right), rows=slice(top, bottom))
                model = model.region(left, right, top, bottom)
            case "on_clock":
                # A clock is measured by the stamps of datagrams: a converted recording of few events may have none.
                is_measured = recording.clock is not None and len(recording.clock.board_us)
                if recording.is_slice or recording._main.view.clock or not is_measured:
                    continue
                host = recording.clock.host_ns(np.concatenate([model.t, np.array([t for _, t in model.notes])]))
                times = (np.asarray(host, np.int64) + 500) // 1000
                recording = recording.on_clock("host")
                notes = tuple((text, int(t)) for (text, _), t in zip(model.notes, times[len(model.t) :], strict=True))
                model = replace(model, t=times[: len(model.t)], notes=notes)
            case "cut and merge":
                middle = int(model.t[len(model.t) // 2]) if len(model.t) else 0
                recording = taxel.merge([recording.between(-np.inf, middle), recording.between(middle, np.inf)])
            case "gap":
                shift = int(model.t[-1] - model.t[0]) + 500 if len(model.t) else 0
                recording, again = taxel.merge([recording, recording], gap_us=500), model.later(shift)
                model = replace(
                    model,
                    t=np.concatenate([model.t, again.t]),
                    rows=np.concatenate([model.rows, again.rows]),
                    notes=tuple(dict.fromkeys((*model.notes, *again.notes))),
                )
            case "pickle":
                recording = pickle.loads(pickle.dumps(recording))
            case "convert":
                assert {*taxel.convert(recording, tmp_path / f"{k}.mcap", overwrite=True)} <= {"raw datagrams"}
                recording = taxel.open(tmp_path / f"{k}.mcap")
                assert recording.side == "left"
            case "export":
                place = tmp_path / f"{k}{data.draw(st.sampled_from(['.npz', '.h5']))}"
                *before, lost = taxel.convert(recording, place, overwrite=True)
                assert {*before} <= {"raw datagrams"}
                assert lost.startswith(f"a {place.suffix} holds the table alone: not ")
                assert "the side" in lost
                recording, model = taxel.open(place), replace(model, notes=())
                reader = recording._main.in_memory(side="left")
                recording = Recording.of(reader)
        check(recording, model)


@QUIET
@given(drawn=recordings(), at=st.lists(st.integers(0, 2_500_000), min_size=2, max_size=2).map(sorted))
def test_a_slice_begins_with_the_values_that_the_taxels_held(drawn: tuple[InMemory, Model], at: list[int]) -> None:
    reader, model = drawn
    part = Recording.of(reader).between(*at)
    if not model.has_events:
        assert part.held is None
        return
    held = np.full((ROWS, COLUMNS), np.nan)
    for t, (x, y, _, ticks) in zip(model.t, model.rows, strict=True):
        if t < at[0] and not np.isnan(ticks):
            held[int(y), int(x)] = ticks
    found = np.full_like(held, np.nan) if part.held is None else part.held
    np.testing.assert_array_equal(found, held)
    if part.interval is not None and part.interval[1] > part.interval[0]:
        first = part.frames(1000).values[0]
        changed = part.events.t == part.interval[0]
        untouched = np.ones((ROWS, COLUMNS), bool)
        untouched[part.events.y[changed], part.events.x[changed]] = False
        np.testing.assert_array_equal(first[untouched], np.nan_to_num(held)[untouched])


@QUIET
@given(count=st.integers(0, 30), rate=st.floats(1.0, 1e6), ends=st.lists(st.floats(-3, 40), min_size=2, max_size=2))
def test_numbered_frames_have_times_by_a_rate_whether_cut_before_or_after(
    count: int, rate: float, ends: list[float]
) -> None:
    frames = Frames(np.arange(2.0 * count).reshape(count, 1, 2), np.arange(count))
    facts = Facts(path=Path("grasp"), array=frames.array, kind="icub", timed=False)
    numbered = Recording.of(InMemory(facts, frames, Marks(notes=(Note("a", count // 2),))))
    first, last = sorted(ends)
    part = numbered.between(first, last).at_rate(rate)
    kept = np.flatnonzero((np.arange(count) >= first) & (np.arange(count) < last))
    assert part.timed
    assert part.frames().t.tolist() == np.rint(kept * (1e6 / rate)).astype(int).tolist()
    np.testing.assert_array_equal(part.frames().values[:, 0, 0], 2 * kept)
    assert [note.t for note in part.notes] == [round(count // 2 * (1e6 / rate))] * (first <= count // 2 < last)


def test_opening_cutting_and_listing_read_no_datagram(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    record(tmp_path / "a.mcap", some_events())
    (tmp_path / "a.notes.csv").write_text("label,t_us\nhere,5000\n")

    def refuse(*_: object) -> None:
        raise AssertionError("a datagram is read")

    monkeypatch.setattr("taxel.recording.files.mcap.McapReader._decoded", property(refuse))
    recording = taxel.open(tmp_path / "a.mcap")
    listed = recording.notes, recording.registers, recording.zeroings, recording.detections, recording.verdict
    assert "here" in [note.text for note in listed[0]]
    [part] = taxel.cut(recording, start_us=1000, stop_us=9000, columns=slice(0, 8))
    assert (part.array.columns, part.is_slice, part.lost) == (8, True, ("raw datagrams",))
    with pytest.raises(AssertionError, match="a datagram is read"):
        _ = part.events


def test_only_the_sensor_of_a_recording_is_cut_where_clocks_differ() -> None:
    """The interval is by its clock; of several sensors it is by none."""
    frames = Frames(np.ones((9, 1, 2)), np.arange(9) * 1000)
    board = Events([0, 5000], [0, 1], [0, 0], [True, True], array=Array(1, 2))
    imu = InMemory(Facts(path=Path("a"), array=frames.array, label="imu", columns=("x", "y")), frames)
    both = Recording.of(InMemory(Facts(path=Path("a"), array=board.array), board), imu)
    part = both.between(4000, 6000)
    assert (len(part.events), list(part.sources)) == (1, ["board"])
    assert part.lost == ("the source imu (it has another clock)",)
    again = InMemory(Facts(path=Path("a"), array=board.array, label="second"), board)
    with pytest.raises(taxel.ProblemError, match="call on_clock"):
        Recording.of(InMemory(Facts(path=Path("a"), array=board.array), board), again).between(0, 1)
