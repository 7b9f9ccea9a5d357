"""Options and steps that the commands that work on recordings share."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import chain, repeat
from pathlib import Path
from threading import Event, Thread
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taxel._base.arguments import short
from taxel._base.documents import of_toml
from taxel._base.files import check_writable
from taxel._base.messages import collected, escaped
from taxel._base.progress import Forecast, Steps
from taxel._core import FormatError, ProblemError
from taxel.cli._say import say

if TYPE_CHECKING:
    from taxel.encode import Encoder
    from taxel.recording import Recording

#: Without a terminal a line says the step after so long, then after so long again; the last repeats, s.
_REPORT_S = (0.5, 9.5, 20.0, 30.0)

#: What every command that works on recordings reads.
READ_HELP = ".mcap, .lsa, .npz, .csv or .h5, a ROS bag or a file of a sensor's maker"
SET_HELP = "Set a parameter to a value (TOML); a key with dots sets a nested parameter. May be repeated."

ReportOption = Annotated[
    Path | None,
    typer.Option(help="Write a report to this folder, with potential, weights, errors and the worst events."),
]


def tare_option(default: str = "") -> Any:
    """Return the option ``--tare``, with what is taken without it."""
    about = (
        "Tare (the taxels' values at rest): a recording of the sensor at rest (taxel cut makes one), a saved tare, or "
        "how many seconds at the beginning of the recording are at rest."
    )
    return typer.Option(metavar="SECONDS|FILE", help=f"{about} {default}".rstrip())


def pairs(option: str, texts: Iterable[str], form: str = "NAME=VALUE") -> Iterator[tuple[str, str]]:
    """Yield names and values that an option gives as NAME=VALUE."""
    for text in texts:
        name, _, value = text.partition("=")
        if not name or not value:
            raise ProblemError(f"{option} {text}: must be {form}")
        yield name, value


def one_or_several(texts: list[str]) -> str | list[str]:
    """Return what an option gives once, or all that it gives."""
    return texts[0] if len(texts) == 1 else texts


def paths_text(paths: Sequence[Path]) -> str:
    """Return the first three paths in words."""
    return ", ".join(map(str, paths[:3])) + " ..." * (len(paths) > 3)


def assignments(settings: list[str]) -> dict[str, Any]:
    """Return the values of ``--set KEY=VALUE``; a VALUE that is not TOML is text."""
    values = {}
    for setting in settings:
        key, equals, value = setting.partition("=")
        if not equals or not key.strip():
            raise ProblemError(f"--set {short(setting)}: must be KEY=VALUE")
        try:
            values[key.strip()] = of_toml(f"--set {short(key.strip())}", f"value = {value}")["value"]
        except FormatError:
            values[key.strip()] = value.strip()
    return values


def encoder_of(name: str | None, settings: list[str]) -> Encoder:
    """Return the encoder that ``--encoder`` and ``--set`` describe."""
    from taxel.tasks.encode import encoder_of as of_values  # noqa: PLC0415  the command line starts quickly

    return of_values(name, assignments(settings))


def try_report(folder: Path, *, overwrite: bool) -> None:
    """Check that a report's page can be written to a folder, before the work that it will show; leave no folder behind.

    Raises
    ------
    FileExistsError : the folder holds a report already and `overwrite` is false
    OSError : the folder cannot be made
    """
    missing = [missing_folder for missing_folder in (folder, *folder.parents) if not missing_folder.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        check_writable(folder / "report.html", overwrite=overwrite)
    finally:
        for missing_folder in missing:
            with suppress(OSError):
                missing_folder.rmdir()


def _report(steps: Steps, ended: Event) -> None:
    """Say where a task is on stderr, first after a few seconds and then now and then, until it has ended."""
    for wait_s in chain(_REPORT_S, repeat(_REPORT_S[-1])):
        if ended.wait(wait_s):
            return
        say(f"taxel: {steps}", err=True)


@contextmanager
def progress(quiet: bool) -> Iterator[Callable[[str, int, int], None]]:
    """Show the current step of a task, and warnings as single lines; on stderr, so that results can be piped.

    Without a terminal a line is printed first after half a second, so that it is there within 2 s of the command's
    begin, then after 10 s and every 30 s. The duration of the work is printed as a separate line.
    """
    from rich.text import Text  # noqa: PLC0415  the command line starts quickly

    from taxel.cli.console import Console  # noqa: PLC0415

    console, steps = Console(stderr=True), Steps()
    with collected() as texts:
        if quiet:
            yield lambda *_: None
        elif console.is_terminal:
            with console.status("") as status:

                def show(step: str, done: int, total: int) -> None:
                    if isinstance(step, Forecast):
                        console.print(Text(escaped(step)))
                    steps.update(step, done, total)
                    status.update(Text(escaped(steps)))

                yield show
        else:
            ended = Event()
            reporting = Thread(target=_report, args=(steps, ended), daemon=True)
            reporting.start()

            def update(step: str, done: int, total: int) -> None:
                if isinstance(step, Forecast):
                    say(f"taxel: {step}", err=True)
                steps.update(step, done, total)

            try:
                yield update
            finally:
                ended.set()
                reporting.join()
    say_warnings(texts)


def say_warnings(texts: Iterable[str]) -> None:
    """Print warnings as single lines on stderr; one that holds for several recordings is there once."""
    say(*(f"taxel: warning: {text}" for text in texts), err=True)


def of_source(recording: Recording, name: str | None) -> Recording:
    """Return the source that ``--source`` names; without a name the recording itself."""
    if name is None:
        return recording
    sources = recording.sources
    if name not in sources:
        raise ProblemError(f"--source {name}: {recording.path} contains only {', '.join(sources)}")
    return sources[name]
