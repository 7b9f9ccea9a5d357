"""How many times faster than real time a skin of 4096 afferents of all four types is, beside the obvious NumPy.

64 x 64 taxels of 2.67 mm at 5208 Hz have 4096 afferents in the fingertip's mixture (70 : 140 : 6 : 25), less dense than
a fingertip's. On the board's events, and on frames whose every taxel changes all the time. The NumPy version
computes the receptive fields alone: a dense product a frame.

Peer: NumPy's dense product of the fields. Unit: times real time, on one core. Goal: 20.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from _goals import Goal, times_real_time
from _instructions import beside_avx2
from _rounds import measure
from _touch import compare, scene

from taxel.encode import Skin

AFFERENTS = 4096
#: Densities a cm^2 of the thesis' array, scaled so that it has 4096 afferents.
SHARE = AFFERENTS / (241 * (64 * 0.267) ** 2)


def skin() -> Skin:
    """Return the skin of the benchmark."""
    return Skin(
        sa1_per_cm2=70 * SHARE,
        fa1_per_cm2=140 * SHARE,
        sa2_per_cm2=6 * SHARE,
        fa2_per_cm2=25 * SHARE,
        period_ms=0.192,
    )


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    return times_real_time({"skin, events": 20, "skin, noisy frames": 20}, result)


@beside_avx2
def run(*, quick: bool) -> dict[str, Any]:
    """Measure; return seconds, real-time factors and ratios."""
    seconds = 0.25 if quick else 1.0
    ticks, _, _, events = scene(seconds)
    encoder = skin()
    afferents = encoder.afferents(ticks.array)
    edges = {"SA-1": 11.0, "FA-1": 12.6, "SA-2": 60.0, "FA-2": 120.0}
    edge = np.sqrt(np.array([edges[kind] for kind in afferents.kind]) / np.pi)
    y, x = (at.ravel() * 2.67 for at in np.mgrid[:64, :64])
    away = np.hypot(x - afferents.x_mm[:, None], y - afferents.y_mm[:, None]) / edge[:, None]
    weights = np.where(away <= 1, np.exp(-2 * away**2), 0).astype(np.float32)
    few = ticks[: len(ticks) // 20]

    def numpy_fields() -> list[Any]:
        for picture in few.values:
            weights @ picture.ravel()
        return []

    ours = {"skin, events": lambda: encoder.encode(events), "skin, noisy frames": lambda: encoder.encode(ticks)}
    result = compare(__doc__, seconds, ours, {}, quick=quick, afferents=len(afferents))
    fields = measure({"numpy, fields of a twentieth": numpy_fields}, rounds=2, work=seconds / 20)
    return result | {"fields alone, numpy": fields}
