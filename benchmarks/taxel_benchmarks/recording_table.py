"""Time and memory of opening tables of another program, beside reading them by pandas with the same options.

Tables of 100 MB as an insole of 99 sensors writes them: commas with points, and semicolons with decimal commas. taxel
finds the form of the table itself, and returns frames of 32 bits with times that ascend; pandas is told the form, and
returns columns of 64 bits. Both in turn in one process, by its CPU time; the memory is that of a process of its own,
less that of one that reads the first lines.

Peer: pandas.read_csv. Unit: CPU seconds, and times the size of the frames. Goal: 0.8 of the rate, three times the size.
"""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import taxel
from taxel_benchmarks._goals import Goal, at_least, at_most
from taxel_benchmarks._rounds import measured, printed

_SENSORS = 99
#: Separator and decimal mark of each table.
_FORMS = {"points": (",", "."), "decimal commas": (";", ",")}
_MEMORY = """
import sys, warnings
from pathlib import Path
import taxel
warnings.simplefilter("ignore")
peak = lambda: int(Path("/proc/self/status").read_text().partition("VmHWM:")[2].split()[0]) * 1024
taxel.open(sys.argv[1]).frames()
before = peak()
frames = taxel.open(sys.argv[2]).frames()
print((peak() - before) / frames.values.nbytes)
"""


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    rates = {name: ratio for name, ratio in result["ratios"].items() if name.endswith("time")}
    sizes = {name: ratio for name, ratio in result["ratios"].items() if name.endswith("memory")}
    return [*at_least(dict.fromkeys(rates, 0.8), rates), *at_most(dict.fromkeys(sizes, 3.0), sizes)]


def written(path: Path, rows: int, separator: str, decimal: str) -> None:
    """Write a table of so many rows."""
    values = np.random.default_rng(1).gamma(1.0, 20.0, (rows, _SENSORS)).round(2)
    table = pd.DataFrame(values, columns=[f"S{k} [kPa]" for k in range(_SENSORS)])
    table.insert(0, "time [s]", np.arange(rows) / 100)
    table.to_csv(path, sep=separator, decimal=decimal, index=False)


def run(*, quick: bool) -> dict[str, Any]:
    """Measure, with few rows and rounds if it is quick."""
    rows, rounds = (4_000, 2) if quick else (200_000, 5)
    runs, pairs, ratios = dict[str, Any](), dict[str, tuple[str, str]](), dict[str, float]()
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name, (separator, decimal) in _FORMS.items():
            path, first = Path(folder) / f"{name}.csv", Path(folder) / f"{name} first.csv"
            written(path, rows, separator, decimal)
            written(first, 100, separator, decimal)
            megabytes = path.stat().st_size / 1e6
            runs |= {
                f"taxel, {name}": lambda path=path: taxel.open(path).frames(),
                f"pandas, {name}": lambda path=path, s=separator, d=decimal: pd.read_csv(path, sep=s, decimal=d),
            }
            pairs[f"{name}, time"] = (f"taxel, {name}", f"pandas, {name}")
            ratios[f"{name}, memory"] = float(printed(_MEMORY, first, path))
        found = measured(runs, pairs, rounds=rounds, work=megabytes)
    found["ratios"] |= ratios
    return found
