"""Time of `taxel information`, from the command to the written page: 60 footfalls, and 144 strides of 8 channels.

Two tables of labelled trials of published recordings (docs/files.md; TAXEL_DATA names their folder, else
../shared/data beside the checkout; without it both are left out):

- footfalls: the 60 of subj000 on the plate, 42 x 33 taxels at 500 Hz; the label is the class of speed that
  ``conditions.csv`` has (1 slow, 2 normal, 3 fast); 400 ms from the contact on. The plate's reader gives as many rows
  as a footfall has and begins with its contact; here each becomes an .npz of 42 rows with a frame of rest before;
- strides: the 144 contacts of GaPt23 of gaitpdb that ``events.csv`` has, 8 channels a foot at 100 Hz; the label is the
  foot; 1000 ms from the contact on, which is searched from 100 ms before the listed one on.

All options of the command stay at their defaults, but for the window. ``python benchmarks/information.py FOLDER`` only
writes the tables (and the footfalls) there and prints the commands.

Peer: none; CPU seconds stand beside the time, which a busy machine stretches. Unit: s, on two idle cores. Goal: 40
for the footfalls, 60 for the strides.
"""

from __future__ import annotations

import csv
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import taxel
from taxel_benchmarks._goals import Goal, at_most
from taxel_studies.datasets import plate

PERSON, WALKER = "subj000", "GaPt23"
#: Rows of the longest footfall, and the time between the samples of a stride, us.
ROWS, SAMPLE_US = 42, 10_000
#: How long before the listed contact of a stride its own is searched, us.
BEFORE_US = 100_000
GOALS_S = {"footfalls": 40.0, "strides": 60.0}
QUICK = ("--draws", "1", "--shuffles", "2", "--periods", "10", "--taxels", "4")


@dataclass(frozen=True)
class Asked:
    """A table of trials that is written, and the command on it."""

    trials: int
    window_ms: int
    command: list[str]


def recordings() -> Path:
    """Return the folder of the published recordings."""
    return Path(os.environ.get("TAXEL_DATA") or Path(__file__).resolve().parents[3] / "shared" / "data")


def footfalls(data: Path, folder: Path) -> Asked:
    """Write one person's footfalls on the plate, labelled with their class of speed."""
    speeds = {int(row["Trial"]): row[PERSON] for row in _read(data / "plate" / "conditions.csv")}
    each = folder / "footfalls"
    each.mkdir(exist_ok=True)
    rows = []
    for number, trial in enumerate(plate.trials(data / "plate" / f"{PERSON}.h5")):
        values = np.zeros((len(trial.frames) + 1, ROWS, trial.frames.array.columns), np.float32)
        values[1:, : trial.frames.array.rows] = trial.frames.values
        t = plate.FRAME_US * np.arange(len(values))
        name = f"{trial.name.replace('/', '-')}.npz"
        taxel.convert(taxel.Frames(values, t, unit="counts"), each / name, overwrite=True)
        rows.append((name, 0, speeds[number]))
    return _written("footfalls", rows, each, 400, folder)


def strides(data: Path, folder: Path) -> Asked:
    """Write one person's strides, labelled with their foot."""
    listed = [row for row in _read(data / "insole_gaitpdb" / "events.csv") if row["person"] == WALKER]
    times = [SAMPLE_US * int(row["contact_sample"]) - BEFORE_US for row in listed]
    rows = [(f"{WALKER}_01 {row['foot']}", max(0, t), row["foot"]) for row, t in zip(listed, times, strict=True)]
    return _written("strides", rows, data / "insole_gaitpdb" / f"{WALKER}_01.txt.gz", 1000, folder)


def written(folder: Path) -> tuple[dict[str, Asked], dict[str, str]]:
    """Write the tables whose recordings are there; return them, and why others are left out."""
    asked, absent = {}, {}
    for name, write, part in (("footfalls", footfalls, "plate"), ("strides", strides, "insole_gaitpdb")):
        if (recordings() / part).is_dir():
            asked[name] = write(recordings(), folder)
        else:
            absent[name] = f"no {recordings() / part} (TAXEL_DATA names the folder of the recordings)"
    return asked, absent


def timed(arguments: list[str]) -> dict[str, Any]:
    """Run a command of taxel in a process of its own; return its time and its CPU time."""
    begun, before = time.perf_counter(), os.times()
    done = subprocess.run([sys.executable, "-m", "taxel", *arguments], check=True, capture_output=True, text=True)
    wall, after = time.perf_counter() - begun, os.times()
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    full = next(line for line in done.stdout.splitlines() if line.startswith("full: "))
    return {"wall_s": wall, "cpu_s": cpu, "found": full}


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    return at_most(
        {f"{name}, s": limit for name, limit in GOALS_S.items()},
        {f"{name}, s": one["wall_s"] for name, one in result["results"].items()},
    )


def run(*, quick: bool) -> dict[str, Any]:
    """Measure both in turn; quick: once, with one period, one draw and two shuffles."""
    results, rounds = {}, 1 if quick else 3
    with tempfile.TemporaryDirectory() as place:
        asked, absent = written(Path(place))
        times: dict[str, list[dict[str, Any]]] = {name: [] for name in asked}
        for _ in range(rounds):
            for name, one in asked.items():
                # The page of the round before is replaced.
                times[name].append(timed([*one.command, "--overwrite", *(QUICK if quick else ())]))
        for name, one in asked.items():
            results[name] = {
                "command": " ".join(["taxel", *(Path(word).name for word in one.command)]),
                "trials": one.trials,
                "goal_s": GOALS_S[name],
                **{clock: statistics.median(row[clock] for row in times[name]) for clock in ("wall_s", "cpu_s")},
                "rounds, wall s": [row["wall_s"] for row in times[name]],
                "found": times[name][0]["found"],
            }
    return {
        "results": results,
        "left out": absent,
        "ratios": {f"{name}: goal over time": GOALS_S[name] / one["wall_s"] for name, one in results.items()},
    }


def _written(name: str, rows: list[tuple[str, int, str]], recording: Path, window_ms: int, folder: Path) -> Asked:
    table, page = folder / f"{name}.csv", folder / f"{name}.html"
    with table.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([("recording", "t_us", "label"), *rows])
    window = ["--window-ms", str(window_ms)]
    command = ["information", str(recording), "--labels", str(table), *window, "--report", str(page)]
    return Asked(len(rows), window_ms, command)


def _read(place: Path) -> list[dict[str, str]]:
    with place.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


if __name__ == "__main__":
    target = Path(sys.argv[1])
    target.mkdir(parents=True, exist_ok=True)
    there, missing = written(target)
    for one in there.values():
        print(" ".join(["taxel", *one.command]))
    for name, why in missing.items():
        print(f"left out: {name}: {why}")
