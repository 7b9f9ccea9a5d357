"""Figures saved for the page name the commit that ran them, or are not saved."""

import importlib.util
import json
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from matplotlib.container import BarContainer
from typer.testing import CliRunner

from taxel import FormatError, ProblemError
from taxel_studies import kept, load
from taxel_studies.command import app, tell
from taxel_studies.page import write_page

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
    monkeypatch.setattr(figures, "git", lambda *arguments: "" if arguments[0] == "status" else "1234abc")
    figures.keep(report)
    assert json.loads((report / "kept" / "fig6.1.json").read_text())["commit"] == "1234abc"


def test_a_report_of_other_code_or_of_uncommitted_code_is_not_kept(
    report: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(figures, "git", lambda *arguments: " M python/taxel/neuron.py")
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
    """The length of a bar is its value only where bars begin at 0."""
    section = json.loads(file.read_text())
    drawn = load(file.stem).draw(section["parameters"], section["said"])
    for axes in (axes for figure in (drawn if isinstance(drawn, Sequence) else [drawn]) for axes in figure.axes):
        for bars in (holder for holder in axes.containers if isinstance(holder, BarContainer)):
            low, high = sorted(axes.get_ylim() if bars.orientation == "vertical" else axes.get_xlim())
            assert low <= 0 <= high, f"{axes.get_ylabel()} from {low:g} to {high:g}"


@pytest.fixture
def figure(tmp_path: Path) -> Path:
    """A folder that keeps one small figure with its coarse result."""
    section = load("fig6.1").run(tmp_path / "report", size="toy", quiet=True)
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept" / "fig6.1.json").write_text(json.dumps(section))
    kept.keep_coarse("fig6.1", tmp_path / "kept")
    return tmp_path / "kept"


def spoil(file: Path, change: Callable[[dict[str, Any]], Any]) -> None:
    value = json.loads(file.read_text())
    change(value)
    file.write_text(json.dumps(value))


def test_a_figure_of_this_code_is_not_stale(figure: Path) -> None:
    assert kept.stale_figures(figure) == {}
    with pytest.raises(FormatError, match="holds no kept figure"):
        kept.stale_figures(figure / "report")


def test_a_figure_of_other_code_is_stale_until_its_coarse_result_is_confirmed(figure: Path) -> None:
    spoil(figure / "fig6.1.json", lambda section: section["made_of"].update({"taxel.neuron": "other"}))
    assert kept.stale_figures(figure) == {"fig6.1": ["taxel.neuron"]}
    assert kept.confirm("fig6.1", figure) == "confirmed"
    assert kept.stale_figures(figure) == {}


def test_a_figure_whose_coarse_result_is_another_one_stays_stale(figure: Path) -> None:
    spoil(figure / "fig6.1.json", lambda section: section["made_of"].update({"taxel.neuron": "other"}))
    spoil(figure / "coarse" / "fig6.1.json", lambda result: result["said"].update({"spikes": [1.0]}))
    with pytest.raises(ProblemError, match="its coarse result is another one"):
        kept.confirm("fig6.1", figure)
    assert kept.stale_figures(figure) == {"fig6.1": ["taxel.neuron"]}


def test_a_result_that_is_rounded_otherwise_is_the_same(figure: Path) -> None:
    def moved(part: float) -> Callable[[dict[str, Any]], Any]:
        def change(result: dict[str, Any]) -> None:
            result["said"] = scaled(result["said"], 1.0 + part)

        return change

    spoil(figure / "coarse" / "fig6.1.json", moved(1e-13))
    assert kept.confirm("fig6.1", figure) == "confirmed"
    spoil(figure / "coarse" / "fig6.1.json", moved(1e-7))
    with pytest.raises(ProblemError, match="its coarse result is another one"):
        kept.confirm("fig6.1", figure)


def scaled(value: Any, by: float) -> Any:
    """Return a result with each float of it scaled."""
    if isinstance(value, dict):
        return {key: scaled(inner, by) for key, inner in value.items()}
    if isinstance(value, list):
        return [scaled(inner, by) for inner in value]
    return value * by if isinstance(value, float) else value


def test_all_stale_figures_are_tried_and_those_that_moved_named(figure: Path) -> None:
    for name in ("fig6.2", "fig6.1"):
        section = json.loads((figure / "fig6.1.json").read_text()) | {
            "name": name,
            "made_of": {"taxel.neuron": "other"},
        }
        (figure / f"{name}.json").write_text(json.dumps(section))
        kept.keep_coarse(name, figure)
    spoil(figure / "coarse" / "fig6.1.json", lambda result: result["said"].update({"spikes": [1.0]}))
    ended = CliRunner().invoke(app, ["all", "--confirm", "--figures", str(figure)])
    assert isinstance(ended.exception, ProblemError)
    assert "not confirmed: fig6.1;" in str(ended.exception)
    assert "fig6.2: confirmed" in ended.output
    assert kept.stale_figures(figure) == {"fig6.1": list(load("fig6.1").made_of)}


def test_a_figure_whose_sources_were_not_recorded_is_stale(figure: Path) -> None:
    spoil(figure / "fig6.1.json", lambda section: section.pop("made_of"))
    assert kept.stale_figures(figure) == {"fig6.1": ["its sources were not recorded"]}


def test_a_stale_figure_is_marked_on_the_page(tmp_path: Path) -> None:
    load("fig6.1").run(tmp_path, size="toy", quiet=True)
    assert "Stale" not in write_page(tmp_path).read_text()
    spoil(tmp_path / "fig6.1" / "summary.json", lambda section: section["made_of"].update({"taxel.neuron": "other"}))
    page = write_page(tmp_path).read_text()
    assert "Stale: made by other code than today's</summary>" in page
    assert "Changed since: taxel.neuron.<" in page


@pytest.mark.parametrize(
    ("changed", "stale", "counts"),
    [
        ("taxel._core.neuron_run", {"fig6.1", "fig6.9", "fig6.11"}, {"fig4.3", "drops"}),
        ("taxel._core.circuit_volts", {"fig4.6"}, {"fig6.1", "stdp"}),
        ("taxel.learn.cone_x", {"fig6.9", "fig6.7"}, {"fig4.3", "drops", "codes"}),
        ("taxel/detect/recipes/touch.toml", {"touch"}, {"fig6.1", "fig6.9"}),
    ],
)
def test_a_change_makes_those_stale_that_use_it(changed: str, stale: set[str], counts: set[str]) -> None:
    uses = {name for name in stale | counts if changed in load(name).made_of}
    assert uses == stale


def test_a_printed_table_loses_no_cell_to_the_width(capsys: pytest.CaptureFixture[str]) -> None:
    head, row = ["way", *map(str, range(12))], ["a long name of one of the ways", *["100.25"] * 12]
    table = {"title": "Shares", "head": head, "rows": [row], "folded": False}
    tell({"name": "touch", "size": "toy", "title": "t", "statements": [], "tables": [table], "unread": {}})
    assert re.split(" {2,}", capsys.readouterr().out.splitlines()[-1].strip()) == row
