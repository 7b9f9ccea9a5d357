"""Curves, bands and dots as SVG in the colours of a page: small, sharp on paper, and made without matplotlib."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from markupsafe import Markup, escape
from numpy.typing import ArrayLike, NDArray

__all__ = ["COLOURS", "LEFT_OUT", "Axes"]

#: Of the left foot, the right foot, and a foot of no known side; distinct for eyes that do not see red or green too.
COLOURS = {"left": "#2f6690", "right": "#c8553d", "": "#2f6690"}
LEFT_OUT = "#9a9a9a"
#: Room for numbers and names left of, and below, the axes; and to the right and above, pixels.
_LEFT, _BELOW, _RIGHT, _ABOVE = 58, 36, 10, 22


@dataclass
class Axes:
    """A drawing with axes.

    Parameters
    ----------
    x, y : (float, float)
        What is shown.
    across, down : str
        The names of both axes.
    title : str
    width, height : int, pixels
    """

    x: tuple[float, float]
    y: tuple[float, float]
    across: str
    down: str
    title: str = ""
    width: int = 460
    height: int = 240
    _marks: list[str] = field(default_factory=list)

    def line(self, x: ArrayLike, y: ArrayLike, colour: str, *, width: float = 1.5, title: str = "") -> None:
        """Draw a line; its title is shown where a mouse rests on it."""
        about = f"<title>{escape(title)}</title>" * bool(title)
        self._marks.append(
            f'<polyline points="{self._points(x, y)}" fill="none" stroke="{colour}" stroke-width="{width}"'
            + (f">{about}</polyline>" if about else "/>")
        )

    def band(self, x: ArrayLike, low: ArrayLike, high: ArrayLike, colour: str) -> None:
        """Fill what is between two lines."""
        points = f"{self._points(x, low)} {self._points(np.asarray(x)[::-1], np.asarray(high)[::-1])}"
        self._marks.append(f'<polygon points="{points}" fill="{colour}" fill-opacity="0.22"/>')

    def dots(self, x: ArrayLike, y: ArrayLike, colour: str, *, crosses: bool = False) -> None:
        """Draw dots, or crosses."""
        for a, b in zip(self._across(x), self._down(y), strict=True):
            shape = (
                f'<path d="M{a - 3:.1f} {b - 3:.1f}l6 6m0-6l-6 6" stroke="{colour}" stroke-width="1.2"/>'
                if crosses
                else f'<circle cx="{a:.1f}" cy="{b:.1f}" r="2" fill="{colour}"/>'
            )
            self._marks.append(shape)

    def text(self, x: float, y: float, words: str, colour: str) -> None:
        """Write words that begin at a place."""
        (a,), (b,) = self._across([x]), self._down([y])
        self._marks.append(f'<text x="{a:.1f}" y="{b:.1f}" style="fill:{colour}" font-size="11">{escape(words)}</text>')

    def svg(self) -> Markup:
        """Return the drawing."""
        right, bottom = self.width - _RIGHT, self.height - _BELOW
        parts = [
            f'<svg viewBox="0 0 {self.width} {self.height}" width="{self.width}" height="{self.height}" role="img" '
            f'font-family="system-ui, sans-serif" font-size="11"><title>{escape(self.title)}</title>',
            f'<text x="{_LEFT}" y="13" font-size="12">{escape(self.title)}</text>',
            *self._marks,
            f'<path d="M{_LEFT} {_ABOVE}V{bottom}H{right}" fill="none" stroke="currentColor" stroke-width="0.8"/>',
        ]
        for value, at in zip(ticks(*self.x), self._across(ticks(*self.x)), strict=True):
            parts.append(f'<text x="{at:.1f}" y="{bottom + 14}" text-anchor="middle">{value:g}</text>')
        for value, at in zip(ticks(*self.y), self._down(ticks(*self.y)), strict=True):
            parts.append(f'<text x="{_LEFT - 5}" y="{at + 4:.1f}" text-anchor="end">{value:g}</text>')
        centre, middle = (_LEFT + right) / 2, (_ABOVE + bottom) / 2
        parts += [
            f'<text x="{centre:.0f}" y="{self.height - 4}" text-anchor="middle">{escape(self.across)}</text>',
            f'<text x="12" y="{middle:.0f}" text-anchor="middle" transform="rotate(-90 12 {middle:.0f})">'
            f"{escape(self.down)}</text></svg>",
        ]
        return Markup("".join(parts))

    def _across(self, x: ArrayLike) -> NDArray[np.float64]:
        low, high = self.x
        return _LEFT + (np.asarray(x, np.float64) - low) / (high - low) * (self.width - _LEFT - _RIGHT)

    def _down(self, y: ArrayLike) -> NDArray[np.float64]:
        low, high = self.y
        return _ABOVE + (high - np.asarray(y, np.float64)) / (high - low) * (self.height - _ABOVE - _BELOW)

    def _points(self, x: ArrayLike, y: ArrayLike) -> str:
        return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(self._across(x), self._down(y), strict=True))


def ticks(low: float, high: float, about: int = 5) -> Sequence[float]:
    """Return round numbers between two.

    Examples
    --------
    >>> ticks(0.0, 930.0)
    [0.0, 200.0, 400.0, 600.0, 800.0]
    """
    step = (high - low) / about
    power = 10.0 ** np.floor(np.log10(step))
    step = min((one for one in (1, 2, 5, 10) if one * power >= step * 0.999), default=10) * power
    first = np.ceil(low / step - 1e-9)
    # No 0 has a sign.
    return [round(float(k * step), 10) + 0.0 for k in np.arange(first, np.floor(high / step + 1e-9) + 1)]


def spanned(values: Iterable[float], *, zero: bool = False) -> tuple[float, float]:
    """Return a range that holds values, with a little room; from 0 on demand."""
    some = np.array([*values, *[0.0] * zero], np.float64)
    some = some[np.isfinite(some)]
    if not len(some):
        return 0.0, 1.0
    low, high = float(some.min()), float(some.max())
    room = 0.05 * (high - low) or 0.5
    return (low if zero else low - room), high + room
