"""The tables of steps: a row a step, a summary by person, foot and condition, symmetry, and curves over stance."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "KEYS",
    "SUMMED",
    "SYMMETRIES",
    "Curves",
    "Means",
    "Summary",
    "Table",
    "columns_of",
    "curves",
    "figure",
    "load_name",
    "means_of",
    "summary",
    "symmetry",
]

#: Mean and SD over stance of each region, by person, condition, foot, and the name of the load.
Curves: TypeAlias = dict[tuple[str, str, str, str], dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]]

#: What names a step, and says whether it counts.
KEYS = ("recording", "person", "condition", "foot", "step", "bout", "region", "used")
#: The columns of a summary after those that name a foot.
SUMMED = ("measure", "n", "mean", "sd", "cv_pct")
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
        from taxel.report import write_whole  # noqa: PLC0415  loads slowly

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
    keys = [name for name in KEYS[:-1] if name in found]
    return [*keys, *(name for name in found if name not in (*KEYS, *last)), *last, KEYS[-1]]


def load_name(row: Mapping[str, Any]) -> str:
    """Return the name of the load of a row, with its unit: "force_N"; "" of a step that is cut."""
    return next((name.removeprefix("mean_") for name in row if name.startswith("mean_")), "")


class Means(NamedTuple):
    """Number, mean and standard deviation (n - 1) of values."""

    n: int
    mean: float
    sd: float

    @property
    def cv_pct(self) -> float:
        """The coefficient of variation, %."""
        return 100 * self.sd / self.mean if self.mean else float("nan")


class Summary(NamedTuple):
    """The means of a measure of a person's foot in a condition; of one of its regions, or of the whole ("")."""

    person: str
    condition: str
    foot: str
    region: str
    measure: str
    means: Means

    def row(self) -> dict[str, Any]:
        """Return it as a row of a table."""
        n, mean, sd = self.means
        return {**self._asdict(), "n": n, "mean": mean, "sd": sd, "cv_pct": self.means.cv_pct}


def figure(value: float, digits: int) -> str:
    """Return a number with so many significant digits, without an exponent; "" where it is not known.

    Examples
    --------
    >>> figure(6781.4, 2), figure(float("nan"), 2)
    ('6800', '')
    """
    return "" if np.isnan(value) else np.format_float_positional(value, digits, fractional=False, trim="-")


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


def summary(rows: Sequence[Mapping[str, Any]]) -> list[Summary]:
    """Return the means of the steps that are used: of each measure by person, condition, foot and region."""
    found = []
    names = [name for name in columns_of(rows) if name not in (*KEYS, *_NO_MEASURE)]
    for region in dict.fromkeys(row.get("region", "") for row in rows):
        of_region = [row for row in rows if row.get("region", "") == region]
        for (person, condition, foot), own in _groups(of_region).items():
            for name in names:
                means = means_of(of_region[k].get(name) for k in own)
                if means.n:
                    found.append(Summary(person, condition, foot, region, name, means))
    return found


def symmetry(summed: Sequence[Summary]) -> list[dict[str, Any]]:
    """Return the symmetries of each measure of each person, condition and region, from a `summary`."""
    pairs: dict[tuple[str, str, str, str], dict[str, float]] = {}
    for one in summed:
        pairs.setdefault((one.person, one.condition, one.region, one.measure), {})[one.foot] = one.means.mean
    found = []
    for (person, condition, region, name), by_foot in pairs.items():
        left, right = by_foot.get("left", np.nan), by_foot.get("right", np.nan)
        if left > 0 and right > 0:
            keys = {"person": person, "condition": condition, "region": region, "measure": name}
            cells = {"left": left, "right": right}
            found.append(keys | cells | {column: of(left, right) for column, of in SYMMETRIES.items()})
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
