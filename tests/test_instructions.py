"""TAXEL_INSTRUCTIONS names the widest vector instructions to use; a set that the processor lacks is refused."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from taxel import _core

NAMES = ["plain", "avx2", "avx512"]
#: A script that decodes words of both versions and encodes them, and prints the results.
WORK = """
import numpy as np, taxel
from taxel import _core
random = np.random.default_rng(5)
t = np.sort(random.integers(0, 200_000, 5000)) // 100 * 100
x, y = random.integers(0, 64, (2, 5000))
more = {"intensity": random.integers(0, 800, 5000), "array": taxel.Array.thesis()}
events = taxel.Events(t, x, y, random.random(5000) < .5, **more)
data = taxel.wire.encode(events)
again = taxel.wire.decode(data)
spikes = taxel.encode.FA1().encode(events)
print(_core.instructions(), len(again), again.t.sum(), again.intensity.sum(), len(spikes.times), spikes.times.sum())
"""


#: What this process uses: where no variable says other, the widest that the processor has.
WIDEST = NAMES.index(_core.instructions())


def run(name: str, program: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "TAXEL_INSTRUCTIONS": name}
    command = [sys.executable, "-c", program]
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120, check=False)


@pytest.mark.slow
@pytest.mark.skipif("TAXEL_INSTRUCTIONS" in os.environ, reason="all tests use one set")
def test_an_available_set_caps_the_dispatch_and_changes_no_result(capsys: pytest.CaptureFixture[str]) -> None:
    exec(WORK, {})
    _, *expected = capsys.readouterr().out.split()
    # This process uses the widest set; those between are alike in Rust's tests.
    assert run("plain", WORK).stdout.split() == ["plain", *expected]
    for name in NAMES[WIDEST + 1 :]:
        assert f"this machine has at most {NAMES[WIDEST]}" in run(name, WORK).stderr


def test_an_unknown_set_is_refused_in_one_line() -> None:
    done = run("avx3", "import sys; sys.argv = ['taxel', '--help']; from taxel_start import main; main()")
    assert done.returncode == 2
    assert 'TAXEL_INSTRUCTIONS is "avx3": must be plain, avx2, avx512' in done.stderr
    assert done.stderr.count("\n") == 1, done.stderr
