"""What becomes of a recording's contents is decided field by field and function by function; nothing goes unsaid."""

from __future__ import annotations

import json
import pickle
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from draws import seeds

import taxel
from taxel import Array, Events, Note, _core
from taxel.recording.once import Once
from taxel.wire import Registers

ARRAY = Array(8, 10, 2.0, name="mat")
#: The host's clock at the board's time 0: whole us.
BEGAN = 1_700_000_000_000_000_000
KINDS = (".mcap", ".lsa", ".npz", ".csv", ".h5")


def registers(period: float = 5.0) -> Registers:
    return Registers(array=ARRAY, lines=10, line_period=period)


def write(path: Path, seed: int = 0, n: int = 300) -> Path:
    """Write a recording that has something in every field, begun in mid-stream, as a board of version 1 sends it."""
    draw = np.random.default_rng(seed)
    t = np.sort(draw.integers(0, 3000, n)) * 100
    x, y = draw.integers(0, 10, n), draw.integers(0, 8, n)
    events = Events(
        t, x, y, draw.random(n) < 0.5, array=ARRAY, intensity=draw.integers(0, 400, n), present=draw.random(n) < 0.9
    )
    header = {
        "array": ARRAY._geometry(), "registers": json.loads(registers()._json()), "source": "udp 127.0.0.1:5208",
    }  # fmt: skip
    writer = _core.RecordingWriter(path, json.dumps(header), "none", True)
    held = draw.integers(0, 300, 80).astype(np.uint16)
    held[draw.random(80) < 0.3] = 65_535
    writer.held(BEGAN, None, held)
    times = np.unique(t)
    for k, at in enumerate(times.tolist()):
        writer.datagram(BEGAN + at * 1000, k, taxel.wire.encode(events[events.t == at]))
        if k == len(times) // 3:
            change = {"t_us": at, "change": "reset"}
            writer.board_change(BEGAN + at * 1000, json.dumps(change))
    writer.note(BEGAN + 50_000_000, 50_000, "heel")
    writer.note(BEGAN + 200_000_000, 200_000, "toe")
    writer.note(BEGAN + 1, None, "cough")
    writer.zeroing(BEGAN + 60_000_000, 60_000, 2, 3, 40.0, None)
    writer.zeroing(BEGAN + 220_000_000, 220_000, 7, 1, 41.5, 39.0)
    writer.registers(BEGAN + 150_000_000, registers(6.0)._json())
    writer.detection(BEGAN + 100_000_000, "contact", 99_000, 100_000, 1.5, False)
    writer.detection(BEGAN + 240_000_000, "lift", 239_000, 240_000, float("nan"), True)
    writer.finish(json.dumps({"received": len(times), "dropped_by_kernel": 2}))
    return path


# nothing is read that is not asked for


def test_opening_cutting_and_listing_read_no_datagram(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[str] = []
    compiled = _core.RecordingReader

    class Reader:
        """Reads as the compiled one does, and notes what."""

        def __init__(self, of: Any, *limits: Any) -> None:
            self.of = of if isinstance(of, compiled) else compiled(of, *limits)

        def of_source(self, name: str) -> Reader:
            return Reader(self.of.of_source(name))

        def within(self, memory: int) -> Reader:
            return Reader(self.of.within(memory))

        def __getattr__(self, name: str) -> Any:
            read.append(name)
            return getattr(self.of, name)

    write(tmp_path / "a.mcap")
    monkeypatch.setattr("taxel.recording.readers.mcap._core.RecordingReader", Reader)
    recording = taxel.open(tmp_path / "a.mcap")
    [part] = taxel.cut(recording, start_us=1000, stop_us=2000, columns=slice(2, 5))
    [half] = taxel.cut(recording, rows=slice(2, 5))
    for one in (recording, recording.between(0, 5), half, part, recording.with_notes([Note("a", 5, 0)])):
        assert list(one.sources) == ["board"]
        assert isinstance(one.lost, tuple)
        _ = (
            one.notes,
            one.registers,
            one.register_changes,
            one.board_changes,
            one.zeroings,
            one.detections,
            one.verdict,
        )
        _ = (one.truncated, one.rebuilt, one.is_slice, one.is_stream, one.has_events, one.array, one.source)
    assert half.lost == ("raw datagrams",)
    assert set(read) <= {"sources", "about", "remarks"}
    _ = part.events
    assert "decode" in read
    assert "datagrams" not in read


def test_a_value_is_read_once_and_an_error_is_no_value() -> None:
    asked: list[int] = []

    def read() -> int:
        asked.append(1)
        if len(asked) == 1:
            raise OSError
        return 5

    value = Once(read)
    with pytest.raises(OSError):  # noqa: PT011  any
        value()
    assert (value(), value(), len(asked)) == (5, 5, 2)


def test_a_recording_goes_to_another_process_with_all_it_holds(tmp_path: Path) -> None:
    recording = taxel.open(write(tmp_path / "a.mcap")).between(0, 200_000)
    again = pickle.loads(pickle.dumps(recording))
    (tmp_path / "a.mcap").unlink()
    same(again, model_of(recording), "pickled")
    assert list(again.sources) == ["board"]


# random chains, against a reckoning of its own


@dataclass
class Model:
    """What a recording should hold, reckoned event by event."""

    rows: list[tuple[int, int, int, bool, int | None]]
    shape: tuple[int, int] = (8, 10)
    held: dict[tuple[int, int], int] | None = None
    registers: Registers | None = None
    driven: tuple[int, int] = (8, 10)
    changes: list[Any] = field(default_factory=list)
    board: list[tuple[int | None, str]] = field(default_factory=list)
    notes: list[tuple[str, int | None]] = field(default_factory=list)
    found: list[tuple[str, int, int, bool]] = field(default_factory=list)
    zeroed: list[tuple[int, int, int, float]] = field(default_factory=list)
    datagrams: bool = True
    clock: bool = True
    verdict: bool = True
    counts: bool = True
    source: bool = True
    #: Words that the lines in `lost` must contain from now on.
    lost: set[str] = field(default_factory=set)


def model_of(recording: taxel.Recording) -> Model:
    held = recording.held
    assert held is not None
    return Model(
        rows_of(recording),
        held={(x, y): int(held[y, x]) for y, x in np.argwhere(~np.isnan(held)).tolist()},
        registers=recording.registers,
        changes=list(recording.register_changes),
        board=[(c.t, c.change) for c in recording.board_changes],
        notes=[(n.text, n.t) for n in recording.notes],
        found=[(d.label, d.t, d.known, d.repaired) for d in recording.detections],
        zeroed=[(z.t, z.x, z.y, z.rest) for z in recording.zeroings],
    )


def rows_of(recording: taxel.Recording) -> list[tuple[int, int, int, bool, int | None]]:
    return [(e.t, e.x, e.y, e.p, e.intensity) for e in recording.events]


def sliced(m: Model, a: float, b: float) -> Model:
    known = dict(m.held or {})
    for t, x, y, _, ticks in sorted(m.rows, key=lambda row: row[0]):
        if t < a and ticks is not None:
            known[x, y] = ticks
    return replace(
        m, rows=[r for r in m.rows if a <= r[0] < b], held=known or None,
        notes=[n for n in m.notes if n[1] is not None and a <= n[1] < b], found=[f for f in m.found if a <= f[1] < b],
        zeroed=[z for z in m.zeroed if z[0] < b], lost=m.lost | untimed(m),
    )  # fmt: skip


def untimed(m: Model) -> set[str]:
    count = sum(t is None for _, t in m.notes)
    return {f"{count} note{'s' * (count > 1)} without a time"} if count else set()


def cut_to(m: Model, x0: int, x1: int, y0: int, y1: int) -> Model:
    if (y1 - y0, x1 - x0) == m.shape:
        return m

    def inside(x: int, y: int) -> bool:
        return x0 <= x < x1 and y0 <= y < y1

    return replace(
        m, rows=[(t, x - x0, y - y0, p, i) for t, x, y, p, i in m.rows if inside(x, y)], shape=(y1 - y0, x1 - x0),
        held=None if m.held is None else {(x - x0, y - y0): v for (x, y), v in m.held.items() if inside(x, y)},
        zeroed=[(t, x - x0, y - y0, r) for t, x, y, r in m.zeroed if inside(x, y)], datagrams=False,
        lost=m.lost | ({"raw datagrams"} if m.datagrams else set()),
    )  # fmt: skip


def joined(m: Model, at: int, name: str) -> Model:
    """Both sides of a time, merged again: as it was, but the bytes, and a note with its name where each begins."""
    left, right = [r[0] for r in m.rows if r[0] < at], [r[0] for r in m.rows if r[0] >= at]
    begins = [(name, min(side, default=0)) for side in (left, right)]
    both = replace(m, rows=sorted(m.rows, key=lambda r: r[0]), notes=m.notes + begins, datagrams=False)
    both.notes = [n for n in both.notes if n[1] is not None]
    both.lost = m.lost | untimed(m) | ({"raw datagrams"} if m.datagrams else set())
    return both


def through(m: Model, kind: str, made: bool) -> tuple[Model, set[str]]:
    """Return what a file of a kind gives back, and the words that converting must say."""
    said: set[str] = set()
    if kind in (".npz", ".h5"):
        said |= {"arrival times"} if m.clock else set()
        said |= {"raw datagrams"} if m.datagrams else set()
        return replace(m, datagrams=False, clock=False, source=True, lost=m.lost | said), said
    if kind == ".mcap":
        said |= {"raw datagrams"} if made and m.datagrams else set()
        return replace(m, datagrams=True, counts=True, source=True, lost=m.lost | said), said
    words = {
        "sensor": True, "at the beginning": bool(m.held), "registers": m.registers is not None,
        "of the registers": bool(m.changes), "of the board": bool(m.board), "note": bool(m.notes),
        "detection": bool(m.found), "zeroed taxel": bool(m.zeroed), "arrival times": m.clock, "received": m.counts,
        "the origin of the recording": m.source,
    }  # fmt: skip
    said = {word for word, there in words.items() if there}
    if kind == ".lsa" and any(t % 100 for t, *_ in m.rows):
        said |= {"times finer than 100 us"}
    rows = m.rows
    if kind == ".lsa" and rows:
        turns = rows[0][0] // 6_553_600 * 6_553_600
        said |= {"whole turns"} if turns else set()
        rows = [(t // 100 * 100 - turns, x, y, p, ticks) for t, x, y, p, ticks in m.rows]
    empty = {"datagrams": False, "clock": False, "verdict": False, "source": False, "counts": kind == ".lsa"}
    return Model(rows, shape=m.shape, **empty), said  # type: ignore[arg-type]


def same(recording: taxel.Recording, m: Model, where: str) -> None:
    __tracebackhide__ = True
    assert rows_of(recording) == m.rows, where
    held = recording.held
    known = {} if held is None else {(x, y): int(held[y, x]) for y, x in np.argwhere(~np.isnan(held)).tolist()}
    assert known == (m.held or {}), where
    assert (recording.registers, list(recording.register_changes)) == (m.registers, m.changes), where
    if m.registers is not None:
        assert recording.registers is not None
        assert recording.registers.array.shape == m.driven, where
    assert [(c.t, c.change) for c in recording.board_changes] == m.board, where
    assert sorted((n.text, str(n.t)) for n in recording.notes) == sorted((text, str(t)) for text, t in m.notes), where
    assert [(d.label, d.t, d.known, d.repaired) for d in recording.detections] == m.found, where
    assert [(z.t, z.x, z.y, z.rest) for z in recording.zeroings] == m.zeroed, where
    assert (recording.clock is not None and len(recording.clock.board_us) > 0) >= m.clock, where
    if m.verdict:
        assert "dropped by the kernel" in recording.verdict, where
    for word in m.lost:
        assert any(word in line for line in recording.lost), f"{where}: nothing says {word}: {recording.lost}"


@pytest.mark.parametrize("seed", seeds(200, quick=10))
def test_in_any_chain_of_steps_nothing_goes_lost_unsaid(tmp_path: Path, seed: int) -> None:  # noqa: PLR0912, PLR0915
    draw = np.random.default_rng(seed)
    recording = taxel.open(write(tmp_path / "0.mcap", seed % 7))
    m, where = model_of(recording), "as recorded"
    same(recording, m, where)
    for k in range(1, int(draw.integers(3, 7))):
        step = draw.choice(["slice", "cut", "merge", "notes", "clock", *KINDS[:1], *KINDS])
        rows, columns = recording.array.shape
        t = [r[0] for r in m.rows] or [0]
        match step:
            case "slice":
                a, b = sorted(draw.integers(min(t) - 10, max(t) + 10, 2).tolist())
                recording, m, said = recording.between(a, b), sliced(m, a, b), f"between {a} {b}"
            case "cut":
                x0, x1 = sorted(draw.integers(0, columns + 1, 2).tolist())
                y0, y1 = sorted(draw.integers(0, rows + 1, 2).tolist())
                if draw.random() < 0.3 or x0 == x1 or y0 == y1:
                    x0, x1, y0, y1 = 0, columns, 0, rows
                [recording] = taxel.cut(recording, columns=slice(x0, x1), rows=slice(y0, y1))
                m, said = cut_to(m, x0, x1, y0, y1), f"cut {x0}:{x1} {y0}:{y1}"
            case "merge":
                m.source = True
                at = int(draw.integers(min(t), max(t) + 2))
                parts = [recording.between(-np.inf, at), recording.between(at, np.inf)]
                m, said = joined(m, at, recording.name), f"merge at {at}"
                recording = taxel.merge(parts)
            case "notes":
                recording = recording.with_notes([Note(f"n{k}", k, 0)])
                m, said = replace(m, notes=[*m.notes, (f"n{k}", k)]), "notes"
            case "clock":
                if recording.is_slice or recording.is_on_clock or not m.clock:
                    continue
                recording, said = recording.on_clock("host"), "on_clock"
                moved = [r[0] for r in rows_of(recording)]
                by = moved[0] - m.rows[0][0] if moved else 0
                assert all(abs(b - r[0] - by) <= 2 for b, r in zip(moved, m.rows, strict=True)), where
                # The fit of the clock is exact to 2 us only, so the model continues with the times that taxel computed.
                exact = taxel.recording.recording.Recording(recording._contents)
                m.rows = rows_of(exact)
                m.zeroed = [(z.t, z.x, z.y, z.rest) for z in exact.zeroings]
                m.notes = [(n.text, n.t) for n in exact.notes]
                m.found = [(d.label, d.t, d.known, d.repaired) for d in exact.detections]
                m.board = [(c.t, c.change) for c in exact.board_changes]
            case kind:
                made = recording.is_slice or recording.is_on_clock or not m.datagrams
                whose = {"the clock of the times"} if recording.is_on_clock else set()
                file = tmp_path / f"{k}{kind}"
                if kind == ".lsa" and not m.datagrams and any(r[4] is not None for r in m.rows) is False:
                    continue
                lost = taxel.convert(recording, file)
                before, (m, words) = m, through(m, kind, made)
                for word in words | whose | before.lost:
                    assert any(word in line for line in lost), f"{where}; {kind}: {word} is not in {lost}"
                m.lost |= whose if kind in (".npz", ".h5", ".mcap") else set()
                array = recording.array if kind in (".lsa", ".csv") else None
                recording, said = taxel.open(file, array=array), f"to {kind}"
                if kind in (".npz", ".h5", ".mcap"):
                    assert list(recording.lost) == lost, where
                if kind == ".lsa":
                    # A silence of more than 6.5 s has no length in raw bytes; the recordings here have none.
                    m.datagrams = False
        where = f"{where}; {said}"
        same(recording, m, where)
