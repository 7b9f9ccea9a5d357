"""Recordings whose information is known."""

import numpy as np

import taxel

ARRAY = taxel.Array(4, 4, name="small")
#: From touch to touch, us.
APART_US = 400_000

#: A table of trials of `ordered(24)`.
GOOD = "recording,t_us,label,stop_us,group\n" + "".join(
    f"touches.npz,{100_000 + 400_000 * k},{'ab'[k % 2]},{200_000 + 400_000 * k},{'uvwxyz'[k % 6]}\n" for k in range(24)
)


def ordered(trials, gap_ms=3.0, seed=0, before=None):
    """Two taxels that are touched one after the other: the label is which comes first.

    A sensor that looks every T ms tells them apart where a sample falls between: with probability gap / T.
    """
    random = np.random.default_rng(seed)
    labels = random.permutation(np.arange(trials) % 2)
    changes, rows = [], []
    for k, label in enumerate(labels):
        at = 100_000 + k * APART_US + int(random.integers(0, 1000))
        touched = [(at, 0), (at + int(gap_ms * 1000), 1)] if label else [(at, 1), (at + int(gap_ms * 1000), 0)]
        if before is not None:
            touched.append((at - 40_000, 3 if (label if before == "tells" else random.integers(2)) else 2))
        for t, x in touched:
            changes += [(t, x, 100), (at + 250_000, x, 0)]
        rows.append((at - 500, "left first" if label else "right first"))
    t, x, intensity = zip(*sorted(changes), strict=True)
    p = [level > 0 for level in intensity]
    return taxel.Events(t, x, np.zeros(len(t), int), p, array=ARRAY, intensity=intensity), rows


def folder(place, trials=120, **what):
    """Write the recording and its table of trials; return both paths."""
    events, rows = ordered(trials, **what)
    taxel.convert(events, place / "touches.npz")
    lines = ["recording,t_us,label", *(f"touches.npz,{t},{label}" for t, label in rows)]
    (place / "labels.csv").write_text("\n".join(lines) + "\n")
    return place / "touches.npz", place / "labels.csv"
