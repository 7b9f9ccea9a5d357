"""Pages of reports: one file that needs no other and no network, light and dark, on a desk and on a phone."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from typing import Any

import jinja2
from markupsafe import Markup, escape

from taxel import _core
from taxel._base.messages import escaped, escaped_lines

__all__ = ["render"]


def _shown(value: object) -> object:
    """Return what a template shows: texts as one line without control characters; figures and scripts are no texts."""
    return value if hasattr(value, "__html__") else escaped(value)


def _lines(value: object) -> Markup:
    """Return a text of several lines for a template: {{ text|lines }}."""
    return escape(escaped_lines(value))


@cache
def _environment(package: str) -> jinja2.Environment:
    made = jinja2.Environment(
        loader=jinja2.ChoiceLoader([jinja2.PackageLoader(name, ".") for name in dict.fromkeys((package, "taxel"))]),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
        finalize=_shown,
    )
    made.filters["lines"] = _lines
    return made


def render(template: str, *, package: str = "taxel", **values: Any) -> str:
    """Return a page.

    Parameters
    ----------
    template : str
        A Jinja template in the package, such as "demo/report.html.j2"; it extends "report/page.html.j2" of taxel.
    package : str
        Name of the installed package that the template is part of.
    values
        What the template shows; figures as `taxel.report.charts.chart` makes them.
    """
    plot = _core.page_file("vendor/uPlot.js").decode()
    # A script in a page cannot export: a function returns uPlot's public name, and its other names stay local.
    drawn, exported, _ = plot.rpartition("export {")
    assert exported, "uPlot.js ends with what it exports"
    own = files("taxel.report").joinpath("charts.js").read_text(encoding="utf-8")
    licence = _core.page_file("vendor/uPlot.LICENSE").decode()
    return (
        _environment(package)
        .get_template(template)
        .render(
            uplot_css=Markup(_core.page_file("vendor/uPlot.css").decode()),
            uplot_js=Markup(f"/*\n{licence}*/\nconst uPlot = (() => {{\n{drawn}\nreturn uPlot;\n}})();"),
            charts_js=Markup(own),
            **values,
        )
    )
