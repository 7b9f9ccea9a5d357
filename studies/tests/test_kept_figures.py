"""What is kept for the page of figures names the commit that ran it, or is not kept."""

import importlib.util
import json
from collections.abc import Sequence
from pathlib import Path

import pytest
from matplotlib.container import BarContainer

from taxel_studies import load

_spec = importlib.util.spec_from_file_location("figures", Path(__file__).parents[2] / "docs" / "figures.py")
assert _spec is not None
assert _spec.loader is not None
figures = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(figures)


@pytest.fixture
def report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A report of one study, of this very code; the page's folder is another."""
    (tmp_path / "kept").mkdir()
    monkeypatch.setattr(figures, "FIGURES", tmp_path / "kept")
    study = load("fig6.1")
    (tmp_path / "fig6.1").mkdir()
    section = {"name": "fig6.1", "tables": [], "made_of": study.made_of}
    (tmp_path / "fig6.1" / "summary.json").write_text(json.dumps(section))
    return tmp_path


def test_the_commit_is_named_where_its_code_ran_the_study(report: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(figures, "git", lambda *said: "" if said[0] == "status" else "1234abc")
    figures.keep(report)
    assert json.loads((report / "kept" / "fig6.1.json").read_text())["commit"] == "1234abc"


def test_a_report_of_other_code_or_of_uncommitted_code_is_not_kept(
    report: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(figures, "git", lambda *said: " M python/taxel/neuron.py")
    with pytest.raises(SystemExit, match="not committed"):
        figures.keep(report)
    summary = report / "fig6.1" / "summary.json"
    summary.write_text(summary.read_text().replace('"taxel.neuron": "', '"taxel.neuron": "0'))
    with pytest.raises(SystemExit, match="other code"):
        figures.keep(report)
    assert list((report / "kept").iterdir()) == []


@pytest.mark.parametrize("file", sorted(figures.FIGURES.glob("*.json")), ids=lambda file: file.stem)
def test_statements_are_judged_from_the_numbers_that_stand_beside_them(file: Path) -> None:
    section = json.loads(file.read_text())
    assert section["statements"] == figures.judged(section), "run docs/figures.py"


@pytest.mark.parametrize("file", sorted(figures.FIGURES.glob("*.json")), ids=lambda file: file.stem)
def test_bars_begin_at_zero(file: Path) -> None:
    """A bar's length is what is read of it."""
    section = json.loads(file.read_text())
    drawn = load(file.stem).draw(section["parameters"], section["said"])
    for axes in (axes for figure in (drawn if isinstance(drawn, Sequence) else [drawn]) for axes in figure.axes):
        for bars in (holder for holder in axes.containers if isinstance(holder, BarContainer)):
            low, high = sorted(axes.get_ylim() if bars.orientation == "vertical" else axes.get_xlim())
            assert low <= 0 <= high, f"{axes.get_ylabel()} from {low:g} to {high:g}"
