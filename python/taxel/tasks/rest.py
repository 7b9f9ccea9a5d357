"""The rest of a recording's taxels that a training and a detection take, and where it is from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from errno import ENOENT
from pathlib import Path
from shlex import quote
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import checked_path, instance
from taxel._base.errors import helped, refused
from taxel._base.messages import warn
from taxel._base.times import beginning_us
from taxel._core import ProblemError
from taxel.detect import Example
from taxel.detect.floors import TOUCH, held_by_tare
from taxel.events import Events
from taxel.frames import Frames
from taxel.options import GivenTare, check_tare, seconds_of
from taxel.recorded import recorded
from taxel.recording import Recording, open_one
from taxel.recording.analysis.pressure import quiet_rest
from taxel.recording.analysis.rest import by_unit, of_quiet, quantile, standing
from taxel.spikes import to_ms
from taxel.tare import Tare

#: How long before the first label the rest ends, and how long it must last at least, us.
_BEFORE_US, _LEAST_REST_US = 20_000, 10_000
#: So long a stretch must be quiet, us.
_QUIET_US = 500_000
#: The noise is not known from fewer frames.
_LEAST_FRAMES = 20
#: A taxel in a unit of force or pressure reads more than its noise in a quiet stretch from so many times that on; more
#: than this share of all are many. It has no load that stays for a while if it reads as much in all but this share of
#: the frames, of so many, and not less than that share of the stretch's reading.
_TIMES, _MANY, _LOWEST, _FRAMES, _MOSTLY_LOAD = 3.0, 0.25, 0.05, 2000, 0.5
#: Share of the taxels with events that may lack a rest without a warning: a few have their first event late.
_MOST_UNKNOWN = 0.1


class UnknownRestError(ProblemError):
    """Say that the rest of a recording's taxels is not known, as nothing in it is quiet: a tare must be given.

    The others of several recordings can still be detected.
    """


@dataclass(frozen=True, eq=False)
class TakenRest:
    """Hold the rest that a training and a detection take for a recording.

    Parameters
    ----------
    source : {"given", "beginning", "unit", "quiet", "labels"}
        A given tare; seconds at the recording's beginning, as asked; 0, as the values are force or pressure; the
        recording's first quiet stretch; in a training the time before its first label.
    tare : Tare
    begin_us : int, us
        The time that text counts from: the recording's first if its times count from 1970, else 0.
    """

    source: str
    tare: Tare
    begin_us: int = 0

    @property
    def detect_from_us(self) -> int | None:
        """When detection begins: at the end of a beginning that was given as at rest; None: with the recording."""
        return self.tare.stop_us if self.source == "beginning" else None

    def __str__(self) -> str:
        first, end = ((t - self.begin_us) / 1e6 for t in (self.tare.start_us, self.tare.stop_us))
        return {
            "given": "the given tare",
            "beginning": f"its beginning, {first:.3f} to {end:.3f} s",
            "unit": "0, as the values are force or pressure",
            "quiet": f"its first quiet stretch, {first:.3f} to {end:.3f} s",
            "labels": f"the time before its first label, {first:.3f} to {end:.3f} s",
        }[self.source]

    def to_dict(self) -> dict[str, Any]:
        """Return where the rest is from, and from when to when it was measured, as plain values."""
        measured = self.source in ("beginning", "quiet", "labels")
        return {"source": self.source, "us": [self.tare.start_us, self.tare.stop_us] if measured else None}


def rest(
    recording: Recording,
    tare: GivenTare | None = None,
    labels: Mapping[str, NDArray[np.int64]] | None = None,
) -> TakenRest:
    """Return the rest of a recording's taxels as trainings and detections take it, on the page, in shell and Python.

    It is the given one; else 0 of frames in a unit of force or pressure; else that of the first quiet stretch of half
    a second in which nothing is on the array, for a board's events on their held values; else, where labels are given,
    as a training does, that of the time before the first of them.

    Parameters
    ----------
    recording : Recording
        Of one sensor.
    tare : Tare, path or float (s), optional
        A tare, its file, a recording at rest, or the seconds at rest at the recording's beginning.
    labels : mapping of str to int64, shape (events,), us, optional
        The labels of a training.

    Raises
    ------
    UnknownRestError : nothing is quiet, so that a tare must be given
    ProblemError : a given tare is invalid
    FormatError : the file is neither a tare nor a recording

    Examples
    --------
    >>> import numpy as np
    >>> import taxel
    >>> values = np.full((100, 2, 2), 50.0)
    >>> values[70:] += 200
    >>> frames = taxel.Frames(values, 10_000 * np.arange(100), unit="counts", array=taxel.Array(2, 2))
    >>> import pathlib, tempfile
    >>> place = pathlib.Path(tempfile.mkdtemp()) / "press.npz"
    >>> _ = taxel.convert(frames, place)
    >>> taken = rest(taxel.open(place))
    >>> str(taken), taken.tare.rest[0, 0]
    ('its first quiet stretch, 0.000 to 0.500 s', np.float64(50.0))
    """
    source = recorded(instance("recording", recording, Recording), hold=False)
    begin_us = beginning_us(source.t[:1])
    if tare is not None:
        seconds = seconds_of(tare)
        return TakenRest("given" if seconds is None else "beginning", given_tare(tare, recording), begin_us)
    if (zero := zero_by_unit(recording)) is not None:
        return TakenRest("unit", zero, begin_us)
    found = of_quiet(source) if isinstance(source, Frames) else quiet_rest(recording)
    if found is not None and found.quiet_us is not None:
        quiet = _measured(recording, recorded(recording), found.quiet_us[1], found.quiet_us[0])
        if found.preload_at and found.preload is not None:
            warn(f"{recording.path}: the rest is {found}; the tare is without it", stacklevel=2)
            quiet = _without(quiet, found.preload)
        return TakenRest("quiet", quiet, begin_us)
    before = None if labels is None else _before(recorded(recording), labels)
    if before is None:
        why = "no stretch of half a second and four values is quiet" + " and no label is late enough" * (
            labels is not None
        )
        error = UnknownRestError(f"{recording.path}: the values of its taxels at rest are not known, because {why}")
        raise helped(error, "tare", "give")
    return TakenRest("labels", _measured(recording, recorded(recording), before), begin_us)


def _before(source: Events | Frames, labels: Mapping[str, NDArray[np.int64]]) -> int | None:
    """Return until when nothing is labelled, or until the board's start marker, us; None if that is too short a time.

    A label that a person set may be late, so it ends a little earlier.
    """
    ends = [int(times.min()) - _BEFORE_US for times in labels.values() if len(times)]
    first = int(source.t[0]) if len(source) else 0
    if isinstance(source, Events):
        ends += [t for t, start in source.markers if start and t > first]
    if not ends or min(ends) - first < _LEAST_REST_US:
        return None
    few = isinstance(source, Frames) and np.count_nonzero(source.t < min(ends)) < _LEAST_FRAMES
    return None if few else min(ends)


def _without(tare: Tare, load: NDArray[np.float64]) -> Tare:
    """Return a tare less what lay on the taxels while it was measured."""
    rest = tare.rest.reshape(-1) - load
    return tare._with(rest=[None if np.isnan(value) else value for value in rest.tolist()])


def given_tare(tare: GivenTare, recording: Recording) -> Tare:
    """Return the tare that is given: itself, that of a file or of a recording at rest, or of seconds at the beginning.

    The rest ends early where the board marked the start of the recording, as a board that was tared does. A rest
    longer than half of the recording is refused, because the sensor was hardly at rest for all of it.
    """
    if isinstance(tare, Tare):
        return tare
    seconds = seconds_of(tare)
    if seconds is None:
        return tare_of(Path(checked_path("tare", tare)), recording)
    check_tare(tare)
    source = recorded(recording)
    if not len(source):
        raise ProblemError(f"{recording.path}: holds nothing to take a tare from")
    first, last = int(source.t[0]), int(source.t[-1])
    if seconds * 2e6 > last - first:
        raise refused(
            "tare",
            f" is {tare}: more than half of {recording.title}, which lasts {(last - first) / 1e6:g} s; must be the "
            "seconds at its beginning in which nothing was touched",
        )
    stop = first + int(seconds * 1e6)
    if isinstance(source, Events):
        stop = min([stop, *(t for t, start in source.markers if start and t > first)])
    measured = _measured(recording, source, stop)
    subject, remedy = f"the beginning of {recording.title}", "give the seconds before it, or a file"
    _warn_of_touch(f"tare is {tare}: {subject}", remedy, source, measured)
    return measured


def tare_of(path: Path, recording: Recording | None = None) -> Tare:
    """Return the tare that a file holds, or the rest of the taxels in a recording in which nothing is touched.

    Parameters
    ----------
    path : Path
        A file that `Tare.save` wrote, which is JSON; else what `taxel.open` opens.
    recording : Recording, optional
        What the tare is for.

    Raises
    ------
    ProblemError : a recording in another unit than the one that the tare is for
    FormatError : neither a tare nor a recording
    FileNotFoundError : no such file
    """
    if not path.exists():
        why = "no such file; seconds are a number with a point, for example 0.5"
        raise FileNotFoundError(ENOENT, why, f"tare: {path}")
    if path.suffix == ".json" or (path.is_file() and _is_json(path)):
        return Tare.load(path)
    resting = open_one(path)
    source = recorded(resting)
    expected = None if recording is None else recorded(recording)
    if isinstance(source, Frames) and isinstance(expected, Frames) and source.unit != expected.unit:
        assert recording is not None
        raise refused(
            "tare", f" is {path}: a recording in {source.unit}; must be in {expected.unit}, as {recording.title} is"
        )
    measured = Tare.take(source, note=str(path))
    _warn_of_touch(f"tare is {path}: it", "cut it (taxel cut) to what is quiet", source, measured)
    return measured


def _is_json(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(64).lstrip().startswith(b"{")


def given_or_by_unit(tare: GivenTare | None, recording: Recording) -> Tare | None:
    """Return the tare that is given; without one 0 of frames in a unit of force or pressure, else none."""
    if tare is not None:
        return given_tare(tare, recording)
    source = recorded(recording, hold=False)
    return by_unit(source) if isinstance(source, Frames) else None


def zero_by_unit(recording: Recording) -> Tare | None:
    """Return 0 of frames in a unit of force or pressure, else none; warn of many taxels that do not rest near it."""
    source = recorded(recording)
    zero = by_unit(source) if isinstance(source, Frames) else None
    if zero is None:
        return None
    assert isinstance(source, Frames)
    found = of_quiet(source)
    if found.quiet_us is None or found.preload_at:
        return zero
    middle = np.nan_to_num(quantile(source.between(*found.quiet_us).values, 0.5))
    lowest = np.nan_to_num(quantile(source.values[:: 1 + len(source) // _FRAMES], _LOWEST))
    above = _TIMES * zero.noise
    # What is mostly a load that ends later is no rest.
    off = (middle < -above) | ((middle > above) & (lowest > np.maximum(above, _MOSTLY_LOAD * middle)))
    count = np.count_nonzero(off)
    is_off = count > _MANY * source.array.taxels
    where = "" if is_off else standing(source)
    if is_off or where:
        first, end = found.quiet_us
        stretch_s = [(t - beginning_us(source.t[:1])) / 1e6 for t in (first, end)]
        stretch = "{:.3f} to {:.3f} s".format(*stretch_s)
        # Of several recordings one number is right for all: the shortest that is quiet.
        option = f"give --tare {_QUIET_US / 1e6:g} to subtract the values of this stretch"
        if first > source.t[0]:
            cut = "taxel cut {} rest.npz --from {:.3f} --to {:.3f}".format(quote(str(recording.path)), *stretch_s)
            option = f"give --tare rest.npz to subtract the values of this stretch; to make this file, run: {cut}"
        reads = (
            f"{count} of {source.array.taxels} taxels read {middle[off].min():.3g} to {middle[off].max():.3g} "
            f"{source.unit} in a quiet stretch, {stretch}, and not 0; if nothing touches them then"
        )
        if where:
            reads = (
                f"an object is on the sensor from beginning to end, at {where}; if nothing else touches the sensor in "
                f"{stretch}"
            )
        warn(f"{recording.path}: {reads}, {option}", stacklevel=3)
    return zero


def _warn_of_touch(subject: str, remedy: str, source: Events | Frames, measured: Tare) -> None:
    """Warn of a tare in which something was touched, by which lifts are missed or false."""
    taxels = held_by_tare([Example(source, {}, measured)])
    if taxels >= TOUCH:
        warn(f"{subject} is not quiet but contains a touch of {taxels} taxels; {remedy}", stacklevel=3)


def _measured(recording: Recording, source: Events | Frames, stop_us: int, start_us: int | None = None) -> Tare:
    """Return the rest before a time; warn of taxels whose first event is later, which encoders ignore."""
    tare = Tare.take(source, start_us=start_us, stop_us=stop_us, note=str(recording.path))
    if isinstance(source, Events):
        present = np.zeros(source.array.shape, bool)
        present[source.y, source.x] = True
        unknown = int(np.count_nonzero(present & np.isnan(tare.rest)))
        if unknown > _MOST_UNKNOWN * np.count_nonzero(present):
            warn(
                f"{recording.path}: the rest of {unknown} of {np.count_nonzero(present)} taxels is not known, because "
                f"none of their changes is in its first {to_ms(stop_us - int(source.t[0])):g} ms: their events are "
                "left "
                "out; start the recording before the board, which then sends all values, or give a tare's file",
                stacklevel=2,
            )
    return tare
