"""What `encode`, `train` and `detect` have in common."""

from __future__ import annotations

import tomllib
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import typer

from taxel._core import ProblemError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from taxel.encode import Encoder
    from taxel.recording import Recording
    from taxel.tare import Tare

TARE_HELP = "Rest of the taxels: a file that Tare.save wrote, or so many seconds at the recording's beginning."
SET_HELP = "A value by dotted key, as KEY=VALUE, where VALUE is TOML; may be said often."


def assignments(said: list[str]) -> dict[str, Any]:
    """Return what ``--set KEY=VALUE`` says; a VALUE that is no TOML is a text."""
    values = {}
    for one in said:
        key, equals, value = one.partition("=")
        if not equals or not key.strip():
            raise ProblemError(f"--set {one}: must be KEY=VALUE")
        try:
            values[key.strip()] = tomllib.loads(f"value = {value}")["value"]
        except tomllib.TOMLDecodeError:
            values[key.strip()] = value.strip()
    return values


def encoder_of(name: str | None, said: list[str]) -> Encoder:
    """Return the encoder that ``--encoder`` and ``--set`` describe."""
    from taxel._arguments import parameters  # noqa: PLC0415  the command line starts quickly
    from taxel.encode import Encoder  # noqa: PLC0415

    return Encoder.from_json(parameters({**assignments(said), **({"name": name} if name else {})}))


def tare_of(said: str | None, recording: Recording) -> Tare | None:
    """Return the tare that ``--tare`` names: a file, or so many seconds at the beginning of the recording.

    The stretch ends early where the board marked the start of the recording, as a board that was tared does. One
    longer than half of the recording is refused: hardly all of that was rest.
    """
    from taxel.events import Events  # noqa: PLC0415  the command line starts quickly
    from taxel.tare import Tare  # noqa: PLC0415

    if said is None:
        return None
    try:
        seconds = float(said)
    except ValueError:
        return Tare.load(said)
    if not 0 < seconds < 1e6:
        raise ProblemError(f"--tare {said}: must be seconds above 0, or a file")
    source = recording.events if recording.has_events else recording.frames()
    if not len(source):
        raise ProblemError(f"{recording.path}: holds nothing to take a tare from")
    first, last = int(source.t[0]), int(source.t[-1])
    if seconds * 2e6 > last - first:
        raise ProblemError(
            f"--tare {said}: more than half of {recording.path}, which lasts {(last - first) / 1e6:g} s; "
            "give the seconds at its beginning in which nothing was touched"
        )
    stop = first + int(seconds * 1e6)
    if isinstance(source, Events):
        stop = min([stop, *(t for t, start in source.markers if start and t > first)])
    return Tare.take(source, stop_us=stop, note=str(recording.path))


def reference(said: str | None, recording: Recording, among: int = 1) -> dict[str, NDArray[np.int64]]:
    """Return a recording's reference events: from a table, or its own notes (a note's text is the label).

    A table names recordings by path or file name; `among` is how many recordings it is about.
    """
    from taxel.detect import read_labels  # noqa: PLC0415  the command line starts quickly

    if said is None or said == "notes":
        times: dict[str, list[int]] = {}
        for note in recording.notes:
            if note.t is not None:
                times.setdefault(note.text, []).append(note.t)
        return {label: np.sort(np.array(t, np.int64)) for label, t in times.items()}
    table = read_labels(said)
    if "" in table:
        if among > 1:
            raise ProblemError(f"{said}: names no recording, and there are {among}; must be recording,label,t_us")
        return table[""]
    return next((table[name] for name in (str(recording.path), recording.path.name) if name in table), {})


@contextmanager
def told(quiet: bool) -> Iterator[Callable[[str], None]]:
    """Show what is being done, and warnings as single lines; on stderr, so that results can be piped."""
    from rich.console import Console  # noqa: PLC0415  the command line starts quickly

    console = Console(stderr=True)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        if quiet:
            yield lambda _: None
        else:
            with console.status("") as status:
                yield status.update
    for warning in caught:
        if issubclass(warning.category, UserWarning):
            typer.echo(f"taxel: warning: {warning.message}", err=True)


def open_recording(path: Path) -> Recording:
    """Open a recording; `taxel.open`, imported late."""
    import taxel  # noqa: PLC0415  the command line starts quickly

    return taxel.open(path)
