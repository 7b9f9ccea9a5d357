"""``taxel study``: run a study and leave its report."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from taxel import ProblemError
from taxel.cli.app import App, Flat, say
from taxel.options import Settings
from taxel.tasks import Workers
from taxel_studies import DRAWN, FIGURES, STUDIES, load
from taxel_studies.claims import CLAIMS

app = App(name="study")


@dataclass(frozen=True)
class StudyOptions:
    """Hold how a study is run.

    Parameters
    ----------
    size
        full, or toy (a quick check that the study runs); some studies have more sizes.
    changes
        Set a parameter of the study to a value (TOML). May be repeated.
    data
        Folder of recordings, for the studies that need some (or TAXEL_DATA names it).
    report
        Folder for the page, pictures and all results. Results that it contains are not computed again.
    json
        Print the summary as JSON, and no progress.
    """

    size: str = "full"
    changes: Settings = field(default_factory=dict)
    data: Path | None = None
    report: Path = Path("taxel-studies")
    json: bool = False

    def run(self, name: str, workers: Workers, changes: Mapping[str, Any]) -> dict[str, Any]:
        """Run a study, and return its part of the page."""
        data = self.recordings
        run = load(name).run
        given: dict[str, Any] = {"size": self.size, "data": data, "quiet": self.json}
        return run(self.report, workers=workers, changes=changes, **given)

    @property
    def recordings(self) -> Path | None:
        """The folder of recordings, if there is any."""
        named = os.environ.get("TAXEL_DATA")
        return self.data or (Path(named) if named else None)


@app.default
def study(
    name: str | None = None,
    /,
    *,
    options: Flat[StudyOptions] = StudyOptions(),
    workers: Flat[Workers] = Workers(),
) -> None:
    """Run a study: a protocol, its parameters, a report. Stops on Ctrl-C, resumes where it was.

    Figures and tables of the thesis are names too: fig5.6 runs the study that holds it. Without NAME, the studies are
    listed. Studies on recordings are left out of all, and named, where no recordings are.

    Example: taxel study fig6.9 --size toy

    Parameters
    ----------
    name
        The name of a study, figure or table, or all; lists them if left out.
    """
    from taxel_studies.page import write_page  # noqa: PLC0415  jinja2 loads slowly

    if name is None:
        say(*(f"{one:<16}{title}" for one, title in STUDIES.items()))
        return
    wanted = _every(options) if name == "all" else [_named(name)]
    sections = {}
    try:
        for one in wanted:
            known = load(one).parameters if name == "all" else options.changes
            changes = {key: value for key, value in options.changes.items() if key in known}
            sections[one] = options.run(one, workers, changes)
            if not options.json:
                tell(sections[one])
    finally:
        # The page is written however the run ends: it shows what was run, and names the rest.
        page = write_page(options.report) if options.report.is_dir() else None
    if options.json:
        say(json.dumps(sections if name == "all" else sections[wanted[0]]))
    else:
        say(f"page: {page}  pictures and numbers: in the folders beside it")


def _named(name: str) -> str:
    """Return the study that a name is of."""
    if name in DRAWN:
        raise ProblemError(f"{name} is a drawing or a table of words, not a result: {DRAWN[name]}")
    if name in FIGURES:
        say(f"{name} is a figure of the study {FIGURES[name]}", err=True)
    if FIGURES.get(name, name) not in STUDIES:
        raise ProblemError(
            f"no study {name!r}: there are {', '.join(STUDIES)}, the thesis' figures and tables, and all"
        )
    return FIGURES.get(name, name)


def _every(options: StudyOptions) -> list[str]:
    """Return the studies that can be run here, and say why others are left out."""
    why = {}
    for name in STUDIES:
        load(name).set(options.size)  # refused before any study begins
        why[name] = load(name).cannot_run(options.recordings)
    say(*(f"{name}: left out, {reason}" for name, reason in why.items() if reason), err=True)
    return [name for name, reason in why.items() if reason is None]


def tell(section: dict[str, Any]) -> None:
    """Print what a study found: its judgements of claims, and tables."""
    from rich.table import Table  # noqa: PLC0415

    from taxel.cli.console import Console  # noqa: PLC0415  the command line starts quickly

    say("", f"{section['name']}, size {section['size']}: {section['title']}")
    for judged in section["judgements"]:
        claim = CLAIMS[judged["claim"]]
        holds = {True: "holds", False: "does not hold", None: "not judged"}[judged["holds"]]
        reading = f" ({judged['reading']}{', main' if judged['reading'] == claim.main else ''})"
        say(f"- {claim.says} {holds.upper()}" + reading * bool(judged["reading"]))
        say(f"    {claim.number}: {claim.where}; published: {claim.value or 'none'}", f"    ours: {judged['ours']}")
        say(*[f"    {judged['why']}"] * bool(judged["why"]))
    console = Console()
    if not console.is_terminal:
        console.width = 10_000  # a file breaks and cuts nothing
    for shown in section["tables"]:
        say("", shown["title"])
        table = Table(box=None, pad_edge=False)
        for k, name in enumerate(shown["head"]):
            table.add_column(name, justify="right" if k else "left", no_wrap=not k, overflow="fold")
        for row in shown["rows"]:
            table.add_row(*row)
        console.print(table)
