"""Spike trains in the files of other tools: NWB."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from uuid import uuid4
from warnings import catch_warnings, filterwarnings

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import number, shown, text
from taxel._base.arguments import path as checked_path
from taxel._base.files import whole_file
from taxel._core import FormatError, ProblemError

__all__ = ["read_nwb", "write_nwb"]

#: Times (ms) train by train, start, stop, and values train by train.
Read = tuple[list[NDArray[np.float64]], float, float, list[NDArray[np.float32]] | None]


def write_nwb(
    path: str | os.PathLike[str],
    times: list[NDArray[np.float64]],
    values: list[NDArray[np.float32]] | None,
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
        file.add_unit_column("value", "signed value of each spike: polarity or bits", index=True)
    window_s = np.array([window_ms]) / 1000.0
    for n, train in enumerate(times):
        signed = {} if values is None else {"value": values[n]}
        file.add_unit(id=n, spike_times=train / 1000.0, obs_intervals=window_s, **signed)
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
            values = None
            if "value" in columns:
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
    return times, first, last, values


@contextmanager
def _quiet_about_names() -> Iterator[None]:
    """Suppress pynwb's warnings about the name of the temporary file and about columns that NWB does not define."""
    with catch_warnings():
        filterwarnings("ignore", category=UserWarning, module="pynwb|hdmf")
        yield
