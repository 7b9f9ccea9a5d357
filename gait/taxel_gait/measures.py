"""What a step's load measures: force, peaks, impulse, loading rate, contact area, peak pressure, path of the centre."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from taxel_gait.feet import Foot
from taxel_gait.walk import Step

__all__ = ["POINTS", "curve_of", "loading_rate", "measures_of", "peaks_of"]

#: The number of points of a curve over stance: from 0 to 100 %.
POINTS = 101
#: The loading rate is taken between these shares of the maximum.
_RISE = (0.2, 0.8)
#: The centre of pressure counts where the load is above this share of its maximum in the step.
CENTRE = 0.02
#: Units of a pressure.
_PRESSURES = ("kPa", "N/cm2", "psi", "mmHg")
#: N of a mass of 1 kg.
_G = 9.80665


def curve_of(foot: Foot, step: Step) -> NDArray[np.float64]:
    """Return the load over the stance of a whole step, by linear interpolation; shape (101,)."""
    here = slice(step.first, min(step.end + 1, len(foot.t)))
    return np.interp(np.linspace(step.contact_s, step.lift_s, POINTS), foot.t[here], foot.force[here])


def measures_of(
    foot: Foot, step: Step, *, above: float, saturation: float | None, weight_kg: float | None
) -> dict[str, float]:
    """Return the measures of a whole step by the name of their column, with its unit; NaN where there is none.

    Parameters
    ----------
    foot : Foot
    step : Step
        Neither its contact nor its lift is cut off.
    above : float, in the unit of the values
        A taxel with a greater value is loaded.
    saturation : float, in the unit of the values, optional
        The value at which the range of a taxel ends.
    weight_kg : float, kg, optional
        The person's.
    """
    frames, stance = foot.frames, slice(step.first, step.end)
    t, force = foot.t[step.first : step.end + 1], foot.force[step.first : step.end + 1]
    load, unit = ("force", "N") if foot.unit == "N" else ("sum", foot.unit)
    inside = foot.force[stance]
    found = {
        f"max_{load}_{unit}": float(inside.max()),
        f"mean_{load}_{unit}": float(inside.mean()),
        **{name if name.endswith("_pct") else f"{name}_{unit}": one for name, one in peaks_of(t, force).items()},
        f"impulse_{unit}_s": float(np.trapezoid(force, t)),
        # From the last sample before contact, where a fast rise may begin.
        f"loading_rate_{unit}_per_s": loading_rate(
            *(x[max(step.first - 1, 0) : step.end] for x in (foot.t, foot.force))
        ),
    }
    if weight_kg is not None and unit == "N":
        found["max_force_pct_weight"] = 100 * float(inside.max()) / (weight_kg * _G)
    values = frames.values[stance]
    found[f"peak_{'pressure' if frames.unit in _PRESSURES else 'sensor'}_{frames.unit}"] = float(values.max())
    if frames.array.area_mm2 is not None:
        found["contact_area_cm2"] = float(frames[stance].area(above).max()) / 100
    if saturation is not None:
        found["saturated_cells"] = float(np.count_nonzero((values >= saturation).any(axis=0)))
    if frames.array.centre_unit is not None:
        found |= _path(foot, step)
    return found


def peaks_of(t: NDArray[np.float64], force: NDArray[np.float64]) -> dict[str, float]:
    """Return both peaks of a step's load, the valley between them, and when they are, % of stance.

    The first peak is the largest load of the first half of stance, the second that of the second half, and the valley
    the least load between them. A half whose largest load is at the middle of stance has no peak of its own, and then
    there is no valley.

    Parameters
    ----------
    t : float64, shape (n,), s
        From contact to lift.
    force : float64, shape (n,)
    """
    names = ("first_peak", "valley", "second_peak")
    found = {one: np.nan for name in names for one in (name, f"{name}_pct")}
    pct = 100 * (t - t[0]) / (t[-1] - t[0])
    middle = int(np.searchsorted(pct, 50.0))
    if not 0 < middle < len(t) - 1:
        return found
    first, second = int(force[: middle + 1].argmax()), middle + int(force[middle:].argmax())
    at = {"first_peak": first, "second_peak": second}
    if middle in (first, second):
        at = {name: k for name, k in at.items() if k != middle}
    else:
        at["valley"] = first + int(force[first : second + 1].argmin())
    for name, k in at.items():
        found[name], found[f"{name}_pct"] = float(force[k]), float(pct[k])
    return found


def loading_rate(t: NDArray[np.float64], force: NDArray[np.float64]) -> float:
    """Return the mean slope between 20 and 80 % of the maximum on the first rise to it, per s; NaN without a rise.

    Parameters
    ----------
    t : float64, shape (n,), s
    force : float64, shape (n,)
    """
    top = float(force.max())
    times = []
    for share in _RISE:
        k = int((force >= share * top).argmax())
        if k == 0:
            return np.nan
        before = force[k - 1]
        times.append(t[k - 1] + (share * top - before) / (force[k] - before) * (t[k] - t[k - 1]))
    return float((_RISE[1] - _RISE[0]) * top / (times[1] - times[0])) if times[1] > times[0] else np.nan


def _path(foot: Foot, step: Step) -> Mapping[str, float]:
    """Return the length and the mean speed of the path of the centre of pressure."""
    stance = slice(step.first, step.end)
    path, unit = foot.frames[stance].centre_path(CENTRE), foot.frames.array.centre_unit
    counts = ~np.isnan(path[:, 0])
    centre, t = path[counts], foot.t[stance][counts]
    if len(t) < 2:
        return {}
    length = float(np.hypot(*np.diff(centre, axis=0).T).sum())
    return {f"cop_length_{unit}": length, f"cop_speed_{unit}_per_s": length / float(t[-1] - t[0])}
