"""Every study at toy size: its judgements, its picture, its part of the page; and the command line."""

from __future__ import annotations

import base64
import functools
import json
import os
import re
from collections.abc import Callable, Iterator
from html.parser import HTMLParser
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taxel import learn
from taxel.cli import main
from taxel.learn.cone_r import ConeRProblem
from taxel_studies import STUDIES, load
from taxel_studies.claims import CLAIMS
from taxel_studies.page import write_page
from taxel_studies.runner import Kept
from taxel_studies.waves import READINGS

#: Studies on recordings have tests of their own; published ones lie elsewhere.
MADE_HERE = [name for name in STUDIES if not load(name).data]
ON_RECORDINGS = [name for name in STUDIES if load(name).data]
DATA = Path(os.environ["TAXEL_DATA"]) if "TAXEL_DATA" in os.environ else None
KEPT = Path(__file__).parents[2] / "benchmarks" / "results" / "figures" / "toy"
#: The longest of toy size, which take half as long as all others together.
LONGEST = ("asynchronous", "fig4.8", "drops")
EACH = [pytest.param(name, marks=pytest.mark.slow if name in LONGEST else ()) for name in MADE_HERE]


@pytest.fixture(scope="module")
def report(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("report")


@pytest.fixture(scope="module")
def first_run(report) -> Callable[[str], dict[str, Any]]:
    """Run a study of toy size once for all tests of this file; `fitted`: how often a learner was fitted."""

    def run(name: str) -> dict[str, Any]:
        fitted = []

        def counted(fit):
            return lambda *args, **options: [fit(*args, **options), fitted.append(1)][0]

        with pytest.MonkeyPatch.context() as patched:
            patched.setattr(learn.ConeX, "fit", counted(learn.ConeX.fit))
            patched.setattr(ConeRProblem, "fit", counted(ConeRProblem.fit))
            section = load(name).run(report, size="toy", data=DATA, quiet=True)
        return section | {"fitted": len(fitted)}

    return functools.cache(run)


@pytest.fixture
def small(tmp_path) -> list[str]:
    """Name the command that runs the smallest study."""
    return ["study", "fig6.11", "--size", "toy", "--set", "realisations=1", "--report", str(tmp_path)]


def ends(arguments: list[str]) -> int:
    with pytest.raises(SystemExit) as end:
        main(arguments)
    return int(end.value.code or 0)


@pytest.mark.parametrize("name", EACH)
def test_a_study_of_toy_size_judges_claims_and_gives_a_picture(report, first_run, name):
    assert load(name).name == name
    section = first_run(name)
    assert section["title"] == STUDIES[name]
    for judged in section["judgements"]:
        assert judged["claim"] in CLAIMS
        assert judged["ours"]
        assert judged["holds"] in (True, False, None)
    assert (report / name / "summary.json").exists()
    for picture in json.loads((report / name / "summary.json").read_text())["pictures"]:
        data = (report / name / picture).read_bytes()
        assert data.startswith(b"<?xml")
        assert 3_000 < len(data) < 1_000_000


def differences(kept: Any, now: Any, where: str) -> Iterator[str]:
    """Return where two results differ by more than rounding, which another processor or version of NumPy does so."""
    if isinstance(kept, dict) and isinstance(now, dict) and kept.keys() == now.keys():
        for key in kept.keys() - {"cpu_seconds"}:
            yield from differences(kept[key], now[key], f"{where}.{key}")
    elif isinstance(kept, list) and isinstance(now, list) and len(kept) == len(now):
        for k, (a, b) in enumerate(zip(kept, now, strict=True)):
            yield from differences(a, b, f"{where}[{k}]")
    elif not (isinstance(kept, float) and kept == pytest.approx(now, rel=1e-9, abs=1e-12)) and kept != now:
        yield f"{where} was {str(kept)[:40]}, is {str(now)[:40]}"


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("name", [*EACH, *(pytest.param(name, marks=pytest.mark.slow) for name in ON_RECORDINGS)])
def test_a_study_gives_its_kept_toy_result(first_run, name):
    file = KEPT / f"{name}.json"
    why = load(name).cannot_run(DATA) if file.exists() else "nothing of it is kept"
    if why is not None:
        pytest.skip(why)
    kept = json.loads(file.read_text())
    now = json.loads(json.dumps(first_run(name)))
    assert not [line for key in ("parameters", "said") for line in differences(kept[key], now[key], key)]


@pytest.mark.parametrize("name", EACH)
def test_every_fit_of_a_study_closes_or_is_told(first_run, name):
    section = first_run(name)
    assert section["fits"]["count"] == section["fitted"]
    assert section["fits"]["open"] == 0


@pytest.mark.parametrize("name", ["fig6.1", "fig6.2", "fig6.3", "fig6.4", "fig6.5", "fig6.6", "fig6.8", "fig6.9"])
def test_what_the_thesis_says_holds_at_toy_size(first_run, name):
    """Of 6.9 in the readings of B that give kappa its power."""
    for judged in first_run(name)["judgements"]:
        assert judged["holds"] or (name == "fig6.9" and judged["reading"] == READINGS["B_max"].name), judged


@pytest.mark.parametrize("name", EACH)
def test_a_second_run_reckons_nothing_again_and_says_the_same(report, first_run, name):
    first = first_run(name)
    results = set((report / "cache").rglob("output.pkl"))
    second = load(name).run(report, size="toy", quiet=True)
    assert set((report / "cache").rglob("output.pkl")) == results
    assert second["said"] == first["said"]
    assert second["judgements"] == first["judgements"]


@pytest.mark.parametrize("name", EACH)
def test_a_realisation_is_a_pure_function_of_parameters_and_seed(report, first_run, name, tmp_path):
    """Here, alone and after other draws, it gives what the whole study gave among the others."""
    study = load(name)
    first_run(name)
    task = study.tasks(study.set("toy"))[-1]
    stored = Kept(report / "cache", "0123abc").row(study.realise, {}, task).result
    np.random.default_rng().random()
    given = {"kept": Kept(tmp_path, "0123abc")} if "kept" in signature(study.realise).parameters else {}
    assert json.dumps(study.realise(task.params, task.seed, **given)) == json.dumps(stored)


class Page(HTMLParser):
    """Collects the references and the text of a page."""

    def __init__(self) -> None:
        super().__init__()
        self.references: list[str] = []
        self.text = ""

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        del tag
        self.references += [v for k, v in attributes if k in ("src", "href") and v]

    def handle_data(self, data: str) -> None:
        self.text += data


def test_the_page_holds_every_picture_and_names_what_was_not_run(report, first_run, tmp_path):
    first_run(MADE_HERE[0])
    page = Page()
    page.feed(write_page(report).read_text())
    assert all(r.startswith(("#", "data:image/svg+xml;base64,")) for r in page.references)
    shown = [base64.b64decode(r.partition(",")[2]) for r in page.references if r.startswith("data:")]
    sections = {
        name: json.loads((report / name / "summary.json").read_text()) for name in STUDIES if (report / name).exists()
    }
    assert shown == [(report / name / file).read_bytes() for name, of in sections.items() for file in of["pictures"]]
    assert "it shows that the study runs, not what it finds" in page.text
    empty = Page()
    empty.feed(write_page(tmp_path).read_text())
    assert [re.search(rf"taxel study {re.escape(name)}\b", empty.text) for name in STUDIES].count(None) == 0
    assert not [r for r in empty.references if r.startswith("data:")]


def test_the_command_prints_json(small, capsys):
    assert ends([*small, "--json"]) == 0
    section = json.loads(capsys.readouterr().out)
    assert section["name"] == "fig6.11"
    assert section["parameters"]["realisations"] == 1
