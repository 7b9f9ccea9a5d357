"""Runs the realisations of a study: shows progress, resumes after a stop, uses processes here or a cluster.

A study gives one pure function of parameters and seed, and the list of what to run. Each result is one JSON line, keyed
by parameters, seed and the commit, so a result that is there already is not computed again, and a stop
(Ctrl-C, kill, power) loses no more than the realisations that are running.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import process_time
from typing import Any

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from taxel import ProblemError
from taxel.tasks import Workers

__all__ = ["Results", "SharedFolder", "Task", "Workers", "one_of", "run", "whole"]


def one_of(name: str, value: object, allowed: Collection[str]) -> str:
    """Return a word of a closed list.

    Raises
    ------
    ProblemError : any other value (names the parameter and the list)
    """
    if not isinstance(value, str) or value not in allowed:
        raise ProblemError(f"{name} is {value!r}: must be one of {', '.join(map(repr, allowed))}")
    return value


def whole(name: str, value: object, least: int) -> int:
    """Return a whole number that is not below the least one.

    Raises
    ------
    ProblemError : any other value (names the parameter)
    """
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        raise ProblemError(f"{name} is {value!r}: must be a whole number, {least} or more")
    return value


@dataclass(frozen=True)
class Task:
    """Name one realisation: parameters that JSON can hold, and a seed.

    Examples
    --------
    >>> Task({"tau": 70}, seed=1).key("abc")
    '[{"tau": 70}, 1, "abc"]'
    """

    params: dict[str, Any]
    seed: int = 0

    def key(self, code: str) -> str:
        """Return the key of its result in the file."""
        return json.dumps([self.params, self.seed, code], sort_keys=True)


@dataclass(frozen=True)
class SharedFolder:
    """Name the folder in which the studies of a report share what takes long to compute.

    Parameters
    ----------
    path : Path
    code : str
        Which code runs, as of `Results`: what other code saved there is computed again. Processes of one run share it.
    """

    path: Path
    code: str


class Results:
    """Save results in a file of JSON lines, and read those that are there.

    Parameters
    ----------
    path : Path
        Made at the first result. A last line that a kill cut short is dropped.
    code : str
        Which code runs (`commit.code_version`): results of other code stay in the file, but count no more.

    Raises
    ------
    ProblemError : a line is not a result of a study
    """

    def __init__(self, path: Path, code: str) -> None:
        self.path, self.code = path, code
        self._results: dict[str, Any] = {}
        self._seconds: dict[str, float] = {}
        for line in _whole_lines(path):
            try:
                row = json.loads(line)
                key = json.dumps([row["params"], row["seed"], row["code"]], sort_keys=True)
                self._results[key], self._seconds[key] = row["result"], row["seconds"]
            except (ValueError, KeyError, TypeError):
                raise ProblemError(f"{path}: a line is not a result of a study; give another folder") from None

    def __contains__(self, task: Task) -> bool:
        return task.key(self.code) in self._results

    def __getitem__(self, task: Task) -> Any:
        """Return the result of a task that was run."""
        return self._results[task.key(self.code)]

    def seconds(self, tasks: Iterable[Task]) -> float:
        """Return the CPU seconds that tasks took."""
        return sum(self._seconds[t.key(self.code)] for t in tasks)

    def add(self, task: Task, result: Any, seconds: float) -> None:
        """Append one result to the file at once."""
        seconds = round(seconds, 3)
        row = {"params": task.params, "seed": task.seed, "code": self.code, "seconds": seconds}
        with self.path.open("a", encoding="utf-8", newline="\n") as file:
            file.write(json.dumps(row | {"result": result}) + "\n")
        self._results[task.key(self.code)], self._seconds[task.key(self.code)] = result, seconds


def _whole_lines(path: Path) -> list[str]:
    """Read the whole lines of a file, and cut off the last one where a kill left it short."""
    if not path.exists():
        return []
    data = path.read_bytes()
    whole = data[: data.rfind(b"\n") + 1]
    if len(whole) < len(data):
        with path.open("r+b") as file:
            file.truncate(len(whole))
    return whole.decode().splitlines()


def run(
    realise: Callable[[dict[str, Any], int], Any],
    tasks: Sequence[Task],
    results: Results,
    *,
    workers: Workers | None = None,
    title: str = "",
    quiet: bool = False,
) -> None:
    """Run what is not there yet; each result is in `results` as soon as it is known.

    Parameters
    ----------
    realise : function of (params, seed)
        Pure: the same arguments give the same result, which JSON can hold.
    tasks : sequence of Task
        Begun in this order: the longest first where they differ much.
    results : Results
    workers : Workers, optional
        Default: this process alone.
    title : str
        What the progress line says.
    quiet : bool
        No progress line.

    Raises
    ------
    DeviceError : a cluster that does not answer
    """
    workers = Workers() if workers is None else workers
    wanted = list({t.key(results.code): t for t in tasks if t not in results}.values())
    if not wanted:
        return
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, TimeRemainingColumn(), disable=quiet) as progress:
        bar = progress.add_task(title, total=len(tasks), completed=len(tasks) - len(wanted))
        for k, (result, seconds) in workers.run(partial(_one, realise), wanted):
            results.add(wanted[k], result, seconds)
            progress.advance(bar)


def _one(realise: Callable[[dict[str, Any], int], Any], task: Task) -> tuple[Any, float]:
    begun = process_time()
    result = realise(task.params, task.seed)
    return result, process_time() - begun
