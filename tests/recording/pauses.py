"""A board whose clock drifts, or which pauses, as its recording shows it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

import taxel
from taxel import _core

from .making import HEADER

CAUSE = "is impossible for a clock. Either the sender paused or ran slower than its own clock"


def recorded(path: Path, drift_ppm: float, delay_s: float) -> Path:
    """Write 20 s of a board than whose clock the host's runs so much faster, and which pauses three times."""
    own = np.arange(0, 20_000_000, 5_000)
    host_us = own * (1 + drift_ppm * 1e-6) + np.random.default_rng(2).exponential(50.0, len(own))
    for pause in (400, 2000, 3600) if delay_s else ():
        host_us[pause] += 1e6 * delay_s
    # What was sent behind a late datagram comes when that has come.
    at_ns = 1_700_000_000_000_000_000 + np.rint(np.maximum.accumulate(host_us) * 1000).astype(np.int64)
    writer = _core.RecordingWriter(path, json.dumps(HEADER), "none", False)
    n, at = np.ones(len(own), int), np.arange(len(own))
    events = taxel.Events(own, 3 * n, 4 * n, at % 2 > 0, array=taxel.Array.thesis(), intensity=60 + at % 2)
    # Two words of five bytes each: the change and its intensity.
    data = taxel.wire.encode(events)
    for k, at in enumerate(at_ns.tolist()):
        writer.datagram(at, k, data[10 * k : 10 * k + 10])
    writer.finish(json.dumps({"received": len(own)}))
    return path
