"""What is measured of a footprint and of each of its regions, each by a definition of its own (docs/gait.md).

Pressures and areas are those of the array's own cells, never of resampled pictures. A cell that a border cuts counts
with its share of area for force and area; for peaks it counts where its middle lies.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel import ProblemError, Region
from taxel_gait.measures import POINTS, loading_rate, peaks_of
from taxel_gait.prints import Placed, Print

__all__ = ["Loads", "arch_index", "balances", "cpei_pct", "curves_of", "loads_of", "of_print", "of_region"]

Floats = NDArray[np.float64]

#: The path of the centre is measured where the load is above this share of its maximum; for the index of its excursion.
_PATH, _EXCURSION = 0.02, 0.05
_CM2 = 100.0
#: Measures that need the areas of the cells.
_OF_AREA = ("contact_area", "max_mean_pressure", "region_pressure", "pti_force_area", "pti_mean_curve")


class Loads(NamedTuple):
    """Hold the load of a region over stance.

    Parameters
    ----------
    force : float64, shape (n,)
        N where the force is known, else the sum of the values.
    pressure_area : float64, shape (n,), unit of the values times mm2
        The integral of the pressure over the loaded area.
    peak : float64, shape (n,), in the unit of the values
        The largest value of a cell; 0 where none is loaded.
    area : float64, shape (n,), mm2
        What is loaded at each moment.
    ever : float, mm2
        What is loaded at any moment.
    integrals : float64, shape (cells,), unit of the values times s
        Of each cell whose middle is in the region, over stance.
    most : float64, shape (cells,), in the unit of the values
        The largest value of each of these.
    """

    force: Floats
    pressure_area: Floats
    peak: Floats
    area: Floats
    ever: float
    integrals: Floats
    most: Floats


def loads_of(one: Print, regions: Sequence[Region]) -> dict[str, Loads]:
    """Return the load of the whole print, and of each region that has a cell of it.

    Parameters
    ----------
    one : Print
    regions : sequence of Region
        On the print's array; those off it are left out.
    """
    array, n = one.frames.array, len(one.frames)
    there = one.picture > 0
    cells = np.flatnonzero(there)
    values = one.frames.values.reshape(n, -1)[:, cells].astype(np.float64)
    loaded = values > one.above
    values = np.where(loaded, values, 0.0)
    area = 1.0 if array.pitch_mm is None else array.row_mm * array.column_mm
    # Force is the pressure times the area, or the sum of cells that are forces or counts themselves.
    of_force = 1.0 if one.load[1] != "N" or one.frames.unit == "N" else area * _newton(one)
    shares, inside = {"whole": np.ones(there.shape)}, {"whole": there}
    for region in regions:
        try:
            shares[region.name], inside[region.name] = region.shares(array), region.centred(array) & there
        except ProblemError:
            # A foot without toes on the array has none there.
            continue
    weights = np.stack([share.ravel()[cells] for share in shares.values()], axis=1)
    sums, areas = values @ weights, (loaded.astype(np.float64) @ weights) * area
    ever = (loaded.any(axis=0) @ weights) * area
    integrals, most = np.asarray(np.trapezoid(values, one.t, axis=0)), values.max(axis=0)
    found = {}
    for k, name in enumerate(shares):
        own = np.flatnonzero(inside[name].ravel()[cells])
        peak = values[:, own].max(axis=1) if len(own) else np.zeros(n)
        found[name] = Loads(
            sums[:, k] * of_force,
            sums[:, k] * area,
            peak,
            areas[:, k],
            float(ever[k]),
            integrals[own],
            most[own],
        )
    return found


def _newton(one: Print) -> float:
    """Return the force of a value of 1 on 1 mm2, N."""
    total = float(one.frames.total().max()) * one.frames.array.row_mm * one.frames.array.column_mm
    return float(one.load[0].max()) / total


def of_region(one: Print, own: Loads, total_fti: float, saturation: float | None) -> dict[str, float]:
    """Return the measures of a region by column, NaN where it is never loaded.

    Parameters
    ----------
    one : Print
    own : Loads
        Of the region.
    total_fti : float
        The sum of the force-time integrals of all regions.
    saturation : float, in the unit of the values, optional
        The value at which the range of a cell ends.
    """
    load, unit, value = *_named(one), one.frames.unit
    t, step = one.t, _step_s(one)
    stance, there = len(t) * step, own.area > 0
    fti = float(np.trapezoid(own.force, t))
    found = {
        f"max_{load}_{unit}": float(own.force.max()),
        f"peak_{'sensor' if value == 'N' else 'pressure'}_{value}": float(own.peak.max()),
        f"max_mean_pressure_{value}": float(_over(own.pressure_area, own.area).max(initial=0.0)),
        f"region_pressure_{value}": float(_over(own.pressure_area.max(keepdims=True), np.array([own.ever]))[0]),
        "contact_area_cm2": float(own.area.max()) / _CM2,
        "contact_area_ever_cm2": own.ever / _CM2,
        "contact_time_s": float(np.count_nonzero(there)) * step,
        f"fti_{unit}_s": fti,
        "impulse_share_pct": 100 * fti / total_fti if total_fti else np.nan,
        f"pti_peak_cell_{value}_s": float(own.integrals.max(initial=0.0)),
        f"pti_peak_curve_{value}_s": float(np.trapezoid(own.peak, t)),
        f"pti_force_area_{value}_s": float(np.trapezoid(own.pressure_area, t)) / own.ever if own.ever else np.nan,
        f"pti_mean_curve_{value}_s": float(np.trapezoid(_over(own.pressure_area, own.area), t)),
        f"loading_rate_{unit}_per_s": loading_rate(t, own.force) if there.any() else np.nan,
    }
    if there.any():
        first, last = np.flatnonzero(there)[[0, -1]]
        found |= {
            "contact_begin_s": float(t[first]),
            "contact_begin_pct": 100 * float(t[first]) / stance,
            "contact_end_pct": 100 * (float(t[last]) + step) / stance,
            "contact_first_to_last_s": float(t[last] - t[first]) + step,
            "instant_max_force_s": float(t[own.force.argmax()]),
            "instant_max_force_pct": 100 * float(t[own.force.argmax()]) / stance,
            "instant_peak_s": float(t[own.peak.argmax()]),
            "instant_peak_pct": 100 * float(t[own.peak.argmax()]) / stance,
        }
    if saturation is not None:
        found["saturated_cells"] = float(np.count_nonzero(own.most >= saturation))
    # Of sensors whose area is not known.
    without = _OF_AREA if one.frames.array.pitch_mm is None else ()
    return {name: measure for name, measure in found.items() if not name.startswith(without)}


def of_print(
    one: Print,
    placed: Placed | None,
    loads: Mapping[str, Loads],
    toes: Sequence[Region],
    saturation: float | None,
    weight_kg: float | None,
) -> dict[str, float]:
    """Return the measures of a whole print by column.

    Parameters
    ----------
    one : Print
    placed : Placed, optional
        Not of an insole of few sensors.
    loads : mapping from region to Loads
        With that of the whole; without regions where the print is doubtful.
    toes : sequence of Region
        The regions of hallux and toes.
    saturation : float, in the unit of the values, optional
    weight_kg : float, kg, optional
    """
    load, unit = _named(one)
    whole, t, step = loads["whole"], one.t, _step_s(one)
    peaks = peaks_of(t, whole.force) if len(t) > 2 else {}
    found = {
        "stance_s": len(t) * step,
        **{f"{name}_{share}pct_s": at for share in (5, 10) for name, at in _edges(one, share).items()},
        **of_region(one, whole, float(np.trapezoid(whole.force, t)), saturation),
        f"mean_{load}_{unit}": float(whole.force.mean()),
        **{name if name.endswith("_pct") else f"{name}_{unit}": at for name, at in peaks.items()},
    }
    del found["impulse_share_pct"]
    if weight_kg is not None and unit == "N":
        found["max_force_pct_weight"] = 100 * float(whole.force.max()) / (weight_kg * 9.80665)
    if placed is None:
        return found
    found |= {"print_length_mm": placed.length, "print_width_mm": placed.width}
    path = placed.in_foot(one.path)
    counts = np.isfinite(path[:, 0]) & (one.load[0] > _PATH * one.load[0].max())
    if np.count_nonzero(counts) > 1:
        x, y = path[counts].T
        length = float(np.hypot(np.diff(x), np.diff(y)).sum())
        found |= {
            "cop_length_mm": length,
            "cop_straight_mm": float(np.hypot(x[-1] - x[0], y[-1] - y[0])),
            "cop_speed_mm_per_s": length / float(np.ptp(t[counts])),
            "cop_range_ap_mm": float(np.ptp(y)),
            "cop_range_ml_mm": float(np.ptp(x)),
        }
    if len(loads) > 1:
        found["cpei_pct"], found["arch_index"] = cpei_pct(one, placed), arch_index(one, placed, toes)
    return found


def balances(loads: Mapping[str, Loads], t: Floats) -> dict[str, float]:
    """Return footscan's balances of the impulses, % of that of the print; only of its ten regions."""
    impulse = {name: float(np.trapezoid(one.force, t)) for name, one in loads.items()}
    medial, lateral = (sum(impulse.get(f"metatarsal {k}", np.nan) for k in numbers) for numbers in ((1, 2), (3, 4, 5)))
    heels = impulse.get("medial heel", np.nan) - impulse.get("lateral heel", np.nan)
    return {
        "balance_foot_pct": 100 * (medial - lateral + heels) / impulse["whole"],
        "balance_forefoot_pct": 100 * (medial - lateral) / impulse["whole"],
    }


def cpei_pct(one: Print, placed: Placed) -> float:
    """Return the excursion index of the centre of pressure, % of the print's width, lateral above 0 (Song 1996).

    *Reading*: at two thirds of the length the distance, across, of the path from the line between its ends, where the
    load is above 5 % of its maximum.

    Parameters
    ----------
    one : Print
    placed : Placed

    Returns
    -------
    float, %
        NaN where the path does not pass there.
    """
    path = placed.in_foot(one.path)
    x, y = path[np.isfinite(path[:, 0]) & (one.load[0] > _EXCURSION * one.load[0].max())].T
    at = 2 / 3 * placed.length
    past = np.flatnonzero((y[:-1] < at) & (y[1:] >= at))
    if not len(past) or y[-1] == y[0]:
        return np.nan
    k = int(past[0])
    own = x[k] + (at - y[k]) / (y[k + 1] - y[k]) * (x[k + 1] - x[k])
    line = x[0] + (at - y[0]) / (y[-1] - y[0]) * (x[-1] - x[0])
    # The width there: of the cells that reach it.
    array = one.frames.array
    centres = placed.in_foot(np.stack([place[one.picture > 0] for place in array.positions()], axis=1))
    # A turned cell reaches as far as its corners do.
    half = _reach(placed, array.column_mm, array.row_mm)
    near = np.abs(centres[:, 1] - at) <= half[1]
    if not near.any():
        return np.nan
    return float(100 * (own - line) / (np.ptp(centres[near, 0]) + 2 * half[0]))


def _reach(placed: Placed, column_mm: float, row_mm: float) -> tuple[float, float]:
    """Return how far a cell reaches from its middle, across the foot and along it, mm: half the side that lies so."""
    across, along = np.abs(placed.lateral), np.abs(placed.along)
    sides = np.array([column_mm, row_mm]) / 2
    return float((sides * across).max()), float((sides * along).max())


def arch_index(one: Print, placed: Placed, toes: Sequence[Region]) -> float:
    """Return the area of the middle third over the whole area, both without toes (Cavanagh and Rodgers 1987).

    The thirds are of the axis from the heel to the front of the metatarsals; cells that a border cuts count with their
    share of area.

    Parameters
    ----------
    one : Print
    placed : Placed
    toes : sequence of Region
        The regions of hallux and toes.

    Returns
    -------
    float, 0 to 1
    """
    array, there = one.frames.array, (one.picture > 0).astype(np.float64)
    for toe in toes:
        try:
            there = there * (1 - toe.shares(array))
        except ProblemError:
            continue
    cells = there > 0.5
    if not cells.any():
        return np.nan
    along = placed.in_foot(np.stack([place[cells] for place in array.positions()], axis=1))[:, 1]
    front = float(along.max()) + _reach(placed, array.column_mm, array.row_mm)[1]
    wide = 10 * placed.length
    outline = np.array([[-wide, front / 3], [wide, front / 3], [wide, 2 * front / 3], [-wide, 2 * front / 3]])
    middle = Region("middle third", tuple(map(tuple, placed.on_array(outline).tolist()))).shares(array)
    return float((there * middle).sum() / there.sum())


def curves_of(one: Print, loads: Mapping[str, Loads]) -> dict[str, list[float]]:
    """Return the load of the whole and of each region at 0, 1 ... 100 % of stance."""
    at = np.linspace(one.t[0], one.t[-1], POINTS)
    return {name: [round(float(v), 4) for v in np.interp(at, one.t, own.force)] for name, own in loads.items()}


def _named(one: Print) -> tuple[str, str]:
    """Return the name of the load, and its unit."""
    unit = one.load[1]
    return ("force", "N") if unit == "N" else ("sum", unit)


def _step_s(one: Print) -> float:
    """Return the time from one frame to the next, s."""
    return float(np.median(np.diff(one.t))) if len(one.t) > 1 else 0.0


def _over(values: Floats, areas: Floats) -> Floats:
    return np.divide(values, areas, out=np.zeros_like(values), where=areas > 0)


def _edges(one: Print, share: int) -> dict[str, float]:
    begin, end = one.times_at(share / 100)
    return {"contact": begin, "lift": end}
