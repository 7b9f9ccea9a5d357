"""The 8 x 8 fabric array of chapter 3 on its foam, a sphere pressed into it, and the voltages of its dividers (3.4)."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.array import Array
from taxel.frames import Frames
from taxel.simulate import Layer
from taxel.simulate.circuit import Divider, Fabric

Values = NDArray[np.float64]

#: 6 x 6 cm (3.4.1).
ARRAY = Array(8, 8, pitch_mm=7.5, name="fabric of chapter 3")
#: What the thesis leaves open, as experiment parameters: foam beneath the sensor, its divider, how taxels differ.
SENSOR: dict[str, Any] = {
    "foam_kpa": 60.0,
    "foam_mm": 10.0,
    "resistor_kohm": 10.0,
    "threshold_v": 0.25,
    "gain_spread": 0.2,
    "noise_v": 0.002,
}
#: The 10 kHz of 3.4.2.
PERIOD_US = 100
#: Points of foam along a taxel, depths of a course; the side of the taxel that the fabric's law is stated for, mm.
_FINE, _STEPS, _STATED_MM = 4, 16, 2.29


@cache
def _layer(modulus_kpa: float, thickness_mm: float) -> Layer:
    side = 8 * _FINE
    grid = Array(side, side, pitch_mm=ARRAY.column_mm / _FINE, name="foam")
    return Layer({"modulus_kpa": modulus_kpa, "thickness_mm": thickness_mm}, grid)


def _gap(diameter_mm: float, x_mm: float, y_mm: float) -> Values:
    """Return how far a sphere's face lies above its lowest point, mm, at each point of the foam."""
    at = (np.arange(8 * _FINE) + 0.5) * ARRAY.column_mm / _FINE - 4 * ARRAY.column_mm
    away = (at[None, :] - x_mm) ** 2 + (at[:, None] - y_mm) ** 2
    radius = diameter_mm / 2
    return radius - np.sqrt(np.clip(radius**2 - away, 0.0, None))


@cache
def depth_of(diameter_mm: float, force_n: float, modulus_kpa: float, thickness_mm: float) -> float:
    """Return how deep a sphere in the array's middle must be pressed for a force, mm."""
    layer, gap = _layer(modulus_kpa, thickness_mm), _gap(diameter_mm, 0.0, 0.0)
    layer.forget()
    depths = np.arange(0.0, 0.8 * thickness_mm, 0.1)
    forces = [0.0]
    for depth in depths[1:]:
        forces.append(layer.press(depth - gap).force_n)
        if forces[-1] > force_n:
            break
    return float(np.interp(force_n, forces, depths[: len(forces)]))


def pressed(
    p: Mapping[str, Any], diameter_mm: float, depth_mm: float, x_mm: float, y_mm: float
) -> tuple[Values, Values]:
    """Return depths (mm) and the mean pressure on each taxel (kPa) at each: the sensor lies on the foam's face."""
    layer, gap = _layer(p["foam_kpa"], p["foam_mm"]), _gap(diameter_mm, x_mm, y_mm)
    layer.forget()
    depths = np.linspace(0.0, depth_mm, _STEPS + 1)
    pressures = [np.zeros(ARRAY.shape)]
    for depth in depths[1:]:
        fine = layer.press(depth - gap).pressure_kpa
        pressures.append(fine.reshape(8, _FINE, 8, _FINE).mean(axis=(1, 3)))
    return depths, np.array(pressures)


def read(p: Mapping[str, Any], depths: Values, pressures: Values, course_mm: Values, seed: int) -> Frames:
    """Return what the dividers read (V) along a course of depths, a sample each 0.1 ms.

    Fabric conducts by pressure: a crossing of n times the area is n crossings side by side. The taxels' spread is of
    the array, the noise of the trial.
    """
    times = (ARRAY.column_mm / _STATED_MM) ** 2
    gain = np.exp(p["gain_spread"] * np.random.default_rng(3).standard_normal(ARRAY.shape))
    fabric = Fabric()
    # kPa mm^2 is mN; conductances of the course's depths, then straight between them.
    known = fabric.rest_us + gain * (fabric.conductance(pressures * _STATED_MM**2 / 1000.0) - fabric.rest_us)
    lines = Divider(resistor_kohm=p["resistor_kohm"])
    volts = lines.volts(times * known).reshape(len(depths), -1)
    place = np.interp(course_mm, depths, np.arange(len(depths)))
    low = np.minimum(place.astype(int), len(depths) - 2)
    share = (place - low)[:, None]
    values = (1 - share) * volts[low] + share * volts[low + 1]
    values += p["noise_v"] * np.random.default_rng([seed, 7]).standard_normal(values.shape)
    t = PERIOD_US * np.arange(len(course_mm), dtype=np.int64)
    return Frames(values.reshape(-1, *ARRAY.shape).astype(np.float32), t, unit="V", array=ARRAY)
