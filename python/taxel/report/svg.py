"""Figures of matplotlib in a page, as SVG in the page's own colours."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
from markupsafe import Markup

from taxel._base.messages import escaped_lines

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: What pages paint in their own colours, dark or light: text, axes, and lines of no colour of their own; the ground.
INK, _LINE, _GROUND = "#2b2b2b", "#dedad2", "#fffffe"

#: Colours of what was detected, of what is true, and of lines behind.
DETECTED, TRUE, QUIET = "#b5423c", "#2f6690", "#999999"

#: The look of all pictures: draw inside ``matplotlib.rc_context(STYLE)``.
STYLE: Any = {
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "grid.color": _LINE,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "font.size": 9,
    "legend.facecolor": _GROUND,
    "legend.edgecolor": "none",
}


#: From how many characters on the marks within the axes become pixels, and how many pixels an inch has.
_LARGEST, _PIXELS = 500_000, 200


def picture(figure: Figure) -> Markup:
    """Return a figure for a page: SVG that takes the page's colours, and whose text can be searched.

    Where a figure has so many points, lines or bars that the page would become large, these are pixels in it, on white.
    """
    svg, where = _svg(figure), "picture"
    if len(svg) > _LARGEST:
        for axes in figure.axes:
            for artist in (*axes.lines, *axes.patches, *axes.collections):
                artist.set_rasterized(True)
        svg, where = _svg(figure), "picture light"
    return Markup(f'<div class="{where}">') + Markup(escaped_lines(svg)) + Markup("</div>")


def image(figure: Figure) -> str:
    """Return a figure as a file of SVG, on no ground."""
    text = io.StringIO()
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": "taxel"}):
        figure.savefig(text, format="svg", metadata={"Date": None}, transparent=True, dpi=_PIXELS)
    return text.getvalue()


def _svg(figure: Figure) -> str:
    svg = image(figure)
    svg = svg[svg.index("<svg") :]
    for colour, variable in ((INK, "--ink"), ("#000000", "--ink"), (_LINE, "--line"), (_GROUND, "--card")):
        svg = svg.replace(f": {colour}", f": var({variable})")
    return svg
