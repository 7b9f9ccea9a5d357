"""The runner of studies: each result is computed once, however a run ends."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from taxel import DeviceError, ProblemError
from taxel_studies.runner import Results, Task, Workers, run

CALLS: list[int] = []


def square(params: dict, seed: int) -> dict:
    CALLS.append(params["x"])
    return {"y": params["x"] ** 2 + seed}


def stops_at_three(params: dict, seed: int) -> dict:
    if params["x"] == 3:
        raise KeyboardInterrupt
    return square(params, seed)


def workers(backend: str) -> Workers:
    if backend == "here":
        return Workers()
    pytest.importorskip({"loky": "joblib", "dask": "distributed", "ray": "ray"}[backend])
    return Workers(2, backend)


def tasks(count: int) -> list[Task]:
    return [Task({"x": x}, seed=1) for x in range(count)]


def fails_at_twenty(params: dict, seed: int) -> dict:
    if params["x"] == 20:
        time.sleep(0.5)
        raise ZeroDivisionError
    return square(params, seed)


def process_number(_params: dict, _seed: int) -> dict:
    time.sleep(0.1)
    return {"pid": os.getpid()}


@pytest.fixture(autouse=True)
def _forget(monkeypatch):
    CALLS.clear()
    # A cluster's processes import these functions by name, as they would an installed package.
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent), prepend=os.pathsep)


@pytest.mark.parametrize(
    "backend",
    # A cluster takes ten seconds of processor time to start: the results of one are looked at beside its errors, below.
    ["here", "loky", *(pytest.param(cluster, marks=pytest.mark.slow) for cluster in ("dask", "ray"))],
)
def test_each_task_has_its_result(tmp_path, backend):
    """Dask and Ray start two worker processes on loopback."""
    results = Results(tmp_path / "results.jsonl", "code")
    run(square, tasks(4), results, workers=workers(backend), quiet=True)
    again = Results(tmp_path / "results.jsonl", "code")
    assert [again[t]["y"] for t in tasks(4)] == [1, 2, 5, 10]
    rows = [json.loads(line) for line in (tmp_path / "results.jsonl").read_text().splitlines()]
    assert {(row["params"]["x"], row["seed"], row["code"]) for row in rows} == {(x, 1, "code") for x in range(4)}


def test_what_is_there_is_not_run_again(tmp_path):
    run(square, tasks(3), Results(tmp_path / "r.jsonl", "code"), quiet=True)
    CALLS.clear()
    run(square, tasks(5), Results(tmp_path / "r.jsonl", "code"), quiet=True)
    assert CALLS == [3, 4]


def test_the_same_task_twice_in_a_list_runs_once(tmp_path):
    run(square, tasks(2) + tasks(2), Results(tmp_path / "r.jsonl", "code"), quiet=True)
    assert CALLS == [0, 1]


def test_results_of_other_code_count_no_more(tmp_path):
    run(square, tasks(2), Results(tmp_path / "r.jsonl", "old"), quiet=True)
    CALLS.clear()
    run(square, tasks(2), Results(tmp_path / "r.jsonl", "new"), quiet=True)
    assert CALLS == [0, 1]
    assert len((tmp_path / "r.jsonl").read_text().splitlines()) == 4


def test_a_stop_keeps_what_was_done_and_the_next_run_goes_on(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        run(stops_at_three, tasks(6), Results(tmp_path / "r.jsonl", "code"), quiet=True)
    CALLS.clear()
    run(square, tasks(6), Results(tmp_path / "r.jsonl", "code"), quiet=True)
    assert CALLS == [3, 4, 5]


def test_a_line_cut_short_by_a_kill_is_dropped(tmp_path):
    path = tmp_path / "r.jsonl"
    run(square, tasks(3), Results(path, "code"), quiet=True)
    whole = path.read_bytes()
    path.write_bytes(whole[:-9])
    CALLS.clear()
    run(square, tasks(3), Results(path, "code"), quiet=True)
    assert CALLS == [2]
    assert [json.loads(line)["result"]["y"] for line in path.read_text().splitlines()] == [1, 2, 5]


def test_a_file_of_something_else_is_refused(tmp_path):
    (tmp_path / "r.jsonl").write_text('{"hello": 1}\n')
    with pytest.raises(ProblemError, match="a line is not a result"):
        Results(tmp_path / "r.jsonl", "code")


@pytest.mark.parametrize("backend", ["here", "loky", "dask", pytest.param("ray", marks=pytest.mark.slow)])
def test_what_was_done_before_an_error_is_kept(tmp_path, backend):
    """A realisation that raises ends the run with its own error; the next run begins where it stood."""
    with pytest.raises(ZeroDivisionError):
        run(fails_at_twenty, tasks(24), Results(tmp_path / "r.jsonl", "code"), workers=workers(backend), quiet=True)
    results = Results(tmp_path / "r.jsonl", "code")
    assert sum(t in results for t in tasks(24)) >= 16
    run(square, tasks(24), results, quiet=True)
    assert [results[t]["y"] for t in tasks(24)] == [x * x + 1 for x in range(24)]


def test_a_dask_cluster_that_runs_already_is_used(tmp_path):
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None
    ) as cluster:
        results = Results(tmp_path / "r.jsonl", "code")
        run(
            process_number,
            tasks(6),
            results,
            workers=Workers(backend="dask", scheduler=cluster.scheduler_address),
            quiet=True,
        )
        of_the_cluster = {worker.process.pid for worker in cluster.workers.values()}
    used = {results[t]["pid"] for t in tasks(6)}
    assert used <= of_the_cluster
    assert os.getpid() not in used


def test_a_dask_scheduler_that_is_not_there_is_told(tmp_path):
    pytest.importorskip("distributed")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    nobody = Workers(backend="dask", scheduler=f"tcp://127.0.0.1:{port}")
    with pytest.raises(DeviceError, match="no Dask scheduler answers at this address"):
        run(square, tasks(1), Results(tmp_path / "r.jsonl", "code"), workers=nobody, quiet=True)


@pytest.mark.parametrize("backend", ["dask", "ray"])
def test_a_backend_that_is_not_installed_names_its_extra(monkeypatch, backend):
    monkeypatch.setattr("taxel._base.parallel.find_spec", lambda name: None)
    with pytest.raises(ProblemError, match=r"taxel\[cluster\]"):
        Workers(backend=backend)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"jobs": 0}, "jobs is 0"),
        ({"jobs": "two"}, "jobs is 'two'"),
        ({"backend": "slurm"}, "backend is 'slurm'"),
        ({"scheduler": 3}, "scheduler is 3"),
        ({"scheduler": "tcp://127.0.0.1:9"}, "scheduler is for the backends"),
    ],
)
def test_nonsense_about_workers_is_refused(arguments, message):
    with pytest.raises(ProblemError, match=message):
        Workers(**arguments)


@pytest.mark.parametrize("who", ["Workers()", "Workers(2)", "Workers(2, 'dask')"])
def test_ctrl_c_ends_promptly(tmp_path, who):
    if "dask" in who:
        pytest.importorskip("distributed")
    code = (
        "import time\nfrom pathlib import Path\nfrom taxel_studies.runner import Results, Task, Workers, run\n"
        "def first_is_quick(p, s):\n    if p['x']:\n        time.sleep(60)\n"
        "if __name__ == '__main__':\n"
        f"    results = Results(Path({str(tmp_path)!r}) / 'r.jsonl', 'c')\n"
        f"    run(first_is_quick, [Task({{'x': k}}) for k in range(4)], results, workers={who}, quiet=True)\n"
    )
    script = tmp_path / "script.py"
    script.write_text(code)
    process = subprocess.Popen([sys.executable, str(script)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        deadline = time.monotonic() + 60
        while not (tmp_path / "r.jsonl").exists() and time.monotonic() < deadline:
            time.sleep(0.05)
        os.kill(process.pid, signal.SIGINT)
        assert process.wait(timeout=20) != 0
    finally:
        process.kill()
        process.wait()
    assert len((tmp_path / "r.jsonl").read_text().splitlines()) == 1
