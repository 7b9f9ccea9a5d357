"""Runs the realisations of a study: shows progress, resumes after a stop, uses processes here or a cluster.

A study gives one pure function of parameters and seed, and the list of what to run. joblib keeps each result, by its
function, parameters, seed and the commit, so a result that is there already is not computed again, and a stop (Ctrl-C,
kill, power) loses no more than the realisations that are running.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextvars import ContextVar
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from time import process_time
from typing import Any, TypeVar

import joblib
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from taxel.learn import ConeR, ConeX
from taxel.tasks import Workers

#: The gaps of the fits of the realisation that runs; 0 of those that are solved or proven to have no solution.
_GAPS: ContextVar[list[float]] = ContextVar("_GAPS")
Cone = TypeVar("Cone", bound=ConeX | ConeR)


@dataclass(frozen=True)
class Task:
    """Name one realisation: its parameters, and a seed."""

    params: dict[str, Any]
    seed: int = 0


@dataclass(frozen=True)
class Row(Task):
    """One realisation, its result, the CPU seconds that it took, and the gaps of its fits, 0 of those that closed."""

    result: Any = None
    seconds: float = 0.0
    gaps: Sequence[float] = ()


def grid(p: Mapping[str, Any], **axes: str) -> list[Task]:
    """List the realisations of a grid: an axis is named after what a realisation is given, by the parameter of values.

    The values of the axis ``seed`` are as many as its parameter says. Parameters that are no axis are given to all.

    Examples
    --------
    >>> [task.seed for task in grid({"kappas": [1.0, 1.2], "realisations": 2}, kappa="kappas", seed="realisations")]
    [0, 1, 0, 1]
    """
    shared = {name: value for name, value in p.items() if name not in axes.values()}
    values = [range(p[of]) if axis == "seed" else p[of] for axis, of in axes.items()]
    named = (dict(zip(axes, one, strict=True)) for one in product(*values))
    return [Task(shared | {k: v for k, v in one.items() if k != "seed"}, one.get("seed", 0)) for one in named]


def _made(function: Callable[..., Any], arguments: tuple[Any, ...], code: str) -> Any:
    del code  # it is part of what joblib keeps the result by
    return function(*arguments)


def noted(cone: Cone) -> Cone:
    """Return a learner after its fit, whose gap goes to the row of the realisation that runs."""
    if (gaps := _GAPS.get(None)) is not None:
        gaps.append(0.0 if cone.status_ in ("solved", "infeasible") else cone.gap_)
    return cone


def _timed(
    realise: Callable[..., Any], params: dict[str, Any], seed: int, code: str, given: Any
) -> tuple[Any, float, list[float]]:
    del code
    gaps: list[float] = []
    held = _GAPS.set(gaps)
    try:
        begun = process_time()
        result = realise(params, seed, **given)
        return result, process_time() - begun, gaps
    finally:
        _GAPS.reset(held)


@dataclass(frozen=True)
class Kept:
    """What long computations gave, in a folder: used again by the same code alone.

    Parameters
    ----------
    folder : Path
    code : str
        Which code runs (`commit.code_version`): what other code gave stays, but counts no more.
    """

    folder: Path
    code: str

    def made(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Return what a function of a module gives, from the folder where it is there; studies share it."""
        return self._memory.cache(_made)(function, arguments, self.code)

    def has(self, realise: Callable[..., Any], task: Task) -> bool:
        """Whether the result of a realisation is there."""
        return bool(self._realised.check_call_in_cache(realise, task.params, task.seed, self.code, {}))

    def row(self, realise: Callable[..., Any], given: Mapping[str, Any], task: Task) -> Row:
        """Return a realisation with its result, from the folder where it is there."""
        return Row(task.params, task.seed, *self._realised(realise, task.params, task.seed, self.code, given))

    @property
    def _realised(self) -> Any:
        return self._memory.cache(_timed, ignore=["given"])

    @property
    def _memory(self) -> Any:
        return joblib.Memory(self.folder, verbose=0, compress=True)


def make(params: dict[str, Any], _seed: int, kept: Kept) -> None:
    """Make what realisations share: a realisation whose parameter ``call`` has the arguments of `Kept.made`."""
    kept.made(*params["call"])


def run(
    realise: Callable[..., Any],
    tasks: Sequence[Task],
    kept: Kept,
    *,
    given: Mapping[str, Any] | None = None,
    workers: Workers | None = None,
    title: str = "",
    quiet: bool = False,
) -> list[Row]:
    """Run what is not there yet; each result is kept as soon as it is known.

    Parameters
    ----------
    realise : function of (params, seed), of a module
        Pure: the same arguments give the same result.
    tasks : sequence of Task
        Begun in this order: the longest first where they differ much.
    kept : Kept
    given : mapping, optional
        More arguments, the same for all, which the results do not depend on.
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
    row = partial(kept.row, realise, given or {})
    wanted = [k for k, task in enumerate(tasks) if not kept.has(realise, task)]
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    found: dict[int, Row] = {}
    with Progress(*columns, TimeRemainingColumn(), disable=quiet) as progress:
        bar = progress.add_task(title, total=len(tasks), completed=len(tasks) - len(wanted))
        for k, one in workers.run(row, [tasks[k] for k in wanted]) if wanted else ():
            found[wanted[k]] = one
            progress.advance(bar)
    return [found[k] if k in found else row(task) for k, task in enumerate(tasks)]
