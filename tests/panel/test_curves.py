"""Curves are least to greatest of their columns of time, and the values are those of the time that is asked for.

The oracle is `taxel.open` of the recording, at drawn zooms and times.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from panel.protocol import CURVE, EXTENT, Client, head, held_in, section

import taxel
from taxel.panel import Panel

#: Frames: gaps between times, us, and values of a taxel, N; NaN where one is missing.
GAPS = st.one_of(st.integers(1, 300), st.integers(300, 20_000), st.just(3_000_000))
VALUES = st.one_of(st.integers(0, 60), st.integers(0, 3), st.just(np.nan))
ZOOMS = st.lists(st.tuples(st.integers(0, 20), st.floats(0, 1)), min_size=1, max_size=4)


@dataclass
class Loads:
    """What taxels hold from times on, above their rest: (n, rows, columns), NaN where nothing is known."""

    t: np.ndarray
    above: np.ndarray
    floor: float

    def curves(self):
        """Sum, area and centre from each time on; NaN where no taxel has a value, and where nothing is pressed."""
        found = []
        for above in self.above:
            loaded = np.where(np.nan_to_num(above) > self.floor, np.nan_to_num(above), 0)
            y, x = np.indices(above.shape)
            total = np.nansum(above) if not np.isnan(above).all() else np.nan
            pressed = loaded.sum()
            at = ((loaded * axis).sum() / pressed if pressed else np.nan for axis in (x, y))
            found.append((total, np.nan if np.isnan(total) else np.count_nonzero(loaded), *at))
        return np.array(found)


@st.composite
def frames(draw):
    rows, columns, n = draw(st.integers(2, 3)), draw(st.integers(2, 4)), draw(st.integers(2, 30))
    t = draw(st.integers(-30_000, 30_000)) + np.cumsum([0, *draw(st.lists(GAPS, min_size=n - 1, max_size=n - 1))])
    values = draw(st.lists(VALUES, min_size=n * rows * columns, max_size=n * rows * columns))
    array = taxel.Array(rows, columns)
    return taxel.Frames(np.reshape(values, (n, rows, columns)).astype(float), t, unit="N", array=array)


@st.composite
def events(draw):
    """Changes within 60 ms: so early no rest is tracked, each taxel rests at its first value."""
    n = draw(st.integers(2, 60))
    t = np.sort(draw(st.lists(st.integers(0, 600), min_size=n, max_size=n))) * 100
    x, y = (np.array(draw(st.lists(st.integers(0, 2), min_size=n, max_size=n))) for _ in range(2))
    ticks = np.array(draw(st.lists(st.integers(40, 90), min_size=n, max_size=n)))
    # One change of a taxel at a time.
    _, kept = np.unique(np.stack([t, x, y]), axis=1, return_index=True)
    kept = np.sort(kept)
    p = np.arange(n) % 2 == 0
    return taxel.Events(t[kept], x[kept], y[kept], p[kept], intensity=ticks[kept], array=taxel.Array(3, 3))


def loads_of_frames(recorded):
    frames = recorded.frames()
    return Loads(frames.t, frames.values.astype(float), 0)


def loads_of_events(recorded):
    changes = recorded.events
    held, rest, above = np.full((3, 3), np.nan), np.full((3, 3), np.nan), []
    stamps = np.unique(changes.t)
    for stamp in stamps:
        for k in np.flatnonzero(changes.t == stamp):
            at = changes.y[k], changes.x[k]
            held[at] = changes.intensity[k]
            if np.isnan(rest[at]):
                rest[at] = held[at]
        above.append(np.maximum(np.nan_to_num(held - rest), 0))
    # Nobody stated the registers, so no noise floor is known.
    return Loads(stamps, np.array(above), 0)


def shown_at(page, t_us):
    """A frame of this time with all of its columns."""
    assert page.ask("seek", t_us=t_us)["type"] == "done"
    page.send(type="credit", n=2)
    while not ((found := head(page.until("frame"))[0])["t_us"] == t_us and found["flags"] & 4):
        pass
    return page.frames[-1]


def extent(values):
    """Least and greatest of values that are numbers."""
    known = values[~np.isnan(values)]
    return (known.min(), known.max()) if len(known) else None


def follows(recorded, loads_of, zooms):
    with tempfile.TemporaryDirectory() as folder:
        name = "drawn.npz" if isinstance(recorded, taxel.Frames) else "drawn.mcap"
        taxel.convert(recorded, Path(folder) / name)
        loads = loads_of(taxel.open(Path(folder) / name))
        curves, t = loads.curves(), loads.t
        with Panel(Path(folder) / name) as panel, Client(panel) as page:
            assert page.ask("open", name=name)["type"] == "done"
            about = page.since_asked("opened", name=name)
            step = about["frames"]["step"] if about["frames"] else 1
            if about["frames"]:
                loads.floor = about["frames"]["floor"] * step
                curves = loads.curves()
            near = {"abs": 1.01 * step * loads.above[0].size}
            for zoom, share in zooms:
                column_us, shown_us = 125 << zoom, int(t[0] + share * (t[-1] - t[0]))
                assert page.ask("zoom", column_us=column_us)["type"] == "done"
                frame = shown_at(page, shown_us)
                of, drawn = head(frame)[0], section(frame, 3, EXTENT)
                assert of["column_us"] == column_us
                assert len(drawn) == min(1250, shown_us // column_us - t[0] // column_us + 1)
                for number, one in enumerate(drawn, of["first"]):
                    held = curves[held_in(t, number, column_us, shown_us)]
                    for k, (key, close) in enumerate(
                        (("sum", near), ("area", {}), ("x", {"abs": 0.02}), ("y", {"abs": 0.02}))
                    ):
                        least, greatest = one[key].tolist()
                        expected = extent(held[:, k])
                        if expected is None:
                            assert not least <= greatest, (key, number)
                        else:
                            assert (
                                least * (step if k == 0 else 1),
                                greatest * (step if k == 0 else 1),
                            ) == pytest.approx(expected, **close), (key, number)
                # What the frame says of its time, and what is said of any time that is asked for.
                now = section(frame, 6, CURVE)[0].item()
                at_now = curves[np.searchsorted(t, shown_us, side="right") - 1]
                expected = [at_now[0] / step if k == 0 else at_now[k] for k in range(4)]
                if not np.isnan(at_now[0]):
                    assert now == pytest.approx(expected, abs=1.01 * loads.above[0].size, nan_ok=True)
                asked = int(t[0] + (1 - share) * (t[-1] - t[0]))
                assert page.ask("values", t_us=asked)["type"] == "done"
                [said] = page.since_asked("values", t_us=asked)["curves"]
                there = curves[np.searchsorted(t, asked, side="right") - 1]
                assert (said is None) == np.isnan(there[0])
                if said is not None:
                    assert said["sum"] * step == pytest.approx(there[0], **near)
                    assert said["area"] == there[1]
                    for key, value in (("x", there[2]), ("y", there[3])):
                        assert (said[key] is None) == np.isnan(value)
                        assert said[key] is None or said[key] == pytest.approx(value, abs=0.02)


@given(frames(), ZOOMS)
def test_curves_of_frames_are_least_to_greatest_at_every_zoom(recorded, zooms):
    follows(recorded, loads_of_frames, zooms)


@given(events(), ZOOMS)
def test_curves_of_events_are_least_to_greatest_at_every_zoom(recorded, zooms):
    follows(recorded, loads_of_events, zooms)
