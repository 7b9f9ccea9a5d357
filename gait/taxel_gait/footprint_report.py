"""The report of footprints: one page of HTML, a sheet of A4 for each person with the left and the right foot."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup, escape
from numpy.typing import NDArray

from taxel.report import write_whole
from taxel.report.page import render
from taxel_gait.drawing import Axes, spanned
from taxel_gait.masks import CELL_MM
from taxel_gait.tables import Curves, Summary, figure

__all__ = ["write_report"]

#: The colours of regions, in their order, and of load from little to much.
COLOURS = ("#4878a8", "#66b8d9", "#e4605e", "#f08c5a", "#c9a227", "#6aa84f", "#2e7d4f", "#a64d79", "#8e7cc3", "#777777")
_RAMP = np.array([[236, 240, 246], [120, 180, 220], [70, 160, 110], [250, 200, 60], [200, 40, 40]], np.float64)
#: Pixels of a mm, and how many cells of a picture are one that is drawn.
_SCALE, _EACH = 1.15, 2
#: Where marks are on the path, % of the time that is known.
_MARKS = (0, 25, 50, 75, 100)
#: What the table shows of each region.
_SHOWN = (
    "max_force",
    "max_sum",
    "peak_pressure_",
    "contact_area_cm2",
    "contact_time_s",
    "fti_",
    "impulse_share",
    "pti_peak_cell_",
)


def write_report(
    path: Path,
    about: Sequence[str],
    feet: Mapping[str, Mapping[str, Any]],
    curves: Curves,
    summed: Sequence[Summary],
    *,
    overwrite: bool,
) -> None:
    """Write the page.

    Parameters
    ----------
    path : Path
    about : sequence of str
        What the tables have above their names.
    feet : mapping from person to mapping from side to mapping
        As of `Footprints.feet`.
    curves : Curves
    summed : sequence of Summary
        Means of whole prints (region "") and of regions.
    overwrite : bool
    """
    sheets = []
    # A person without a print in means has a sheet that says so.
    groups = dict.fromkeys([(person, condition) for person, condition, *_ in curves])
    groups |= dict.fromkeys((person, "") for person in feet if person not in {whose for whose, _ in groups})
    for person, condition in groups:
        own_rows = [one for one in summed if (one.person, one.condition) == (person, condition)]
        own_curves = {key[2:]: own for key, own in curves.items() if key[:2] == (person, condition)}
        sheets.append(
            {
                "title": " ".join(filter(None, (person, condition))) or "footprints",
                "feet": [
                    {
                        "side": side or "side not known",
                        "pictures": [
                            draw(foot, side) for foot in [feet[person].get(side)] if foot for draw in (_map, _picture)
                        ],
                        "whole": _curves(own, ["whole"], load),
                        "regions": _curves(own, [name for name in own if name != "whole"], load),
                    }
                    for (side, load), own in sorted(own_curves.items())
                ],
                "key": _key(next(iter(own_curves.values()), {})),
                "prints": {one.foot or "side not known": one.means.n for one in own_rows if not one.region},
                **_table(own_rows),
            }
        )
    text = render("footprints.html.j2", package="taxel_gait", about=about, sheets=sheets)
    write_whole(path, lambda file: file.write(text.encode()), overwrite=overwrite)


def _key(regions: Iterable[str]) -> list[tuple[str, str]]:
    """Return the name and the colour of each region."""
    names = [name for name in regions if name != "whole"]
    return [(name, COLOURS[k % len(COLOURS)]) for k, name in enumerate(names)]


def _table(rows: Sequence[Summary]) -> dict[str, Any]:
    """Return the columns of a person's table, and its cells by region."""
    of_regions = [row for row in rows if row.region]
    names = [name for name in dict.fromkeys(row.measure for row in of_regions) if name.startswith(_SHOWN)]
    by_region: dict[tuple[str, str], dict[str, str]] = {}
    for row in of_regions:
        by_region.setdefault((row.foot, row.region), {})[row.measure] = _spread(row)
    whole = [
        f"{row.foot} {row.measure}: {_spread(row)}"
        for row in rows
        if not row.region and row.measure in ("arch_index", "cpei_pct", "stance_s", "print_length_mm")
    ]
    cells = [[foot, region, *(own.get(name, "") for name in names)] for (foot, region), own in by_region.items()]
    return {"columns": names, "cells": cells, "whole": whole}


def _spread(row: Summary) -> str:
    """Return a mean, with its standard deviation where there are several."""
    return f"{figure(row.means.mean, 4)}" + f" ± {figure(row.means.sd, 2)}" * (row.means.n > 1)


def _mirror(side: str) -> float:
    """Return the direction to the right on paper: as seen from above, the big toe of a left foot is on the right."""
    return -1.0 if side == "left" else 1.0


def _at(points: NDArray[np.float64], side: str, size: tuple[float, float]) -> NDArray[np.float64]:
    """Return points of the foot, mm, in pixels of a drawing: toes up."""
    width, height = size
    x = width / 2 + _SCALE * _mirror(side) * points[:, 0]
    return np.stack([x, height - 14 - _SCALE * (points[:, 1] + 8)], axis=1)


def _size(foot: Mapping[str, Any]) -> tuple[float, float]:
    rows = np.flatnonzero(np.array(foot["most"]).any(axis=1))
    return 150 * _SCALE, _SCALE * (CELL_MM * int(rows[-1]) + 8) + 24


def _cells(values: NDArray[np.float64], side: str, size: tuple[float, float]) -> str:
    """Return a picture as squares in the colours of its load."""
    rows, columns = (n // _EACH * _EACH for n in values.shape)
    small = values[:rows, :columns].reshape(rows // _EACH, _EACH, columns // _EACH, _EACH).max(axis=(1, 3))
    top, marks, edge = max(float(small.max()), 1e-12), [], CELL_MM * _EACH
    for row, column in np.argwhere(small > 0):
        share = small[row, column] / top * (len(_RAMP) - 1)
        k = min(int(share), len(_RAMP) - 2)
        red, green, blue = (_RAMP[k] + (share - k) * (_RAMP[k + 1] - _RAMP[k])).astype(int)
        middle = np.array([[column * edge - 75 + edge / 4, row * edge - 10 + edge / 4]])
        x, y = (_at(middle, side, size) - edge * _SCALE / 2)[0]
        marks.append(
            f'<rect x="{x:.1f}" y="{y:.1f}" width="{edge * _SCALE + 0.2:.1f}" height="{edge * _SCALE + 0.2:.1f}" '
            f'fill="rgb({red},{green},{blue})"/>'
        )
    return "".join(marks)


def _drawing(size: tuple[float, float], title: str, *marks: str) -> Markup:
    width, height = size
    words = f'<text x="2" y="10">{escape(title)}</text>'
    return Markup(
        f'<svg viewBox="0 0 {width:.0f} {height:.0f}" width="{width:.0f}" height="{height:.0f}" role="img" '
        f'font-family="system-ui, sans-serif" font-size="10">{"".join(marks)}{words}</svg>'
    )


def _map(foot: Mapping[str, Any], side: str) -> Markup:
    """Return the mean footprint with its regions, and the mean path of the centre with marks in time."""
    size = _size(foot)
    marks = [_cells(np.array(foot["mean"]), side, size)]
    for k, region in enumerate(foot["regions"]):
        points = " ".join(f"{x:.1f},{y:.1f}" for x, y in _at(np.array(region["polygon"]), side, size))
        colour = COLOURS[k % len(COLOURS)]
        about = f"<title>{escape(region['name'])}</title>"
        marks.append(
            f'<polygon points="{points}" fill="{colour}" fill-opacity="0.28" stroke="{colour}">{about}</polygon>'
        )
    path = _at(np.array(foot["path"]), side, size)
    line = " ".join(f"{x:.1f},{y:.1f}" for x, y in path)
    marks.append(f'<polyline points="{line}" fill="none" stroke="#000" stroke-width="1.6"/>')
    for pct in _MARKS:
        x, y = path[round(pct / 100 * (len(path) - 1))]
        marks.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.6" fill="#fff" stroke="#000"/>')
        marks.append(f'<text x="{x + 5:.1f}" y="{y + 3:.1f}" font-size="8" style="fill:#000">{pct}</text>')
    return _drawing(size, "mean, regions, path (% of time)", *marks)


def _picture(foot: Mapping[str, Any], side: str) -> Markup:
    """Return the largest value of each place."""
    size, values = _size(foot), np.array(foot["most"])
    return _drawing(size, f"maximum, at most {values.max():g}", _cells(values, side, size))


def _curves(
    own: Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]], names: Sequence[str], load: str
) -> Markup:
    """Return the mean load over stance of regions, with a band of one SD for the whole."""
    there = [name for name in names if name in own]
    tops = [float(np.max(own[name][0] + np.nan_to_num(own[name][1]))) for name in there]
    title = "whole foot, mean and SD" if names == ["whole"] else "regions, means"
    name, _, unit = load.partition("_")
    words = f"{name} ({unit})"
    axes = Axes((0.0, 100.0), spanned(tops, zero=True), "stance (%)", words, title, width=330, height=170)
    pct = np.linspace(0, 100, 101)
    for name in there:
        mean, sd = own[name]
        colour = "#444444" if name == "whole" else COLOURS[names.index(name) % len(COLOURS)]
        if name == "whole":
            axes.band(pct, np.maximum(mean - np.nan_to_num(sd), 0), mean + np.nan_to_num(sd), colour)
        axes.line(pct, mean, colour, title=name)
    return axes.svg()
