"""Runs independent calls in this process, in processes beside it, or on a cluster, by joblib's backends.

Results are given as each is known, with the number of its call; they do not depend on who computes them.
"""

from __future__ import annotations

import atexit
import logging
import os
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import chdir, contextmanager, redirect_stdout, suppress
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import psutil

from taxel._base.arguments import integer, text
from taxel._base.messages import collected
from taxel._core import DeviceError, Error, ProblemError

if TYPE_CHECKING:
    import joblib

_T = TypeVar("_T")
_R = TypeVar("_R")

#: Where calls may run: in loky's processes on this machine, or on a cluster.
BACKENDS = ("loky", "dask", "ray")

#: How many calls each worker gets at most: few enough to cost little, many enough to end at about the same time.
_CALLS_A_WORKER = 8
#: The variable with which Python adds neither the current folder nor a script's to its path.
_SAFE_PATH = "PYTHONSAFEPATH"
#: Interval at which a worker looks whether its parent runs, s.
_ASK_EVERY_S = 0.5


class Tried(NamedTuple):
    """Hold what a call returned, or the error by which it failed, and its warnings."""

    result: Any
    error: Exception | None
    warnings: tuple[str, ...]

    @property
    def failure(self) -> str:
        """Why it failed, in words; "" where it did not."""
        return "" if self.error is None else str(self.error) or type(self.error).__name__


@dataclass(frozen=True)
class Workers:
    """Name the processes that work on many recordings, folds or realisations.

    Parameters
    ----------
    jobs : int, 1 or more
        Number of processes; with 1 of loky everything stays in this one. Of a cluster that runs already, all are taken.
    backend : {"loky", "dask", "ray"}
        Who runs them: loky (processes here), dask or ray (a cluster).
    scheduler : str, optional
        Address of a running Dask or Ray cluster; otherwise a cluster starts here.

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
        """Refuse what cannot run."""
        object.__setattr__(self, "jobs", integer("jobs", self.jobs, 1))
        text("backend", self.backend, BACKENDS)
        if self.scheduler is not None:
            text("scheduler", self.scheduler)
            if self.backend == "loky":
                raise ProblemError('scheduler is for the backends "dask" and "ray": loky has its processes here')
        package = {"dask": "distributed", "ray": "ray"}.get(self.backend)
        if package is not None and find_spec(package) is None:
            raise ProblemError(
                f"backend \"{self.backend}\" needs the package {package}: install it by pip install 'taxel[cluster]'"
            )

    @property
    def are_here(self) -> bool:
        """Whether all calls run in this process."""
        return self.jobs == 1 and self.backend == "loky"

    def run(self, work: Callable[[_T], _R], each: Sequence[_T]) -> Iterator[tuple[int, _R]]:
        """Yield the number and the result of each call as it is known; the first error of one ends all.

        Parameters
        ----------
        work : function
            Of a module, so that other processes find it; with arguments and results that can be pickled.
        each : sequence
            What it is called with.

        Raises
        ------
        DeviceError : a cluster that does not answer
        """
        if self.are_here:
            yield from ((k, work(one)) for k, one in enumerate(each))
            return
        import joblib  # noqa: PLC0415  what runs in one process does not need it

        with self._parallel() as parallel:
            # A call of a cluster costs a good part of a second: several of `each` share one.
            workers = joblib.effective_n_jobs(parallel.n_jobs) if parallel.n_jobs < 0 else parallel.n_jobs
            share = max(len(each) // (_CALLS_A_WORKER * workers), 1)
            parts = [range(first, min(first + share, len(each))) for first in range(0, len(each), share)]
            calls = [joblib.delayed(_numbered)(work, part, [each[k] for k in part]) for part in parts]
            # joblib gives Ray's results in a list at the end of a call only: a call for a few of them at a time.
            size = workers if self.backend == "ray" else len(calls)
            for first in range(0, len(calls), size):
                for results in parallel(calls[first : first + size]):
                    yield from results

    def tried(self, work: Callable[[_T], Any], each: Sequence[_T], show: Callable[[int, int], object]) -> list[Tried]:
        """Return what each call returned, or why it failed, in their order.

        Parameters
        ----------
        work, each
            As of `run`.
        show : function
            Called after each call with its number, and with how many are done.
        """
        found: dict[int, Tried] = {}
        for k, one in self.run(partial(_tried, work), each):
            found[k] = one
            show(k, len(found))
        return [found[k] for k in range(len(each))]

    @contextmanager
    def _parallel(self) -> Iterator[joblib.Parallel]:
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
                # Before the program waits for its children, of which idle workers are some.
                atexit.unregister(_end_workers)
                atexit.register(_end_workers)
                try:
                    yield joblib.Parallel(n_jobs=self.jobs, return_as="generator_unordered", batch_size=1, **watch)
                except (KeyboardInterrupt, RuntimeError) as error:
                    if not any(isinstance(one, KeyboardInterrupt) for one in (error, error.__context__)):
                        raise
                    # A loky that was interrupted while it began cannot end; its workers see that this process has.
                    with suppress(RuntimeError):
                        _end_workers()
                    raise KeyboardInterrupt from None


#: This process alone.
HERE = Workers()


def _tried(work: Callable[[Any], Any], one: Any) -> Tried:
    result, failure = None, None
    with collected() as warnings:
        try:
            result = work(one)
        except (Error, OSError, MemoryError) as error:
            failure = error
    return Tried(result, failure, tuple(warnings))


def _numbered(work: Callable[[_T], _R], numbers: Iterable[int], each: Iterable[_T]) -> list[tuple[int, _R]]:
    return [(k, work(one)) for k, one in zip(numbers, each, strict=True)]


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


def _end_workers() -> None:
    """End the workers of loky, which stay for the next call."""
    from joblib.externals.loky import get_reusable_executor  # noqa: PLC0415  what runs in one process does not need it

    get_reusable_executor(reuse=True).shutdown(wait=False, kill_workers=True)


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
            with chdir(empty), _with_handler(signal.SIGTERM):
                if scheduler is None:
                    ray.init(num_cpus=jobs, include_dashboard=False, _node_ip_address="127.0.0.1", **quiet)
                else:
                    ray.init(address=scheduler, **quiet)
        except (ConnectionError, ValueError, RuntimeError) as error:
            raise DeviceError(f"Ray does not start: {' '.join(str(error).split())}") from None
        try:
            register_ray()  # type: ignore[no-untyped-call]
            # Ray prints that it runs a call again, however quiet: what a command prints may be read by a program.
            with redirect_stdout(sys.stderr):
                yield int(ray.cluster_resources().get("CPU", jobs))  # type: ignore[no-untyped-call]
        finally:
            ray.shutdown()
