"""``taxel study``: run a study and leave its report."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taxel.cli._app import App, app
from taxel.cli._recordings import SET_HELP, assignments
from taxel.studies import STUDIES, load

if TYPE_CHECKING:
    from taxel.studies.runner import Workers

studies = App(help="Run a study: a protocol, its parameters, a report. Stops on Ctrl-C, resumes where it was.")
app.add_typer(studies, name="study", no_args_is_help=True)

Jobs = Annotated[int, typer.Option(help="Processes.")]
Backend = Annotated[str, typer.Option(help="Who runs them: loky (processes here), dask or ray (a cluster).")]
Scheduler = Annotated[
    str | None, typer.Option(help="Address of a Dask or Ray cluster that runs already; else one starts here.")
]
Report = Annotated[Path, typer.Option(help="Folder for the page, pictures and all results; resumes what is in it.")]
Size = Annotated[str, typer.Option(help="full, or toy (shows that it runs); some studies have more.")]
Realisations = Annotated[int | None, typer.Option(help="How many, instead of the size's.")]
Changes = Annotated[list[str] | None, typer.Option("--set", help=SET_HELP)]
Data = Annotated[
    Path | None, typer.Option(help="Folder of recordings, for the studies that need some (or TAXEL_DATA names it).")
]
Strict = Annotated[bool, typer.Option("--strict", help="A recording that cannot be read ends it; else it is left out.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print the summary as JSON, and no progress.")]

REPORT = Path("taxel-studies")


@studies.callback()
def _studies() -> None:
    """Run a study: a protocol, its parameters, a report. Stops on Ctrl-C, resumes where it was."""


@studies.command(name="all")
def every(
    size: Size = "full",
    realisations: Realisations = None,
    data: Data = None,
    jobs: Jobs = 1,
    backend: Backend = "loky",
    scheduler: Scheduler = None,
    report: Report = REPORT,
    strict: Strict = False,
    as_json: AsJson = False,
) -> None:
    """Run every study and make one page of them.

    Studies on recordings are left out, and said to be, where no recordings are; so are those whose packages are not
    installed.

    Example: taxel study all --report figures --jobs 2
    """
    changes = {} if realisations is None else {"realisations": realisations}
    said = {}
    try:
        for name in STUDIES:
            study = load(name)
            own = {k: v for k, v in changes.items() if k in study.parameters}
            where = _data(data)
            if study.data and (where is None or not any((where / folder).is_dir() for folder in study.data)):
                typer.echo(f"{name}: left out, it needs any of {', '.join(study.data)} (--data)", err=True)
                continue
            if study.lacks is not None:
                typer.echo(f"{name}: left out, {study.lacks}", err=True)
                continue
            said[name] = study.run(
                report,
                size=size if size in study.sizes else "full",
                changes=own,
                data=where,
                workers=_workers(jobs, backend, scheduler),
                strict=strict,
                quiet=as_json,
            )
    finally:
        # Whatever stopped it: the page shows what was run, and names the rest.
        page = _page(report)
    if as_json:
        typer.echo(json.dumps(said))
        return
    for section in said.values():
        _tell(section)
    typer.echo(f"page: {page}")


def _add(name: str, title: str) -> None:
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
        as_json: AsJson = False,
    ) -> None:
        workers = _workers(jobs, backend, scheduler)
        _run(name, size, _changes(changes or [], realisations), data, workers, report, strict, as_json)

    text = f"{title[0].upper()}{title[1:]}.\n\nExample: taxel study {name} --report figures --jobs 2"
    studies.command(name=name, help=text, short_help=title)(one)


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
        typer.echo(json.dumps(section))
        return
    _tell(section)
    typer.echo(f"page: {page}  picture: {report / name}  numbers: {report / name / 'summary.json'}")


def _workers(jobs: int, backend: str, scheduler: str | None) -> Workers:
    from taxel.studies.runner import Workers  # noqa: PLC0415  joblib loads slowly

    return Workers(jobs, backend, scheduler)


def _page(report: Path) -> Path | None:
    from taxel.studies.page import write_page  # noqa: PLC0415  jinja2 loads slowly

    return write_page(report) if report.is_dir() else None


def _data(data: Path | None) -> Path | None:
    named = os.environ.get("TAXEL_DATA")
    return data or (Path(named) if named else None)


def _changes(said: list[str], realisations: int | None) -> dict[str, Any]:
    return ({} if realisations is None else {"realisations": realisations}) | assignments(said)


def _tell(section: dict[str, Any]) -> None:
    from rich.console import Console  # noqa: PLC0415  the command line starts quickly
    from rich.table import Table  # noqa: PLC0415

    typer.echo(f"\n{section['name']}, size {section['size']}: {section['title']}")
    for s in section["statements"]:
        holds = {True: "holds", False: "does not hold", None: "not judged"}[s["holds"]]
        typer.echo(f"- {s['says']} {holds.upper()}" + (f" ({s['why']})" if s["why"] else ""))
        typer.echo(f"    published: {s['published']}\n    ours: {s['ours']}")
    for said in section["tables"]:
        if not said["folded"]:
            table = Table(title=said["title"], title_justify="left")
            for k, name in enumerate(said["head"]):
                table.add_column(name, justify="right" if k else "left", no_wrap=not k)
            for row in said["rows"]:
                table.add_row(*row)
            Console().print(table)
    for file, why in section["unread"].items():
        typer.echo(f"could not be read, so left out: {file}: {why}")


@studies.command(short_help=STUDIES["gait"])
def gait(
    size: Size = "full",
    test: Annotated[
        str | None,
        typer.Option(help="Such a folder of other people: train on DATA, judge on TEST, instead of by folds."),
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
    as_json: AsJson = False,
) -> None:
    """Find gait events in walking recordings with one neuron an event (thesis 6.5, figures 6.12 to 6.14).

    Recordings are not part of taxel. They can be had, each for its folder of DATA, from: github.com/jiku-pro/jiku-data,
    SpeedPP2DS (plate; GPL-3.0); physionet.org/content/gaitpdb/1.0.0 (insole_gaitpdb; ODC-By 1.0);
    physionet.org/content/gaitndd/1.0.0 (insole_gaitndd; ODC-By 1.0); github.com/moticon-rego/moticon-opengo,
    tests/testdata (insole_moticon; Apache-2.0); github.com/Telfer/pressuRe, inst/extdata (pressure_formats; MIT). By
    whom, and what their truth is: docs/recordings.md.

    Example: taxel study gait --data recordings --jobs 2 --report figures
    """
    named = {name: value for name, value in (("test", test), ("search", search), ("sources", only)) if value}
    workers = _workers(jobs, backend, scheduler)
    _run("gait", size, named | _changes(changes or [], None), data, workers, report, strict, as_json)


for _name, _title in STUDIES.items():
    if _name != "gait":
        _add(_name, _title)
