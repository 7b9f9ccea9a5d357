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


def run(name: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *arguments],
        env={**os.environ, "TAXEL_INSTRUCTIONS": name},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


@pytest.mark.parametrize("name", NAMES)
def test_an_available_set_caps_the_dispatch_and_changes_no_result(name: str) -> None:
    done = run(name, "-c", WORK)
    widest = NAMES.index(subprocess.run(
        [sys.executable, "-c", "from taxel import _core; print(_core.instructions())"],
        env={k: v for k, v in os.environ.items() if k != "TAXEL_INSTRUCTIONS"},
        capture_output=True, text=True, timeout=120, check=True,
    ).stdout.strip())  # fmt: skip
    if NAMES.index(name) > widest:
        assert f"this machine has at most {NAMES[widest]}" in done.stderr
        return
    used, *results = done.stdout.split()
    assert used == name
    assert results == run("plain", "-c", WORK).stdout.split()[1:]


def test_an_unknown_set_is_refused_in_one_line() -> None:
    done = run("avx3", "-c", "import taxel")
    assert done.returncode != 0
    assert 'TAXEL_INSTRUCTIONS is "avx3": must be plain, avx2, avx512' in done.stderr
    done = run("avx3", "-c", "from taxel_start import main; main()", "--help")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1, done.stderr


def test_the_name_of_the_set_in_use_is_known() -> None:
    assert _core.instructions() in NAMES
