"""Options and steps that the commands that work on recordings share."""

from __future__ import annotations

import tomllib
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import typer

from taxel._base.messages import counted
from taxel._core import ProblemError
from taxel.spikes import to_ms

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from taxel.encode import Encoder
    from taxel.events import Events
    from taxel.frames import Frames
    from taxel.labels import Labels
    from taxel.recording import Recording
    from taxel.tare import Tare

#: How long before the first label the rest ends, and how long it must last at least, us.
_BEFORE_US, _LEAST_REST_US = 20_000, 10_000
#: Units of pictures that read 0 at rest.
_RESTS_AT_0 = ("N", "kPa")
#: Share of the taxels with events that may lack a rest without a warning: a few have their first event late.
_MOST_UNKNOWN = 0.1

TARE_HELP = "Rest of the taxels: a file that Tare.save wrote, or seconds at rest at the beginning of the recording."
SET_HELP = "KEY=VALUE: set a parameter to a value (TOML); a dotted key names a nested one. May be repeated."


def assignments(settings: list[str]) -> dict[str, Any]:
    """Return the values of ``--set KEY=VALUE``; a VALUE that is not TOML is text."""
    values = {}
    for one in settings:
        key, equals, value = one.partition("=")
        if not equals or not key.strip():
            raise ProblemError(f"--set {one}: must be KEY=VALUE")
        try:
            values[key.strip()] = tomllib.loads(f"value = {value}")["value"]
        except tomllib.TOMLDecodeError:
            values[key.strip()] = value.strip()
    return values


def encoder_of(name: str | None, settings: list[str]) -> Encoder:
    """Return the encoder that ``--encoder`` and ``--set`` describe."""
    from taxel._base.arguments import parameters  # noqa: PLC0415  the command line starts quickly
    from taxel.encode import Encoder  # noqa: PLC0415

    return Encoder.from_json(parameters({**assignments(settings), **({"name": name} if name else {})}))


def tare_of(value: str | None, recording: Recording) -> Tare | None:
    """Return the tare that ``--tare`` names: a file, or a number of seconds at the beginning of the recording.

    The rest ends early where the board marked the start of the recording, as a board that was tared does. A rest
    longer than half of the recording is refused, because the sensor was hardly at rest for all of it.
    """
    from taxel.events import Events  # noqa: PLC0415
    from taxel.recorded import recorded  # noqa: PLC0415  the command line starts quickly
    from taxel.tare import Tare  # noqa: PLC0415

    if value is None:
        return None
    try:
        seconds = float(value)
    except ValueError:
        return Tare.load(value)
    if not 0 < seconds < np.inf:
        raise ProblemError(f"--tare {value}: must be seconds above 0, or a file")
    source = recorded(recording)
    if not len(source):
        raise ProblemError(f"{recording.path}: holds nothing to take a tare from")
    first, last = int(source.t[0]), int(source.t[-1])
    if seconds * 2e6 > last - first:
        raise ProblemError(
            f"--tare {value}: more than half of {recording.path}, which lasts {(last - first) / 1e6:g} s; "
            "give the seconds at its beginning in which nothing was touched"
        )
    stop = first + int(seconds * 1e6)
    if isinstance(source, Events):
        stop = min([stop, *(t for t, start in source.markers if start and t > first)])
    return _measured(recording, source, stop)


def tare_before(labels: Mapping[str, NDArray[np.int64]], recording: Recording) -> Tare:
    """Return the tare of the time before a recording's first label, or before the board's start marker.

    A label that a person set may be late, so the rest ends a little earlier.
    """
    from taxel.events import Events  # noqa: PLC0415
    from taxel.recorded import recorded  # noqa: PLC0415  the command line starts quickly

    source = recorded(recording)
    ends = [int(times[0]) - _BEFORE_US for times in labels.values() if len(times)]
    first = int(source.t[0]) if len(source) else 0
    if isinstance(source, Events):
        ends += [t for t, start in source.markers if start and t > first]
    if not ends or min(ends) - first < _LEAST_REST_US:
        what = f"only {to_ms(max(0, min(ends) - first)):g} ms before its first label" if ends else "no label"
        raise ProblemError(
            f"{recording.path}: holds {what}, from which to take the taxels' rest; give --tare SECONDS or --tare FILE"
        )
    return _measured(recording, source, min(ends))


def tare_if_any(labels: Mapping[str, NDArray[np.int64]], recording: Recording) -> Tare | None:
    """Return a recording's tare: 0 for pictures in N or kPa, else as `tare_before`, or None without such a time."""
    from taxel.frames import Frames  # noqa: PLC0415  the command line starts quickly
    from taxel.recorded import recorded  # noqa: PLC0415
    from taxel.tare import Tare  # noqa: PLC0415

    source = recorded(recording)
    if isinstance(source, Frames) and source.unit in _RESTS_AT_0:
        nothing = np.zeros((2, *source.array.shape))
        return Tare.take(Frames(nothing, [0, 1], unit=source.unit, array=source.array), note="0, by the unit")
    try:
        return tare_before(labels, recording)
    except ProblemError:
        return None


def _measured(recording: Recording, source: Events | Frames, stop_us: int) -> Tare:
    """Return the rest before a time; warn of taxels whose first event is later, which encoders ignore."""
    from taxel.events import Events  # noqa: PLC0415  the command line starts quickly
    from taxel.tare import Tare  # noqa: PLC0415

    tare = Tare.take(source, stop_us=stop_us, note=str(recording.path))
    if isinstance(source, Events):
        present = np.zeros(source.array.shape, bool)
        present[source.y, source.x] = True
        unknown = int(np.count_nonzero(present & np.isnan(tare.rest)))
        if unknown > _MOST_UNKNOWN * np.count_nonzero(present):
            warnings.warn(
                f"{recording.path}: the rest of {unknown} of {np.count_nonzero(present)} taxels is not known, as none "
                f"of their changes lies in its first {to_ms(stop_us - int(source.t[0])):g} ms: their events are left "
                "out; start the recording before the board, which then sends all values, or give --tare FILE",
                stacklevel=2,
            )
    return tare


def span_us(recording: Recording) -> tuple[int, int]:
    """Return the first and the last time of a recording; refuse an empty one."""
    times = recording.events.t if recording.has_events else recording.frames().t
    if not len(times):
        raise ProblemError(f"{recording.path}: holds nothing")
    return int(times.min()), int(times.max())


def new_report(folder: Path) -> Path:
    """Return the path of a report's page in a folder, which is created."""
    folder.mkdir(parents=True, exist_ok=True)
    return folder / "report.html"


def references(source: str | None, option: str, recordings: Sequence[Recording]) -> list[dict[str, NDArray[np.int64]]]:
    """Return the reference events of each recording: from a table, or its own notes (a note's text is the label).

    A table names recordings by path, file name or stem; in one that it does not name nothing happened, unless the
    table also names a recording that is not there.
    """
    from taxel.labels import Labels  # noqa: PLC0415  the command line starts quickly

    if source is None or source == "notes":
        return [_notes(recording) for recording in recordings]
    table = Labels(source)
    if len(recordings) > 1 and any(not row.recording for row in table.rows):
        raise ProblemError(
            f"{option} {source}: names no recording, and there are {len(recordings)}; must have the column recording"
        )
    _check_sources(table, option, recordings)
    unnamed = [str(recording.path) for recording in recordings if table.named(recording.path) is None]
    known = {table.named(recording.path) for recording in recordings}
    others = [name for name in table.recordings if name not in known]
    if unnamed and (others or len(unnamed) == len(recordings)):
        names = f"it names {', '.join(table.recordings)}" if table.rows else "it is empty"
        raise ProblemError(f"{option} {source}: names no event in {', '.join(unnamed)}; {names}")
    return [_within(table, recording, option) for recording in recordings]


def _check_sources(table: Labels, option: str, recordings: Sequence[Recording]) -> None:
    """Refuse labels of a source that their recording does not have."""
    for row in table.rows:
        labels = {one.label for one in recordings if row.recording == table.named(one.path)}
        if row.source and labels and row.source not in labels:
            there = ", ".join(sorted(labels))
            raise ProblemError(
                f"{option} {table.path}: {row.text} at {row.t} us is of source {row.source}; there is {there}"
            )


def _notes(recording: Recording) -> dict[str, NDArray[np.int64]]:
    times: dict[str, list[int]] = {}
    for note in recording.notes:
        if note.t is not None:
            times.setdefault(note.text, []).append(note.t)
    return {label: np.sort(np.array(t, np.int64)) for label, t in times.items()}


def _within(table: Labels, recording: Recording, option: str) -> dict[str, NDArray[np.int64]]:
    """Return the events that lie within a recording; those outside are left out, with a warning."""
    from taxel.recording import kind_of_file  # noqa: PLC0415  the command line starts quickly

    first, last = span_us(recording)
    events = table.of(recording)
    inside = {label: t[(t >= first) & (t <= last + 1_000_000)] for label, t in events.items()}
    total = sum(map(len, events.values()))
    outside = total - sum(map(len, inside.values()))
    span = f"{recording.title} ({first / 1e6:.3f} to {last / 1e6:.3f} s)"
    if total and outside == total:
        raise ProblemError(f"{option} {table.path}: holds {counted(total, 'event')}, none within {span}")
    if recording.clock is None and any(row.at_ns for row in table.rows):
        warnings.warn(
            f"the {kind_of_file(recording.kind)} holds no arrival times, so host_ns cannot show by how many periods of "
            f"the board's clock (6.5536 s) {table.path} is ahead of it: its times are used unchanged",
            stacklevel=2,
        )
    if outside:
        warnings.warn(f"{outside} of the {total} events of {table.path} left out: outside {span}", stacklevel=2)
    return inside


@contextmanager
def progress(quiet: bool) -> Iterator[Callable[[str], None]]:
    """Show the current step, and warnings as single lines; on stderr, so that results can be piped."""
    from rich.console import Console  # noqa: PLC0415  the command line starts quickly

    console = Console(stderr=True)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        if quiet:
            yield lambda _: None
        else:
            with console.status("") as status:
                yield status.update
    # One that holds for several recordings is shown once.
    for message in dict.fromkeys(str(one.message) for one in caught if issubclass(one.category, UserWarning)):
        typer.echo(f"taxel: warning: {message}", err=True)


def of_source(recording: Recording, name: str | None) -> Recording:
    """Return the source that ``--source`` names; without a name the recording itself."""
    if name is None:
        return recording
    sources = recording.sources
    if name not in sources:
        raise ProblemError(f"--source {name}: {recording.path} holds {', '.join(sources)}")
    return sources[name]
