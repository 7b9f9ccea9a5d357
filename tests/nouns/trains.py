"""Spike trains that are drawn."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from taxel import SpikeTrains


@st.composite
def some(draw: st.DrawFn) -> SpikeTrains:
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    lists = [np.sort(rng.uniform(0, 100, n)).round(3) for n in draw(st.lists(st.integers(0, 8), max_size=5))]
    kind = draw(st.sampled_from(["unsigned", "signed", "graded"]))
    values = None if kind == "unsigned" else [rng.choice([-2.0, -1.0, 1.0, 3.0], len(t)) for t in lists]
    if kind == "graded":
        values = [v * 10.0 ** rng.uniform(-6, 6, len(v)) for v in values]
    return SpikeTrains.from_lists(lists, -1.0, 101.0, values, kind=kind)
