"""Runs the realisations of a study: progress, resuming after a stop, jobs.

A study hands over one pure function of parameters and seed, and the list of what to run. Each result is one JSON line,
keyed by parameters, seed and a digest of the code, so what is there already is not reckoned again, and a stop (Ctrl-C,
kill, power) loses no more than the realisations at work.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import process_time
from types import ModuleType
from typing import Any

import joblib
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from taxel import _arguments as arguments
from taxel import _core
from taxel._core import ProblemError

__all__ = ["Results", "Task", "code_digest", "run"]


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
        """Return what its result is filed under."""
        return json.dumps([self.params, self.seed, code], sort_keys=True)


class Results:
    """Keep results in a file of JSON lines, and read back what is there.

    Parameters
    ----------
    path : Path
        Made at the first result. A last line that a kill cut short is dropped.
    code : str
        The digest of the code: results of other code stay in the file, but count no more.
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
                raise ProblemError(f"{path}: holds a line that is no result of a study; name another folder") from None

    def __contains__(self, task: Task) -> bool:
        return task.key(self.code) in self._results

    def __getitem__(self, task: Task) -> Any:
        """Return the result of a task that was run."""
        return self._results[task.key(self.code)]

    def seconds(self, tasks: Iterable[Task]) -> float:
        """Return the CPU seconds that tasks took."""
        return sum(self._seconds[t.key(self.code)] for t in tasks)

    def add(self, task: Task, result: Any, seconds: float) -> None:
        """Append one result, and see it written."""
        row = {"params": task.params, "seed": task.seed, "code": self.code, "seconds": round(seconds, 3)}
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row | {"result": result}, sort_keys=True) + "\n")
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


def code_digest(modules: Sequence[ModuleType]) -> str:
    """Return a short digest of some modules' source (a package stands for its files) and of the compiled part.

    Only what a realisation uses belongs in it: what lists the tasks or draws the report moves no result.

    Examples
    --------
    >>> import taxel.formats
    >>> len(code_digest([taxel.formats]))
    16
    """
    digest = hashlib.sha256()
    for module in (*modules, _core):
        file = Path(str(module.__file__))
        for part in sorted(file.parent.glob("*.py")) if file.name == "__init__.py" else [file]:
            digest.update(part.name.encode() + b"\0" + part.read_bytes())
    return digest.hexdigest()[:16]


def run(
    realise: Callable[[dict[str, Any], int], Any],
    tasks: Sequence[Task],
    results: Results,
    *,
    jobs: int = 1,
    title: str = "",
    quiet: bool = False,
) -> None:
    """Run what is not there yet; each result is in `results` as soon as it is known.

    Parameters
    ----------
    realise : function of (params, seed)
        Pure: the same arguments give the same result, which JSON can hold.
    tasks : sequence of Task
    results : Results
    jobs : int, 1 or more
        Processes. With 1 everything stays in this one.
    title : str
        What the progress line says.
    quiet : bool
        No progress line.

    Raises
    ------
    ProblemError : `jobs` below 1
    """
    jobs = arguments.whole("jobs", jobs, 1)
    wanted = list({t.key(results.code): t for t in tasks if t not in results}.values())
    if not wanted:
        return
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, TimeRemainingColumn(), disable=quiet) as progress:
        bar = progress.add_task(title, total=len(tasks), completed=len(tasks) - len(wanted))
        for task, result, seconds in _realised(realise, wanted, jobs):
            results.add(task, result, seconds)
            progress.advance(bar)


def _realised(
    realise: Callable[[dict[str, Any], int], Any], tasks: Sequence[Task], jobs: int
) -> Iterator[tuple[Task, Any, float]]:
    if jobs == 1:
        for task in tasks:
            yield (task, *_one(realise, task))
        return
    parallel = joblib.Parallel(n_jobs=jobs, return_as="generator_unordered", batch_size=1)
    calls = (joblib.delayed(_numbered)(realise, k, task) for k, task in enumerate(tasks))
    try:
        for k, result, seconds in parallel(calls):
            yield tasks[k], result, seconds
    except KeyboardInterrupt:
        joblib.externals.loky.get_reusable_executor().shutdown(wait=False, kill_workers=True)
        raise


def _one(realise: Callable[[dict[str, Any], int], Any], task: Task) -> tuple[Any, float]:
    begun = process_time()
    result = realise(task.params, task.seed)
    return result, process_time() - begun


def _numbered(realise: Callable[[dict[str, Any], int], Any], k: int, task: Task) -> tuple[int, Any, float]:
    return (k, *_one(realise, task))
