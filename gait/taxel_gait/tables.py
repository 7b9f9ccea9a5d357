"""The tables of steps: a row a step, a summary by person, foot and condition, symmetry, and curves over stance."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.report import write_whole

__all__ = ["KEYS", "SYMMETRIES", "Means", "Table", "curves", "means_of", "summary", "symmetry"]

#: What names a step, and says whether it counts.
KEYS = ("recording", "person", "condition", "foot", "step", "bout", "used")
#: Times that are no measure.
_NO_MEASURE = ("contact_s", "lift_s")
#: Significant digits of a cell.
_DIGITS = 7

#: The symmetries in use, of the means of the left and the right foot, by their column.
SYMMETRIES: dict[str, Callable[[float, float], float]] = {
    "symmetry_index_robinson_pct": lambda left, right: 200 * (left - right) / (left + right),
    "ratio_left_to_right": lambda left, right: left / right,
    "symmetry_log_ratio_pct": lambda left, right: 100 * float(np.log(left / right)),
    "symmetry_angle_zifchock_pct": lambda left, right: 100 * (45 - float(np.degrees(np.arctan(left / right)))) / 90,
    "symmetry_of_larger_pct": lambda left, right: 100 * (left - right) / max(left, right),
}


class Table(NamedTuple):
    """A table with lines of comments above its names.

    Parameters
    ----------
    about : list of str
    columns : list of str
    rows : list of mapping
        Cells that are None, NaN or missing are empty.
    """

    about: list[str]
    columns: list[str]
    rows: Sequence[Mapping[str, Any]]

    def write(self, path: Path, *, decimal_comma: bool, overwrite: bool) -> None:
        """Write it with commas between cells, or with decimal commas and semicolons."""
        text = io.StringIO(newline="")
        text.writelines(f"# {' '.join(line.split())}\n" for line in self.about)
        table = csv.writer(text, lineterminator="\n", delimiter=";" if decimal_comma else ",")
        table.writerow(self.columns)
        for row in self.rows:
            table.writerow([_cell(row.get(name), decimal_comma) for name in self.columns])
        write_whole(path, lambda file: file.write(text.getvalue().encode()), overwrite=overwrite)


def _cell(value: Any, decimal_comma: bool) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    text = f"{value:.{_DIGITS}g}" if isinstance(value, float) else str(value)
    return text.replace(".", ",") if decimal_comma and isinstance(value, float) else text


def columns_of(rows: Iterable[Mapping[str, Any]], last: Sequence[str] = ()) -> list[str]:
    """Return the columns of rows: keys, then measures in the order in which they first are, then `last`."""
    found = dict.fromkeys(name for row in rows for name in row)
    return [*KEYS[:-1], *(name for name in found if name not in (*KEYS, *last)), *last, KEYS[-1]]


class Means(NamedTuple):
    """Number, mean and standard deviation (n - 1) of values."""

    n: int
    mean: float
    sd: float

    @property
    def cv_pct(self) -> float:
        """The coefficient of variation, %."""
        return 100 * self.sd / self.mean if self.mean else float("nan")


def means_of(values: Iterable[float | None]) -> Means:
    """Return number, mean and standard deviation of the values that are known.

    Examples
    --------
    >>> means_of([1.0, None, 3.0])
    Means(n=2, mean=2.0, sd=1.4142135623730951)
    """
    known = np.array([value for value in values if value is not None], np.float64)
    n = len(known)
    return Means(n, float(known.mean()) if n else np.nan, float(known.std(ddof=1)) if n > 1 else np.nan)


def _groups(rows: Sequence[Mapping[str, Any]]) -> dict[tuple[str, str, str], list[int]]:
    """Return the numbers of the rows that are used, by person, condition and foot, the left one first."""
    found: dict[tuple[str, str], dict[str, list[int]]] = {}
    for k, row in enumerate(rows):
        own = found.setdefault((row["person"], row["condition"]), {}).setdefault(row["foot"], [])
        own += [k] * (row["used"] == "yes")
    return {(*key, foot): by_foot[foot] for key, by_foot in found.items() for foot in sorted(by_foot)}


def summary(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return n, mean, SD and CV of the steps that are used: a row a measure of a person, a condition and a foot."""
    found = []
    names = [name for name in columns_of(rows) if name not in (*KEYS, *_NO_MEASURE)]
    for (person, condition, foot), own in _groups(rows).items():
        for name in names:
            one = means_of(rows[k].get(name) for k in own)
            if one.n:
                cells = {"measure": name, "n": one.n, "mean": one.mean, "sd": one.sd, "cv_pct": one.cv_pct}
                found.append({"person": person, "condition": condition, "foot": foot} | cells)
    return found


def symmetry(summed: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return the symmetries of each measure of each person and condition, from the rows of a `summary`."""
    pairs: dict[tuple[str, str, str], dict[str, float]] = {}
    for row in summed:
        pairs.setdefault((row["person"], row["condition"], row["measure"]), {})[row["foot"]] = row["mean"]
    found = []
    for (person, condition, name), by_foot in pairs.items():
        left, right = by_foot.get("left", np.nan), by_foot.get("right", np.nan)
        if left > 0 and right > 0:
            cells = {"person": person, "condition": condition, "measure": name, "left": left, "right": right}
            found.append(cells | {column: of(left, right) for column, of in SYMMETRIES.items()})
    return found


def curves(
    rows: Sequence[Mapping[str, Any]], over_stance: Sequence[Sequence[float] | None]
) -> dict[tuple[str, str, str], tuple[int, NDArray[np.float64], NDArray[np.float64]]]:
    """Return the number of steps, the mean and the SD of the curves that are used, by person, condition and foot."""
    found = {}
    for key, own in _groups(rows).items():
        used = [curve for k in own if (curve := over_stance[k]) is not None]
        if used:
            values = np.array(used)
            sd = values.std(axis=0, ddof=1) if len(used) > 1 else np.full(values.shape[1], np.nan)
            found[key] = len(used), values.mean(axis=0), sd
    return found
