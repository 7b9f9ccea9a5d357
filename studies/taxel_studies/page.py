"""The page of all studies: each figure, its statements with our results, and the studies that were not run."""

from __future__ import annotations

from pathlib import Path

from markupsafe import Markup

from taxel.report import write_whole
from taxel.report.page import render
from taxel_studies import STUDIES, load
from taxel_studies.study import Section, read_section

__all__ = ["write_page"]


def write_page(report: Path) -> Path:
    """Write ``index.html`` from what lies in a report's folder: one file that needs no other.

    Parameters
    ----------
    report : Path
        Holds a folder a study; studies without one are named as not run.

    Returns
    -------
    Path
        Of the page.

    Raises
    ------
    FormatError : a file ``summary.json`` in the folder that is not a study's
    """
    sections = {name: read_section(report / name) for name in STUDIES}
    charts = {name: _charts(name, section) for name, section in sections.items()}
    text = render("page.html.j2", package="taxel_studies", titles=STUDIES, sections=sections, charts=charts)
    return write_whole(report / "index.html", lambda file: file.write(text.encode()), overwrite=True)


def _charts(name: str, section: Section | None) -> Markup | None:
    """Return a study's figures, drawn from its numbers; None where only older code can draw them."""
    if section is None:
        return None
    from taxel.report.charts import chart  # noqa: PLC0415  loads slowly

    try:
        return chart(load(name).draw(section["parameters"], section["said"]))
    except (KeyError, TypeError, ValueError, IndexError):
        return None
