"""Ctrl-C while information is estimated: answered between calls of NumPy, each of which is short."""

import subprocess
import sys

import pytest

#: The processor time between the signal and its answer, s: another load of the machine does not count.
SOON_S = 0.5

CHILD = """
import os, signal, sys, threading, time
import numpy as np
from taxel.information import estimate

random = np.random.default_rng(1)
if sys.argv[1] == "labels":
    truth = random.integers(0, 4000, 20_000)
else:
    truth = random.integers(0, 3, 2_000_000).astype(str)
estimate(["a", "b"] * 20, ["a", "b"] * 20)  # modules that load late are there
sent = []

def interrupt():
    time.sleep(float(sys.argv[2]))
    sent.append(time.process_time())
    os.kill(os.getpid(), signal.SIGINT)

threading.Thread(target=interrupt, daemon=True).start()
try:
    estimate(truth, truth)
except KeyboardInterrupt:
    print(time.process_time() - sent[0])
else:
    print("ended before the signal")
"""


@pytest.mark.parametrize("what", ["labels", "texts"])
@pytest.mark.parametrize("after_s", [0.2, 0.9, 2.5])
def test_an_estimate_of_many_labels_or_trials_answers_ctrl_c_soon(what: str, after_s: float) -> None:
    ended = subprocess.run(
        [sys.executable, "-c", CHILD, what, str(after_s)],
        stdout=subprocess.PIPE,
        check=True,
        text=True,
        env={"OMP_NUM_THREADS": "1", "PATH": ""},
        timeout=300,
    )
    if "ended" in ended.stdout:
        pytest.skip("this machine is too quick for it")
    assert float(ended.stdout) < SOON_S
