"""Runs the realisations of a study: shows progress, resumes after a stop, uses processes here or a cluster.

A study gives one pure function of parameters and seed, and the list of what to run. Each result is one JSON line, keyed
by parameters, seed and the commit, so a result that is there already is not computed again, and a stop
(Ctrl-C, kill, power) loses no more than the realisations that are running.
"""

from __future__ import annotations

import json
import logging
import os
import signal
import tempfile
import threading
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from time import process_time
from typing import TYPE_CHECKING, Any

import psutil
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from taxel import DeviceError, ProblemError

if TYPE_CHECKING:
    import joblib

__all__ = ["BACKENDS", "HERE", "Results", "SharedFolder", "Task", "Workers", "one_of", "run", "whole"]

#: Where realisations may run: in loky's processes on this machine, or on a cluster.
BACKENDS = ("loky", "dask", "ray")

#: The variable with which Python adds neither the current folder nor a script's to its path.
_SAFE_PATH = "PYTHONSAFEPATH"
#: Interval at which a worker looks whether its parent runs, s.
_ASK_EVERY_S = 0.5


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


@dataclass(frozen=True)
class Workers:
    """Name the processes that run realisations.

    Parameters
    ----------
    jobs : int, 1 or more
        Processes. With 1 of loky's everything stays in this one. Of a cluster that runs already, all are taken.
    backend : {"loky", "dask", "ray"}
        Through joblib: processes here, or a cluster's.
    scheduler : str, optional
        The address of a cluster that runs already; without it Dask and Ray start one on this machine.

    Raises
    ------
    ProblemError : nonsense in a parameter; a backend that is not installed

    Examples
    --------
    >>> Workers(jobs=2).backend
    'loky'
    """

    jobs: int = 1
    backend: str = "loky"
    scheduler: str | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "jobs", whole("jobs", self.jobs, 1))
        one_of("backend", self.backend, BACKENDS)
        if self.scheduler is not None:
            if not isinstance(self.scheduler, str):
                raise ProblemError(f"scheduler is {self.scheduler!r}: must be an address")
            if self.backend == "loky":
                raise ProblemError('scheduler is for the backends "dask" and "ray": loky has its processes here')
        package, extra = {
            "dask": ("distributed", "cluster"),
            "ray": ("ray", "cluster"),
            "loky": ("joblib", "studies"),
        }[self.backend]
        if (self.backend != "loky" or self.jobs > 1) and find_spec(package) is None:
            raise ProblemError(
                f'backend "{self.backend}" needs the package {package}: install it by pip install "taxel[{extra}]"'
            )

    @contextmanager
    def joblib(self) -> Iterator[joblib.Parallel]:
        """Give a `joblib.Parallel` that uses them, for the time of a ``with`` block."""
        import joblib  # noqa: PLC0415  what runs in one process does not need it

        with _without_current_folder():
            if self.backend == "dask":
                with _dask(self.jobs, self.scheduler), joblib.parallel_config(backend="dask"):
                    yield joblib.Parallel(n_jobs=-1, return_as="generator_unordered", batch_size=1)
            elif self.backend == "ray":
                with _ray(self.jobs, self.scheduler) as jobs, joblib.parallel_config(backend="ray"):
                    yield joblib.Parallel(n_jobs=jobs, batch_size=1)
            else:
                # Workers of Dask and Ray end with their parent by themselves; helpers of a killed Ray may stay.
                watch: dict[str, Any] = {"initializer": _end_with_parent, "initargs": (os.getpid(),)}
                try:
                    yield joblib.Parallel(n_jobs=self.jobs, return_as="generator_unordered", batch_size=1, **watch)
                except KeyboardInterrupt:
                    joblib.externals.loky.get_reusable_executor().shutdown(wait=False, kill_workers=True)
                    raise


@contextmanager
def _without_current_folder() -> Iterator[None]:
    """Let workers start without the current folder on their path: it may hold a stranger's files."""
    before = os.environ.get(_SAFE_PATH)
    os.environ[_SAFE_PATH] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[_SAFE_PATH]
        else:
            os.environ[_SAFE_PATH] = before


def _end_with_parent(parent: int) -> None:
    """End this worker of loky when its parent has ended: loky passes no pipe whose end tells so."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_ASK_EVERY_S)
        psutil.Process().kill()

    threading.Thread(target=watch, name="taxel-parent", daemon=True).start()


@contextmanager
def _dask(jobs: int, scheduler: str | None) -> Iterator[None]:
    from distributed import Client, LocalCluster  # noqa: PLC0415  an extra

    if scheduler is not None:
        try:
            client = Client(scheduler, timeout="5s")  # type: ignore[no-untyped-call]
        except (OSError, ValueError) as error:
            raise DeviceError(f"{scheduler}: no Dask scheduler answers at this address ({error})") from None
        with client:
            yield
        return
    with (
        LocalCluster(  # type: ignore[no-untyped-call]
            n_workers=jobs,
            threads_per_worker=1,
            host="127.0.0.1",
            dashboard_address=None,
            silence_logs=logging.CRITICAL,
        ) as cluster,
        Client(cluster),  # type: ignore[no-untyped-call]
    ):
        yield


@contextmanager
def _in_folder(folder: str) -> Iterator[None]:
    """Run a block in another current folder."""
    here = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(here)


@contextmanager
def _with_handler(number: signal.Signals) -> Iterator[None]:
    """Keep the handler of a signal, which Ray replaces."""
    handler = signal.getsignal(number)
    try:
        yield
    finally:
        if handler is not None and threading.current_thread() is threading.main_thread():
            signal.signal(number, handler)


@contextmanager
def _ray(jobs: int, scheduler: str | None) -> Iterator[int]:
    # Without this a call after its end, as after Ctrl-C, starts another Ray.
    os.environ["RAY_ENABLE_AUTO_CONNECT"] = "0"
    import ray  # noqa: PLC0415  an extra
    from ray.util.joblib import register_ray  # noqa: PLC0415

    quiet: dict[str, Any] = {"log_to_driver": False, "logging_level": logging.ERROR}
    # Ray adds the current folder to the path of its workers, which run there, whatever the environment says.
    with tempfile.TemporaryDirectory() as empty:
        try:
            with _in_folder(empty), _with_handler(signal.SIGTERM):
                if scheduler is None:
                    ray.init(num_cpus=jobs, include_dashboard=False, _node_ip_address="127.0.0.1", **quiet)
                else:
                    ray.init(address=scheduler, **quiet)
        except (ConnectionError, ValueError, RuntimeError) as error:
            raise DeviceError(f"Ray does not start: {' '.join(str(error).split())}") from None
        try:
            register_ray()  # type: ignore[no-untyped-call]
            yield int(ray.cluster_resources().get("CPU", jobs))  # type: ignore[no-untyped-call]
        finally:
            ray.shutdown()


#: This process alone.
HERE = Workers()


def run(
    realise: Callable[[dict[str, Any], int], Any],
    tasks: Sequence[Task],
    results: Results,
    *,
    workers: Workers = HERE,
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
    workers : Workers
    title : str
        What the progress line says.
    quiet : bool
        No progress line.

    Raises
    ------
    DeviceError : a cluster that does not answer
    """
    wanted = list({t.key(results.code): t for t in tasks if t not in results}.values())
    if not wanted:
        return
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, TimeRemainingColumn(), disable=quiet) as progress:
        bar = progress.add_task(title, total=len(tasks), completed=len(tasks) - len(wanted))
        for task, result, seconds in _realised(realise, wanted, workers):
            results.add(task, result, seconds)
            progress.advance(bar)


def _realised(
    realise: Callable[[dict[str, Any], int], Any], tasks: Sequence[Task], workers: Workers
) -> Iterator[tuple[Task, Any, float]]:
    if workers == HERE:
        for task in tasks:
            yield (task, *_one(realise, task))
        return
    import joblib  # noqa: PLC0415  what runs in one process does not need it

    calls = [joblib.delayed(_numbered)(realise, k, task) for k, task in enumerate(tasks)]
    with workers.joblib() as parallel:
        # joblib gives Ray's results in a list at the end of a call only: a call for a few of them at a time.
        size = 8 * parallel.n_jobs if workers.backend == "ray" else len(calls)
        for first in range(0, len(calls), size):
            for k, result, seconds in parallel(calls[first : first + size]):
                yield tasks[k], result, seconds


def _one(realise: Callable[[dict[str, Any], int], Any], task: Task) -> tuple[Any, float]:
    begun = process_time()
    result = realise(task.params, task.seed)
    return result, process_time() - begun


def _numbered(realise: Callable[[dict[str, Any], int], Any], k: int, task: Task) -> tuple[int, Any, float]:
    return (k, *_one(realise, task))
