"""Labelled recordings of several kinds, which begin with more than half a second of rest."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from discs import touches

import taxel

#: How long nothing is touched at first, us.
REST_US = 700_000


def rested(seed: int) -> tuple[taxel.Events, dict[str, np.ndarray]]:
    """Return a board's events, which begin with rest, and their labels."""
    events, truth = touches(seed)
    first = min(int(times[0]) for times in truth.values()) - 20_000
    t = events.t + np.where(events.t >= first, REST_US, 0)
    later = taxel.Events(t, events.x, events.y, events.p, intensity=events.intensity, array=events.array)
    return later, {label: np.add(times, REST_US) for label, times in truth.items()}


def board(folder: Path, seed: int = 9) -> Path:
    """Write a board's events; return the file."""
    events, truth = rested(seed)
    taxel.convert(events, folder / f"{seed}.mcap")
    _labels(folder / f"{seed}.notes.csv", truth)
    return folder / f"{seed}.mcap"


def mat(folder: Path, seed: int = 3) -> Path:
    """Write frames of a mat in counts; return the file."""
    rng, hz = np.random.default_rng(seed), 100
    values = 40 + rng.normal(0, 0.5, (6 * hz, 6, 6))
    begins = [hz + 60 * k for k in range(8)]
    for k, begin in enumerate(begins):
        values[begin : begin + 20, 1:4, k % 3 : k % 3 + 3] += 60
    t = np.arange(len(values)) * (1_000_000 // hz)
    frames = taxel.Frames(np.round(values), t, unit="counts", array=taxel.Array(6, 6, name="mat"))
    taxel.convert(frames, folder / f"mat{seed}.npz")
    truth = {"contact": t[begins], "lift": t[[begin + 20 for begin in begins]]}
    _labels(folder / f"mat{seed}.notes.csv", truth)
    return folder / f"mat{seed}.npz"


def trials(folder: Path) -> Path:
    """Write a folder of frames in N, each with its labels; return it."""
    place = folder / "trials"
    place.mkdir()
    for seed in range(3):
        mat(place, seed)
        file = place / f"mat{seed}.npz"
        frames = taxel.open(file).frames()
        newton = taxel.Frames(np.maximum(frames.values - 40, 0), frames.t, unit="N", array=frames.array)
        taxel.convert(newton, file, overwrite=True)
    return place


def _labels(table: Path, truth: dict[str, np.ndarray]) -> None:
    rows = sorted((int(t), label) for label, times in truth.items() for t in times)
    table.write_text("label,t_us\n" + "".join(f"{label},{t}\n" for t, label in rows))
