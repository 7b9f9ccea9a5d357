"""The page of all studies: each figure, its claims with our results, and the studies that were not run."""

from __future__ import annotations

from pathlib import Path

from taxel.report import write_whole
from taxel.report.page import render
from taxel_studies import STUDIES
from taxel_studies.claims import CLAIMS
from taxel_studies.study import read_section


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
    text = render("page.html.j2", package="taxel_studies", titles=STUDIES, sections=sections, claims=CLAIMS)
    return write_whole(report / "index.html", lambda file: file.write(text.encode()), overwrite=True)
