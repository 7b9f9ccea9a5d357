"""Footprints that are drawn: a heel, a lateral midfoot, five metatarsal heads, a hallux and four toes, rolling off.

Places are in the foot's own mm: x from medial to lateral, y from heel to toes. Each part is an ellipse that carries a
known load at known times.
"""

from __future__ import annotations

import numpy as np

import taxel

LENGTH = 260.0
#: Name, x, y, half widths, pressure, and from when to when it is loaded, shares of stance; heads lie at 73 %.
PARTS = (
    ("heel", 0.0, 32.0, 27.0, 32.0, 200.0, 0.0, 0.60),
    ("midfoot", 16.0, 100.0, 13.0, 48.0, 60.0, 0.08, 0.70),
    ("metatarsal 1", -30.0, 188.0, 13.0, 17.0, 180.0, 0.25, 0.93),
    ("metatarsal 2", -12.0, 193.0, 9.0, 17.0, 220.0, 0.18, 0.94),
    ("metatarsal 3", 5.0, 189.0, 9.0, 17.0, 210.0, 0.16, 0.94),
    ("metatarsal 4", 20.0, 181.0, 9.0, 17.0, 160.0, 0.14, 0.92),
    ("metatarsal 5", 34.0, 170.0, 9.0, 17.0, 110.0, 0.12, 0.90),
    ("hallux", -27.0, 243.0, 12.0, 16.0, 190.0, 0.45, 1.0),
    ("toes 2-5", -5.0, 240.0, 6.0, 8.0, 80.0, 0.5, 0.98),
    ("toes 2-5", 9.0, 234.0, 6.0, 8.0, 70.0, 0.5, 0.97),
    ("toes 2-5", 21.0, 226.0, 6.0, 8.0, 60.0, 0.5, 0.96),
    ("toes 2-5", 32.0, 214.0, 5.0, 7.0, 50.0, 0.5, 0.95),
)


def course(begin, end, n=51):
    """A load over stance: up, and down, as half a sine."""
    s = np.linspace(0, 1, n)
    return np.where((s >= begin) & (s <= end), np.sin(np.pi * np.clip((s - begin) / (end - begin), 0, 1)) + 0.02, 0.0)


def drawn(cell=5.0, angle=0.0, left=False, heads=0.73, noise=0.0, cut=None, seed=0, size=0.0):
    """Frames of a footfall, and the share of the impulse that each region carries.

    `angle` turns the foot, which points up without it; `heads` moves the metatarsal heads along the length; `cut`
    leaves out what is not between two shares of the length.
    """
    n = round(400 / cell)
    rows, columns = np.indices((n, n))
    fine = 4
    inner = (np.arange(fine) + 0.5) / fine - 0.5
    turn = np.radians(angle)
    along, right = np.array([np.sin(turn), -np.cos(turn)]), np.array([np.cos(turn), np.sin(turn)])
    values, loads = np.zeros((51, n, n)), {}
    shift = (heads - 0.73) * LENGTH
    for name, x, at, a, b, pressure, begin, end in PARTS:
        y = at + shift * (0.5 if name == "midfoot" else 1.0) * (name.startswith("meta") or name == "midfoot")
        share = np.zeros((n, n))
        for dx in inner:
            for dy in inner:
                places = np.stack([(columns + dx) * cell - 200, (rows + dy) * cell - 200], axis=-1)
                px, py = places @ right * (-1 if left else 1), places @ along + LENGTH / 2
                share += (((px - x) / a) ** 2 + ((py - y) / b) ** 2 < 1) / fine**2
        if cut is not None:
            py = np.stack([columns * cell - 200, rows * cell - 200], axis=-1) @ along + LENGTH / 2
            share *= (py >= cut[0] * LENGTH) & (py <= cut[1] * LENGTH)
        part = course(begin, end)[:, None, None] * pressure * share
        values += part
        loads[name] = loads.get(name, 0.0) + float(part.sum())
    if noise:
        values += np.abs(np.random.default_rng(seed).normal(0, noise * values.max(), values.shape)) * (values > 0)
    total = sum(loads.values())
    array = taxel.Array(n, n, cell, name="drawn plate")
    t = np.arange(51, dtype=np.int64) * 10_000
    frames = taxel.Frames(values.astype(np.float32), t, unit="kPa", array=array)
    return frames, {name: load / total for name, load in loads.items()}
