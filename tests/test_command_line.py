"""Errors of the command line name the option that was typed, in one line; exit codes are those of the docs."""

import re
import sys
from pathlib import Path

import pytest
from shell import call, commands, run

from taxel.cli._commands import OWN, plugins
from taxel.cli.app import rows

DOCS = Path(__file__).parent.parent / "docs"


def test_exit_codes_are_those_of_the_docs() -> None:
    table = (DOCS / "howto.md").read_text()
    assert set(re.findall(r"^\| (\d+) \|", table, re.MULTILINE)) == {"0", "1", "2", "3", "130"}


def test_the_help_has_a_whole_line_for_each_command_in_the_order_of_the_work(capsys) -> None:
    code, out, _ = call(capsys, "--help")
    listed, _, epilog = out.partition("Commands:\n")[2].partition("\n\n")
    assert "Begin with: taxel demo" in epilog
    assert "docs/start.md" in epilog
    lines = dict(line.split(maxsplit=1) for line in listed.splitlines())
    assert code == 0
    assert {*lines} == {*OWN, *plugins()}
    assert {name: text for name, text in lines.items() if len(text) > 60 or not text.endswith(".")} == {}
    order = [*lines]
    way = ("record", "info", "train", "detect", "bench")
    assert sorted(way, key=order.index) == [*way]
    assert "..." not in call(capsys, "device", "--help")[1].partition("Commands:")[2]


@pytest.fixture
def stranger(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The module of another distribution, which brings two commands and one that is named as ours."""
    about = tmp_path / "stranger-2.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: stranger\nVersion: 2.0\nSummary: Greet a stranger.\n")
    (about / "entry_points.txt").write_text(
        "[taxel.commands]\nwave = stranger:app\nnod = stranger:absent\ntrain = stranger:app\n"
    )
    module = tmp_path / "stranger.py"
    module.write_text(
        "from cyclopts import App\napp = App(name='wave')\n@app.default\ndef greet():\n    print('hello')\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "stranger", raising=False)
    return module


def test_a_command_of_another_distribution_is_listed_and_runs(stranger: Path, capsys) -> None:
    listed = call(capsys, "--help")[1]
    assert re.search(r"\n  wave +Greet a stranger\.\n", listed)
    assert listed.count("\n  train ") == 1
    assert "stranger" not in sys.modules
    assert call(capsys, "wave") == (0, "hello\n", "")
    assert "Usage: taxel wave" in call(capsys, "wave", "--help")[1]
    assert "taxel train a" in call(capsys, "train", "--help")[1], "ours"


def test_each_option_has_a_text_and_a_name_of_its_own() -> None:
    options = [(path, row) for path, app in commands().items() for row in rows(app)]
    assert len(options) > 100
    assert [(path, row.names) for path, row in options if not row.about] == []
    for path, app in commands().items():
        names = [name for row in rows(app) for name in row.names]
        assert len(names) == len(set(names)), path


def test_an_option_of_one_value_is_refused_where_it_is_given_twice(capsys) -> None:
    code, out, error = call(capsys, "train", "a.mcap", "--folds", "2", "--folds=3")
    assert (code, out) == (2, "")
    assert error == "taxel: --folds is given twice; see taxel train --help\n"


def test_a_warning_is_a_line_without_its_place_in_the_code(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t_s,b,c\n" + "".join(f"{k / 10},{k % 7},3\n" for k in range(30)))
    said = run("cut", tmp_path / "a.csv", tmp_path / "b.npz", "--columns", "0:1")
    assert said.returncode == 0, said.stderr
    assert said.stderr.startswith("taxel: warning: a.csv: read as ")
    assert ".py" not in said.stderr
