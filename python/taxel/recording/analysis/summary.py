"""Summary of a recording: its size and rates, pressure, dead taxels, and losses."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.clock import doubt
from taxel.events import Events
from taxel.formats.layout import layout_name
from taxel.frames import Frames
from taxel.reading import ENDINGS
from taxel.recording.analysis.health import health
from taxel.recording.analysis.pressure import Series
from taxel.recording.frames import value_us
from taxel.recording.recording import Recording

#: The interval over which the highest rate is measured, us.
_PEAK_US = 10_000
#: At most so many places of taxels are listed that were not touched enough: a large sensor may have millions.
_PLACES = 100
#: Kinds of files that do not state the sensor of their events.
_WITHOUT_SIZE = ("csv", "lsa", "records", "table")
#: Kinds of files whose times are those of a board or of a camera; those of others may be when a host asked.
_OF_BOARDS = (*ENDINGS.values(), "events", "merged", "event_camera")


def summary(recording: Recording, pressed: Series | None) -> dict[str, Any]:
    """Return everything that `taxel info` prints, as JSON values.

    Parameters
    ----------
    recording : Recording
    pressed : Series, optional
        Its pressure over time (`taxel.recording.analysis.pressure.series`), if it has intensities.
    """
    array, stated = recording.array, recording._main.facts.layout
    table: Events | Frames = recording.events if recording.has_events else recording.frames()
    span = (int(table.t.min()), int(table.t.max())) if len(table) and recording.timed else None
    seconds = (span[1] - span[0]) / 1e6 if span else 0.0
    facts: dict[str, Any] = {
        "file": recording.title,
        "kind": recording.kind,
        "source": recording.source,
        "array": {name: value for name, value in array._geometry().items() if name != "exists"},
        "side": recording.side,
        "heel": recording.heel,
        "array_assumed": recording.kind in _WITHOUT_SIZE and recording.has_events and not stated.startswith("rows"),
        "timed": recording.timed,
        "from_us": span[0] if span else None,
        "to_us": span[1] if span else None,
        "seconds": seconds,
    }
    if isinstance(table, Events):
        events = table
        facts["events"] = len(events)
        facts["intensities"] = 0 if events.present is None else int(events.present.sum())
        facts["bursts_us"] = _bursts_us(events.t) if recording.kind not in _OF_BOARDS else None
        facts["markers"] = [{"t_us": t, "start": start} for t, start in events.markers]
        facts["events_per_s_board"] = len(events) / seconds if seconds else None
        if events.intensity is None and _may_be_of_camera(recording):
            facts["on_share"] = float(events.p.mean()) if len(events) else None
        facts["peak_events_per_s_board"], facts["peak_before_start"] = _peak(events)
    else:
        facts["frames"], facts["unit"] = len(table), table.unit
        facts["frames_per_s"] = (len(table) - 1) / seconds if seconds else None
        facts["values_per_s"] = 1e6 / value_us(table) if seconds else None
        facts["missing"] = {"values": table.missing, "of": table.values.size}
    gaps = recording._gaps
    facts["gaps"] = None if gaps is None else gaps.to_dict()
    clock = recording.clock
    if clock is not None and len(clock.board_us) > 1:
        host = (int(clock.arrived_ns.max()) - int(clock.arrived_ns.min())) / 1e9
        late = np.percentile(clock.delay_us, [50, 99])
        facts |= {
            "seconds_host": host,
            "events_per_s_host": facts["events"] / host if host and "events" in facts else None,
            "datagrams_per_s_host": recording.counts.get("datagrams", len(clock.arrived_ns)) / host if host else None,
            "drift_ppm": clock.drift_ppm,
            "delay_us": {"median": float(late[0]), "p99": float(late[1])},
            "clock_doubt": doubt(clock.drift_ppm, float(late[1]), float(late[0])),
        }
    calibration = recording.calibration
    facts["calibration"] = None if calibration is None else calibration.described()
    facts["rest"] = (
        None
        if pressed is None
        else {**pressed.rest.to_dict(), "text": pressed.rest._text(recording.path, recording._turned)}
    )
    # Above the rest of readings that fall is nothing but noise.
    facts["pressure"] = None if pressed is None or pressed.rest.falls else _pressure(pressed)
    of_taxels = health(table)
    return facts | {
        "notes": [{"t_us": note.t, "text": note.text} for note in recording.notes],
        "detections": {label: len(recording.detections[label]) for label in recording.detections.labels},
        "registers": None if recording.registers is None else recording.registers._held,
        "taxels": of_taxels.named(),
        "taxels_untested": int(np.count_nonzero(of_taxels.untested)),
        "taxels_untested_at": _places(of_taxels.untested),
        "counts": recording.counts,
        "truncated": recording.truncated,
        "rebuilt": recording.rebuilt,
        "lost": list(recording.lost),
        "verdict": recording.verdict,
        "verdict_details": recording.verdict.to_dict(),
        "remarks": list(recording.remarks),
        "layout": stated,
        "layout_file": layout_name(recording.path),
        "roles": list(recording._main.facts.roles),
    }


def _bursts_us(t: NDArray[np.int64]) -> float | None:
    """Return how far apart bursts of events are, us, if between most of them nearly all time passes; else None."""
    steps = np.diff(t)
    wide = steps[steps > 10 * max(1.0, float(np.median(steps)))] if len(steps) else steps
    if len(wide) < 20:
        return None
    usual = float(np.median(wide))
    near = wide[np.abs(wide - usual) < 0.25 * usual]
    return usual if near.sum() > 0.5 * steps[steps < 4 * usual].sum() else None


def _may_be_of_camera(recording: Recording) -> bool:
    """Return whether events are of an event camera by the file's kind or the sensor's name."""
    return recording.kind in ("event_camera", "records") or recording.array.name.startswith("event camera")


def _places(taxels: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return column and row of the first of some taxels."""
    columns = taxels.shape[1]
    return [(int(k % columns), int(k // columns)) for k in np.flatnonzero(taxels)[:_PLACES]]


def _pressure(pressed: Series) -> dict[str, Any] | None:
    """Return the largest contact area, peak and sum with their times, and the path of the centre, as far as known."""
    if not len(pressed.t):
        return None
    facts: dict[str, Any] = {"unit": pressed.unit, "above": pressed.above}
    facts["regions"] = {
        region: {name: float(np.nanmax(values, initial=0.0)) for name, values in loads.items() if "centre" not in name}
        for region, loads in pressed.regions.items()
    }
    for name, values in pressed.columns.items():
        kind, _, unit = name.partition("_")
        if kind == "centre":
            axis, _, unit = unit.partition("_")
            known = values[~np.isnan(values)]
            limits = facts.setdefault(f"centre_{unit}", {} if len(known) else None)
            if limits is not None:
                limits[axis] = [float(known.min()), float(known.max())]
        else:
            # A frame of missing values alone has no peak.
            k = int(np.where(np.isnan(values), -np.inf, values).argmax())
            key = {"area": name, "force": "force_n"}.get(kind, kind)
            facts[key] = {"most": float(values[k]), "t_us": int(pressed.t[k])}
    return facts


def _peak(events: Events) -> tuple[float | None, bool]:
    """Return the highest rate in 10 ms of board time, events/s, and whether most of it is before the start marker."""
    if not len(events):
        return None, False
    interval_of = events.t // _PEAK_US
    intervals, counts = np.unique(interval_of, return_counts=True)
    busiest = events.t[interval_of == intervals[counts.argmax()]]
    start_us = min((t for t, start in events.markers if start), default=int(busiest.min()))
    return len(busiest) / (_PEAK_US / 1e6), bool(np.median(busiest) < start_us)
