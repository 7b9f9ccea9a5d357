"""Figures saved for the page name the commit that ran them, or are not saved."""

import importlib.util
import json
from pathlib import Path

import pytest

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
    monkeypatch.setattr(figures, "code_version", lambda *packages: "0123abc")
    (tmp_path / "fig6.1").mkdir()
    section = {"name": "fig6.1", "tables": [], "commit": "0123abc"}
    (tmp_path / "fig6.1" / "summary.json").write_text(json.dumps(section))
    return tmp_path


def test_a_kept_figure_and_its_toy_result_name_the_commit(report: Path) -> None:
    figures.keep(report)
    for name in ("fig6.1.json", "toy/fig6.1.json"):
        assert json.loads((report / "kept" / name).read_text())["commit"] == "0123abc"
    toy = json.loads((report / "kept" / "toy" / "fig6.1.json").read_text())
    assert {"date", "machine"} < toy.keys()


@pytest.mark.parametrize("code", ["4567def", "0123abc with local changes, 1"])
def test_a_report_of_another_commit_or_beside_local_changes_is_not_kept(
    report: Path, monkeypatch: pytest.MonkeyPatch, code: str
) -> None:
    monkeypatch.setattr(figures, "code_version", lambda *packages: code)
    with pytest.raises(SystemExit, match=r"fig6\.1: not computed by the commit that is checked out"):
        figures.keep(report)
    assert list((report / "kept").iterdir()) == []


@pytest.mark.parametrize("file", sorted(figures.FIGURES.glob("*.json")), ids=lambda file: file.stem)
def test_claims_are_judged_from_the_numbers_that_stand_beside_them(file: Path) -> None:
    section = json.loads(file.read_text())
    assert section["judgements"] == figures.judged(section), "run docs/figures.py"
