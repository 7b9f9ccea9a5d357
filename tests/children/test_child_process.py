"""A child of taxel runs no code of the current folder, and ends when its parent ends or says so."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import psutil
import pytest
from loopback import until

import taxel
from taxel._base.child_process import ChildProcess

#: A child that is hard to end; it says its number first.
BUSY = """
import os, pathlib, signal
signal.signal(signal.SIGINT, signal.SIG_IGN)
pathlib.Path('half').write_text(str(os.getpid()))
os.rename('half', 'number')
while True:
    pass
"""
PARENT = """
import os, sys, time
from taxel._base.child_process import ChildProcess
child = ChildProcess("program")
while not os.path.exists("number"):
    time.sleep(0.01)
os.kill(os.getpid(), 9)
"""
#: A child ends within this time after its parent, s: it has 3 s, and a machine with much to do takes longer.
WITHIN_S = 60.0


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, of whose modules none is found, and beside it one whose modules are."""
    named, here = tmp_path / "named", tmp_path / "here"
    for folder in (named, here):
        folder.mkdir()
    monkeypatch.chdir(here)
    monkeypatch.setenv("PYTHONPATH", str(named))
    return here


def program(here: Path, text: str) -> None:
    (here.parent / "named" / "program.py").write_text(text)


def test_a_child_ends_with_its_parent(here: Path) -> None:
    program(here, BUSY)
    subprocess.run([sys.executable, "-P", "-c", PARENT], check=False)
    number = int((here / "number").read_text())
    until(lambda: not psutil.pid_exists(number) or psutil.Process(number).status() == "zombie", WITHIN_S)


def test_a_parent_ends_its_child_when_it_likes(here: Path) -> None:
    program(here, BUSY)
    with ChildProcess("program", stderr=subprocess.DEVNULL) as child:
        until((here / "number").exists, WITHIN_S)
    assert child.returncode != 0
    assert child.end() == child.returncode


def test_a_child_has_its_words_its_line_and_its_exit_code_and_runs_no_code_of_the_current_folder(here: Path) -> None:
    for name in ("typing", "random", "runpy", "json", "sitecustomize", "usercustomize", "numpy", "taxel"):
        (here / f"{name}.py").write_text(f"open({str(here / 'RAN')!r}, 'w')")
    program(
        here,
        "import json, sys; print(json.dumps([sys.argv[1:], __name__, input(), sys.stdin.read(), sys.path])); exit(7)",
    )
    with ChildProcess("program", ["a b", 5, here], line="heard", stdout=subprocess.PIPE) as child:
        assert child.stdout is not None
        *said, path = json.loads(child.stdout.read())
    assert said == [["a b", "5", str(here)], "__main__", "heard", ""]
    assert child.returncode == 7
    assert not {"", ".", str(here)} & {*path}
    assert not (here / "RAN").exists()


def test_a_command_runs_no_code_of_the_current_folder_and_escapes_what_a_console_lacks(here: Path) -> None:
    for name in ("sitecustomize", "numpy", "cyclopts", "h5py", "taxel", "pathlib"):
        (here / f"{name}.py").write_text(f"open({str(here / 'RAN')!r}, 'w')")
    taxel.convert(taxel.Frames(np.zeros((3, 2, 2)), [0, 1, 2]), here / "walk ä ł.npz")
    variables = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    variables |= {"PYTHONIOENCODING": "cp1252", "PYTHONUTF8": "0"}
    command = [Path(sys.executable).with_name("taxel"), "info", "walk ä ł.npz"]
    done = subprocess.run(command, env=variables, capture_output=True, check=True)
    assert "walk ä \\u0142.npz".encode("cp1252") in done.stdout
    assert not (here / "RAN").exists()
