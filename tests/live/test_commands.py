"""The commands `taxel record` and `taxel live`: when they end, what they print and with which exit code."""

import json
import signal
from pathlib import Path

import numpy as np
import pytest
from loopback import free_port, until
from shell import run, run_beside

import taxel
from taxel import Events

from .boards import LOOPBACK, SMALL, held, play, presses, touch


@pytest.mark.parametrize("ended", [signal.SIGINT, signal.SIGTERM])
def test_taxel_record_keeps_what_comes_until_ctrl_c_and_gives_a_verdict(ended: signal.Signals, tmp_path: Path) -> None:
    port, file, events = free_port(), tmp_path / "walk.mcap", presses(3)
    arguments = ("record", file, "--host", LOOPBACK, "--port", port, "--array", "4x4")

    def board(_: str) -> None:
        play(events, port)
        until(lambda: held(file) == len(events))

    done = run_beside(board, *arguments, ended=ended)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1].startswith("nothing lost after arrival")
    assert taxel.open(file).verdict.status == "complete after arrival"
    np.testing.assert_array_equal(taxel.open(file).events.to_numpy(), events.to_numpy())
    again = run(*arguments)
    assert again.returncode == 2
    said = f"taxel: {file}: exists already; give --overwrite, or another name"
    assert again.stderr.strip().splitlines() == [said]


def test_taxel_live_writes_a_line_of_json_a_detection(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    port, events = free_port(), presses(5)
    moved = np.diff(events.intensity.astype(int), prepend=0)
    said = Events(events.t, events.x, events.y, moved >= 0, array=SMALL, intensity=np.abs(moved))
    touch().save(tmp_path / "touch.json")
    files = ["--readout", tmp_path / "touch.json", "--record", tmp_path / "live.mcap", "--report", tmp_path / "report"]
    arguments = ["live", *files, "--host", LOOPBACK, "--port", port, "--array", "4x4", "--json"]

    def board(_: str) -> None:
        play(said, port)
        until(lambda: held(tmp_path / "live.mcap") == len(said))

    # The datagrams' times do not follow the board's pace: the guard prevents the host's clock from advancing time here.
    done = run_beside(board, *arguments, "--guard-frames", "1e6", "--differences")
    assert done.returncode == 0, done.stderr
    # A thread of the compiled part writes them.
    lines = [json.loads(line) for line in capfd.readouterr().out.splitlines()]
    assert "Live detections, recorded to" in (tmp_path / "report" / "report.html").read_text()
    keys = {"label", "t_us", "known_us", "slope_mv_per_ms", "repaired"}
    assert [set(line) for line in lines] == [keys | {"reported_us", "reported_ns"}] * 5
    heard_again = ("detect", tmp_path / "live.mcap", "--readout", tmp_path / "touch.json", "--json")
    detected = json.loads(run(*heard_again).stdout)["detections"]
    assert detected == [{key: line[key] for key in keys} for line in lines], "one schema"
    recorded = taxel.open(tmp_path / "live.mcap")
    np.testing.assert_array_equal([line["t_us"] for line in lines], recorded.detections.t)
    np.testing.assert_array_equal(recorded.events.intensity, events.intensity)


@pytest.mark.parametrize(("unit", "is_said"), [("", True), (",unit=N", False)])
def test_the_unit_of_the_readout_is_assumed_only_where_none_is_stated(tmp_path: Path, unit: str, is_said: bool) -> None:
    taxel.detect.PlainRule("load", 5.0, 1.0, noise_floor=1.0, unit="N").save(tmp_path / "rule.json")
    (tmp_path / "mat.txt").write_text("".join(f"{20 * k},0,0,0,{k % 9}\n" for k in range(60)))
    source = f"lines:{tmp_path / 'mat.txt'},array=2x2,time=1:ms{unit}"
    done = run("live", "--readout", tmp_path / "rule.json", "--source", source, "--tare", 0.1, "--seconds", 1)
    assert done.returncode == 0, done.stderr
    assert ("assumed to be in N" in " ".join(done.stderr.split())) == is_said
