"""Options and steps that the commands that work on recordings share."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from itertools import chain, repeat
from pathlib import Path
from threading import Event, Thread
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from taxel._base.arguments import short
from taxel._base.documents import NotTomlError, of_toml
from taxel._base.messages import counted, escaped, warn
from taxel._base.number_text import float_of
from taxel._base.times import beginning_us, begun
from taxel._core import ProblemError
from taxel.cli._say import say
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
#: Of fewer pictures the noise is not known.
_LEAST_PICTURES = 20
#: Without a terminal a line says the step after so long, then after so long again; the last repeats, s.
_REPORT_S = (2.0, 8.0, 20.0, 30.0)
#: So long after the last event of a board a label may follow, us, as people mark late; one further than the window of a
#: score is named, as no detection can lie so near to it.
_LATE_US, _NEAR_US = 1_000_000, 50_000
#: Share of the taxels with events that may lack a rest without a warning: a few have their first event late.
_MOST_UNKNOWN = 0.1

#: What every command that works on recordings reads.
READ_HELP = ".mcap, .lsa, .npz, .csv or .h5, a ROS bag or a file of another maker"
TARE_HELP = "Rest of the taxels: a file that Tare.save wrote, or seconds at rest at the beginning of the recording."
SET_HELP = "KEY=VALUE: set a parameter to a value (TOML); a dotted key names a nested one. May be repeated."


def assignments(settings: list[str]) -> dict[str, Any]:
    """Return the values of ``--set KEY=VALUE``; a VALUE that is not TOML is text."""
    values = {}
    for one in settings:
        key, equals, value = one.partition("=")
        if not equals or not key.strip():
            raise ProblemError(f"--set {short(one)}: must be KEY=VALUE")
        try:
            values[key.strip()] = of_toml(f"--set {short(key.strip())}", f"value = {value}")["value"]
        except NotTomlError:
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
    seconds = _seconds(value)
    if seconds is None:
        return Tare.load(value)
    if not 0 < seconds < np.inf:
        raise ProblemError(f"--tare {value}: must be seconds above 0, or a file")
    source = recorded(recording)
    if not len(source):
        raise ProblemError(f"{recording.path}: holds nothing to take a tare from")
    first, last = int(source.t[0]), int(source.t[-1])
    if seconds * 2e6 > last - first:
        raise ProblemError(
            f"--tare {value}: more than half of {recording.title}, which lasts {(last - first) / 1e6:g} s; "
            "give the seconds at its beginning in which nothing was touched"
        )
    stop = first + int(seconds * 1e6)
    if isinstance(source, Events):
        stop = min([stop, *(t for t, start in source.markers if start and t > first)])
    tare = _measured(recording, source, stop)
    _warn_of_touch(value, recording, source, tare)
    return tare


def tare_or_by_unit(value: str | None, recording: Recording) -> Tare | None:
    """Return the tare that ``--tare`` names; without one 0 of pictures in a unit of force or pressure, else none."""
    from taxel.frames import Frames  # noqa: PLC0415  the command line starts quickly
    from taxel.recorded import recorded  # noqa: PLC0415
    from taxel.recording.rest import by_unit  # noqa: PLC0415

    source = recorded(recording, hold=False)
    return by_unit(source) if value is None and isinstance(source, Frames) else tare_of(value, recording)


def _warn_of_touch(value: str, recording: Recording, source: Events | Frames, tare: Tare) -> None:
    """Warn of a tare in which something was touched, by which lifts are missed or false."""
    from taxel.detect import Example  # noqa: PLC0415  the command line starts quickly
    from taxel.detect.label_times import TOUCH, held_by_tare  # noqa: PLC0415
    from taxel.recording.rest import NOISE_FLOOR  # noqa: PLC0415

    held = held_by_tare([Example(source, {}, tare)], NOISE_FLOOR)
    if held >= TOUCH:
        warn(
            f"--tare {value}: the beginning of {recording.title} is not quiet but holds a touch of {held} taxels; give "
            "the seconds before it, or --tare FILE",
            stacklevel=2,
        )


def _seconds(value: str) -> float | None:
    """Return the seconds that ``--tare`` says; None of a file."""
    try:
        return float_of(value)
    except ValueError:
        return None


def end_of_rest_us(value: str | None, tare: Tare | None) -> int | None:
    """Return the end of the tare if ``--tare`` took it from the recording itself: before it nothing is detected."""
    return None if value is None or tare is None or _seconds(value) is None else tare.stop_us


def tare_before(labels: Mapping[str, NDArray[np.int64]], recording: Recording) -> Tare:
    """Return the tare of the time before a recording's first label, or before the board's start marker.

    Of pictures in a unit of force or pressure it is 0, as everywhere (`taxel.recording.rest`).
    A label that a person set may be late, so the rest ends a little earlier. Where fewer than 20 pictures come before
    it, the tare is that of a quiet stretch, if there is one. Where something lay on the array before it and was taken
    away, the tare is of the longest time without it, before the label if there is one; a warning says so.
    """
    from taxel.frames import Frames  # noqa: PLC0415  the command line starts quickly
    from taxel.recorded import recorded  # noqa: PLC0415
    from taxel.recording.lain import without_what_lay  # noqa: PLC0415
    from taxel.recording.rest import by_unit, of_quiet  # noqa: PLC0415
    from taxel.tare import Tare  # noqa: PLC0415

    source = recorded(recording)
    if isinstance(source, Frames) and (rest := by_unit(source)) is not None:
        return rest
    first = min((int(times[0]) for times in labels.values() if len(times)), default=0) - _BEFORE_US
    tare, said = without_what_lay(recording, first)
    if said:
        warn(said, stacklevel=2)
    if tare is not None:
        return tare
    if isinstance(source, Frames) and np.count_nonzero(source.t < first) < _LEAST_PICTURES <= len(source):
        quiet = of_quiet(source).quiet_us
        if quiet is not None:
            return Tare.take(source, start_us=quiet[0], stop_us=quiet[1], note=str(recording.path))
    return _before(labels, recording)


def _before(labels: Mapping[str, NDArray[np.int64]], recording: Recording) -> Tare:
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
    """Return a recording's tare: 0 of force or pressure, else as `tare_before`, or None without such a time."""
    from taxel.frames import Frames  # noqa: PLC0415  the command line starts quickly
    from taxel.recorded import recorded  # noqa: PLC0415
    from taxel.recording.rest import by_unit  # noqa: PLC0415

    source = recorded(recording)
    if isinstance(source, Frames) and (rest := by_unit(source)) is not None:
        return rest
    try:
        return _before(labels, recording)
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
            warn(
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


def try_report(folder: Path) -> None:
    """Check that a report's page can be written to a folder, before the work that it will show; leave no folder behind.

    Raises
    ------
    FileExistsError : the folder holds a report already
    OSError : the folder cannot be made
    """
    from taxel._base.files import try_whole  # noqa: PLC0415  the command line starts quickly

    missing = [place for place in (folder, *folder.parents) if not place.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        try_whole(folder / "report.html")
    finally:
        for place in missing:
            with suppress(OSError):
                place.rmdir()


def references(source: str | None, option: str, recordings: Sequence[Recording]) -> list[dict[str, NDArray[np.int64]]]:
    """Return the reference events of each recording: from a table, or its own notes (a note's text is the label).

    A table names recordings by path, file name or stem; in one that it does not name nothing happened, unless the
    table also names a recording that is not there.
    """
    from taxel.labels import Labels, trial_of  # noqa: PLC0415  the command line starts quickly

    if source is None or source == "notes":
        noted = [_notes(recording) for recording in recordings]
        outside = next((one for one in recordings if any(note.t is not None for note in one.notes)), None)
        if source is not None and outside is not None and not any(noted):
            notes = counted(sum(note.t is not None for note in outside.notes), "note")
            raise ProblemError(f"{outside.title}: has {notes}, none within {_span(outside)}")
        return noted
    table = Labels(source)
    # The sources of one file are one recording.
    count = len({(one.path, trial_of(one.name, one.label)) for one in recordings})
    if count > 1 and any(not row.recording for row in table.rows):
        raise ProblemError(
            f"{option} {source}: names no recording, and there are {count}; must have the column recording"
        )
    _check_sources(table, option, recordings)
    named = {one.title: table.named(one.path, trial_of(one.name, one.label), one.label) for one in recordings}
    unnamed = [title for title, name in named.items() if name is None]
    known = set(named.values())
    others = [name for name in table.recordings if name not in known]
    if unnamed and (others or len(unnamed) == len(recordings)):
        names = f"it names {', '.join(table.recordings)}" if table.rows else "it is empty"
        raise ProblemError(f"{option} {source}: names no event in {', '.join(unnamed)}; {names}")
    _warn_of_strangers(table, option, recordings)
    return [_within(table, recording, option) for recording in recordings]


def _warn_of_strangers(table: Labels, option: str, recordings: Sequence[Recording]) -> None:
    """Warn of events of recordings that are not there: their names may be misspelt."""
    from taxel.labels import trial_of  # noqa: PLC0415  the command line starts quickly

    trials = [(one.path, trial_of(one.name, one.label), one.label) for one in recordings]
    known = {
        name for path, trial, label in trials for name in (table.named(path), table.named(path, trial, label), trial)
    }
    strange = [name for name in table.recordings if name not in known]
    if strange:
        count = counted(sum(row.recording in strange for row in table.rows), "event")
        there = _few(dict.fromkeys(one.title for one in recordings))
        warn(
            f"{option} {table.path}: left out {count} of {_few(strange)}, which {'is' if len(strange) == 1 else 'are'} "
            f"not here; there {'is' if len(recordings) == 1 else 'are'} {there}",
            stacklevel=3,
        )


def _few(names: Iterable[str]) -> str:
    """Return the first five names, and how many more there are."""
    every = list(names)
    return ", ".join(every[:5]) + f" and {len(every) - 5} more" * (len(every) > 5)


def labelled_trials(source: str | None, recordings: Sequence[Recording]) -> list[Recording]:
    """Leave out trials of a file that its labels do not name, if they name another: those have no labels.

    A trial without labels would otherwise count as one in which nothing happened.
    """
    from taxel.labels import Labels, beside, trial_of  # noqa: PLC0415  the command line starts quickly

    trials: dict[Path, set[str]] = {}
    for one in recordings:
        trials.setdefault(one.path, set()).add(trial_of(one.name, one.label))
    named: dict[Path, set[str]] = {}
    for path, every in trials.items():
        table = beside(path) if source in (None, "notes") else Path(str(source))
        named[path] = every & {row.recording for row in Labels(table).rows} if table.is_file() else set()
        if 0 < len(named[path]) < len(every):
            warn(
                f"{path}: left out {len(every) - len(named[path])} of its {len(every)} trials, which have no labels",
                stacklevel=2,
            )
    return [one for one in recordings if not named[one.path] or trial_of(one.name, one.label) in named[one.path]]


def _check_sources(table: Labels, option: str, recordings: Sequence[Recording]) -> None:
    """Refuse labels of a source that their recording does not have."""
    from taxel.labels import trial_of  # noqa: PLC0415  the command line starts quickly

    trials = [(one.path, trial_of(one.name, one.label), one.label) for one in recordings]
    names = [(label, (table.named(path), table.named(path, trial, label), trial)) for path, trial, label in trials]
    for row in table.rows:
        labels = {label for label, every in names if row.recording in every}
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
    events = {label: np.sort(np.array(t, np.int64)) for label, t in times.items()}
    return _inside(events, recording, f"the notes of {recording.title}")


def _within(table: Labels, recording: Recording, option: str) -> dict[str, NDArray[np.int64]]:
    """Return the events of a table that lie within a recording; refuse a table of which none does."""
    from taxel.recording import kind_of_file  # noqa: PLC0415  the command line starts quickly

    events = table.of(recording)
    if recording.clock is None and any(row.at_ns for row in table.rows):
        warn(
            f"the {kind_of_file(recording.kind)} holds no arrival times, so host_ns cannot show by how many periods of "
            f"the board's clock (6.5536 s) {table.path} is ahead of it: its times are used unchanged",
            stacklevel=2,
        )
    inside = _inside(events, recording, str(table.path))
    if any(map(len, events.values())) and not any(map(len, inside.values())):
        times = np.concatenate(list(events.values()))
        ends = " to ".join(f"{t / 1e6:.3f}" for t in np.unique([times.min(), times.max()]))
        held = f"{option} {table.path}: holds {counted(len(times), 'event')} ({ends} s)"
        raise ProblemError(f"{held}, none within {_span(recording)}")
    return inside


def _span(recording: Recording) -> str:
    first, last = span_us(recording)
    more = "" if recording.timed else ", whose pictures are numbered: give --rate-hz"
    begin = beginning_us(np.array([first]))
    if begin:
        more = f"; it begins {begun(begin)}, {begin} us since 1970, and labels must count from 1970 too"
    return f"{recording.title} ({(first - begin) / 1e6:.3f} to {(last - begin) / 1e6:.3f} s){more}"


def _inside(events: Mapping[str, NDArray[np.int64]], recording: Recording, where: str) -> dict[str, NDArray[np.int64]]:
    """Return the events that lie within a recording; say which are left out as they do not, and which may not.

    A picture holds until the next one would come. A board sends nothing where nothing changes, so that the end of its
    recording may lie behind its last event: an event soon after that counts, and is named.
    """
    total = sum(map(len, events.values()))
    if not total:
        return dict(events)
    first, last = span_us(recording)
    if recording.has_events:
        held, stretch = recording.events, recording._contents.one.timing.stretch
        seen = [last, *(t for t, _ in held.markers), *(() if stretch is None else stretch()[1:])]
        # A heartbeat or a frame without events is a sign of life, too.
        end = max(seen if recording.clock is None else [*seen, *recording.clock.board_us[-1:].tolist()])
        near_us, late_us = _NEAR_US, _LATE_US
    else:
        pictures = recording.frames().t
        end = last + (int(np.median(np.diff(pictures))) if len(pictures) > 1 else 0)
        near_us, late_us = 0, 0
    inside = {label: t[(t >= first) & (t <= end + late_us)] for label, t in events.items()}
    behind = sorted((int(one), label) for label, t in inside.items() for one in t[t > end + near_us])
    if behind:
        (at, label), begin = behind[0], beginning_us(np.array([first]))
        warn(
            f"{len(behind)} of the {total} events of {where} are behind the last that was recorded, at "
            f"{(end - begin) / 1e6:.3f} s ({label} at {(at - begin) / 1e6:.3f} s): they count, and as missed if the "
            "recording stopped before them",
            stacklevel=2,
        )
    outside = total - sum(map(len, inside.values()))
    if outside:
        warn(f"{outside} of the {total} events of {where} left out: outside {_span(recording)}", stacklevel=2)
    return {label: t for label, t in inside.items() if len(t) or not len(events[label])}


class _Steps:
    """Holds the current step of a command, and about how long all of them take by the folds that are done."""

    def __init__(self) -> None:
        self._begun = perf_counter()
        self._step = "starting"
        self._fold: tuple[int, int, float] | None = None
        self._first_fold_s = 0.0

    def update(self, step: str) -> None:
        """Take the line of the next step."""
        self._step = step
        fold = re.fullmatch(r"fold (\d+) of (\d+)", step)
        if fold is not None:
            after_s = perf_counter() - self._begun
            self._first_fold_s = after_s if self._fold is None else self._first_fold_s
            self._fold = int(fold[1]), int(fold[2]), after_s

    def __str__(self) -> str:
        """Return the step, how long it is since the beginning, and about how long all take once that is known."""
        after_s, all_s = perf_counter() - self._begun, 0.0
        if self._fold is not None and self._fold[0] > 1:
            number, count, at_s = self._fold
            # The training on all data and the plain rules take as long as two more folds.
            all_s = self._first_fold_s + (at_s - self._first_fold_s) / (number - 1) * (count + 2)
        expected = f"; about {all_s:.0f} s in all" if all_s > after_s else ""
        return f"{self._step}, after {after_s:.0f} s{expected}"

    def report(self, ended: Event) -> None:
        """Say where it is on stderr, first after a few seconds and then now and then, until it has ended."""
        for wait_s in chain(_REPORT_S, repeat(_REPORT_S[-1])):
            if ended.wait(wait_s):
                return
            say(f"taxel: {self}", err=True)


@contextmanager
def progress(quiet: bool) -> Iterator[Callable[[str], None]]:
    """Show the current step, and warnings as single lines; on stderr, so that results can be piped.

    Without a terminal a line is said first after 2 s, then after 10 s and every 30 s.
    """
    from rich.text import Text  # noqa: PLC0415  the command line starts quickly

    from taxel.cli.console import Console  # noqa: PLC0415

    console, steps = Console(stderr=True), _Steps()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        if quiet:
            yield lambda _: None
        elif console.is_terminal:
            with console.status("") as status:

                def show(step: str) -> None:
                    steps.update(step)
                    status.update(Text(escaped(steps)))

                yield show
        else:
            ended = Event()
            reporting = Thread(target=steps.report, args=(ended,), daemon=True)
            reporting.start()
            try:
                yield steps.update
            finally:
                ended.set()
                reporting.join()
    # One that holds for several recordings is shown once.
    for message in dict.fromkeys(str(one.message) for one in caught if issubclass(one.category, UserWarning)):
        say(f"taxel: warning: {message}", err=True)


def of_source(recording: Recording, name: str | None) -> Recording:
    """Return the source that ``--source`` names; without a name the recording itself."""
    if name is None:
        return recording
    sources = recording.sources
    if name not in sources:
        raise ProblemError(f"--source {name}: {recording.path} holds {', '.join(sources)}")
    return sources[name]
