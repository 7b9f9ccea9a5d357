"""Spike trains in the files of other tools: NWB."""

from __future__ import annotations

import os
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal
from uuid import uuid4

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import checked_path, number, shown, text
from taxel._base.arrays import datasets, hdf5, read_dataset, write_hdf5
from taxel._base.errors import refused, unreadable

if TYPE_CHECKING:
    import h5py

Kind = Literal["unsigned", "signed", "graded"]

#: Times (ms) of all trains, their offsets, start, stop, values and their kind: the arguments of `SpikeTrains`.
Read = tuple[NDArray[np.float64], NDArray[np.int64], float, float, NDArray[Any] | None, Kind]


def write_nwb(
    path: str | os.PathLike[str],
    times: list[NDArray[np.float64]],
    values: list[NDArray[np.float32]] | None,
    kind: Kind,
    window_ms: tuple[float, float],
    *,
    begun: datetime | None,
    description: str,
    overwrite: bool,
) -> Path:
    """Write spike trains to an NWB file, one unit a train; see `SpikeTrains.to_nwb`."""
    if begun is None:
        begun = datetime.now()
    if not isinstance(begun, datetime):
        raise refused("begun", f" is {shown(begun)}: must be a datetime")
    try:
        begun = begun.astimezone()
    except (OverflowError, ValueError, OSError):
        raise refused("begun", f" is {begun}: must be a date that this computer can represent") from None
    if "\0" in text("description", description):
        raise refused(
            "description", f" is {shown(description)}: must not contain a zero byte, because NWB does not allow it"
        )
    trains = (times, values, kind, np.array([window_ms]) / 1000.0)
    # pynwb closes the file where this ends.
    kept: list[object] = []
    write_hdf5(path, lambda file: kept.append(_write(file, description, begun, *trains)), overwrite=overwrite)
    return Path(path)


def _write(
    file: h5py.File,
    description: str,
    begun: datetime,
    times: list[NDArray[np.float64]],
    values: list[NDArray[np.float32]] | None,
    kind: Kind,
    window_s: NDArray[np.float64],
) -> object:
    """Write an open file, and return what has written it."""
    from pynwb import NWBHDF5IO, NWBFile  # noqa: PLC0415  heavy, and an extra

    session = NWBFile(description, str(uuid4()), begun)
    if values is not None:
        meaning = "factor of the weight" if kind == "graded" else "polarity or bits"
        # A list without values has no type to write.
        none: Any = [] if any(map(len, values)) else np.empty(0, np.float32)
        session.add_unit_column("value", f"{kind} value of each spike: {meaning}", data=none, index=True)
    valued: dict[str, object] = {}
    if kind == "graded":
        session.add_unit_column("value_kind", "what the values of the spikes mean")
        valued["value_kind"] = kind
    for n, train in enumerate(times):
        if values is not None:
            valued["value"] = values[n]
        session.add_unit(id=n, spike_times=train / 1000.0, obs_intervals=window_s, **valued)
    io = NWBHDF5IO(file=file, mode="w")
    io.write(session)
    return io


def read_nwb(path: str | os.PathLike[str], start: float | None, stop: float | None) -> Read:
    """Read the units of an NWB file; see `SpikeTrains.from_nwb`."""
    file = checked_path("path", path)
    window_ms = [
        None if edge is None else number(name, edge, "ms") for name, edge in (("start", start), ("stop", stop))
    ]
    with hdf5(file) as h5:
        if "nwb_version" not in h5.attrs:
            raise unreadable("is not an NWB file, because the attribute nwb_version is missing", file)
        there = datasets(h5)
        if "units/spike_times" not in there:
            raise unreadable("the NWB file contains no spike times in a table of units", file)
        seconds, offsets = _lists(h5, "spike_times")
        values: NDArray[Any] | None = None
        kind: Kind = "unsigned"
        if "units/value" in there:
            kind = _kind_of(h5)
            values, others = _lists(h5, "value")
            if not np.array_equal(offsets, others):
                raise unreadable("units/value must have the lengths of the trains, one value per spike", file)
        watched = np.empty((0, 2))
        if "units/obs_intervals" in there and len(offsets) > 1:
            watched = 1000.0 * read_dataset(h5, "units/obs_intervals").astype(np.float64)
            if watched.ndim != 2 or watched.shape[1] != 2:
                raise unreadable(f"units/obs_intervals has shape {watched.shape}; must be (intervals, 2)", file)
    times = 1000.0 * seconds.astype(np.float64, copy=False)
    if len(watched):
        widest = (watched[:, 0].min(), watched[:, 1].max())
    else:
        widest = (times.min(initial=0.0), times.max(initial=0.0))
    first, last = (
        float(outermost) if chosen is None else chosen for chosen, outermost in zip(window_ms, widest, strict=True)
    )
    return times, offsets, first, last, values, kind


def _lists(h5: h5py.File, name: str) -> tuple[NDArray[Any], NDArray[np.int64]]:
    """Return a column of the table of units, of which each row is a list: all values, and the offsets of the lists."""
    column, index = f"units/{name}", f"units/{name}_index"
    if index not in h5:
        raise unreadable(f"{column} must have a list for each unit, but {index} is missing", h5.filename)
    values, ends = read_dataset(h5, column), read_dataset(h5, index)
    if values.ndim != 1 or ends.ndim != 1 or ends.dtype.kind not in "ui":
        found = f"{values.dtype} of shape {values.shape}"
        raise unreadable(f"{column} is {found}; must be a list for each unit", h5.filename)
    offsets = np.concatenate([[0], ends.astype(np.int64)])
    if np.any(offsets[1:] < offsets[:-1]) or offsets[-1] > len(values):
        raise unreadable(f"{index} must ascend from 0 to {len(values)}, the number of values", h5.filename)
    return values[: offsets[-1]], offsets


def _kind_of(h5: h5py.File) -> Kind:
    """Return the kind of the values in a table of units: signed, unless all units are graded."""
    kinds = read_dataset(h5, "units/value_kind", texts=True) if "units/value_kind" in h5 else np.array([""])
    graded = {kind == "graded" for kind in kinds.flat}
    if graded == {True, False}:
        raise unreadable("the units have different value_kind: all must have the same", h5.filename)
    return "graded" if graded == {True} else "signed"
