"""``taxel study``: run a study and leave its report."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import wraps
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from taxel import ProblemError
from taxel.cli.app import App, Flat, say
from taxel.options import Settings
from taxel.tasks import Workers
from taxel_studies import DRAWN, FIGURES, STUDIES, load
from taxel_studies.durations import forecast_all

__all__ = ["app"]

app = App(
    name="study",
    help="""Run a study: a protocol, its parameters, a report. Stops on Ctrl-C, resumes where it was.

Figures and tables of the thesis are names too: fig5.6 runs the study that holds it.

Example: taxel study fig6.9 --size toy
""",
)


@dataclass(frozen=True)
class StudyOptions:
    """Hold how a study is run.

    Parameters
    ----------
    size
        full, or toy (a quick check that the study runs); some studies have more sizes.
    realisations
        How many, instead of the number in the size.
    data
        Folder of recordings, for the studies that need some (or TAXEL_DATA names it).
    report
        Folder for the page, pictures and all results. Results that it contains are not computed again.
    strict
        End the study at a recording that cannot be read. Otherwise the recording is left out.
    confirm
        Run the study at size toy, and compare the result with the result saved beside the figure; exit code 2 if they
        differ.
    figures
        Folder of the saved figures, in a checkout.
    json
        Print the summary as JSON, and no progress.
    """

    size: str = "full"
    realisations: int | None = None
    data: Path | None = None
    report: Path = Path("taxel-studies")
    strict: bool = False
    confirm: bool = False
    figures: Path = Path("benchmarks/results/figures")
    json: bool = False

    @property
    def recordings(self) -> Path | None:
        """The folder of recordings, if there is any."""
        named = os.environ.get("TAXEL_DATA")
        return self.data or (Path(named) if named else None)

    @property
    def changes(self) -> dict[str, Any]:
        """The parameters that these options change."""
        return {} if self.realisations is None else {"realisations": self.realisations}

    def run(self, name: str, changes: dict[str, Any], workers: Workers) -> dict[str, Any]:
        """Run a study."""
        return load(name).run(
            self.report,
            size=self.size,
            changes=changes,
            data=self.recordings,
            workers=workers,
            strict=self.strict,
            quiet=self.json,
        )


@dataclass(frozen=True)
class _Changes:
    """Hold the parameters of a study that differ.

    Parameters
    ----------
    changes
        Set a parameter to a value (TOML). May be repeated.
    """

    changes: Settings = field(default_factory=dict)


@app.command(name="all")
def every(*, options: Flat[StudyOptions] = StudyOptions(), workers: Flat[Workers] = Workers()) -> None:
    """Run every study and make one page of them; with --confirm, compare each with its kept toy result.

    Studies on recordings are left out, and named, where no recordings are; so are those whose packages are not
    installed.

    Example: taxel study all --report figures --jobs 2
    """
    data = options.recordings
    if options.confirm:
        from taxel_studies.kept import kept_figures  # noqa: PLC0415  the command line starts quickly

        moved = []
        for name in kept_figures(options.figures):
            if _left_out(name, data) is None:
                try:
                    _confirm(name, options)
                except ProblemError as error:
                    moved.append(name)
                    say(str(error), err=True)
        if moved:
            raise ProblemError(
                f"not confirmed: {', '.join(moved)}; run them again at full size, and say why they moved"
            )
        return
    for name in STUDIES:
        load(name).set(options.size)  # refused before any study begins
    begun = [name for name in STUDIES if load(name).cannot_run(data) is None]
    if not options.json and (text := forecast_all(begun, options.size, workers.jobs)):
        say(f"all: {text}", err=True)
    sections = {}
    try:
        for name in STUDIES:
            if _left_out(name, data) is None:
                own = {k: v for k, v in options.changes.items() if k in load(name).parameters}
                sections[name] = options.run(name, own, workers)
    finally:
        # The page is written however the run ends: it shows what was run, and names the rest.
        page = _page(options.report)
    if options.json:
        say(json.dumps(sections))
        return
    for section in sections.values():
        tell(section)
    say(f"page: {page}")


def _left_out(name: str, data: Path | None) -> str | None:
    """Say why a study cannot be run here; None where it can."""
    why = load(name).cannot_run(data)
    if why is not None:
        say(f"{name}: left out, {why}", err=True)
    return why


def _confirm(name: str, options: StudyOptions) -> None:
    from taxel_studies.kept import confirm  # noqa: PLC0415  the command line starts quickly

    confirm(name, options.figures, data=options.recordings, strict=options.strict)
    say(f"{name}: confirmed")


def _add(name: str, title: str) -> Callable[..., None]:
    def one(
        *,
        changed: Flat[_Changes] = _Changes(),
        options: Flat[StudyOptions] = StudyOptions(),
        workers: Flat[Workers] = Workers(),
    ) -> None:
        _run(name, dict(changed.changes), options, workers)

    text = f"{title[0].upper()}{title[1:]}.\n\nExample: taxel study {name} --report figures --jobs 2"
    app.command(one, name=name, help=text)
    return one


def _run(name: str, changes: dict[str, Any], options: StudyOptions, workers: Workers) -> None:
    if options.confirm:
        _confirm(name, options)
        return
    section = options.run(name, options.changes | changes, workers)
    page = _page(options.report)
    if options.json:
        say(json.dumps(section))
        return
    tell(section)
    folder = options.report / name
    say(f"page: {page}  picture: {folder}  numbers: {folder / 'summary.json'}")


def _page(report: Path) -> Path | None:
    from taxel_studies.page import write_page  # noqa: PLC0415  jinja2 loads slowly

    return write_page(report) if report.is_dir() else None


def tell(section: dict[str, Any]) -> None:
    """Print what a study found: its statements and tables."""
    from rich.table import Table  # noqa: PLC0415

    from taxel.cli.console import Console  # noqa: PLC0415  the command line starts quickly

    say("", f"{section['name']}, size {section['size']}: {section['title']}")
    for s in section["statements"]:
        holds = {True: "holds", False: "does not hold", None: "not judged"}[s["holds"]]
        say(f"- {s['says']} {holds.upper()}" + (f" ({s['why']})" if s["why"] else ""))
        say(f"    published: {s['published']}", f"    ours: {s['ours']}")
    console = Console()
    if not console.is_terminal:
        console.width = 10_000  # a file breaks and cuts nothing
    for shown in section["tables"]:
        if not shown["folded"]:
            say("", shown["title"])
            table = Table(box=None, pad_edge=False)
            for k, name in enumerate(shown["head"]):
                table.add_column(name, justify="right" if k else "left", no_wrap=not k, overflow="fold")
            for row in shown["rows"]:
                table.add_row(*row)
            console.print(table)
    for file, why in section["unread"].items():
        say(f"left out, because it could not be read: {file}: {why}")


@app.command
def gait(
    *,
    test: Annotated[Path | None, Parameter(metavar="FOLDER")] = None,
    search: str | None = None,
    only: Annotated[list[str] | None, Parameter(metavar="NAME")] = None,
    changed: Flat[_Changes] = _Changes(),
    options: Flat[StudyOptions] = StudyOptions(),
    workers: Flat[Workers] = Workers(),
) -> None:
    """Find gait events in walking recordings with one neuron an event (thesis 6.5, figures 6.12 to 6.14).

    Recordings are not part of taxel. They can be had, each for its folder of DATA, from: github.com/jiku-pro/jiku-data,
    SpeedPP2DS (plate; GPL-3.0); physionet.org/content/gaitpdb/1.0.0 (insole_gaitpdb; ODC-By 1.0);
    physionet.org/content/gaitndd/1.0.0 (insole_gaitndd; ODC-By 1.0); github.com/moticon-rego/moticon-opengo,
    tests/testdata (insole_moticon; Apache-2.0); github.com/Telfer/pressuRe, inst/extdata (pressure_formats; MIT). By
    whom, and what their truth is: docs/files.md.

    Example: taxel study gait --data recordings --jobs 2 --report figures

    Parameters
    ----------
    test
        A folder like DATA with other people: train on DATA and judge on TEST, instead of by folds.
    search
        listed points, or full: on plate also the 528 settings of 6.5.2 (hours).
    only
        One source (plate, gaitpdb, gaitndd, moticon, pedar); may be repeated.
    """
    given = {"test": None if test is None else str(test), "search": search, "sources": only}
    named = {name: value for name, value in given.items() if value}
    _run("gait", named | dict(changed.changes), options, workers)


def _add_figure(figure: str, study: str, run: Callable[..., None]) -> None:
    @wraps(run)
    def one(**given: Any) -> None:
        say(f"{figure} is a figure of the study {study}", err=True)
        run(**given)

    app.command(one, name=figure, help=f"The study {study}, which holds {figure}.", show=False)


def _add_drawing(figure: str, where: str) -> None:
    def one() -> None:
        raise ProblemError(f"{figure} is a drawing or a table of words, not a result: {where}")

    app.command(one, name=figure, help=f"No study: {where}.", show=False)


_RUN = {"gait": gait} | {name: _add(name, title) for name, title in STUDIES.items() if name != "gait"}
for _figure, _study in FIGURES.items():
    _add_figure(_figure, _study, _RUN[_study])
for _figure, _where in DRAWN.items():
    _add_drawing(_figure, _where)
