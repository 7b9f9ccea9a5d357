"""What commands share: how recordings are opened, what is printed and written, progress and warnings."""

from __future__ import annotations

import json as to_json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import chain, repeat
from pathlib import Path
from threading import Event, Thread
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from taxel._base.files import check_writable
from taxel._base.messages import collected, escaped
from taxel._base.progress import Announcement, Steps
from taxel._core import ProblemError
from taxel.cli._say import say
from taxel.cli.app import WRONG_INPUT

if TYPE_CHECKING:
    from taxel._base.parallel import Tried
    from taxel.recording import Recording

#: Without a terminal a line says the step after so long, then after so long again; the last repeats, s.
_REPORT_S = (0.5, 9.5, 20.0, 30.0)

SourceOption = Annotated[
    str | None, Parameter(name="--source", metavar="NAME", help="The source, if the recording has several.")
]
#: A file that is written: the last argument, or what -o names.
OutArgument = Annotated[Path, Parameter(name=("--out", "-o"))]
OutOption = Annotated[Path | None, Parameter(name=("--out", "-o"), metavar="FILE")]


@dataclass(frozen=True)
class Output:
    """Hold how a result is printed, and whether it may replace a file.

    Parameters
    ----------
    json
        Print the result as JSON.
    overwrite
        Replace output files that exist already.
    """

    json: bool = False
    overwrite: bool = False

    def check(self, *files: Path | None) -> None:
        """Refuse files that cannot be written, before the work."""
        for file in files:
            if file is not None:
                check_writable(file, overwrite=self.overwrite)

    def check_report(self, folder: Path | None) -> None:
        """Refuse a folder to which a report's page cannot be written, before the work; leave no folder behind."""
        if folder is None:
            return
        missing = [one for one in (folder, *folder.parents) if not one.exists()]
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self.check(folder / "report.html")
        finally:
            for one in missing:
                with suppress(OSError):
                    one.rmdir()

    def say(self, result: Mapping[str, Any], *lines: object) -> None:
        """Print a result as lines for people, or as one of JSON."""
        say(*([to_json.dumps(result)] if self.json else lines))


def one_or_several(texts: Sequence[str]) -> str | list[str]:
    """Return what an option gives once, or all that it gives."""
    return texts[0] if len(texts) == 1 else list(texts)


def paths_text(paths: Sequence[Path]) -> str:
    """Return the first three paths in words."""
    return ", ".join(map(str, paths[:3])) + " ..." * (len(paths) > 3)


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
                    if isinstance(step, Announcement):
                        console.print(Text(escaped(step)))
                    steps.update(step, done, total)
                    status.update(Text(escaped(steps)))

                yield show
        else:
            ended = Event()
            reporting = Thread(target=_report, args=(steps, ended), daemon=True)
            reporting.start()

            def update(step: str, done: int, total: int) -> None:
                if isinstance(step, Announcement):
                    say(f"taxel: {step}", err=True)
                steps.update(step, done, total)

            try:
                yield update
            finally:
                ended.set()
                reporting.join()
    say_warnings(texts)


def say_failures(files: Sequence[Path], found: Sequence[Tried]) -> int:
    """Print the warnings of several files, and which of them failed and why; return an exit code that says so."""
    say_warnings(dict.fromkeys(text for one in found for text in one.warnings))
    failed = {str(file): one.failure for file, one in zip(files, found, strict=True) if one.failure}
    say(*(f"taxel: {why if name in why else f'{name}: {why}'}" for name, why in failed.items()), err=True)
    return WRONG_INPUT if failed else 0


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
