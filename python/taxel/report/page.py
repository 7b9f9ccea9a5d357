"""Pages of reports: one file that needs no other and no network, light and dark, on a desk and on a phone."""

from __future__ import annotations

from functools import cache
from typing import Any

import jinja2
from markupsafe import Markup, escape

from taxel._base.messages import escaped, escaped_lines

__all__ = ["render"]


def _show(value: object) -> object:
    """Return what a template shows: texts as one line without control characters; figures are not texts."""
    return value if hasattr(value, "__html__") else escaped(value)


def _lines(value: object) -> Markup:
    """Return a text of several lines for a template: {{ text|lines }}."""
    return escape(escaped_lines(value))


@cache
def _environment(package: str) -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.ChoiceLoader([jinja2.PackageLoader(name, ".") for name in dict.fromkeys((package, "taxel"))]),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
        finalize=_show,
    )
    environment.filters["lines"] = _lines
    return environment


def render(template: str, *, package: str = "taxel", **values: Any) -> str:
    """Return a page.

    Parameters
    ----------
    template : str
        A Jinja template in the package, such as "demo/report.html.j2"; it extends "report/page.html.j2" of taxel.
    package : str
        Name of the installed package that the template is part of.
    values
        What the template shows; figures as `taxel.report.svg.picture` makes them.
    """
    return _environment(package).get_template(template).render(**values)
