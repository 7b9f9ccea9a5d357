"""The runner of studies: each result is computed once, however a run ends."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from taxel.tasks import Workers
from taxel_studies.runner import Kept, Task, run

CALLS: list[int] = []


def square(params: dict, seed: int) -> dict:
    CALLS.append(params["x"])
    return {"y": params["x"] ** 2 + seed}


def stops_at_three(params: dict, seed: int) -> dict:
    if params["x"] == 3 and os.environ.get("STOP"):
        raise KeyboardInterrupt
    return square(params, seed)


def fails_at_twenty(params: dict, seed: int) -> dict:
    if params["x"] == 20 and Path(params["fails while"]).exists():
        time.sleep(0.5)
        raise ZeroDivisionError
    return square(params, seed)


def workers(backend: str) -> Workers:
    if backend == "here":
        return Workers()
    pytest.importorskip({"loky": "joblib", "dask": "distributed", "ray": "ray"}[backend])
    return Workers(2, backend)


def tasks(count: int) -> list[Task]:
    return [Task({"x": x}, seed=1) for x in range(count)]


@pytest.fixture
def kept(tmp_path: Path) -> Kept:
    return Kept(tmp_path / "cache", "0123abc")


@pytest.fixture(autouse=True)
def _forget(monkeypatch):
    CALLS.clear()
    # A cluster's processes import these functions by name, as they would an installed package.
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent), prepend=os.pathsep)


@pytest.mark.parametrize(
    "backend",
    # A cluster takes ten seconds of processor time to start.
    ["here", "loky", *(pytest.param(cluster, marks=pytest.mark.slow) for cluster in ("dask", "ray"))],
)
def test_each_task_has_its_result(kept, backend):
    """Dask and Ray start two worker processes on loopback."""
    for _ in range(2):
        rows = run(square, tasks(4), kept, workers=workers(backend), quiet=True)
        assert [(row.params["x"], row.seed, row.result["y"]) for row in rows] == [(x, 1, x * x + 1) for x in range(4)]
    assert all(kept.has(square, task) for task in tasks(4))
    assert not kept.has(square, Task({"x": 1}, seed=2))


def test_what_is_there_is_not_run_again_and_a_cut_file_is(kept):
    run(square, tasks(3), kept, quiet=True)
    CALLS.clear()
    run(square, tasks(5), kept, quiet=True)
    assert CALLS == [3, 4]
    for file in kept.folder.rglob("output.pkl"):
        file.write_bytes(file.read_bytes()[:9])
    rows = run(square, tasks(5), kept, quiet=True)
    assert [row.result["y"] for row in rows] == [x * x + 1 for x in range(5)]


def test_results_of_other_code_count_no_more(kept):
    run(square, tasks(2), kept, quiet=True)
    CALLS.clear()
    run(square, tasks(2), Kept(kept.folder, "4567def"), quiet=True)
    assert CALLS == [0, 1]


def test_what_is_shared_is_made_once_by_the_same_code(kept):
    for code in ("0123abc", "0123abc", "4567def"):
        assert Kept(kept.folder, code).made(square, {"x": 3}, 1) == {"y": 10}
    assert CALLS == [3, 3]


def test_a_stop_keeps_what_was_done_and_the_next_run_goes_on(kept, monkeypatch):
    monkeypatch.setenv("STOP", "1")
    with pytest.raises(KeyboardInterrupt):
        run(stops_at_three, tasks(6), kept, quiet=True)
    CALLS.clear()
    monkeypatch.delenv("STOP")
    run(stops_at_three, tasks(6), kept, quiet=True)
    assert CALLS == [3, 4, 5]


@pytest.mark.parametrize("backend", ["here", "loky"])
def test_what_was_done_before_an_error_is_kept(kept, backend, tmp_path):
    """A realisation that raises ends the run with its own error; the next run begins where it stood."""
    (tmp_path / "stop").touch()
    wanted = [Task({"x": x, "fails while": str(tmp_path / "stop")}, seed=1) for x in range(24)]
    with pytest.raises(ZeroDivisionError):
        run(fails_at_twenty, wanted, kept, workers=workers(backend), quiet=True)
    assert sum(kept.has(fails_at_twenty, t) for t in wanted) >= 16
    (tmp_path / "stop").unlink()
    rows = run(fails_at_twenty, wanted, kept, quiet=True)
    assert [row.result["y"] for row in rows] == [x * x + 1 for x in range(24)]
