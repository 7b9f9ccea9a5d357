"""How many times faster than real time a skin of 4096 afferents of all four types is, beside the obvious NumPy.

64 x 64 taxels of 2.67 mm at 5208 Hz have 4096 afferents in the fingertip's mixture (70 : 140 : 6 : 25), less dense than
a fingertip's. On the board's events, and on frames whose every taxel changes all the time. No other library has such a
skin. The NumPy version multiplies SciPy's sparse matrix of the fields with all frames, and steps the afferents of
each type as one vector. Our weights have 32 bits, so that a spike may differ by a sample.

Peer: the obvious NumPy and SciPy. Unit: times real time, on one core. Goal: 20, with 99 % of the spikes equal.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from taxel import Frames
from taxel.encode import FA2, SA1, SA2, Skin
from taxel.encode.skin import Afferents
from taxel_benchmarks._goals import Goal, times_real_time
from taxel_benchmarks._instructions import beside_avx2
from taxel_benchmarks._receptor import numpy_afferents
from taxel_benchmarks._touch import compare, scene
from taxel_benchmarks.encode_fa1 import numpy_fa1

AFFERENTS, PITCH_MM = 4096, 2.67
KINDS = ("SA-1", "FA-1", "SA-2", "FA-2")
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


def fields(afferents: Afferents, encoder: Skin, shape: tuple[int, int]) -> Any:
    """Return the weights of the taxels in each afferent's field: a Gaussian of half its edge, in sum 1."""
    areas = {kind: getattr(encoder, f"{kind.replace('-', '').lower()}_field_mm2") for kind in KINDS}
    edge = np.sqrt(np.array([areas[kind] for kind in afferents.kind]) / np.pi)
    y, x = (at.ravel() * PITCH_MM for at in np.mgrid[: shape[0], : shape[1]])
    away = np.hypot(x - afferents.x_mm[:, None], y - afferents.y_mm[:, None]) / edge[:, None]
    weights = np.where(away <= 1, np.exp(-2 * away**2), 0)
    return csr_array(weights / weights.sum(1, keepdims=True))


def numpy_skin(frames: Frames, encoder: Skin) -> list[Any]:
    """Return (t, train) of all spikes, of either sign."""
    afferents = encoder.afferents(frames.array)
    readings = frames.values.reshape(len(frames), -1)
    felt = (fields(afferents, encoder, frames.array.shape) @ readings.T.astype(np.float64)).T
    spikes = []
    receptors = {"SA-1": SA1(period_ms=0.192), "SA-2": SA2(period_ms=0.192), "FA-2": FA2(period_ms=0.192)}
    for kind in KINDS:
        trains = afferents.trains(kind)
        part = Frames(felt[:, None, trains].astype(np.float32), frames.t, unit="ticks")
        found = (
            numpy_fa1(part, 150.0**0.7 / 1024, fall=0.05 * 0.192)
            if kind == "FA-1"
            else numpy_afferents(receptors[kind], part)
        )
        spikes += [(t, trains[k]) for t, k, *_ in found]
    return spikes


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    return times_real_time({"skin, events": 20, "skin, noisy frames": 20}, result, share=0.99)


@beside_avx2
def run(*, quick: bool) -> dict[str, Any]:
    """Measure; return seconds, real-time factors and ratios."""
    seconds = 0.25 if quick else 1.0
    ticks, _, _, events = scene(seconds)
    encoder = skin()
    ours = {"skin, events": lambda: encoder.encode(events), "skin, noisy frames": lambda: encoder.encode(ticks)}
    numpy = {"skin, noisy frames": lambda: numpy_skin(ticks, encoder)}
    return compare(__doc__, seconds, ours, numpy, quick=quick, afferents=len(encoder.afferents(ticks.array)))
