"""``taxel bench``: the list of goals, the table of a result, what is measured beside it, what is refused."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
from tests.shell import call

import taxel_benchmarks
from taxel_benchmarks import _command, _rounds
from taxel_benchmarks._command import _better, _Others, _table, goals_of, load

PACKAGE = Path(taxel_benchmarks.__file__).parent
RESULTS = PACKAGE.parent / "results"
BENCHMARKS = sorted(path.stem for path in PACKAGE.glob("[!_]*.py"))

BENCHMARK = '''"""How fast is it?"""
from taxel_benchmarks._goals import at_least
from taxel_benchmarks._shared import often
from taxel.metrics import distance_of

def run(*, quick):
    return often(distance_of)

def goals(result):
    return at_least({"a": 3.0}, result)
'''


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The folder of the package, of a benchmark with a result and of one without."""
    folder = tmp_path / "taxel_benchmarks"
    (folder / "results").mkdir(parents=True)
    monkeypatch.setattr(taxel_benchmarks, "__path__", [str(folder)])
    before = set(sys.modules)
    (folder / "fast.py").write_text(BENCHMARK.replace("distance_of", "victor_purpura"))
    (folder / "other.py").write_text(BENCHMARK.replace("distance_of", "van_rossum"))
    (folder / "_shared.py").write_text("def often(run):\n    return 3\n")
    shutil.copy(PACKAGE / "_goals.py", folder)
    (folder / "results" / "fast.json").write_text(json.dumps({"ratios": {}}))
    yield folder
    for name in set(sys.modules) - before:
        if name.startswith("taxel_benchmarks."):
            del sys.modules[name]


def test_a_result_of_changed_code_is_refused(folder: Path, capsys, monkeypatch: pytest.MonkeyPatch) -> None:
    result = {"ratios": {"a": 3.0}, "machine": {"cores": 2, "others": 0.0}}
    monkeypatch.setattr(_command, "_run", lambda name, quick: json.loads(json.dumps(result)))
    place = folder / "results" / "fast.json"
    before = place.read_text()
    for code, refused in (("0123abc with local changes, 1", True), ("0123abc", False)):
        monkeypatch.setattr("taxel_studies.commit.code_version", lambda *packages, code=code: code)
        assert call(capsys, "bench", "fast", "--quick", "--results", folder / "results")[0] == 0
        assert place.read_text() == before
        ended, _, err = call(capsys, "bench", "fast", "--results", folder / "results")
        assert (ended, "local changes since the last commit" in err) == ((2, True) if refused else (0, False))
    assert json.loads(place.read_text())["ratios"] == {"a": 3.0}


def test_a_result_is_saved_in_a_folder_that_is_there_alone(folder: Path, capsys) -> None:
    code, _, err = call(capsys, "bench", "fast", "--results", folder / "absent")
    assert code == 2
    assert "absent: no such folder; run this in a checkout of taxel, or name it by --results" in err
    assert not (folder / "absent").exists()


JUDGED = (
    BENCHMARK.replace("distance_of", "victor_purpura")
    .replace(
        'at_least({"a": 3.0}, result)',
        'at_least({"a": 3.0}, result["ratios"]) + at_most({"b": 2.0}, result["ratios"]) + not_slower(result, "c")',
    )
    .replace("import at_least", "import at_least, at_most, not_slower")
)
MET = {"ratios": {"a": 3.0, "b": 2.0, "c": 1.0}}
ALL = """\
  reached               3 >= 3          a
  reached               2 <= 2          b
  reached               1 >= 1          c
"""
QUIET = {"cpu": "one, AVX2", "others": 0.04, "cores": 2}


@pytest.mark.parametrize(
    ("result", "said"),
    [
        (
            MET | {"machine": QUIET},
            f"fast: 3 of 3 goals reached\n  one, AVX2; commit 0123abc; other programs used 0.0 of 2 cores\n{ALL}",
        ),
        (
            MET | {"ratios": {"a": 3.0, "b": 2.5, "c": 4.0}, "larger": ["c"], "machine": QUIET, "date": "2026-11-25"},
            "fast: 2 of 3 goals reached\n  one, AVX2; commit 0123abc, 2026-11-25; other programs used 0.0 of 2 cores\n"
            "  not reached         2.5 <= 2          b\n"
            "  reached               3 >= 3          a\n"
            "  reached             > 4 >= 1          c\n",
        ),
        (
            {"ratios": {"a": 2.9996, "b": 2.5}, "spread": {"a": [2.6, 3.1234]}, "machine": QUIET | {"others": 0.7}},
            "fast: 0 of 3 goals reached\n  one, AVX2; commit 0123abc; other programs used 0.7 of 2 cores\n"
            "  not reached      2.9996 >= 3          a (2.6 to 3.12)\n"
            "  not reached         2.5 <= 2          b\n"
            "  not measured            >= 1          c\n",
        ),
        (
            MET | {"machine": {"load": 9.7, "cores": 2}},
            "fast: 3 of 3 goals reached\n"
            "  unknown processor; commit 0123abc; what other programs used was not measured,\n  load 9.7\n"
            f"{ALL}",
        ),
        (
            MET | {"machine": QUIET, "stable": False},
            "fast: 3 of 3 goals reached\n"
            "  one, AVX2; commit 0123abc; other programs used 0.0 of 2 cores; not stable by\n"
            "  its own judgement\n" + ALL,
        ),
        (
            MET
            | {"results": {name: {"cpu_s": 1.0, "stable": name == "c"} for name in "abcde"}, "avx2": {"results": {}}}
            | {"machine": QUIET},
            "fast: 3 of 3 goals reached\n"
            "  one, AVX2; commit 0123abc; other programs used 0.0 of 2 cores; quartiles more\n"
            "  than 15 % of the median apart: a; b and 2 more\n" + ALL,
        ),
    ],
)
def test_the_list_of_goals_says_what_is_reached_on_what_beside_what_and_of_which_commit(
    folder: Path, capsys, result: dict, said: str
) -> None:
    (folder / "fast.py").write_text(JUDGED)
    (folder / "results" / "fast.json").write_text(json.dumps({"commit": "0123abc", **result}))
    code, out, _ = call(capsys, "bench", "--goals", "--results", folder / "results")
    assert code == 1
    assert out.startswith(said)
    assert "\n\nother: no result\n\n3 goals: " in out
    assert max(map(len, out.splitlines())) <= 80


@pytest.mark.parametrize(("b", "code"), [(2.0, 0), (2.5, 1), (None, 1)])
def test_goals_that_are_not_reached_or_not_measured_end_with_1(
    folder: Path, capsys, b: float | None, code: int
) -> None:
    (folder / "fast.py").write_text(JUDGED)
    ratios = {name: one for name, one in (MET["ratios"] | {"b": b}).items() if one is not None}
    (folder / "results" / "fast.json").write_text(json.dumps({"ratios": ratios}))
    assert call(capsys, "bench", "fast", "--goals", "--results", folder / "results")[0] == code


def test_benchmarks_are_listed_with_what_they_took(folder: Path, capsys) -> None:
    (folder / "results" / "fast.json").write_text(json.dumps({"took_s": 12.4}))
    code, out, _ = call(capsys, "bench", "--results", folder / "results")
    assert (code, out.splitlines()) == (
        0,
        [f"fast{'12 s':>33}  How fast is it?", f"other{'no result':>32}  How fast is it?"],
    )


@pytest.mark.parametrize("saved", [{}, {"left out": {}}, {"left out": {"peer": "not installed"}}, None])
def test_a_result_with_peers_is_not_replaced_by_one_without(
    folder: Path, capsys, monkeypatch: pytest.MonkeyPatch, saved: dict | None
) -> None:
    monkeypatch.setattr(
        _command,
        "_run",
        lambda name, quick: {"ratios": {"of the run": 1.0}, "machine": {"cores": 2}, "left out": {"peer": "absent"}},
    )
    monkeypatch.setattr("taxel_studies.commit.code_version", lambda *packages: "0123abc")
    place = folder / "results" / "fast.json"
    place.unlink()
    if saved is not None:
        place.write_text(json.dumps({"took_s": 1.0} | saved))
    code, _, err = call(capsys, "bench", "fast", "--results", folder / "results")
    if saved is None or saved.get("left out"):
        assert code == 0
        assert "of the run" in place.read_text()
        assert re.fullmatch(r"\d{4}-\d\d-\d\d", json.loads(place.read_text())["date"])
    else:
        assert code
        assert "has peer, which is left out here; make bench" in err
        assert json.loads(place.read_text()) == {"took_s": 1.0} | saved


@pytest.mark.parametrize("name", BENCHMARKS)
def test_the_table_says_which_way_a_figure_is_better_as_its_goal_does(name: str) -> None:
    result = json.loads((RESULTS / f"{name}.json").read_text())
    benchmark = load(name)
    for goal in goals_of(benchmark, result):
        if goal.what in result.get("ratios", {}):
            assert _better(goal.what, benchmark) == f"{'smaller' if goal.at_most else 'larger'} is better"
    stated = (*getattr(benchmark, "SMALLER", ()), *getattr(benchmark, "COUNTS", ()))
    # What earlier code did not measure has no row yet.
    assert all(word in (PACKAGE / f"{name}.py").read_text() for word in stated)


def test_the_table_groups_figures_and_says_of_bounds_that_they_are_bounds() -> None:
    result = {"ratios": {"a": 3.0, "b, cores": 2.0, "touches": 5}, "spread": {"a": [2.5, 3.5]}, "larger": ["a"]}
    benchmark = SimpleNamespace(goals=lambda result: [], SMALLER=("cores",), COUNTS=("touches",))
    assert _table("fast", result | {"took_s": 2.0, "machine": QUIET}, benchmark)[1:] == [
        "  larger is better:",
        "    a: > 3 (2.5 to 3.5)",
        "  smaller is better:",
        "    b, cores: 2",
        "  counts:",
        "    touches: 5",
    ]


def test_the_list_of_goals_ends_with_how_many_are_reached(folder: Path, capsys) -> None:
    (folder / "fast.py").write_text(JUDGED)
    saved = {"ratios": {"a": 3.0, "b": 2.5}}
    (folder / "results" / "fast.json").write_text(json.dumps(saved))
    out = call(capsys, "bench", "--goals", "--results", folder / "results")[1]
    last = "3 goals: 1 reached, 1 not reached, 1 not measured\n"
    assert out.endswith(last)


def test_the_list_of_all_goals_fits_a_terminal(capsys) -> None:
    out = call(capsys, "bench", "--goals", "--results", RESULTS)[1]
    assert [line for line in out.splitlines() if len(line) > 80] == []


@pytest.mark.parametrize("name", BENCHMARKS)
def test_each_benchmark_states_goals_and_judges_its_saved_result(name: str) -> None:
    result = json.loads((RESULTS / f"{name}.json").read_text())
    goals = goals_of(load(name), result)
    assert goals
    assert [goal.what for goal in goals if goal.figure is None] == [], f"run taxel bench {name}"


def test_avx2_is_judged_by_the_same_goals_beside_the_best(folder: Path) -> None:
    """A figure that is the same with both is listed once."""
    (folder / "fast.py").write_text(JUDGED)
    result = {"ratios": MET["ratios"] | {"AVX2: a": 2.0, "AVX2: c": 1.5}, "avx2": {}}
    found = [(goal.what, goal.figure, goal.reached) for goal in goals_of(load("fast"), result)]
    best = [("a", 3.0, True), ("b", 2.0, True), ("c", 1.0, True)]
    assert found == [*best, ("AVX2: a", 2.0, False), ("AVX2: c", 1.5, True)]
    del result["avx2"]
    assert [what for what, *_ in best] == [goal.what for goal in goals_of(load("fast"), result)]


@pytest.mark.parametrize(
    ("flags", "said"), [("avx2 avx512f", "EPYC, AVX-512"), ("sse avx2", "EPYC, AVX2"), ("sse", "EPYC")]
)
def test_a_processor_is_its_model_and_its_widest_vectors(
    monkeypatch: pytest.MonkeyPatch, flags: str, said: str
) -> None:
    text = f"processor\t: 0\nmodel name\t: EPYC\nflags\t\t: fpu {flags}\n\n"
    monkeypatch.setattr(_rounds, "_read", lambda path: (2 * text).splitlines())
    assert _rounds.processor() == said


def test_a_benchmark_runs_in_a_process_of_its_own_on_no_other_calls(folder: Path) -> None:
    """A peer that looks through the stack does not pay for the command line."""
    for shared in PACKAGE.glob("_*.py"):
        shutil.copy(shared, folder)

    def bench() -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "taxel", "bench", "fast", "--quick"],
            env=os.environ | {"PYTHONPATH": str(folder.parent)},
            capture_output=True,
            text=True,
            check=False,
        )

    text = (folder / "fast.py").read_text()
    calls = 'return {"ratios": {"calls": len(inspect.stack())}, "machine": {"cores": 2}}'
    (folder / "fast.py").write_text("import inspect\n" + text.replace("return often(victor_purpura)", calls))
    done = bench()
    # Those that start a child process are few beside the command line's.
    found = re.search(r"  calls: (\d+)\n", done.stdout)
    assert found, done.stderr
    assert int(found[1]) < 10
    (folder / "fast.py").write_text(text.replace("return often(victor_purpura)", 'raise SystemExit("broken")'))
    assert "fast: ended with status 1" in bench().stderr


def test_help_comes_before_what_measures_and_what_draws() -> None:
    code = "import sys; from taxel.cli import main\ntry: main(['bench', '--help'])\nfinally: print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = done.stdout.splitlines()[-1].split()
    assert "taxel_benchmarks._command" in loaded
    assert {"scipy", "matplotlib", "taxel_benchmarks._rounds"} & {*loaded} == set()


def test_a_benchmark_without_goals_is_refused(folder: Path, capsys) -> None:
    text = (folder / "fast.py").read_text()
    (folder / "fast.py").write_text(text.replace("def goals", "def judged"))
    code, _, err = call(capsys, "bench", "fast", "--quick", "--results", folder / "results")
    assert code
    assert "fast.py: defines no goals(result)" in err


def test_the_time_of_other_programs_counts() -> None:
    busy = subprocess.Popen([sys.executable, "-c", "while True: pass"])
    others = _Others()
    time.sleep(1.0)
    found = others.cores()
    busy.kill()
    busy.wait()
    assert found is not None
    # On a busy computer it has less than a core.
    assert found > 0.3
