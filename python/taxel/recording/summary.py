"""Summary of a recording: its size and rates, pressure, dead taxels, and losses."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.clock import doubt
from taxel.recording.health import health
from taxel.recording.pressure import Series
from taxel.recording.recording import Recording

__all__ = ["summary"]

#: The interval over which the highest rate is measured, us.
_PEAK_US = 10_000


def summary(recording: Recording, pressed: Series | None) -> dict[str, Any]:
    """Return everything that `taxel info` prints, as JSON values.

    Parameters
    ----------
    recording : Recording
    pressed : Series, optional
        Its pressure over time (`taxel.recording.pressure.series`), if it has intensities.
    """
    array = recording.array
    table = recording.events if recording.has_events else recording.frames()
    span = (int(table.t.min()), int(table.t.max())) if len(table) and recording.timed else None
    seconds = (span[1] - span[0]) / 1e6 if span else 0.0
    facts: dict[str, Any] = {
        "file": recording.title,
        "kind": recording.kind,
        "source": recording.source,
        "array": {name: value for name, value in array._geometry().items() if name != "exists"},
        "side": recording.side,
        "heel": recording.heel,
        "array_assumed": recording.kind in ("csv", "lsa") and recording.has_events,
        "timed": recording.timed,
        "from_us": span[0] if span else None,
        "to_us": span[1] if span else None,
        "seconds": seconds,
    }
    if recording.has_events:
        events = recording.events
        facts["events"] = len(events)
        facts["intensities"] = 0 if events.present is None else int(events.present.sum())
        facts["markers"] = [{"t_us": t, "start": start} for t, start in events.markers]
        facts["events_per_s_board"] = len(events) / seconds if seconds else None
        facts["peak_events_per_s_board"] = _peak(events.t)
    else:
        facts["pictures"], facts["unit"] = len(table), recording.frames().unit
        facts["pictures_per_s"] = (len(table) - 1) / seconds if seconds else None
    clock = recording.clock
    if clock is not None and len(clock.board_us) > 1:
        host = (int(clock.arrived_ns.max()) - int(clock.arrived_ns.min())) / 1e9
        late = np.percentile(clock.delay_us, [50, 99])
        facts |= {
            "seconds_host": host,
            "events_per_s_host": facts["events"] / host if host and "events" in facts else None,
            "datagrams_per_s_host": len(clock.arrived_ns) / host if host else None,
            "drift_ppm": clock.drift_ppm,
            "delay_us": {"median": float(late[0]), "p99": float(late[1])},
            "clock_doubt": doubt(clock.drift_ppm, float(late[1])),
        }
    calibration = recording.calibration
    facts["calibration"] = None if calibration is None else calibration.described()
    facts["rest"] = None if pressed is None else {**pressed.rest.described(), "text": str(pressed.rest)}
    facts["pressure"] = None if pressed is None else _pressure(pressed)
    of_taxels = health(table)
    return facts | {
        "notes": [{"t_us": note.t, "text": note.text} for note in recording.notes],
        "detections": {label: len(recording.detections[label]) for label in recording.detections.labels},
        "registers": None if recording.registers is None else json.loads(recording.registers._json()),
        "taxels": of_taxels.named(),
        "taxels_untold": int(np.count_nonzero(of_taxels.untold)),
        "counts": recording.counts,
        "truncated": recording.truncated,
        "rebuilt": recording.rebuilt,
        "lost": list(recording.lost),
        "verdict": recording.verdict,
    }


def _pressure(pressed: Series) -> dict[str, Any] | None:
    """Return the largest contact area, peak and sum with their times, and the path of the centre, as far as known."""
    if not len(pressed.t):
        return None
    facts: dict[str, Any] = {"unit": pressed.unit, "above": pressed.above}
    curves: dict[str, Any] = {f"area_{pressed.area_unit}": pressed.area, "peak": pressed.peak, "sum": pressed.total}
    curves["force_n"] = pressed.force
    for name, values in curves.items():
        if values is not None:
            k = int(values.argmax())
            facts[name] = {"most": float(values[k]), "t_us": int(pressed.t[k])}
    if pressed.centre is None:
        return facts
    centre = pressed.centre[~np.isnan(pressed.centre).any(axis=1)]
    limits = {"x": [float(v) for v in (centre[:, 0].min(), centre[:, 0].max())]} if len(centre) else None
    if limits is not None:
        limits["y"] = [float(v) for v in (centre[:, 1].min(), centre[:, 1].max())]
    return facts | {f"centre_{pressed.centre_unit}": limits}


def _peak(t: NDArray[np.int64]) -> float | None:
    """Return the highest rate in an interval of 10 ms of board time, events/s."""
    if not len(t):
        return None
    _, counts = np.unique(t // _PEAK_US, return_counts=True)
    return float(counts.max() / (_PEAK_US / 1e6))
