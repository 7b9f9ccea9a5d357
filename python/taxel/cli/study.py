"""``taxel study``: run a study and leave its report."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from taxel.cli import app

studies = typer.Typer(help="Run a study: a protocol, its parameters, a report. Stops on Ctrl-C, resumes where it was.")
app.add_typer(studies, name="study", no_args_is_help=True)


@studies.callback()
def _studies() -> None:
    """Run a study: a protocol, its parameters, a report. Stops on Ctrl-C, resumes where it was."""


@studies.command()
def gait(
    data: Annotated[
        Path,
        typer.Option(
            help="Folder with any of plate, insole_gaitpdb, insole_gaitndd, insole_moticon, pressure_formats."
        ),
    ],
    test: Annotated[
        Path | None, typer.Option(help="Such a folder of other people: train on DATA, judge on TEST.")
    ] = None,
    size: Annotated[str, typer.Option(help="full, or toy (shows that it runs).")] = "full",
    jobs: Annotated[int, typer.Option(help="Processes.")] = 1,
    report: Annotated[
        Path, typer.Option(help="Folder for the report, the folds and all results; resumes what is in it.")
    ] = Path("taxel-study-gait"),
    only: Annotated[
        list[str] | None, typer.Option(help="One source (plate, gaitpdb, gaitndd, moticon, pedar); may be repeated.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the summary as JSON, and no progress.")] = False,
) -> None:
    """Find gait events in walking recordings with one neuron an event (thesis 6.5).

    Example: taxel study gait --data recordings --jobs 2 --report gait-report
    """
    from taxel.studies.gait import study  # noqa: PLC0415  the learner and its libraries load slowly

    said = study(data, test, size=size, jobs=jobs, report=report, only=only or (), quiet=as_json)
    if as_json:
        typer.echo(json.dumps(said))
        return
    _show(said)
    typer.echo(f"report: {report / 'gait.html'}  figures: {report / 'gait.json'}  folds: {report / 'folds.json'}")


def _show(said: dict[str, Any]) -> None:
    from rich.console import Console  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415

    console = Console()
    if said["skipped"]:
        console.print(f"not here, so skipped: {', '.join(said['skipped'])}")
    for source in said["sources"]:
        for protocol in source["protocols"]:
            table = Table(title=f"{source['source']}: {protocol['protocol']}", title_justify="left")
            for name in (
                "event",
                "row",
                "% found",
                "missed",
                "false",
                "false/min",
                "% in 10 ms",
                "error of t, ms",
                "goal",
            ):
                table.add_column(name, justify="left" if name in ("event", "row") else "right")
            for row in protocol["rows"]:
                f = row["figures"]
                error = f["error_ms"]
                table.add_row(
                    row["event"],
                    row["row"],
                    _number(f["found_percent"]),
                    str(f["missed"]),
                    str(f["false"]),
                    _number(f["false_per_minute"]) if source["by_minute"] else "",
                    _number(f["within_10_ms_percent"]),
                    f"{error['mean']:+.1f} ± {error['sd']:.1f}" if error else "",
                    {True: "met", False: "below"}.get(row.get("goal_met"), ""),
                )
            console.print(table)


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.1f}"
