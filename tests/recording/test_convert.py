"""Every conversion gives back what the target can hold, and says what it cannot."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import taxel
from taxel import Frames
from taxel._core import ProblemError

from .making import record, some_events, some_frames

THESIS = taxel.Array.thesis()
SEEDS, TIMES = st.integers(0, 2**20), st.integers(-(2**51), 2**51)
CELLS = (
    st.integers(0, 65_535).map(float) | st.floats(width=32, allow_infinity=False) | st.sampled_from([-0.0, 65_536.0])
)


@st.composite
def events_of_any_time(draw: st.DrawFn) -> taxel.Events:
    """Draw events after silences of any length, some of them repaired, with or without intensities."""
    random, gaps = np.random.default_rng(draw(SEEDS)), draw(st.lists(st.integers(0, 40_000_000), max_size=40))
    t = draw(st.integers(-(10**10), 10**10)) + np.cumsum(np.array(gaps, np.int64))
    n, more, present = len(t), {}, random.random(len(t)) < 0.5
    if present.any() and draw(st.booleans()):
        more = {"intensity": np.where(present, random.integers(0, 65_536, n), 0), "present": present}
    if n and draw(st.booleans()):
        more["repaired"] = random.random(n) < 0.3
    markers = [(int(t[0]), True), (int(t[-1]), False)] if n and draw(st.booleans()) else []
    x, y, p = random.integers(0, 64, n), random.integers(0, 64, n), random.random(n) < 0.5
    return taxel.Events(t, x, y, p, array=THESIS, markers=markers, **more)


@st.composite
def frames_of_any_bits(draw: st.DrawFn) -> Frames:
    """Draw frames of any values, on a sensor of which some taxels may not exist; these read 0."""
    rows, columns, t = draw(st.integers(1, 4)), draw(st.integers(1, 5)), sorted(draw(st.sets(TIMES, max_size=6)))
    count = len(t) * rows * columns
    values = np.array(draw(st.lists(CELLS, min_size=count, max_size=count)), np.float32)
    exists = np.arange(rows * columns).reshape(rows, columns) % 3 < draw(st.integers(1, 3))
    values = np.where(exists, values.reshape(len(t), rows, columns), np.float32(0))
    array = taxel.Array(rows, columns, 2.5, None if exists.all() else exists, "mat")
    return Frames(values, t, unit=draw(st.sampled_from(["kPa", "a.u."])), array=array)


def columns_of(table: taxel.Events | Frames) -> list[bytes]:
    """Return the columns of a table to the last bit, missing values alike; of frames the taxels that exist."""
    if isinstance(table, Frames):
        values = table.values[:, table.array._there()]
        return [table.t.tobytes(), np.where(np.isnan(values), np.float32(np.nan), values).tobytes()]
    columns = table.t, table.x, table.y, table.p, table.intensity, table.present, table.repaired
    return [np.asarray(column).tobytes() for column in columns if column is not None]


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    table=events_of_any_time() | frames_of_any_bits(),
    kinds=st.lists(st.sampled_from([".mcap", ".npz", ".h5", ".csv"]), min_size=1, max_size=2),
)
def test_any_table_survives_any_conversions(tmp_path: Path, table: taxel.Events | Frames, kinds: list[str]) -> None:
    source: taxel.Events | Frames | Path = table
    for k, kind in enumerate(kinds):
        place = tmp_path / f"{k}{kind}"
        lost = taxel.convert(source, place, overwrite=True)
        assert lost == [] or kind == ".csv" or k
        source = place
    back = taxel.open(source)
    found = back.events if back.has_events else back.frames()
    assert columns_of(found) == columns_of(table)
    if ".csv" not in kinds:
        assert (found.array, back.timed) == (table.array, True)
        assert found == table or (isinstance(table, Frames) and np.isnan(table.values).any())


@pytest.mark.parametrize("compression", ["none", "lz4", "zstd"])
def test_a_recording_copied_to_mcap_keeps_every_message(tmp_path: Path, compression: str) -> None:
    one, two = tmp_path / "one.mcap", tmp_path / "two.mcap"
    record(one, some_events())
    assert taxel.convert(one, two, compression=compression) == []
    a, b = taxel.open(one), taxel.open(two)
    for name in ("arrived_ns", "number", "offsets", "payload"):
        assert np.array_equal(getattr(a.datagrams(), name), getattr(b.datagrams(), name))
    assert (a.events, a.notes, a.detections, a.registers) == (b.events, b.notes, b.detections, b.registers)
    assert a.register_changes == b.register_changes
    assert (b.verdict, b.remarks) == (a.verdict, ("converted from one.mcap",))


def test_raw_bytes_come_back_exactly_through_mcap(tmp_path: Path) -> None:
    rng = np.random.default_rng(8)
    for k, size in enumerate((0, 1, 7, 1400, 5000, 40_000)):
        raw = taxel.wire.encode(some_events(3000))[:size] if k % 2 else rng.integers(0, 256, size, np.uint8).tobytes()
        lsa, mcap, back = (tmp_path / f"{k}{name}" for name in ("a.lsa", "b.mcap", "c.lsa"))
        lsa.write_bytes(raw)
        taxel.convert(lsa, mcap)
        taxel.convert(mcap, back)
        assert back.read_bytes() == raw
        if k % 2:
            assert taxel.open(mcap).events == taxel.open(lsa).events


def test_what_a_target_cannot_hold_is_said(tmp_path: Path) -> None:
    one = tmp_path / "one.mcap"
    record(one, some_events())
    lost = {kind: " | ".join(taxel.convert(one, tmp_path / f"x{kind}")) for kind in (".lsa", ".npz", ".csv")}
    beside = ("arrival times", "notes", "detections", "registers", "verdict")
    for kind, more in ((".lsa", ()), (".npz", ("raw data",)), (".csv", ("raw data", "markers"))):
        for word in (*beside, *more):
            assert word in lost[kind]
        assert lost[kind].startswith(f"a {kind} holds ")
        assert " | " not in lost[kind]
    assert "sensor" not in lost[".npz"]
    fine = taxel.Events([0, 192], [1, 2], [3, 4], [True, False], array=THESIS)
    [lost] = taxel.convert(fine, tmp_path / "fine.lsa")
    assert lost == "a .lsa holds the board's bytes alone: not times finer than 100 us"
    assert taxel.open(tmp_path / "fine.lsa").events.t.tolist() == [0, 100]
    late = taxel.Events([7_000_000], [1], [3], [True], array=THESIS)
    [lost] = taxel.convert(late, tmp_path / "late.lsa")
    assert lost.endswith("alone: not whole turns of 6.5536 s in times")
    back = taxel.Events([500_001, 0], [1, 2], [3, 4], [True, False], array=THESIS)
    for events in (fine, late, back):
        assert taxel.convert(events, tmp_path / "table.mcap", overwrite=True) == []
        assert taxel.open(tmp_path / "table.mcap").events == events
        assert taxel.open(tmp_path / "table.mcap").verdict == "nothing lost"


def test_a_csv_of_frames_has_a_column_a_taxel_that_exists(tmp_path: Path) -> None:
    exists = np.array([[True, False], [True, True]])
    frames = taxel.Frames(np.array([[[1, 0], [2.5, 3]]]), [100], array=taxel.Array(2, 2, exists=exists))
    path = tmp_path / "a.csv"
    taxel.convert(frames, path)
    assert path.read_text() == "t_us,x0y0,x0y1,x1y1\n100,1,2.5,3\n"
    back = taxel.open(path).frames()
    assert np.array_equal(back.values, frames.values)
    assert np.array_equal(back.array.exists, exists)


def test_frames_do_not_go_into_files_of_events(tmp_path: Path) -> None:
    with pytest.raises(ProblemError, match="can contain only events"):
        taxel.convert(some_frames(), tmp_path / "a.lsa")
    assert not list(tmp_path.iterdir())


def test_a_taxel_beyond_six_bits_is_refused_by_the_wire(tmp_path: Path) -> None:
    wide = taxel.Events([0], [64], [0], [True], array=taxel.Array(8, 100))
    with pytest.raises(ProblemError, match="63"):
        taxel.convert(wide, tmp_path / "a.lsa")
    for kind in (".npz", ".mcap"):
        assert taxel.convert(wide, tmp_path / f"a{kind}") == []
        assert taxel.open(tmp_path / f"a{kind}").events == wide
    huge = taxel.Events([0], [64], [0], [True], array=taxel.Array(300, 300))
    with pytest.raises(ProblemError, match="65536 positions"):
        taxel.convert(huge, tmp_path / "b.mcap")
    assert not (tmp_path / "b.mcap").exists()
