"""Regions of a footprint: heel, midfoot, five metatarsals, hallux and toes, found on a print and laid on others.

A mask is found on a picture in the foot's own mm: from the medial to the lateral side, and from heel to toes
(`Placed.in_foot`). The borders between the metatarsals are a fan between both tangents; heel and midfoot end at shares
of the length; the toes begin on the path of least load in front of the metatarsal heads, which are found first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from taxel import ProblemError, Region
from taxel_gait.prints import Placed, Print

__all__ = ["MASKS", "Mask", "Picture", "find_mask", "laid_on", "mean_picture"]

Floats = NDArray[np.float64]

#: The side of a cell of the pictures on which masks are found, mm; half their width, and what is before the heel.
CELL_MM, _HALF_MM, _BEFORE_MM, _ROWS = 2.5, 75.0, 10.0, 144
#: A cell belongs to a mean print where this share of the prints have it.
_IN_HALF = 0.5
#: Where the heel ends: looked for between shares of the length, near one; and where the midfoot ends.
_HEEL_ENDS, _HEEL_END, _HEEL_WEIGHT, _MIDFOOT_ENDS = (0.24, 0.36), 0.27, 12.0, 0.55
#: Bands of the widest places, as of `prints`.
_HEEL, _FOREFOOT = (0.05, 0.30), (0.55, 0.80)
#: Borders between the five metatarsals, shares of the width.
FAN = (0.30, 0.47, 0.64, 0.81)
#: The row of the metatarsal heads: between shares of the length, near one, medially; and laterally behind it.
_HEADS, _HEAD, _HEAD_WIDTH, _MEDIAL, _BEHIND, _BEHIND_WIDTH = (0.55, 0.86), 0.73, 0.12, 0.55, 0.06, 0.05
#: The toe line: ahead of the heads at least; at most so far on the way to the tip; the prior, medially and laterally.
_AHEAD, _MOST, _PRIOR, _PRIOR_WEIGHT, _CELLS = 0.03, 0.62, (0.32, 0.22), 6.0, 2
#: An island with less than this share of the metatarsals' load is a toe.
_ISLAND = 0.15
#: The border between hallux and toes: between shares of the width, near one.
_HALLUX, _HALLUX_AT = (0.22, 0.50), 0.33
#: How far regions reach beyond both tangents, widths, and beyond heel and toes, lengths.
_OUTSIDE, _BEYOND = 0.6, 0.25

#: The masks by name: of each region its band, and from which to which share of the width. Bands are heel, midfoot,
#: forefoot (metatarsals), toes, and fore (both of these).
MASKS: dict[str, dict[str, tuple[str, float, float]]] = {
    "nine": {
        "heel": ("heel", 0, 1),
        "midfoot": ("midfoot", 0, 1),
        **{
            f"metatarsal {k + 1}": ("forefoot", a, b) for k, (a, b) in enumerate(zip((0, *FAN), (*FAN, 1), strict=True))
        },
        "hallux": ("toes", 0, -1),
        "toes 2-5": ("toes", -1, 1),
    },
    "seven": {
        "heel": ("heel", 0, 1),
        "midfoot": ("midfoot", 0, 1),
        "metatarsal 1": ("forefoot", 0, FAN[0]),
        "metatarsals 2-3": ("forefoot", FAN[0], FAN[2]),
        "metatarsals 4-5": ("forefoot", FAN[2], 1),
        "hallux": ("toes", 0, -1),
        "toes 2-5": ("toes", -1, 1),
    },
    "pedar": {
        "medial heel": ("heel", 0, 0.5),
        "lateral heel": ("heel", 0.5, 1),
        "medial midfoot": ("midfoot", 0, 0.5),
        "lateral midfoot": ("midfoot", 0.5, 1),
        "metatarsal 1": ("forefoot", 0, FAN[0]),
        "metatarsals 2-3": ("forefoot", FAN[0], FAN[2]),
        "metatarsals 4-5": ("forefoot", FAN[2], 1),
        "hallux": ("toes", 0, -1),
        "toes 2-5": ("toes", -1, 1),
    },
    "thirds": {"rearfoot": ("third 1", 0, 1), "midfoot": ("third 2", 0, 1), "forefoot": ("third 3", 0, 1)},
}
MASKS["footscan"] = {
    "medial heel": ("heel", 0, 0.5),
    "lateral heel": ("heel", 0.5, 1),
    **{name: part for name, part in MASKS["nine"].items() if name != "heel"},
}


@dataclass(frozen=True, eq=False)
class Picture:
    """Hold a picture in the foot's own mm.

    Parameters
    ----------
    values : float64, shape (rows, columns)
        From the heel to the toes, from the medial to the lateral side.
    loaded : bool, shape (rows, columns)
    """

    values: Floats
    loaded: NDArray[np.bool_]

    @classmethod
    def of(cls, one: Print, placed: Placed) -> Picture:
        """Return the maximum picture of a print; masks are found on it, and no pressure is measured on it."""
        array = one.frames.array
        x, y = _grid()
        places = placed.on_array(np.stack([x.ravel(), y.ravel()], axis=1))
        column, row = (np.rint(places[:, k] / mm).astype(int) for k, mm in ((0, array.column_mm), (1, array.row_mm)))
        inside = (column >= 0) & (column < array.columns) & (row >= 0) & (row < array.rows)
        values = np.zeros(x.size)
        values[inside] = one.picture[row[inside], column[inside]]
        return cls(values.reshape(x.shape), values.reshape(x.shape) > 0)


def _grid() -> tuple[Floats, Floats]:
    """Return the middles of the cells of a `Picture`, mm."""
    across = np.arange(-_HALF_MM, _HALF_MM + CELL_MM / 2, CELL_MM)
    ahead = np.arange(_ROWS) * CELL_MM - _BEFORE_MM
    x, y = np.meshgrid(across, ahead)
    return x, y


def mean_picture(pictures: Sequence[Picture]) -> Picture:
    """Return the mean of pictures of one foot, each at its axis and heel."""
    if not pictures:
        raise ProblemError("no print has no mean")
    share = np.mean([one.loaded for one in pictures], axis=0)
    return Picture(np.mean([one.values for one in pictures], axis=0) * (share >= _IN_HALF), share >= _IN_HALF)


@dataclass(frozen=True, eq=False)
class Mask:
    """Hold the borders of the regions of a foot, in its own mm.

    Parameters
    ----------
    begin, end : float, mm
        Where heel and toes end.
    heel, midfoot : float, mm
        Where these regions end.
    medial, lateral : (float, float), mm
        Each tangent: how far it is from the axis at the heel's end, and at the toes' end.
    toe_line : float64, shape (n, 2)
        Shares of the width, and mm from the heel, where the toes begin.
    hallux : float
        The share of the width where the toes begin beside the hallux.
    """

    begin: float
    end: float
    heel: float
    midfoot: float
    medial: tuple[float, float]
    lateral: tuple[float, float]
    toe_line: Floats
    hallux: float

    @property
    def length(self) -> float:
        """The length of the foot, mm."""
        return self.end - self.begin

    def width_at(self, y: Floats) -> tuple[Floats, Floats]:
        """Return where the medial tangent is, and how far the lateral one is from it, mm, at mm from the heel."""
        share = (np.asarray(y) - self.begin) / self.length
        medial = self.medial[0] + share * (self.medial[1] - self.medial[0])
        return medial, self.lateral[0] + share * (self.lateral[1] - self.lateral[0]) - medial

    def line(self, w: float, y: Sequence[float]) -> Floats:
        """Return points at a share of the width, shape (n, 2), mm."""
        at = np.asarray(y, np.float64)
        medial, width = self.width_at(at)
        return np.stack([medial + w * width, at], axis=1)

    def toes_at(self, w: float) -> float:
        """Return where the toes begin at a share of the width, mm from the heel."""
        return float(np.interp(w, self.toe_line[:, 0], self.toe_line[:, 1]))

    def regions(self, mask: str = "nine") -> list[Region]:
        """Return the regions in the foot's own mm.

        Parameters
        ----------
        mask : str
            One of `MASKS`.
        """
        return [_region(name, self._outline(*part)) for name, part in MASKS[mask].items()]

    def _outline(self, band: str, a: float, b: float) -> Floats:
        """Return the corners of a region, mm in the foot."""
        w0, w1 = (self.hallux if w == -1 else w for w in (a, b))
        w0, w1 = (-_OUTSIDE if w0 == 0 else w0), (1 + _OUTSIDE if w1 == 1 else w1)
        low, high = self.begin - _BEYOND * self.length, self.end + _BEYOND * self.length
        third = self.length / 3
        level = {
            "heel": (low, self.heel),
            "midfoot": (self.heel, self.midfoot),
            "third 1": (low, self.begin + third),
            "third 2": (self.begin + third, self.begin + 2 * third),
            "third 3": (self.begin + 2 * third, high),
        }
        if band in level:
            (y0, y1) = level[band]
            return np.concatenate([self.line(w0, [y0, y1]), self.line(w1, [y1, y0])])
        between = [w for w in self.toe_line[:, 0].tolist() if w0 < w < w1]
        front = np.concatenate([self.line(w, [self.toes_at(w)]) for w in (w0, *between, w1)])
        if band == "forefoot":
            return np.concatenate([front, self.line(w1, [self.midfoot]), self.line(w0, [self.midfoot])])
        return np.concatenate([front, self.line(w1, [high]), self.line(w0, [high])])


def laid_on(regions: Sequence[Region], placed: Placed) -> list[Region]:
    """Return regions of a foot on the array of a print, mm.

    Parameters
    ----------
    regions : sequence of Region
        In the foot's own mm.
    placed : Placed
        How the print lies.
    """
    return [_region(one.name, placed.on_array(np.array(one.corners))) for one in regions]


def _region(name: str, corners: Floats) -> Region:
    return Region(name, tuple((float(x), float(y)) for x, y in corners))


def find_mask(picture: Picture) -> Mask:
    """Find the borders of the regions on a print, or on a person's mean print.

    Raises
    ------
    ProblemError : a picture without a heel or a forefoot
    """
    x, y = _grid()
    values, loaded = picture.values, picture.loaded
    rows = np.flatnonzero(loaded.any(axis=1))
    if len(rows) < 10:
        raise ProblemError("the print is too short for a mask")
    begin, end = float(y[rows[0], 0]) - CELL_MM / 2, float(y[rows[-1], 0]) + CELL_MM / 2
    share = (y[:, 0] - begin) / (end - begin)
    tangents = [_tangent(loaded * True, x, share, sign) for sign in (-1, 1)]
    mask = Mask(begin, end, 0.0, 0.0, tangents[0], tangents[1], np.zeros((1, 2)), _HALLUX_AT)
    profile = values.sum(axis=1)
    in_band = (share >= _HEEL_ENDS[0]) & (share <= _HEEL_ENDS[1])
    cost = profile[in_band] / profile.max() + _HEEL_WEIGHT * (share[in_band] - _HEEL_END) ** 2
    heel = float(y[np.flatnonzero(in_band)[cost.argmin()], 0])
    # The picture between the tangents: shares of the width as columns.
    w = (np.arange(round(2 * _HALF_MM / CELL_MM * 0.7)) + 0.5) / round(2 * _HALF_MM / CELL_MM * 0.7)
    medial, width = mask.width_at(y[:, 0])
    at = medial[:, None] + w * width[:, None]
    column = np.clip(np.rint((at + _HALF_MM) / CELL_MM).astype(int), 0, values.shape[1] - 1)
    unrolled = np.take_along_axis(values, column, axis=1)
    head = _heads(unrolled, share, w)
    line = _toe_line(unrolled, share, w, head)
    line = _behind_islands(unrolled, share, line, head)
    beyond = np.where(share[:, None] > line, unrolled, 0.0).sum(axis=0)
    near = (w >= _HALLUX[0]) & (w <= _HALLUX[1])
    cost = beyond[near] / max(beyond.max(), 1e-12) + _PRIOR_WEIGHT * (w[near] - _HALLUX_AT) ** 2
    hallux = float(w[near][cost.argmin()])
    toe_line = np.stack([w, begin + line * (end - begin)], axis=1)
    midfoot = begin + _MIDFOOT_ENDS * (end - begin)
    return Mask(begin, end, heel, midfoot, tangents[0], tangents[1], _simpler(toe_line), hallux)


def _tangent(loaded: NDArray[np.bool_], x: Floats, share: Floats, sign: int) -> tuple[float, float]:
    """Return how far a tangent is from the axis at the heel's and the toes' end, mm."""
    points = []
    for low, high in (_HEEL, _FOREFOOT):
        rows = np.flatnonzero((share > low) & (share < high))
        reach = np.where(loaded[rows], sign * x[rows], -np.inf).max(axis=1)
        if not np.isfinite(reach).any():
            raise ProblemError("the print has no heel or no forefoot")
        k = int(reach.argmax())
        points.append((share[rows[k]], sign * (reach[k] + CELL_MM / 2)))
    (s0, x0), (s1, x1) = points
    slope = (x1 - x0) / (s1 - s0)
    return float(x0 - slope * s0), float(x0 + slope * (1 - s0))


def _heads(unrolled: Floats, share: Floats, w: Floats) -> Floats:
    """Return where the metatarsal heads are at each share of the width, shares of the length."""
    rows = (share >= _HEADS[0]) & (share <= _HEADS[1])
    near = share[rows]
    inner = unrolled[rows][:, w < _MEDIAL].sum(axis=1) * np.exp(-(((near - _HEAD) / _HEAD_WIDTH) ** 2))
    medial = near[inner.argmax()]
    outer = unrolled[rows][:, w >= _MEDIAL].sum(axis=1)
    outer = outer * np.exp(-(((near - (medial - _BEHIND)) / _BEHIND_WIDTH) ** 2))
    lateral = near[outer.argmax()] if outer.any() else medial - _BEHIND
    return np.asarray(np.interp(w, (_MEDIAL / 2, (1 + _MEDIAL) / 2), (medial, lateral)))


def _toe_line(unrolled: Floats, share: Floats, w: Floats, head: Floats) -> Floats:
    """Return where the toes begin at each share of the width: the path of least load across, by dynamic programming."""
    way = 1 - head
    prior = head + way * np.interp(w, (0, 1), _PRIOR)
    unit = np.percentile(unrolled[unrolled > 0], 90)
    cost = unrolled / unit + _PRIOR_WEIGHT * ((share[:, None] - prior) / way) ** 2
    allowed = (share[:, None] >= head + _AHEAD) & (share[:, None] <= head + _MOST * way)
    cost = np.where(allowed, cost, np.inf)
    total, came = cost[:, 0].copy(), []
    for k in range(1, len(w)):
        steps = np.full((2 * _CELLS + 1, len(share)), np.inf)
        for step in range(-_CELLS, _CELLS + 1):
            here = slice(max(step, 0), len(share) + min(step, 0))
            steps[step + _CELLS, here] = total[max(-step, 0) : len(share) - max(step, 0)]
        best = steps.argmin(axis=0)
        came.append(best - _CELLS)
        total = steps[best, np.arange(len(share))] + cost[:, k]
    row = int(total.argmin())
    rows = [row]
    for step in reversed(came):
        row -= int(step[row])
        rows.append(row)
    return share[rows[::-1]]


def _behind_islands(unrolled: Floats, share: Floats, line: Floats, head: Floats) -> Floats:
    """Return the toe line behind islands of little load in front of the metatarsal heads, which are toes."""
    of_forefoot = (unrolled > 0) & (share[:, None] > _MIDFOOT_ENDS) & (share[:, None] <= line)
    groups, count = ndimage.label(of_forefoot, np.ones((3, 3)))
    if count < 2:
        return line
    loads = ndimage.sum_labels(unrolled, groups, np.arange(1, count + 1))
    line = line.copy()
    for k in np.flatnonzero(loads < _ISLAND * loads.sum()):
        rows, columns = np.nonzero(groups == k + 1)
        if share[rows].mean() > head[columns].mean():
            across = slice(columns.min(), columns.max() + 1)
            line[across] = np.minimum(line[across], share[rows.min()] - 1e-3)
    return line


def _simpler(line: Floats) -> Floats:
    """Return a line of fewer points: those where its direction changes."""
    slopes = np.diff(line[:, 1])
    keep = np.concatenate([[True], ~np.isclose(slopes[1:], slopes[:-1], atol=1e-6), [True]])
    return np.asarray(line[keep])
