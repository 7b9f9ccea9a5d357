"""Ctrl-C ends long calls of neurons soon: measured in one child process by its own processor time."""

from __future__ import annotations

import json
import subprocess
import sys

CHILD = """
import json, signal, sys, time
import numpy as np
from taxel import Neuron, SpikeTrains

trains, spikes = 100, 200_000
# Every train has a spike in each stretch of 10 ms: sorting them by time is much of the work.
lists = [np.arange(spikes) * 10.0 + n * 0.0999 for n in range(trains)]
given = SpikeTrains.from_lists(lists, stop=spikes * 10.0)
weights = np.full(trains, 1e-3)
times = np.linspace(0, spikes * 10.0, 20_000_000)
calls = {
    "run": lambda: Neuron().run(weights, given),
    "run on a grid": lambda: Neuron(time="grid").run(weights, given),
    "run_many": lambda: Neuron().run_many(np.full((64, trains), 1e-3), given),
    "run_many on a grid": lambda: Neuron(time="grid").run_many(np.full((64, trains), 1e-3), given),
    "potential": lambda: Neuron().potential(weights, given, times),
}
signal.signal(signal.SIGVTALRM, lambda *_: signal.raise_signal(signal.SIGINT))
signal.signal(signal.SIGINT, signal.default_int_handler)
late = {}
for name in sys.argv[1:]:
    late[name] = []
    for after in (0.3, 0.6):
        begun = time.process_time()
        signal.setitimer(signal.ITIMER_VIRTUAL, after)
        try:
            calls[name]()
        except KeyboardInterrupt:
            late[name].append(time.process_time() - begun - after)
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
print(json.dumps(late))
"""
CALLS = ["run", "run on a grid", "run_many", "run_many on a grid", "potential"]


def test_control_c_answers_soon():
    child = subprocess.run([sys.executable, "-c", CHILD, *CALLS], capture_output=True, text=True, check=True)
    late = json.loads(child.stdout)
    assert {name: len(after) for name, after in late.items()} == dict.fromkeys(CALLS, 2), "it ended before Ctrl-C came"
    # Half a second is the goal, and .15 to .27 s was measured; a loaded machine needs more.
    assert max(map(max, late.values())) < 2, late
