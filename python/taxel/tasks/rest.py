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
from taxel._base.messages import collected, counted, warn
from taxel._base.times import beginning_us
from taxel._core import ProblemError
from taxel.detect import Example
from taxel.detect.floors import TOUCH, held_by_tare
from taxel.events import Events
from taxel.formats.event_camera import are_counts
from taxel.frames import Frames
from taxel.options import GivenTare, check_tare, seconds_of
from taxel.recorded import recorded
from taxel.recording import Recording, open_one
from taxel.recording.analysis.preload import free_of_preload, standing, without_preload
from taxel.recording.analysis.pressure import quiet_rest
from taxel.recording.analysis.rest import ZEROS_BEFORE, by_unit, of_quiet, quantile
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
#: A recording begins loaded if the sum of its first so many frames is so many times its least sums, and not less than
#: its largest ones by more.
_FIRST_FRAMES, _LOADED_TIMES = 5, 10.0
#: At most so many half seconds are looked at. Only noise moves in one if no three taxels spread so many times as much.
_STRETCHES, _THIRD, _BY_NOISE = 64, 3, 2.0
#: Share of the taxels with events that may lack a rest without a warning: a few have their first event late.
_MOST_UNKNOWN = 0.1


class UnknownRestError(ProblemError):
    """Say that the rest of a recording's taxels is not known, as nothing in it is quiet: a tare must be given.

    The others of several recordings can still be detected.
    """


@dataclass(frozen=True, eq=False)
class TakenRest:
    """Hold the rest that a detection takes for a recording.

    Parameters
    ----------
    source : {"given", "beginning", "unit", "quiet"}
        A given tare; seconds at the recording's beginning, as asked; 0, as the values are force or pressure; the
        recording's first quiet stretch.
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
        }[self.source]

    def to_dict(self) -> dict[str, Any]:
        """Return where the rest is from, and from when to when it was measured, as plain values."""
        measured = self.source in ("beginning", "quiet")
        return {"source": self.source, "us": [self.tare.start_us, self.tare.stop_us] if measured else None}


def rest(recording: Recording, tare: GivenTare | None = None) -> TakenRest:
    """Return the rest of a recording's taxels as each detection takes it: the page's, the shell's and Python's.

    It is the given one; else 0 of frames in a unit of force or pressure; else that of the first quiet stretch of half
    a second in which nothing is on the array, for a board's events on their held values. Labels and notes never
    count.

    Parameters
    ----------
    recording : Recording
        Of one sensor.
    tare : Tare, path or float (s), optional
        A tare, its file, a recording at rest, or the seconds at rest at the recording's beginning.

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
    if isinstance(source, Frames) and (zero := by_unit(source)) is not None:
        return TakenRest("unit", zero, begin_us)
    span, warning = _quiet_us(recording, source)
    if warning:
        warn(warning, stacklevel=2)
    if span is None:
        loaded = _begun_loaded(source)
        because = ("" if loaded else _noisy(source)) or f" with nothing on it{_slow(source) or loaded}"
        error = UnknownRestError(
            f"{recording.path}: the values of its taxels at rest are not known, because no half second is "
            f"quiet{because}"
        )
        raise helped(error, "tare", "give")
    return TakenRest("quiet", _measured(recording, recorded(recording), span[1], span[0]), begin_us)


def _quiet_us(recording: Recording, source: Events | Frames) -> tuple[tuple[int, int] | None, str]:
    """Return the first quiet stretch with nothing on the array, us, if any, and the line on what lay on it, or ""."""
    found = of_quiet(source) if isinstance(source, Frames) else quiet_rest(recording)
    if found is None or not found.preload_at:
        return None if found is None else found.quiet_us, ""
    return free_of_preload(recording, found)


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
        A file that `Tare.save` or ``taxel live --save-tare`` wrote, which is JSON; else what `taxel.open` opens.
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


def tare_before(labels: Mapping[str, NDArray[np.int64]], recording: Recording) -> Tare:
    """Return the tare of the time before a recording's first label, or before the board's start marker.

    The tare of frames in a unit of force or pressure is 0, as everywhere (`taxel.recording.analysis.rest`).
    A label that a person set may be late, so the rest ends a little earlier. Where fewer than 20 frames come before
    it, the tare is that of a quiet stretch, if there is one. Where something lay on the array before it and was taken
    away, the tare is of the longest time without it, before the label if there is one; a warning says so. So it does
    where a tare would hold a touch, and is that of the first quiet stretch, as of a detection, instead.
    """
    if (zero := zero_by_unit(recording)) is not None:
        return zero
    source = recorded(recording)
    return _without_touch(_unloaded(labels, recording, source), recording, source)


def _without_touch(tare: Tare, recording: Recording, source: Events | Frames) -> Tare:
    """Return a tare of a recording; if it holds a touch, and the first quiet stretch none, that of this stretch."""
    taxels = held_by_tare([Example(source, {}, tare)])
    span = _quiet_us(recording, source)[0] if taxels >= TOUCH else None
    if span is None:
        return tare
    quiet = _measured(recording, source, span[1], span[0])
    if held_by_tare([Example(source, {}, quiet)]) >= TOUCH:
        return tare
    begin_us = beginning_us(source.t[:1])
    first, end, *stretch = ((t - begin_us) / 1e6 for t in (tare.start_us, tare.stop_us, *span))
    warn(
        f"{recording.path}: {first:.3f} to {end:.3f} s, before the first label, contains a touch of {taxels} taxels, "
        "so the tare is that of the first quiet stretch, {:.3f} to {:.3f} s".format(*stretch),
        stacklevel=2,
    )
    return quiet


def _unloaded(labels: Mapping[str, NDArray[np.int64]], recording: Recording, source: Events | Frames) -> Tare:
    """Return the tare of the time before the first label without what lay on the array."""
    first = min((int(times[0]) for times in labels.values() if len(times)), default=0) - _BEFORE_US
    tare, warning = without_preload(recording, first)
    if warning:
        warn(warning, stacklevel=2)
    if tare is not None:
        return tare
    if isinstance(source, Frames) and np.count_nonzero(source.t < first) < _LEAST_FRAMES <= len(source):
        quiet = of_quiet(source).quiet_us
        if quiet is not None:
            return Tare.take(source, start_us=quiet[0], stop_us=quiet[1], note=str(recording.path))
    return _before(labels, recording)


def _before(labels: Mapping[str, NDArray[np.int64]], recording: Recording) -> Tare:
    source = recorded(recording)
    ends = [int(times[0]) - _BEFORE_US for times in labels.values() if len(times)]
    first = int(source.t[0]) if len(source) else 0
    if isinstance(source, Events):
        ends += [t for t, start in source.markers if start and t > first]
    if not ends or min(ends) - first < _LEAST_REST_US:
        content = f"only {to_ms(max(0, min(ends) - first)):g} ms before its first label" if ends else "no label"
        error = UnknownRestError(
            f"{recording.path}: holds {content}, so the taxels' rest is not known{_begun_loaded(source)}"
        )
        raise helped(error, "tare", "give")
    return _measured(recording, source, min(ends))


def _noisy(source: Events | Frames) -> str:
    """Return that only noise is why no half second is quiet, and how strong it is; else ""."""
    if not isinstance(source, Frames) or len(source) < 2:
        return ""
    lasts, values = int(np.ceil(_QUIET_US / np.median(np.diff(source.t)))), source.values.reshape(len(source), -1)
    begins = np.arange(0, len(source) - lasts, lasts)[:: 1 + len(source) // (lasts * _STRETCHES)]
    if lasts < _LEAST_FRAMES or not len(begins):
        return ""
    spread, noise = np.array([_spread(values[begin : begin + lasts]) for begin in begins.tolist()]).transpose(1, 0, 2)
    moves = np.nan_to_num(spread / np.maximum(noise, np.finfo(np.float32).tiny))
    still = np.sort(moves, axis=1)[:, -min(_THIRD, moves.shape[1])] < _BY_NOISE
    strong = float(np.median(noise[still])) if still.any() else 0.0
    if not strong:
        return ""
    share = strong / np.nanmax(np.ptp(values, axis=0))
    return (
        f": {np.count_nonzero(still)} of {counted(len(still), 'half second')} contain only noise, but the noise has a "
        f"standard deviation of {strong:.3g} {source.unit}, {share:.1%} of the range"
    )


def _spread(values: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return each taxel's standard deviation, and that of its noise: two frames differ by twice its variance."""
    apart = np.diff(values, axis=0).astype(np.float64)
    return values.std(axis=0, dtype=np.float64), np.sqrt((apart**2).mean(axis=0) / 2)


def _slow(source: Events | Frames) -> str:
    """Return that frames come so slowly that half a second holds none or one; else ""."""
    apart_us = float(np.median(np.diff(source.t))) if isinstance(source, Frames) and len(source) > 1 else 0.0
    return f": its frames are {apart_us / 1e6:.3g} s apart" if apart_us > _QUIET_US / 2 else ""


def _begun_loaded(source: Events | Frames) -> str:
    """Return what helps if a recording of taxels that read 0 at some time seems to begin loaded; else "".

    It does if the sum of all taxels in its first frames is far above its least ones, and not far below its largest
    ones. Counts of events do not: noise alone counts, and is 0 at times.
    """
    if not isinstance(source, Frames) or are_counts(source.unit) or source.values.min(axis=0, initial=np.inf).any():
        return ""
    sums = np.asarray(np.nansum(source.values, axis=(1, 2), dtype=np.float64))
    begin, (least, most) = np.median(sums[:_FIRST_FRAMES]), np.quantile(sums, (_LOWEST, 1 - _LOWEST))
    is_loaded = begin > 0 and begin >= _LOADED_TIMES * least and begin >= most / _LOADED_TIMES
    return f"; where trials begin with load on the sensor, {ZEROS_BEFORE} helps" if is_loaded else ""


def tare_if_any(labels: Mapping[str, NDArray[np.int64]], recording: Recording) -> Tare | None:
    """Return a recording's tare: 0 of force or pressure, else as `tare_before`, or None without such a time."""
    if (zero := zero_by_unit(recording)) is not None:
        return zero
    source = recorded(recording)
    try:
        return _without_touch(_before(labels, recording), recording, source)
    except ProblemError:
        return None


def has_rest(labels: Mapping[str, NDArray[np.int64]], recording: Recording) -> bool:
    """Return whether a training has a tare of a recording that holds no touch."""
    with collected():  # what it warns of, the training does
        tare = tare_if_any(labels, recording)
    source = recorded(recording)
    return tare is not None and held_by_tare([Example(source, {}, tare)]) < min(TOUCH, source.array.taxels)


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
