"""The one page of all studies: each figure drawn, what was claimed, what was found, what was not run."""

from __future__ import annotations

from pathlib import Path

import jinja2

from taxel._files import write_whole
from taxel.studies import STUDIES
from taxel.studies.study import read_section

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
    FormatError : a summary in the folder that is none
    """
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("taxel.studies", "."), autoescape=True, undefined=jinja2.StrictUndefined
    )
    sections = {name: read_section(report / name) for name in STUDIES}
    text = environment.get_template("page.html.j2").render(titles=STUDIES, sections=sections)
    return write_whole(report / "index.html", lambda file: file.write(text.encode()), overwrite=True)
