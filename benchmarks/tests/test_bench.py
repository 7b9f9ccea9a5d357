"""``taxel bench``: the list of goals, the table of a result, what is measured beside it, what is refused."""

from __future__ import annotations

import json
import re
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.shell import call

import taxel_benchmarks
from taxel_benchmarks import _rounds
from taxel_benchmarks._command import benchmarks

PACKAGE = Path(taxel_benchmarks.__file__).parent
RESULTS = PACKAGE.parent / "results"
BENCHMARKS = benchmarks()

BENCHMARK = '''"""How fast is it?"""
from taxel_benchmarks._goals import at_least
from taxel_benchmarks._shared import often
from taxel.metrics import distance_of

def run(*, quick):
    return often(distance_of)

def goals(result):
    return at_least({"a": 3.0}, result["ratios"])
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
    result = {"ratios": {"a": 3.0}, "machine": {"cores": 2}}
    monkeypatch.setattr(_rounds, "alone", lambda name, quick: json.loads(json.dumps(result)))
    place = folder / "results" / "fast.json"
    before = place.read_text()
    for code, refused in (("0123abc with local changes, 1", True), ("0123abc", False)):
        monkeypatch.setattr("taxel_studies.commit.code_version", lambda *packages, code=code: code)
        assert call(capsys, "bench", "fast", "--quick", "--results", folder / "results")[0] == 0
        assert place.read_text() == before
        ended, _, err = call(capsys, "bench", "fast", "--results", folder / "results")
        assert (ended, "local changes since the last commit" in err) == ((2, True) if refused else (0, False))
    assert json.loads(place.read_text())["ratios"] == {"a": 3.0}


@pytest.mark.parametrize(
    ("was", "now", "spread", "said"),
    [
        ({"a": 3.0, "b": 2.0}, {"a": 2.8, "b": 2.2}, [2.9, 3.11], 0),
        ({"a": 3.0, "b": 2.0}, {"a": 2.8, "b": 1.0}, [2.95, 3.05], 1),
        ({"a": 3.0, "b": 2.0}, {"a": 9.0, "b": 2.31}, [2.95, 3.05], 1),
        ({"a": 3.0, "gone": 2.0, "b": None}, {"a": 2.0, "b": 1.0}, None, 1),
        ({}, {"a": 2.0, "b": 1.0}, None, 0),
    ],
)
def test_a_result_is_compared_with_the_saved_one_by_the_spread_of_the_wider(
    folder: Path, capsys, monkeypatch: pytest.MonkeyPatch, was: dict, now: dict, spread: list | None, said: int
) -> None:
    """Of `a` more is better and it may have rounds; `b` must be at most 2, and has none."""
    goals = 'at_least({"a": 3.0}, result["ratios"]) + at_most({"b": 2.0}, result["ratios"])'
    text = BENCHMARK.replace("import at_least", "import at_least, at_most").replace("distance_of", "victor_purpura")
    (folder / "fast.py").write_text(text.replace('at_least({"a": 3.0}, result["ratios"])', goals))
    rounds = {} if spread is None else {"spread": {"a": spread}}
    result = {"ratios": now, "machine": {"cores": 2}, "spread": {"a": [1.99, 2.0]} if spread else {}}
    saved = {"ratios": was, "commit": "0123abc", "date": "2026-11-25", "machine": {"cpu": "one"}}
    (folder / "results" / "fast.json").write_text(json.dumps(saved | rounds))
    monkeypatch.setattr(_rounds, "alone", lambda name, quick: json.loads(json.dumps(result)))
    monkeypatch.setattr("taxel_studies.commit.code_version", lambda *packages: "4567def")
    out = call(capsys, "bench", "fast", "--results", folder / "results")[1]
    head = f"  against the result before (commit 0123abc, 2026-11-25, one): {said} of {len(was)} ratios fell by"
    assert head in out
    assert len(out.split(head)[1].splitlines()) == said + 1


JUDGED = (
    BENCHMARK.replace("distance_of", "victor_purpura")
    .replace(
        'at_least({"a": 3.0}, result["ratios"])',
        'at_least({"a": 3.0}, result["ratios"]) + at_most({"b": 2.0}, result["ratios"]) + not_slower(result, "c")',
    )
    .replace("import at_least", "import at_least, at_most, not_slower")
)
MET = {"ratios": {"a": 3.0, "b": 2.0, "c": 1.0}}


@pytest.mark.parametrize(
    ("result", "said"),
    [
        (
            MET
            | {"ratios": {"a": 3.0, "b": 2.5, "c": 4.0}, "larger": ["c"], "date": "2026-11-25", "stable": False}
            | {"machine": {"cpu": "one, AVX2", "others": 0.7, "cores": 2}},
            "fast: 2 of 3 goals reached\n  one, AVX2; commit 0123abc; 2026-11-25; other programs used 0.7 of 2 cores; "
            "quartiles more than 15 % of the median apart\n"
            "  not reached         2.5 <= 2          b\n"
            "  reached               3 >= 3          a\n"
            "  reached             > 4 >= 1          c\n",
        ),
        (
            {"ratios": {"a": 2.9996, "b": 2.0}, "spread": {"a": [2.6, 3.1234]}, "machine": {"load": 9.7, "cores": 2}},
            "fast: 1 of 3 goals reached\n"
            "  unknown processor; commit 0123abc; what other programs used was not measured, load 9.7\n"
            "  not reached      2.9996 >= 3          a (2.6 to 3.12)\n"
            "  not measured            >= 1          c\n"
            "  reached               2 <= 2          b\n",
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
    assert "\n\nother: no result\n\n4 goals: " in out


@pytest.mark.parametrize(("b", "code"), [(2.0, 0), (2.5, 1), (None, 1)])
def test_goals_that_are_not_reached_or_not_measured_end_with_1(
    folder: Path, capsys, b: float | None, code: int
) -> None:
    (folder / "fast.py").write_text(JUDGED)
    ratios = {name: one for name, one in (MET["ratios"] | {"b": b}).items() if one is not None}
    (folder / "results" / "fast.json").write_text(json.dumps({"ratios": ratios}))
    assert call(capsys, "bench", "fast", "--goals", "--results", folder / "results")[0] == code


@pytest.mark.parametrize("saved", [{}, {"left out": {}}, {"left out": {"peer": "not installed"}}, None])
def test_a_result_with_peers_is_not_replaced_by_one_without(
    folder: Path, capsys, monkeypatch: pytest.MonkeyPatch, saved: dict | None
) -> None:
    result = {"ratios": {"a": 3.5, "of the run": 1.0}, "machine": {"cores": 2}, "left out": {"peer": "absent"}}
    monkeypatch.setattr(_rounds, "alone", lambda name, quick: json.loads(json.dumps(result)))
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
        assert "as it has peers that are left out here: peer (absent)" in err
        assert json.loads(place.read_text()) == {"took_s": 1.0} | saved


@pytest.mark.parametrize("name", BENCHMARKS)
def test_each_benchmark_states_goals_and_judges_its_saved_result(name: str) -> None:
    result = json.loads((RESULTS / f"{name}.json").read_text())
    goals = BENCHMARKS[name].goals(result)
    assert goals
    assert [goal.what for goal in goals if goal.figure is None] == [], f"run taxel bench {name}"
