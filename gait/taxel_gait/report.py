"""The report of steps: one page of HTML that prints, with a sheet for each person and condition."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from taxel.report import write_whole
from taxel.report.page import render
from taxel_gait.drawing import COLOURS, LEFT_OUT, Axes, spanned
from taxel_gait.tables import SYMMETRIES, curves, figure, load_name, summary, symmetry

__all__ = ["write_report"]

#: The symmetry that the page shows; the tables have all.
_SYMMETRY = next(iter(SYMMETRIES))
#: The page has at most so many sheets: a browser shows no more at once.
_SHEETS = 60
#: A line of the strip is so long, s, and a step is drawn by each of so many points of its curve.
_LINE_S, _EACH = 60.0, 5
#: The measures of the page's table; units follow from the columns.
_SHOWN = (
    *("stride_s", "stance_s", "swing_s", "stance_pct", "step_s", "double_support_s", "single_support_s", "cadence"),
    *("max_", "first_peak", "valley", "second_peak", "impulse", "loading_rate", "peak_", "contact_area", "cop_"),
)


def write_report(
    path: Path,
    about: Sequence[str],
    definitions: Sequence[str],
    rows: Sequence[Mapping[str, Any]],
    over_stance: Sequence[Sequence[float] | None],
    *,
    overwrite: bool,
) -> None:
    """Write the page.

    Parameters
    ----------
    path : Path
    about : sequence of str
        What the tables have above their names: thresholds, definitions, what was left out.
    definitions : sequence of str
        How contact and lift are defined, for the captions.
    rows, over_stance
        Those of the steps, and their curves.
    overwrite : bool
    """
    sheets: dict[tuple[str, str], list[int]] = {}
    for k, row in enumerate(rows):
        sheets.setdefault((row["person"], row["condition"]), []).append(k)
    others = len(sheets) - _SHEETS
    text = render(
        "report.html.j2",
        package="taxel_gait",
        about=about,
        definitions=definitions,
        sheets=[
            _sheet(" ".join(filter(None, key)), [rows[k] for k in own], [over_stance[k] for k in own])
            for key, own in list(sheets.items())[:_SHEETS]
        ],
        others=others,
    )
    write_whole(path, lambda file: file.write(text.encode()), overwrite=overwrite)


def _sheet(
    title: str, rows: Sequence[Mapping[str, Any]], over_stance: Sequence[Sequence[float] | None]
) -> dict[str, Any]:
    """Return what the page shows of a person in a condition."""
    summed = summary(rows)
    feet = sorted({row["foot"] for row in rows})
    by_measure: dict[str, dict[str, list[str]]] = {}
    for one in summed:
        if one.measure.startswith(_SHOWN) and not one.measure.endswith("_peak_pct"):
            means = one.means
            cells = [str(means.n), figure(means.mean, 4), figure(means.sd, 2), f"{means.cv_pct:.1f}"]
            by_measure.setdefault(one.measure, {})[one.foot] = cells
    used = {name: sum(row["used"] == name for row in rows) for name in dict.fromkeys(row["used"] for row in rows)}
    out = ", ".join(f"{count} {name}" for name, count in used.items() if name != "yes")
    return {
        "title": title or "steps",
        "used": f"{used.get('yes', 0)} steps are in the means" + f"; left out: {out}" * bool(out),
        "feet": feet,
        "measures": by_measure,
        "symmetry": {one["measure"]: one[_SYMMETRY] for one in symmetry(summed)},
        "strips": _strips(rows, over_stance),
        "curve": _curve(rows, over_stance),
        "strides": _strides(rows),
    }


def _unit(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the name of the load, and its unit."""
    load, _, unit = next(filter(None, map(load_name, rows)), "load").partition("_")
    return f"{load} ({unit})" if unit else load


def _strips(rows: Sequence[Mapping[str, Any]], over_stance: Sequence[Sequence[float] | None]) -> list[Markup]:
    """Return the steps of each recording over time, a line for each minute; those that are left out in grey."""
    most = max((max(curve) for curve in over_stance if curve is not None), default=1.0)
    whole = [(row, curve) for row, curve in zip(rows, over_stance, strict=True) if curve is not None]
    found = []
    for name in dict.fromkeys(row["recording"] for row, _ in whole):
        own = [(row, curve) for row, curve in whole if row["recording"] == name]
        begin, end = min(row["contact_s"] for row, _ in own), max(row["lift_s"] for row, _ in own)
        count = max(1, round((end - begin) / _LINE_S))
        edges = np.linspace(begin, end, count + 1)
        lines = [
            Axes((first, last), (0.0, 1.05 * most), "time (s)", _unit(rows), width=940, height=130)
            for first, last in pairwise(edges.tolist())
        ]
        lines[0].title = f"{name}: grey steps are left out"
        for row, curve in own:
            is_used = row["used"] == "yes"
            times = np.linspace(row["contact_s"], row["lift_s"], len(curve))[::_EACH]
            words = f"{row['foot']} {row['step']}" + f": {row['used']}" * (not is_used)
            line = lines[min(int(np.searchsorted(edges, row["contact_s"], "right")) - 1, count - 1)]
            colour = COLOURS[row["foot"]] if is_used else LEFT_OUT
            line.line(times, np.minimum(curve[::_EACH], most), colour, width=1.1, title=words)
        found += [line.svg() for line in lines]
    return found


def _curve(rows: Sequence[Mapping[str, Any]], over_stance: Sequence[Sequence[float] | None]) -> Markup:
    """Return the mean load over stance of each foot, with a band of one SD."""
    found = curves(rows, over_stance)
    tops = [float(np.nanmax(mean + np.nan_to_num(sd))) for _, mean, sd in found.values()]
    axes = Axes((0.0, 100.0), spanned(tops, zero=True), "stance (%)", _unit(rows), "mean and SD")
    for k, ((_, _, foot), (n, mean, sd)) in enumerate(found.items()):
        pct = np.linspace(0, 100, len(mean))
        axes.band(pct, np.maximum(mean - np.nan_to_num(sd), 0), mean + np.nan_to_num(sd), COLOURS[foot])
        axes.line(pct, mean, COLOURS[foot])
        axes.text(38, axes.y[1] * (0.14 - 0.08 * k), f"{foot or 'foot'}, {n} steps", COLOURS[foot])
    return axes.svg()


def _strides(rows: Sequence[Mapping[str, Any]]) -> Markup:
    """Return the time of each stride; crosses are left out."""
    known = [row for row in rows if row.get("stride_s") is not None]
    spans = [spanned(row[name] for row in known) for name in ("contact_s", "stride_s")]
    axes = Axes(spans[0], spans[1], "time (s)", "stride (s)", "stride times; crosses are left out")
    for foot, colour in COLOURS.items():
        own = [row for row in known if row["foot"] == foot]
        for is_used in (True, False):
            some = [row for row in own if (row["used"] == "yes") is is_used]
            x, y = ([row[name] for row in some] for name in ("contact_s", "stride_s"))
            axes.dots(x, y, colour if is_used else LEFT_OUT, crosses=not is_used)
    return axes.svg()
