"""How long a study takes, said before it begins: by the kept figures."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from taxel_studies import STUDIES, durations, load

FIGURES = Path(__file__).resolve().parents[2] / "benchmarks" / "results" / "figures"


def test_the_durations_are_those_of_the_kept_figures() -> None:
    kept = [json.loads(file.read_text(encoding="utf-8")) for file in FIGURES.glob("*.json")]
    took = {each["name"]: (each["size"], round(each["cpu_seconds"])) for each in kept}
    assert {name: of for name, of in took.items() if of[1] >= durations.LONG_S} == durations.CPU_SECONDS


@pytest.mark.parametrize(
    ("jobs", "share", "text"), [(1, 1.0, "about 8 min in 1 process"), (4, 1.0, "about 2 min in 4")]
)
def test_a_long_study_says_how_long_by_what_is_left_and_its_processes(jobs: int, share: float, text: str) -> None:
    assert durations.forecast("gait", "full", share, jobs).startswith(text)
    assert durations.forecast("gait", "toy", share, jobs) == ""
    assert durations.forecast("gait", "full", 0.1, jobs) == ""
    assert durations.forecast("fig6.1", "full", share, jobs) == ""


def test_all_studies_say_how_long_together() -> None:
    assert durations.forecast_all(STUDIES, "full", 1).startswith("about 5.7 h in 1 process, less what is there: ")
    assert durations.forecast_all(STUDIES, "toy", 1) == ""


def test_a_run_says_it_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(durations.CPU_SECONDS, "fig6.1", ("full", 600))
    begun: list[str] = []

    def realise(*_: object) -> None:
        begun.append(capsys.readouterr().err)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        replace(load("fig6.1"), realise=realise).run(tmp_path)
    assert begun[0].startswith(
        "fig6.1: about 10 min in 1 process: the kept run took 600 s of CPU, and 100 % of it is to"
    )
