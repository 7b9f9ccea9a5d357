"""Ctrl-C while information is estimated: answered between calls of NumPy, each of which is short."""

import importlib
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from draws import mixed

from .touches import folder

estimating = importlib.import_module("taxel.information.estimate")

#: The processor time between the signal and its answer, s: another load of the machine does not count. Half a second is
#: the goal; the page of limits says where it is missed.
SOON_S = 1.5

CHILD = """
import signal, sys, time
import numpy as np
from taxel.information import estimate

random = np.random.default_rng(1)
if sys.argv[1] == "numbers":
    truth = random.integers(0, 3, 6_000_000)
else:
    truth = random.integers(0, 3, 6_000_000).astype(str)
estimate(["a", "b"] * 20, ["a", "b"] * 20)  # modules that load late are there
# SIGPROF raises KeyboardInterrupt after a given processor time; a signal from another process could only be timed by
# the wall clock.
signal.signal(signal.SIGPROF, signal.default_int_handler)
signal.setitimer(signal.ITIMER_PROF, float(sys.argv[2]))
begun = time.process_time()
try:
    estimate(truth, truth)
except KeyboardInterrupt:
    print(time.process_time() - begun - float(sys.argv[2]))
else:
    print("ended before the signal")
"""


@pytest.mark.parametrize(("what", "after_s"), mixed(["numbers", "texts"], [2.0, 0.5]))
def test_an_estimate_of_many_trials_answers_ctrl_c_soon(what: str, after_s: float) -> None:
    ended = subprocess.run(
        [sys.executable, "-c", CHILD, what, str(after_s)],
        stdout=subprocess.PIPE,
        check=True,
        text=True,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
        timeout=300,
    )
    if "ended" in ended.stdout:
        pytest.skip("this machine is too quick for it")
    assert float(ended.stdout) < SOON_S


def test_units_that_are_redrawn_in_pieces_are_those_of_one_call(monkeypatch: pytest.MonkeyPatch) -> None:
    for units, piece in ((7, 3), (1000, 64), (65_536, 10_000), (65_536, 65_535)):
        monkeypatch.setattr(estimating, "_DRAWN", piece)
        found = estimating._redrawn(np.random.default_rng(units), units, 4)
        assert (found == np.random.default_rng(units).multinomial(units, np.full(units, 1 / units), size=4)).all()


STOPPED = """
import os, signal, sys, time
import taxel.information
from taxel.cli import main

asked, done, stopped = taxel.information.answer, [], []

def counted(*trials, watch=None, **ask):
    def stop(*point):
        done.append(point)
        if len(done) == int(sys.argv[1]):
            stopped.append(time.process_time())
            os.kill(os.getpid(), signal.SIGINT)
    return asked(*trials, watch=stop, **ask)

taxel.information.answer = counted
try:
    main(sys.argv[2:])
finally:
    print(time.process_time() - stopped[0])
"""


def stopped(place: Path, *, after: int, more: Sequence[str] = ()) -> subprocess.CompletedProcess[str]:
    """Run the command on made touches, and send it SIGINT when so many settings are done."""
    recording, labels = folder(place, 60)
    asked = ["--window-ms", "60", "--windows", "10", "--periods", "1,10", "--draws", "3", "--taxels", "1"]
    command = ["information", str(recording), "--labels", str(labels), *asked, *more]
    script = [sys.executable, "-c", STOPPED, str(after), *command, "--report", str(place / "page.html")]
    return subprocess.run(script, capture_output=True, text=True, check=False, timeout=300)


def test_ctrl_c_ends_the_command_soon(tmp_path: Path) -> None:
    ended = stopped(tmp_path, after=5)  # the first draw has two periods to two windows
    assert ended.returncode == 130, ended.stderr
    assert float(ended.stdout) < SOON_S
    assert not (tmp_path / "page.html").exists()
