"""The runner of studies: each result once, whatever stops it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time

import pytest

from taxel import ProblemError
from taxel.studies.runner import Results, Task, run

CALLS: list[int] = []


def square(params: dict, seed: int) -> dict:
    CALLS.append(params["x"])
    return {"y": params["x"] ** 2 + seed}


def stops_at_three(params: dict, seed: int) -> dict:
    if params["x"] == 3:
        raise KeyboardInterrupt
    return square(params, seed)


def tasks(count: int) -> list[Task]:
    return [Task({"x": x}, seed=1) for x in range(count)]


@pytest.fixture(autouse=True)
def _forget():
    CALLS.clear()


@pytest.mark.parametrize("jobs", [1, 2])
def test_each_task_has_its_result(tmp_path, jobs):
    results = Results(tmp_path / "results.jsonl", "code")
    run(square, tasks(4), results, jobs=jobs, quiet=True)
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
    with pytest.raises(ProblemError, match="holds a line that is no result"):
        Results(tmp_path / "r.jsonl", "code")


def test_no_jobs_are_refused(tmp_path):
    with pytest.raises(ProblemError, match="jobs is 0"):
        run(square, tasks(1), Results(tmp_path / "r.jsonl", "code"), jobs=0)


@pytest.mark.parametrize("jobs", [1, 2])
def test_ctrl_c_ends_promptly(tmp_path, jobs):
    code = (
        "import time\nfrom pathlib import Path\nfrom taxel.studies.runner import Results, Task, run\n"
        f"tasks = [Task({{'x': k}}) for k in range(4)]\nresults = Results(Path({str(tmp_path)!r}) / 'r.jsonl', 'c')\n"
        "print('ready', flush=True)\n"
        f"run(lambda p, s: time.sleep(60), tasks, results, jobs={jobs}, quiet=True)\n"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    try:
        assert process.stdout is not None
        process.stdout.readline()
        time.sleep(1.5)
        os.kill(process.pid, signal.SIGINT)
        assert process.wait(timeout=20) != 0
    finally:
        process.kill()
        process.wait()
