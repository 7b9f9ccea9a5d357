"""``taxel study``: run a study and leave its report."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taxel import ProblemError
from taxel.cli import SET_HELP, App, assignments, say
from taxel_studies import DRAWN, FIGURES, STUDIES, load
from taxel_studies.durations import forecast_all

if TYPE_CHECKING:
    from taxel_studies.runner import Workers

__all__ = ["app"]

app = App(no_args_is_help=True)

Jobs = Annotated[int, typer.Option(help="Processes.")]
Backend = Annotated[str, typer.Option(help="Who runs them: loky (processes here), dask or ray (a cluster).")]
Scheduler = Annotated[
    str | None, typer.Option(help="Address of a running Dask or Ray cluster; otherwise a cluster starts here.")
]
Report = Annotated[
    Path,
    typer.Option(
        help="Folder for the page, pictures and all results. Results that it contains are not computed again."
    ),
]
Size = Annotated[
    str, typer.Option(help="full, or toy (a quick check that the study runs); some studies have more sizes.")
]
Realisations = Annotated[int | None, typer.Option(help="How many, instead of the number in the size.")]
Changes = Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help=SET_HELP)]
Data = Annotated[
    Path | None, typer.Option(help="Folder of recordings, for the studies that need some (or TAXEL_DATA names it).")
]
Strict = Annotated[
    bool,
    typer.Option(
        "--strict", help="End the study at a recording that cannot be read. Otherwise the recording is left out."
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print the summary as JSON, and no progress.")]

Figures = Annotated[Path, typer.Option("--figures", help="Folder of the saved figures, in a checkout.")]
Confirm = Annotated[
    bool,
    typer.Option(
        "--confirm",
        help="Run the study at size toy, and compare the result with the result saved beside the figure; exit code 1 "
        "if they differ.",
    ),
]

REPORT = Path("taxel-studies")
KEPT = Path("benchmarks/results/figures")


@app.callback(invoke_without_command=True)
def _root(context: typer.Context) -> None:
    """Run a study: a protocol, its parameters, a report. Stops on Ctrl-C, resumes where it was.

    Figures and tables of the thesis are names too: fig5.6 runs the study that holds it.

    Example: taxel study fig6.9 --size toy
    """
    if context.invoked_subcommand is None:
        say(*context.get_help().split("\n"))


@app.command(name="all")
def every(
    size: Size = "full",
    realisations: Realisations = None,
    data: Data = None,
    jobs: Jobs = 1,
    backend: Backend = "loky",
    scheduler: Scheduler = None,
    report: Report = REPORT,
    strict: Strict = False,
    confirm: Confirm = False,
    figures: Figures = KEPT,
    as_json: AsJson = False,
) -> None:
    """Run every study and make one page of them; with --confirm, compare each with its kept toy result.

    Studies on recordings are left out, and named, where no recordings are; so are those whose packages are not
    installed.

    Example: taxel study all --report figures --jobs 2
    """
    if confirm:
        from taxel_studies.kept import kept_figures  # noqa: PLC0415  the command line starts quickly

        moved = []
        for name in kept_figures(figures):
            if _left_out(name, _data(data)) is None:
                try:
                    _confirm(name, figures, data, strict)
                except ProblemError as error:
                    moved.append(name)
                    say(str(error), err=True)
        if moved:
            raise ProblemError(
                f"not confirmed: {', '.join(moved)}; run them again at full size, and say why they moved"
            )
        return
    changes = {} if realisations is None else {"realisations": realisations}
    for name in STUDIES:
        load(name).set(size)  # refused before any study begins
    begun = [name for name in STUDIES if load(name).cannot_run(_data(data)) is None]
    if not as_json and (text := forecast_all(begun, size, jobs)):
        say(f"all: {text}", err=True)
    sections = {}
    try:
        for name in STUDIES:
            study = load(name)
            own = {k: v for k, v in changes.items() if k in study.parameters}
            where = _data(data)
            if _left_out(name, where) is not None:
                continue
            sections[name] = study.run(
                report,
                size=size,
                changes=own,
                data=where,
                workers=_workers(jobs, backend, scheduler),
                strict=strict,
                quiet=as_json,
            )
    finally:
        # The page is written however the run ends: it shows what was run, and names the rest.
        page = _page(report)
    if as_json:
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


def _confirm(name: str, figures: Path, data: Path | None, strict: bool) -> None:
    from taxel_studies.kept import confirm  # noqa: PLC0415  the command line starts quickly

    confirm(name, figures, data=_data(data), strict=strict)
    say(f"{name}: confirmed")


def _add(name: str, title: str) -> Callable[..., None]:
    def one(
        size: Size = "full",
        realisations: Realisations = None,
        changes: Changes = None,
        data: Data = None,
        jobs: Jobs = 1,
        backend: Backend = "loky",
        scheduler: Scheduler = None,
        report: Report = REPORT,
        strict: Strict = False,
        confirm: Confirm = False,
        figures: Figures = KEPT,
        as_json: AsJson = False,
    ) -> None:
        if confirm:
            _confirm(name, figures, data, strict)
            return
        workers = _workers(jobs, backend, scheduler)
        _run(name, size, _changes(changes or [], realisations), data, workers, report, strict, as_json)

    text = f"{title[0].upper()}{title[1:]}.\n\nExample: taxel study {name} --report figures --jobs 2"
    app.command(name=name, help=text, short_help=title)(one)
    return one


def _run(
    name: str,
    size: str,
    changes: dict[str, Any],
    data: Path | None,
    workers: Workers,
    report: Path,
    strict: bool,
    as_json: bool,
) -> None:
    section = load(name).run(
        report, size=size, changes=changes, data=_data(data), workers=workers, strict=strict, quiet=as_json
    )
    page = _page(report)
    if as_json:
        say(json.dumps(section))
        return
    tell(section)
    say(f"page: {page}  picture: {report / name}  numbers: {report / name / 'summary.json'}")


def _workers(jobs: int, backend: str, scheduler: str | None) -> Workers:
    from taxel_studies.runner import Workers  # noqa: PLC0415  joblib loads slowly

    return Workers(jobs, backend, scheduler)


def _page(report: Path) -> Path | None:
    from taxel_studies.page import write_page  # noqa: PLC0415  jinja2 loads slowly

    return write_page(report) if report.is_dir() else None


def _data(data: Path | None) -> Path | None:
    named = os.environ.get("TAXEL_DATA")
    return data or (Path(named) if named else None)


def _changes(given: list[str], realisations: int | None) -> dict[str, Any]:
    return ({} if realisations is None else {"realisations": realisations}) | assignments(given)


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


@app.command(short_help=STUDIES["gait"])
def gait(
    size: Size = "full",
    test: Annotated[
        str | None,
        typer.Option(
            help="A folder like DATA with other people: train on DATA and judge on TEST, instead of by folds."
        ),
    ] = None,
    search: Annotated[
        str | None, typer.Option(help="listed points, or full: on plate also the 528 settings of 6.5.2 (hours).")
    ] = None,
    only: Annotated[
        list[str] | None, typer.Option(help="One source (plate, gaitpdb, gaitndd, moticon, pedar); may be repeated.")
    ] = None,
    changes: Changes = None,
    data: Data = None,
    jobs: Jobs = 1,
    backend: Backend = "loky",
    scheduler: Scheduler = None,
    report: Report = REPORT,
    strict: Strict = False,
    confirm: Confirm = False,
    figures: Figures = KEPT,
    as_json: AsJson = False,
) -> None:
    """Find gait events in walking recordings with one neuron an event (thesis 6.5, figures 6.12 to 6.14).

    Recordings are not part of taxel. They can be had, each for its folder of DATA, from: github.com/jiku-pro/jiku-data,
    SpeedPP2DS (plate; GPL-3.0); physionet.org/content/gaitpdb/1.0.0 (insole_gaitpdb; ODC-By 1.0);
    physionet.org/content/gaitndd/1.0.0 (insole_gaitndd; ODC-By 1.0); github.com/moticon-rego/moticon-opengo,
    tests/testdata (insole_moticon; Apache-2.0); github.com/Telfer/pressuRe, inst/extdata (pressure_formats; MIT). By
    whom, and what their truth is: docs/files.md.

    Example: taxel study gait --data recordings --jobs 2 --report figures
    """
    if confirm:
        _confirm("gait", figures, data, strict)
        return
    named = {name: value for name, value in (("test", test), ("search", search), ("sources", only)) if value}
    workers = _workers(jobs, backend, scheduler)
    _run("gait", size, named | _changes(changes or [], None), data, workers, report, strict, as_json)


def _add_figure(figure: str, study: str, run: Callable[..., None]) -> None:
    @wraps(run)
    def one(**given: Any) -> None:
        say(f"{figure} is a figure of the study {study}", err=True)
        run(**given)

    app.command(name=figure, help=f"The study {study}, which holds {figure}.", hidden=True)(one)


def _add_drawing(figure: str, where: str) -> None:
    def one() -> None:
        raise ProblemError(f"{figure} is a drawing or a table of words, not a result: {where}")

    app.command(name=figure, help=f"No study: {where}.", hidden=True)(one)


_RUN = {"gait": gait} | {name: _add(name, title) for name, title in STUDIES.items() if name != "gait"}
for _figure, _study in FIGURES.items():
    _add_figure(_figure, _study, _RUN[_study])
for _figure, _where in DRAWN.items():
    _add_drawing(_figure, _where)
