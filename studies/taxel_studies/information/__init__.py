"""Chapter 5's question on other people's recordings: how many bits do touches hold, and which simpler measurements do.

Footfalls on a plate, grasps of a robot's hand, postures on a mat; each compared with chance, with frames and with
trivial measurements.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from taxel_studies.information import footfalls, grasps, postures
from taxel_studies.runner import Task
from taxel_studies.study import Parameters, Row, Statement, Summary, Table

WHERE = "beside thesis 5.5 and 5.6"
PROTOCOL = (
    "Bits of a classifier's answers, corrected by Panzeri and Treves; linear discriminants, smoothing and ridge "
    "chosen inside the folds. Plate: who walked (trials left out) and how fast (people left out); footfalls are "
    "aligned on contact, the middle of the heel in one column, a frame of rest before each (the plate records "
    "none); change events with a floor of 25 counts, phases drawn. Hand: which object, by slice, as the source "
    "gives no times; changes since the first slice, as that one names the object by itself. Mat: which of four "
    "postures, whole poses with all their variants left out; it has no time, so only the number of taxels counts. "
    "What was tried beforehand is our own, with other code, and stands where else published values stand."
)
#: Folders of recordings, and the module with the questions on each.
ASKED: dict[str, Any] = {"plate": footfalls, "touch_icub_grasp": grasps, "mat_popu": postures}
DATA = tuple(ASKED)

PARAMETERS: dict[str, Any] = {
    "periods_ms": [2.0, 4.0, 10.0, 20.0, 50.0],
    "windows_ms": [10.0, 20.0, 50.0, 100.0],
    "window_ms": 400.0,
    "floor_counts": 25.0,
    "taxels": [10, 30, 100, 300],
    "draws": 5,
    "shuffles": 20,
    "slices": [1, 2, 4, 7],
    "mat_taxels": [4, 16, 64, 256],
    "most_trials": 0,
    "seed": 1,
}
SIZES = {
    "toy": {
        "periods_ms": [10.0, 50.0],
        "windows_ms": [50.0],
        "taxels": [30],
        "draws": 1,
        "shuffles": 2,
        "slices": [1, 4],
        "mat_taxels": [16],
        "most_trials": 12,
    }
}


def tasks(p: Parameters, data: Path) -> list[Task]:
    """List one realisation a question, of the recordings that are there."""
    listed = []
    for folder, module in ASKED.items():
        if (data / folder).is_dir():
            common = {name: p[name] for name in module.USES}
            listed += [Task({"folder": folder, "ask": ask, **common}, p["seed"]) for ask in module.ASKS]
    return listed


def realise(params: dict[str, Any], seed: int, data: Path) -> dict[str, Any]:
    """Answer one question."""
    answer: dict[str, Any] = ASKED[params["folder"]].realise(params, seed, data / params["folder"])
    return answer


def summarise(p: Parameters, rows: Sequence[Row], data: Path) -> Summary:
    """Return every answer, by folder and question."""
    del p, data
    summary: Summary = {}
    for row in rows:
        summary.setdefault(row.params["folder"], {})[row.params["ask"]] = row.result
    return summary


def statements(p: Parameters, summary: Summary) -> list[Statement]:
    """Compare the answers with those of an earlier trial with other code."""
    return [one for folder, judged in summary.items() for one in ASKED[folder].statements(p, judged)]


def tables(p: Parameters, summary: Summary) -> list[Table]:
    """Return a table for each set of recordings."""
    return [one for folder, listed in summary.items() for one in ASKED[folder].tables(p, listed)]


def draw(p: Parameters, summary: Summary) -> list[Figure]:
    """Draw each set of recordings."""
    return [one for folder, answers in summary.items() for one in ASKED[folder].draw(p, answers)]
