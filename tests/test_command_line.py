"""Errors of the command line name the option that was typed, in one line; exit codes are those of the docs."""

import os
import re
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from shell import call, commands

import taxel
from taxel.cli._commands import OWN, plugins
from taxel.cli.app import rows

DOCS = Path(__file__).parent.parent / "docs"


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a recording, labels and a readout that needs a tare."""
    monkeypatch.chdir(tmp_path)
    array = taxel.Array(4, 4, name="small")
    t = np.arange(0, 2_000_000, 1000)
    events = taxel.Events(t, t // 1000 % 4, t // 4000 % 4, t % 2000 == 0, array=array, intensity=40 + t // 1000 % 2)
    taxel.convert(events, "walk.npz")
    Path("labels.csv").write_text("label,t_us\ncontact,500000\n")
    readout = taxel.Readout(taxel.encode.ContactArea(), {"contact": (taxel.Neuron(tau=0.5), np.ones(10))})
    readout.save("touch.json")
    Path("there.json").write_text("{}")
    Path("there.mcap").write_bytes(b"")
    return tmp_path


@pytest.mark.usefixtures("here")
def test_an_existing_file_is_not_replaced_by_a_result(capsys) -> None:
    call(capsys, "train", "walk.npz", "--labels", "labels.csv", "-o", "there.json")
    assert Path("there.json").read_text() == "{}"


def test_exit_codes_are_those_of_the_docs() -> None:
    table = (DOCS / "howto.md").read_text()
    assert set(re.findall(r"^\| (\d+) \|", table, re.MULTILINE)) == {"0", "1", "2", "3", "130"}


@pytest.mark.parametrize("after_s", [0.0, 0.1, 0.3, 1.0])
def test_ctrl_c_while_it_starts_ends_quietly(after_s: float) -> None:
    program = Path(sys.executable).with_name("taxel")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.bind(("127.0.0.1", 0))
        port = str(link.getsockname()[1])
    arguments = [program, "emulate", "--port", port, "--scenes", "3", "--json"]
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        # After Python itself has started: the process is importing taxel now.
        until = time.monotonic() + 60
        while "numpy" not in _maps(process.pid):
            assert time.monotonic() < until
            time.sleep(0.005)
        time.sleep(after_s)
        os.kill(process.pid, signal.SIGINT)
        out, error = process.communicate(timeout=60)
    assert (process.returncode, out, error) == (130, "", "")


def _maps(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/maps").read_text()
    except OSError:
        return ""


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


PRINTS_COMMANDS = """
import sys
from taxel.cli import main
try:
    main(sys.argv[1:])
finally:
    loaded = {name.rpartition(".")[2] for name in sys.modules if name.startswith("taxel.cli.")}
    shared = {"app", "console"}
    print(*sorted(name for name in loaded - shared if not name.startswith("_")), file=sys.stderr)
    print(*sorted({"taxel_studies", "taxel_benchmarks", "scipy", "matplotlib"} & sys.modules.keys()), file=sys.stderr)
"""


@pytest.mark.parametrize(
    ("arguments", "loaded"),
    [
        (["--help"], ""),
        (["--version"], ""),
        (["nonsense"], ""),
        (["trian"], ""),
        (["merge", "--help"], "merge"),
        (["device", "show", "--help"], "device"),
    ],
)
def test_a_command_is_imported_only_when_it_is_used(arguments: list[str], loaded: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PRINTS_COMMANDS, *arguments], capture_output=True, text=True, check=False
    )
    assert done.stderr.splitlines()[-2:] == [loaded, ""], done.stderr


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
