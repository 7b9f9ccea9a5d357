"""What recordings once lost without a word, case by case; in any chain of steps see test_chains.py."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import taxel
from taxel import Neuron, Note, Readout, _core
from taxel.encode import LevelCrossing
from taxel.wire import Registers

from .making import some_events, some_frames
from .test_chains import write
from .test_commands import run

SLOW = 7.81


@pytest.fixture
def slow(tmp_path: Path) -> taxel.Recording:
    """A recording of a board whose frames last 499.84 us."""
    registers = Registers(line_period=SLOW)
    assert registers.frame_us == pytest.approx(64 * SLOW)
    header = {"array": registers.array._geometry(), "registers": json.loads(registers._json())}
    writer = _core.RecordingWriter(tmp_path / "slow.mcap", json.dumps(header), "none", True)
    for k, t in enumerate(range(500, 60_000, 500)):
        ticks = 100 if k % 20 < 10 else 40
        one = taxel.Events([t], [5], [7], [ticks > 50], array=registers.array, intensity=[ticks])
        writer.datagram(1_700_000_000_000_000_000 + t * 1000, k, taxel.wire.encode(one))
    writer.finish("{}")
    return taxel.open(tmp_path / "slow.mcap")


def test_a_cut_to_all_columns_and_rows_is_the_recording_itself(slow: taxel.Recording) -> None:
    [same] = taxel.cut(slow, columns=slice(0, 64), rows=slice(None))
    assert same._contents is slow._contents
    assert (same.registers, same.counts, same.verdict, same.lost) == (slow.registers, slow.counts, slow.verdict, ())


def test_a_part_of_the_sensor_is_read_out_at_the_pace_of_the_whole(slow: taxel.Recording, tmp_path: Path) -> None:
    def known(recording: taxel.Recording) -> list[int]:
        weights = np.zeros(recording.array.taxels)
        weights[recording.array.index(5, 7)] = 2.0
        readout = Readout(LevelCrossing([60.0]), {"touch": (Neuron(tau=2.0, refractory=5.0), np.r_[weights, weights])})
        return taxel.detect.run(readout, recording).known.tolist()

    [part] = taxel.cut(slow, columns=slice(0, 16), rows=slice(0, 32))
    assert len(known(slow)) > 3
    assert known(part) == known(slow)
    for kind in ("npz", "h5", "mcap"):
        lost = taxel.convert(part, tmp_path / f"part.{kind}")
        again = taxel.open(tmp_path / f"part.{kind}")
        assert list(again.lost) == lost
        assert "raw datagrams" in lost
        assert again.registers is not None
        assert (again.registers, again.registers.array) == (slow.registers, slow.array)
        assert known(again) == known(slow)
    # The events alone have no board.
    assert known(part.events) != known(part)  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", ["npz", "h5"])
def test_what_a_part_began_with_is_there_again(tmp_path: Path, kind: str) -> None:
    recording = taxel.open(write(tmp_path / "a.mcap"))
    part = recording.between(100_000, 200_000)
    taxel.convert(part, tmp_path / f"part.{kind}")
    again = taxel.open(tmp_path / f"part.{kind}")
    np.testing.assert_array_equal(again.held, part.held)
    assert again.board_changes == recording.board_changes != ()
    assert again.register_changes == recording.register_changes != ()
    told = taxel.convert(part, tmp_path / "part.csv")
    assert any("taxels at the beginning" in line for line in told)


def test_a_stream_on_another_clock_is_a_stream(tmp_path: Path) -> None:
    header = {"array": {"rows": 1, "columns": 1, "pitch_mm": 1.0, "name": "imu", "exists": None}, "name": "imu"}
    stream = {"columns": ["t_us", "ax"], "time": "t_us", "unit_us": 1.0}
    writer = _core.RecordingWriter(tmp_path / "imu.mcap", json.dumps({**header, "stream": stream}), "none", True)
    own = np.arange(200) * 1000.0
    arrived = (1_700_000_000_000_000_000 + own * 1000).astype(np.int64)
    writer.samples(arrived, np.arange(200, dtype=np.uint64), np.stack([own, own], axis=1).reshape(-1))
    writer.finish("{}")
    imu = taxel.open(tmp_path / "imu.mcap")
    moved = imu.on_clock("host")
    assert (imu.is_stream, moved.is_stream, moved.columns) == (True, True, ["ax"])
    for one in (imu, moved):
        with pytest.raises(
            taxel.ProblemError, match="source 'imu' is a stream of numbers, which has lines and no data"
        ):
            one.datagrams()
    assert moved.lost == ("the lines of the stream as received",)
    part = imu.between(50_000, 100_000)
    assert taxel.convert(part, tmp_path / "part.mcap") == [
        "arrival times of lines that are not in this part of the recording"
    ]
    assert taxel.open(tmp_path / "part.mcap").frames() == part.frames()


def test_a_board_on_another_clock_has_the_datagrams_of_its_file(tmp_path: Path) -> None:
    recording = taxel.open(write(tmp_path / "a.mcap"))
    assert len(recording.on_clock("host").datagrams()) == len(recording.datagrams()) > 100
    taxel.convert(recording, tmp_path / "a.npz")
    table = taxel.open(tmp_path / "a.npz")
    with pytest.raises(taxel.ProblemError, match=r"contains no datagrams; only a \.mcap does"):
        table.datagrams()


def test_two_parts_that_agree_are_merged_whole_and_two_that_do_not_say_so(tmp_path: Path) -> None:
    recording, other = (taxel.open(write(tmp_path / f"{k}.mcap", k)) for k in (0, 1))
    whole = taxel.merge([recording.between(-np.inf, 150_000), recording.between(150_000, np.inf)])
    for name in ("registers", "register_changes", "board_changes", "zeroings", "counts", "verdict"):
        assert getattr(whole, name) == getattr(recording, name), name
    np.testing.assert_array_equal(whole.held, recording.held)
    assert whole.lost == ("1 note without a time", "raw datagrams")
    assert whole.clock is not None
    both = taxel.merge([recording, other], gap_us=1000)
    said = " | ".join(both.lost)
    for word in ("arrival times", "changes of the board", "zeroed taxels", "taxels at the beginning of 1.mcap"):
        assert word in said, said
    assert both.zeroings == ()
    assert both.registers == recording.registers


def test_a_calibration_goes_with_its_part(tmp_path: Path) -> None:
    array = taxel.Array(5, 6)
    taxel.convert(some_frames(), tmp_path / "a.npz")
    gain = np.arange(1.0, 31.0).reshape(5, 6)
    made = taxel.Calibration.table(array, [10.0], [1.0], unit="kPa", gain=gain, date="2026-11-21")
    made.save(tmp_path / "a.calibration.json")
    whole = taxel.open(tmp_path / "a.npz")
    [part] = taxel.cut(whole, columns=slice(2, 4), rows=slice(1, 5))
    np.testing.assert_array_equal(part.calibrated().values, whole.calibrated().values[:, 1:5, 2:4])
    assert any("calibration" in line for line in taxel.convert(whole, tmp_path / "b.npz"))


def test_info_shows_what_was_left_behind(tmp_path: Path) -> None:
    recording = taxel.open(write(tmp_path / "a.mcap"))
    [part] = taxel.cut(recording, columns=slice(0, 4))
    taxel.convert(part, tmp_path / "part.npz")
    lost = ["raw datagrams", "arrival times"]
    assert json.loads(run("info", tmp_path / "part.npz", "--json").stdout)["lost"] == lost
    assert "not in file         raw datagrams\n" in run("info", tmp_path / "part.npz").stdout


def test_notes_of_a_folder_stay_on_another_clock(tmp_path: Path) -> None:
    recording = taxel.open(write(tmp_path / "a.mcap")).with_notes([Note("more", 60_000, 0)])
    assert "more" in [note.text for note in recording.on_clock("host").notes]


def test_few_events_on_a_large_sensor_take_little_memory(tmp_path: Path) -> None:
    draw = np.random.default_rng(0)
    t = np.sort(draw.integers(0, 1_000_000, 2000))
    x, y, ticks = draw.integers(0, 2048, 2000), draw.integers(0, 2048, 2000), draw.integers(0, 300, 2000)
    events = taxel.Events(t, x, y, t % 2 > 0, array=taxel.Array(2048, 2048), intensity=ticks)
    taxel.convert(events, tmp_path / "a.npz")
    import subprocess
    import sys

    # Not getrusage, which counts what the process held before it became this program.
    code = "import pathlib, re, sys; from taxel.cli import main; "
    code += "sys.argv = ['taxel', 'info', sys.argv[1]]; "
    code += "\ntry:\n main()\nexcept SystemExit:\n pass\n"
    code += "print(re.search(r'VmHWM:\\s+(\\d+) kB', pathlib.Path('/proc/self/status').read_text())[1])"
    said = subprocess.run([sys.executable, "-c", code, tmp_path / "a.npz"], capture_output=True, text=True, check=True)
    assert "contact area" in said.stdout
    # Whole frames of this second would be 1.6 GB, counts of touches of all taxels .4 GB; the libraries take .3.
    assert int(said.stdout.split()[-1]) < 330_000


def test_pressure_over_time_is_that_of_whole_frames(tmp_path: Path) -> None:
    from taxel.recording.analysis.pressure import Series, above_rest, series

    for k, recording in enumerate([taxel.open(write(tmp_path / "a.mcap")), taxel.open(write(tmp_path / "b.mcap", 1))]):
        for part in (recording, recording.between(100_000, 220_000)):
            found, whole = series(part), above_rest(part)
            assert found is not None
            assert whole is not None
            dense = Series.from_frames(*whole)
            for name in ("t", "area", "peak", "total", "centre"):
                np.testing.assert_array_equal(getattr(found, name), getattr(dense, name), err_msg=f"{k} {name}")
            assert (found.unit, found.above) == (dense.unit, dense.above)
    assert series(taxel.open(_of(tmp_path, some_events(30, intensity=False)))) is None


def _of(folder: Path, events: taxel.Events) -> Path:
    taxel.convert(events, folder / "none.npz")
    return folder / "none.npz"


def test_recordings_that_are_shifted_apart_have_no_common_clock(tmp_path: Path) -> None:
    whole = taxel.open(write(tmp_path / "a.mcap"))
    parts = [whole.between(-np.inf, 100_000), whole.between(100_000, np.inf)]
    assert np.array_equal(taxel.merge(parts).clock.board_us, whole.clock.board_us)
    apart = taxel.merge(parts, gap_us=50_000)
    assert apart.clock is None
    assert "arrival times" in apart.lost
