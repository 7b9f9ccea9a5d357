"""A figure as a chart that can be zoomed and hovered: what matplotlib draws, as data for uPlot in the page.

Figures are written once, with matplotlib, for reports, notebooks and files alike. A page takes the lines, points,
bars, bands, marks and pictures out of their axes; what it does not know (three dimensions, twin axes, arrows) it shows
as SVG.
"""

from __future__ import annotations

import base64
import io
import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from markupsafe import Markup
from matplotlib import collections, colors, container, lines, patches
from matplotlib.image import AxesImage
from numpy.typing import NDArray

from taxel._base.messages import escaped_lines

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

__all__ = ["INK", "STYLE", "chart", "chart_data"]

#: What pages paint in their own ink, dark or light: text, axes, and lines of no colour of their own.
INK, _LINE = "#2b2b2b", "#dedad2"

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
    "svg.fonttype": "none",
    "svg.hashsalt": "taxel",
}
#: Pixels of an inch of the figure, and the least height of a chart.
_PIXELS, _LEAST = 78, 150


class _NotKnownError(Exception):
    """What a chart cannot hold."""


def chart(figure: Figure | Sequence[Figure]) -> Markup:
    """Return a figure, or several, as what stands in a page: charts where all of it is known, else SVG."""
    every = figure if isinstance(figure, Sequence) else [figure]
    return Markup("\n").join(_one(one) for one in every)


def _one(figure: Figure) -> Markup:
    try:
        data = _shown(chart_data(figure))
    except _NotKnownError:
        return Markup('<div class="picture">') + Markup(_svg(figure)) + Markup("</div>")
    # The data must not contain the end tag of the script element that holds it.
    text = json.dumps(data, ensure_ascii=False, separators=(",", ":"), allow_nan=False).replace("</", "<\\/")
    return Markup('<div class="charts"><script type="application/json">') + Markup(text) + Markup("</script></div>")


def _shown(data: Any) -> Any:
    """Return what a chart holds with its texts without control characters."""
    if isinstance(data, str):
        return escaped_lines(data)
    if isinstance(data, dict):
        return {key: _shown(value) for key, value in data.items()}
    return [_shown(value) for value in data] if isinstance(data, list | tuple) else data


def chart_data(figure: Figure) -> dict[str, Any]:
    """Return what a page's charts hold of a figure: its axes in order, colour scales, how many stand side by side.

    Raises
    ------
    _NotKnownError : something that is no line, point, bar, band, mark, text or picture
    """
    own: list[Any] = [axes for axes in figure.axes if axes.get_visible() and not hasattr(axes, "_colorbar")]
    # Within each part of a figure axes stand beside one another.
    parts = {id(axes.figure): axes.figure for axes in own}
    places = [(id(axes.figure), *np.round(axes.get_position().bounds, 6)) for axes in own]
    if len(set(places)) < len(places) or any(axes.name != "rectilinear" for axes in own):
        raise _NotKnownError
    shown = [axes for axes in own if axes.axison or axes.has_data()]
    if not shown or not all(_repeats(inset, axes) for axes in shown for inset in axes.child_axes):
        raise _NotKnownError
    scales = [_colour_scale(axes) for axes in figure.axes if hasattr(axes, "_colorbar")]
    groups: dict[Any, int] = {}
    every = [_axes(axes, figure, groups) for axes in shown]
    for part in parts.values():
        first = next(data for axes, data in zip(shown, every, strict=True) if axes.figure is part)
        if part is not figure and part.get_suptitle():
            first["title"] = f"{part.get_suptitle()}\n{first['title']}".strip()
    if len(parts) > 1:
        for data in every:
            data["place"] = None
    return {
        "title": figure.get_suptitle(),
        "columns": max(_columns(axes) for axes in shown),
        "axes": every,
        "scales": [scale for scale in scales if scale is not None],
    }


def _repeats(inset: Axes, axes: Axes) -> bool:
    """Tell whether an inset shows points of its axes' lines again, only closer: a page can do that anyhow."""

    def points(line: Any) -> set[tuple[float, ...]]:
        return {tuple(point) for point in np.asarray(line.get_xydata(), float).tolist()}

    known = [points(line) for line in axes.lines]
    return not inset.images and all(any(points(line) <= one for one in known) for line in inset.lines)


def _columns(axes: Axes) -> int:
    grid = axes.get_subplotspec()
    return 1 if grid is None else int(grid.get_gridspec().ncols)


def _place(axes: Axes) -> list[int] | None:
    """Return rows and columns of the figure's grid that axes take, from 1, the ends not taken; None without a grid."""
    grid = axes.get_subplotspec()
    if grid is None:
        return None
    return [grid.rowspan.start + 1, grid.rowspan.stop + 1, grid.colspan.start + 1, grid.colspan.stop + 1]


def _axes(axes: Axes, figure: Figure, groups: dict[Any, int]) -> dict[str, Any]:
    names = {id(child): holder.get_label() for holder in axes.containers for child in _children(holder)}
    drawn = _Drawn(axes, names)
    for artist in _artists(axes):
        drawn.add(artist)
    shared = axes.get_shared_x_axes().get_siblings(axes)
    group = groups.setdefault(min(map(id, shared)), len(groups)) if len(shared) > 1 else None
    grid = axes.get_subplotspec()
    # Of the figure, the height of the part of it that holds these axes; of that part, their rows.
    part = axes.figure.bbox.height / figure.bbox.height
    share = 1.0
    if grid is not None:
        whole = grid.get_gridspec()
        heights: Any = whole.get_height_ratios()
        share = sum(heights[grid.rowspan.start : grid.rowspan.stop]) / sum(heights)
    return {
        "title": "\n".join(filter(None, (axes.get_title(where) for where in ("left", "center", "right")))),
        "x": _axis(axes.xaxis, axes.get_xlim()),
        "y": _axis(axes.yaxis, axes.get_ylim()),
        "place": _place(axes),
        "height": max(_LEAST, round(_PIXELS * share * figure.get_figheight() * part)),
        "equal": axes.get_aspect() != "auto",
        "group": group,
        **_legend(axes),
        **drawn.held,
    }


def _children(holder: Any) -> Iterator[Any]:
    """Give what a container holds, those within others too."""
    for child in holder.get_children() if isinstance(holder, container.Container) else holder:
        if isinstance(child, list | tuple):
            yield from _children(child)
        elif child is not None:
            yield child


def _artists(axes: Axes) -> list[Any]:
    every = [*axes.images, *axes.collections, *axes.patches, *axes.lines, *axes.texts]
    return sorted((one for one in every if one.get_visible()), key=lambda one: float(one.get_zorder()))


def _axis(axis: Axis, limits: tuple[float, float]) -> dict[str, Any]:
    scale = axis.get_scale()
    data: dict[str, Any] = {"label": axis.get_label_text(), "min": min(limits), "max": max(limits), "scale": scale}
    if limits[0] > limits[1]:
        data["reversed"] = True
    if scale == "symlog":
        # uPlot's own: straight around 0, logarithmic far from it.
        data |= {"scale": "asinh", "around": float(axis.get_transform().linthresh)}  # type: ignore[attr-defined]
    elif scale == "function":
        # The only function scales of reports are roots; two values determine which root.
        there = np.asarray(axis.get_transform().transform(np.array([4.0, 9.0])))
        if not np.allclose(there, [2.0, 3.0]):
            raise _NotKnownError
        data["scale"] = "root"
    elif scale not in {"linear", "log"}:
        raise _NotKnownError
    from matplotlib.category import StrCategoryLocator  # noqa: PLC0415  heavy together
    from matplotlib.ticker import FixedLocator, NullLocator  # noqa: PLC0415

    locator: Any = axis.get_major_locator()
    formatter: Any = axis.get_major_formatter()
    if isinstance(locator, FixedLocator | StrCategoryLocator):
        places = [float(place) for place in locator()]
        data["names"] = [[p, n] for p, n in zip(places, formatter.format_ticks(places), strict=True)]
    elif isinstance(locator, NullLocator):
        data["names"] = []
    if axis.get_gridlines() and axis.get_gridlines()[0].get_visible():
        data["grid"] = True
    return data


def _colour(value: Any, alpha: float | None = None) -> str | None:
    """Return a colour as CSS holds it; None where it is none."""
    red, green, blue, own = colors.to_rgba(value, alpha)
    if own == 0:
        return None
    text = colors.to_hex((red, green, blue))
    return text if own == 1 else f"{text}{round(255 * own):02x}"


def _numbers(values: Any) -> list[float | None]:
    """Return numbers with as many digits as a screen shows; JSON has no NaN."""
    flat: Any = np.asarray(np.ma.filled(np.ma.asarray(values, float), np.nan), float).ravel()
    return [float(f"{value:.7g}") if math.isfinite(value) else None for value in flat.tolist()]


def _label(label: object) -> str:
    text = str(label)
    return "" if text.startswith("_") else text


class _Drawn:
    """What stands in one pair of axes, by kind, in the order in which it is painted."""

    def __init__(self, axes: Axes, names: Mapping[int, object]) -> None:
        self.axes, self.names = axes, names
        self.held: dict[str, list[dict[str, Any]]] = {}

    def add(self, artist: Any) -> None:
        """Add what one artist draws."""
        in_x, in_y = artist.get_transform().contains_branch_seperately(self.axes.transData)
        if isinstance(artist, AxesImage):
            self._image(artist)
        elif isinstance(artist, lines.Line2D):
            self._line(artist, in_x, in_y)
        elif isinstance(artist, patches.Rectangle):
            self._rectangle(artist, in_x, in_y)
        elif isinstance(artist, patches.StepPatch):
            self._stairs(artist)
        elif isinstance(artist, patches.Polygon) and in_x and in_y:
            self._area(artist.get_xy(), artist.get_facecolor(), artist)
        elif isinstance(artist, collections.LineCollection) and in_x and in_y:
            self._segments(artist)
        elif isinstance(artist, collections.PathCollection):
            self._points(artist)
        elif isinstance(artist, collections.PolyCollection) and in_x and in_y:
            for path in artist.get_paths():
                self._area(path.vertices, artist.get_facecolor()[0], artist)
        elif artist in self.axes.texts:
            self._text(artist, in_x, in_y)
        else:
            raise _NotKnownError

    def _put(self, kind: str, **what: Any) -> None:
        self.held.setdefault(kind, []).append({name: value for name, value in what.items() if value not in (None, "")})

    def _name(self, artist: Any) -> str:
        return _label(self.names.get(id(artist), "")) or _label(artist.get_label())

    def _line(self, line: lines.Line2D, in_x: bool, in_y: bool) -> None:
        colour, style, name = _colour(line.get_color(), line.get_alpha()), line.get_linestyle(), self._name(line)
        dash = {"--": [6, 4], ":": [2, 3], "-.": [6, 3, 2, 3]}.get(str(style))
        width = 0.0 if style in {"None", " ", "", "none"} else float(line.get_linewidth())
        x, y = (np.atleast_1d(np.asarray(d, float)) for d in line.get_data(orig=False))
        if not len(x):
            return
        if in_x != in_y:
            at = float((x if in_x else y)[0])
            self._put("marks", axis="x" if in_x else "y", at=at, color=colour, width=width, dash=dash, name=name)
            return
        if not in_x:
            raise _NotKnownError
        steps = {"steps-post": "post", "steps": "pre", "steps-pre": "pre", "steps-mid": "mid"}
        x, y = _stepped(x, y, steps.get(str(line.get_drawstyle()), ""))
        marker = str(line.get_marker())
        size = (
            0.0 if marker in {"None", "", " ", "none"} else float(line.get_markersize()) * (0.5 if marker == "." else 1)
        )
        face = _colour(line.get_markerfacecolor(), line.get_alpha())
        self._put(
            "lines", x=_numbers(x), y=_numbers(y), color=colour, width=width, dash=dash, name=name,
            size=size or None, marker=marker if size else None, face=face if size else None,
        )  # fmt: skip

    def _rectangle(self, patch: patches.Rectangle, in_x: bool, in_y: bool) -> None:
        colour = _colour(patch.get_facecolor())
        x, y = (patch.get_x(), patch.get_x() + patch.get_width()), (patch.get_y(), patch.get_y() + patch.get_height())
        if in_x and in_y:
            place = dict(zip(("x0", "y0", "x1", "y1"), _numbers([x[0], y[0], x[1], y[1]]), strict=True))
            if x[0] != x[1] and y[0] != y[1]:
                self._put("bars", **place, color=colour, name=self._name(patch))
        elif in_x or in_y:
            start, stop = _numbers(x if in_x else y)
            self._put("bands", axis="x" if in_x else "y", start=start, stop=stop, color=colour, name=self._name(patch))
        else:
            raise _NotKnownError

    def _area(self, corners: Any, colour: Any, artist: Any) -> None:
        x, y = np.asarray(corners, float).T
        self._put("areas", x=_numbers(x), y=_numbers(y), color=_colour(colour), name=self._name(artist))

    def _stairs(self, artist: Any) -> None:
        values, edges, baseline = artist.get_data()
        if np.ndim(baseline):
            raise _NotKnownError
        low = 0.0 if baseline is None else float(baseline)
        x = np.concatenate([edges[:1], np.repeat(edges, 2)[1:-1], edges[-1:]])
        y = np.concatenate([[low], np.repeat(values, 2), [low]])
        if artist.get_fill():
            self._area(np.column_stack([x, y]), artist.get_facecolor(), artist)
        else:
            colour, width = _colour(artist.get_edgecolor()), float(artist.get_linewidth())
            self._put("lines", x=_numbers(x), y=_numbers(y), color=colour, width=width, name=self._name(artist))

    def _segments(self, artist: Any) -> None:
        ends = [np.asarray(segment, float) for segment in artist.get_segments()]
        flat = _numbers(np.concatenate([e.ravel() for e in ends])) if ends else []
        if any(len(e) != 2 for e in ends):
            raise _NotKnownError
        shade = artist.get_colors()
        width = float(np.atleast_1d(artist.get_linewidths())[0])
        if len(shade) > 1:
            raise _NotKnownError
        self._put(
            "segments", at=flat, color=_colour(shade[0]) if len(shade) else INK, width=width, name=self._name(artist)
        )

    def _points(self, artist: Any) -> None:
        if not all(artist.get_offset_transform().contains_branch_seperately(self.axes.transData)):
            raise _NotKnownError
        offsets: Any = np.ma.filled(np.ma.asarray(artist.get_offsets(), float), np.nan)
        artist.update_scalarmappable()
        faces = artist.get_facecolors()
        faces = faces if len(faces) else artist.get_edgecolors()
        size = float(np.sqrt(np.atleast_1d(artist.get_sizes())[0]))
        every = {_colour(face): np.flatnonzero((faces == face).all(axis=1)) for face in np.unique(faces, axis=0)}
        for colour, chosen in every.items():
            points = offsets if len(faces) == 1 else offsets[chosen]
            self._put(
                "lines", x=_numbers(points[:, 0]), y=_numbers(points[:, 1]), color=colour, face=colour, width=0.0,
                size=size, marker="o", name=self._name(artist),
            )  # fmt: skip

    def _text(self, artist: Any, in_x: bool, in_y: bool) -> None:
        if getattr(artist, "arrow_patch", None) is not None or in_x != in_y:
            raise _NotKnownError
        words = artist.get_text()
        if words:
            x, y = artist.get_position()
            self._put(
                "texts", x=float(x), y=float(y), text=words, color=_colour(artist.get_color()),
                within="data" if in_x else "axes",
                align=artist.get_horizontalalignment(), rise=artist.get_verticalalignment(),
            )  # fmt: skip

    def _image(self, artist: AxesImage) -> None:
        values: Any = np.ma.asarray(artist.get_array())
        if values.ndim != 2:
            raise _NotKnownError
        painted = artist.to_rgba(values, bytes=True)
        file = io.BytesIO()
        mpl.image.imsave(file, painted, format="png", metadata={})
        left, right, bottom, top = artist.get_extent()
        upwards = artist.origin == "lower"
        self._put(
            "images",
            png=base64.b64encode(file.getvalue()).decode(),
            x0=left, x1=right, y0=top if not upwards else bottom, y1=bottom if not upwards else top,
            rows=values.shape[0], columns=values.shape[1], values=_short(values),
            flip=bool(artist.origin == "lower") or None,
        )  # fmt: skip


def _short(values: Any) -> list[float | None]:
    """Return the values of a picture with three digits, as shown under the cursor."""
    flat: Any = np.ma.filled(np.ma.asarray(values, float), np.nan).ravel()
    return [float(f"{value:.3g}") if math.isfinite(value) else None for value in flat.tolist()]


def _stepped(x: NDArray[Any], y: NDArray[Any], where: str) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the corners of a line that goes in steps."""
    if not where or len(x) < 2:
        return x, y
    if where == "mid":
        middle = (x[1:] + x[:-1]) / 2
        return np.concatenate([x[:1], np.repeat(middle, 2), x[-1:]]), np.repeat(y, 2)
    twice_x, twice_y = np.repeat(x, 2), np.repeat(y, 2)
    return (twice_x[1:], twice_y[:-1]) if where == "post" else (twice_x[:-1], twice_y[1:])


def _legend(axes: Axes) -> dict[str, Any]:
    legend = axes.get_legend()
    if legend is None:
        return {"legend": []}
    words = [text.get_text() for text in legend.get_texts()]
    held = zip(words, legend.legend_handles, strict=False)
    entries = [{"name": name, **_swatch(handle)} for name, handle in held if handle]
    return {"legend": entries, "legend_title": legend.get_title().get_text()}


def _swatch(handle: Any) -> dict[str, Any]:
    """Return how an entry of a legend looks."""
    if isinstance(handle, lines.Line2D):
        bare = handle.get_linestyle() in {"None", " ", "", "none"}
        dashed = handle.get_linestyle() not in {"-", "None", " ", "", "none"}
        return {"color": _colour(handle.get_color()), "kind": "dot" if bare else "dash" if dashed else "line"}
    if isinstance(handle, patches.Patch):
        return {"color": _colour(handle.get_facecolor()), "kind": "box"}
    if isinstance(handle, collections.PathCollection):
        dots: Any = handle
        return {"color": _colour(_first(dots.get_facecolors(), dots.get_edgecolors())), "kind": "dot"}
    if isinstance(handle, collections.LineCollection):
        return {"color": _colour(_first(handle.get_colors())), "kind": "line"}
    return {"color": INK, "kind": "line"}


def _first(*every: Iterable[Any]) -> Any:
    return next((one for some in every for one in some), INK)


def _colour_scale(axes: Any) -> dict[str, Any] | None:
    # matplotlib has no public way from axes to the colour bar that they show.
    bar = axes._colorbar
    if not isinstance(bar.norm, colors.Normalize) or bar.vmin is None:
        return None
    shades = [colors.to_hex(shade) for shade in bar.cmap(np.linspace(0, 1, 9))]
    label = axes.get_ylabel() or axes.get_xlabel()
    return {"label": label, "min": float(f"{bar.vmin:.4g}"), "max": float(f"{bar.vmax:.4g}"), "shades": shades}


def _svg(figure: Figure) -> str:
    """Return a figure as SVG that takes the page's ink."""
    text = io.StringIO()
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": "taxel"}):
        figure.savefig(text, format="svg", metadata={"Date": None}, transparent=True)
    svg = text.getvalue()
    svg = svg[svg.index("<svg") :]
    for colour, ink in ((INK, "--ink"), ("#000000", "--ink"), (_LINE, "--line")):
        svg = svg.replace(f": {colour}", f": var({ink})")
    return escaped_lines(svg)
