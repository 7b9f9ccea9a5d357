"""Spike trains in the files of other tools: NWB."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import Any, Literal
from uuid import uuid4
from warnings import catch_warnings, filterwarnings

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import number, shown, text
from taxel._base.arguments import path as checked_path
from taxel._base.files import whole_file
from taxel._core import FormatError, ProblemError

__all__ = ["read_nwb", "write_nwb"]

Kind = Literal["unsigned", "signed", "graded"]

#: Times (ms) train by train, start, stop, values train by train, and their kind.
Read = tuple[list[NDArray[np.float64]], float, float, list[NDArray[np.float32]] | None, Kind]


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
    from pynwb import NWBHDF5IO, NWBFile  # noqa: PLC0415  heavy, and an extra

    if begun is None:
        begun = datetime.now()
    if not isinstance(begun, datetime):
        raise ProblemError(f"begun is {shown(begun)}: must be a datetime")
    try:
        begun = begun.astimezone()
    except (OverflowError, ValueError, OSError):
        raise ProblemError(f"begun is {begun}: must be a date that this machine's clock knows") from None
    if "\0" in text("description", description):
        raise ProblemError(f"description is {shown(description)}: NWB takes no zero in a text")
    file = NWBFile(description, str(uuid4()), begun)
    if values is not None:
        meaning = "factor of the weight" if kind == "graded" else "polarity or bits"
        file.add_unit_column("value", f"{kind} value of each spike: {meaning}", index=True)
    valued: dict[str, object] = {}
    if kind == "graded":
        file.add_unit_column("value_kind", "what the values of the spikes mean")
        valued["value_kind"] = kind
    window_s = np.array([window_ms]) / 1000.0
    for n, train in enumerate(times):
        if values is not None:
            valued["value"] = values[n]
        file.add_unit(id=n, spike_times=train / 1000.0, obs_intervals=window_s, **valued)
    with whole_file(path, overwrite=overwrite) as part, _quiet_about_names(), NWBHDF5IO(part, "w") as io:
        io.write(file)
    return Path(path)


def read_nwb(path: str | os.PathLike[str], start: float | None, stop: float | None) -> Read:
    """Read the units of an NWB file; see `SpikeTrains.from_nwb`."""
    from pynwb import NWBHDF5IO  # noqa: PLC0415  heavy, and an extra

    place = checked_path("path", path)
    window_ms = [
        None if edge is None else number(name, edge, "ms") for name, edge in (("start", start), ("stop", stop))
    ]
    open(place, "rb").close()  # a missing file is Python's own error
    try:
        with _quiet_about_names(), NWBHDF5IO(place, "r") as io:
            units = io.read().units
            columns = () if units is None else units.colnames
            if "spike_times" not in columns:
                raise FormatError(f"{place}: an NWB file without spike times in a table of units")
            times = [1000.0 * np.asarray(units["spike_times"][n], np.float64) for n in range(len(units))]
            values: list[NDArray[np.float32]] | None = None
            kind: Kind = "unsigned"
            if "value" in columns:
                kind = _kind_of(units, columns)
                values = [np.asarray(units["value"][n], np.float32) for n in range(len(units))]
            watched = np.empty((0, 2))
            if "obs_intervals" in columns and len(units):
                watched = 1000.0 * np.concatenate([np.reshape(i, (-1, 2)) for i in units["obs_intervals"][:]])
    except FormatError:
        raise
    except Exception as error:  # h5py and pynwb raise errors of many kinds for a foreign or broken file
        raise FormatError(f"{place}: no NWB file that can be read: {shown(str(error))}") from None
    every = np.concatenate([*times, [0.0]])
    widest = (watched[:, 0].min(), watched[:, 1].max()) if len(watched) else (every.min(), every.max())
    first, last = (
        float(outermost) if chosen is None else chosen for chosen, outermost in zip(window_ms, widest, strict=True)
    )
    return times, first, last, values, kind


def _kind_of(units: Any, columns: Iterable[str]) -> Kind:
    """Return the kind of the values in a table of units: signed, unless all units are graded."""
    graded = {str(kind) == "graded" for kind in units["value_kind"][:]} if "value_kind" in columns else {False}
    if graded == {True, False}:
        raise FormatError("units of different value_kind: must be one for all")
    return "graded" if graded == {True} else "signed"


@contextmanager
def _quiet_about_names() -> Iterator[None]:
    """Suppress pynwb's warnings about the name of the temporary file and about columns that NWB does not define."""
    with catch_warnings():
        filterwarnings("ignore", category=UserWarning, module="pynwb|hdmf")
        yield
