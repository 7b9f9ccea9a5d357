"""Figures saved for the page name the commit that ran them, or are not saved; their toy results are compared."""

import importlib.util
import json
import os
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from matplotlib.container import BarContainer

from taxel import FormatError, ProblemError
from taxel_studies import kept, load
from taxel_studies.command import app, tell

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
def test_statements_are_judged_from_the_numbers_that_stand_beside_them(file: Path) -> None:
    section = json.loads(file.read_text())
    assert section["statements"] == figures.judged(section), "run docs/figures.py"


@pytest.mark.parametrize("file", sorted(figures.FIGURES.glob("*.json")), ids=lambda file: file.stem)
def test_bars_begin_at_zero(file: Path) -> None:
    """The length of a bar is its value only where bars begin at 0."""
    section = json.loads(file.read_text())
    drawn = load(file.stem).draw(section["parameters"], section["said"])
    for axes in (axes for figure in (drawn if isinstance(drawn, Sequence) else [drawn]) for axes in figure.axes):
        for bars in (holder for holder in axes.containers if isinstance(holder, BarContainer)):
            low, high = sorted(axes.get_ylim() if bars.orientation == "vertical" else axes.get_xlim())
            assert low <= 0 <= high, f"{axes.get_ylabel()} from {low:g} to {high:g}"


@pytest.fixture
def figure(tmp_path: Path) -> Path:
    """A folder that keeps one small figure with its toy result."""
    section = load("fig6.1").run(tmp_path / "report", size="toy", quiet=True)
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept" / "fig6.1.json").write_text(json.dumps(section))
    kept.keep_toy("fig6.1", tmp_path / "kept")
    return tmp_path / "kept"


def spoil(file: Path, change: Callable[[dict[str, Any]], Any]) -> None:
    value = json.loads(file.read_text())
    change(value)
    file.write_text(json.dumps(value))


def test_what_is_not_kept_is_refused(figure: Path) -> None:
    assert kept.kept_figures(figure) == ["fig6.1"]
    with pytest.raises(FormatError, match="contains no saved figure"):
        kept.kept_figures(figure / "report")
    with pytest.raises(ProblemError, match=r"fig6\.2\.json: contains no toy result of fig6\.2"):
        kept.confirm("fig6.2", figure)


@pytest.mark.parametrize("part", ["said", "parameters", "unread"])
def test_a_toy_result_that_is_another_one_is_found_and_stays(figure: Path, part: str) -> None:
    file = figure / "toy" / "fig6.1.json"
    spoil(file, lambda result: result.update({"commit": "4567def", "date": "2020-01-01", "machine": "another"}))
    before = file.read_text()
    kept.confirm("fig6.1", figure)
    assert file.read_text() == before
    spoil(file, lambda result: result[part].update({"spikes": [1.0]}))
    before = file.read_text()
    with pytest.raises(ProblemError, match=r"fig6\.1: the toy result differs from the saved one"):
        kept.confirm("fig6.1", figure)
    assert file.read_text() == before


def test_a_result_that_is_rounded_otherwise_is_the_same(figure: Path) -> None:
    def moved(part: float) -> Callable[[dict[str, Any]], Any]:
        def change(result: dict[str, Any]) -> None:
            result["said"] = scaled(result["said"], 1.0 + part)

        return change

    spoil(figure / "toy" / "fig6.1.json", moved(1e-13))
    kept.confirm("fig6.1", figure)
    spoil(figure / "toy" / "fig6.1.json", moved(1e-7))
    with pytest.raises(ProblemError, match="the toy result differs from the saved one"):
        kept.confirm("fig6.1", figure)


def scaled(value: Any, by: float) -> Any:
    """Return a result with each float of it scaled."""
    if isinstance(value, dict):
        return {key: scaled(inner, by) for key, inner in value.items()}
    if isinstance(value, list):
        return [scaled(inner, by) for inner in value]
    return value * by if isinstance(value, float) else value


def test_all_kept_figures_are_tried_and_those_that_moved_named(
    figure: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("fig6.2", "fig6.1"):
        section = json.loads((figure / "fig6.1.json").read_text()) | {"name": name}
        (figure / f"{name}.json").write_text(json.dumps(section))
        kept.keep_toy(name, figure)
    spoil(figure / "toy" / "fig6.1.json", lambda result: result["said"].update({"spikes": [1.0]}))
    with pytest.raises(ProblemError, match=r"not confirmed: fig6\.1;"):
        app(["all", "--confirm", "--figures", str(figure)], result_action="return_value")
    assert "fig6.2: confirmed" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("name", kept.kept_figures(figures.FIGURES))
def test_a_study_gives_its_kept_toy_result(name: str) -> None:
    data = Path(os.environ["TAXEL_DATA"]) if "TAXEL_DATA" in os.environ else None
    why = load(name).cannot_run(data)
    if why is not None:
        pytest.skip(why)
    kept.confirm(name, figures.FIGURES, data=data)


def test_a_printed_table_loses_no_cell_to_the_width(capsys: pytest.CaptureFixture[str]) -> None:
    head, row = ["way", *map(str, range(12))], ["a long name of one of the ways", *["100.25"] * 12]
    table = {"title": "Shares", "head": head, "rows": [row], "folded": False}
    tell({"name": "touch", "size": "toy", "title": "t", "statements": [], "tables": [table], "unread": {}})
    assert re.split(" {2,}", capsys.readouterr().out.splitlines()[-1].strip()) == row
