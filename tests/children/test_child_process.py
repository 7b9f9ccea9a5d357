"""A child of taxel: it runs no code of the current folder, and ends when its parent ends or says so."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from loopback import until

from taxel._base.child_process import ChildProcess, make_safe, search_path

from .marked import WITHIN_S, Marked

#: Begins a child with what a file beside it does, says so, and ends or waits.
PARENT = """
import os, sys, time
from pathlib import Path
from taxel._base.child_process import ChildProcess
child = ChildProcess(Path("child.py"), ["a word", 5], unfinished=["half.part"])
while not Path("ready").exists():
    time.sleep(0.01)
{then}
time.sleep(600)
"""
SLEEPS = "import pathlib, time; pathlib.Path('ready').touch(); time.sleep(600)"
#: What a child may do that makes it hard to end.
STUBBORN = {
    "plain": SLEEPS,
    "ignores signals": f"import signal; signal.signal(signal.SIGTERM, signal.SIG_IGN); {SLEEPS}",
    "computes": "import pathlib; pathlib.Path('ready').touch()\nwhile True: pass",
    "has a child of its own": f"import subprocess; one = subprocess.Popen(['sleep', '600']); {SLEEPS}",
    "ignores signals, as does its child": "import signal, subprocess; signal.signal(signal.SIGTERM, signal.SIG_IGN); "
    f"one = subprocess.Popen(['sleep', '600']); {SLEEPS}",
    "has closed its streams": f"import os; [os.close(k) for k in range(3)]; {SLEEPS}",
}


@pytest.mark.parametrize(
    ("does", "ends"), [*((does, "kill") for does in STUBBORN), ("plain", "fork"), ("plain", "leaves")]
)
def test_a_child_ends_with_its_parent_and_its_unfinished_file_with_it(tmp_path: Path, does: str, ends: str) -> None:
    then = {
        "kill": "os.kill(os.getpid(), 9)",
        # The fork lives on, and has a copy of the pipe.
        "fork": "if os.fork(): os.kill(os.getpid(), 9)",
        "leaves": "os._exit(0)",
    }[ends]
    (tmp_path / "child.py").write_text(STUBBORN[does])
    (tmp_path / "half.part").touch()
    with Marked(tmp_path, sys.executable, "-P", "-c", PARENT.format(then=then)) as parent:
        parent.code()
        left = parent.ended_within(WITHIN_S) if ends != "fork" else {}
        until(lambda: not any("child.py" in words or "sleep 600" in words for words in parent.alive().values()), 5.0)
        assert not left
        assert not (tmp_path / "half.part").exists()


@pytest.mark.parametrize("does", STUBBORN)
def test_a_parent_ends_its_child_when_it_likes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, does: str) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "child.py").write_text(STUBBORN[does])
    with ChildProcess(Path("child.py")) as child:
        until((tmp_path / "ready").exists)
    assert child.returncode < 0
    assert child.end() == child.returncode


def test_a_child_has_its_words_its_answers_and_its_exit_code(tmp_path: Path) -> None:
    program = tmp_path / "child.py"
    program.write_text("import sys; print(sys.argv[1:], __name__, input()); sys.exit(7)")
    child = ChildProcess(program, ["a b", 5, tmp_path], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    said, _ = child.communicate("heard\n")
    assert said == f"{['a b', '5', str(tmp_path)]} __main__ heard\n"
    assert child.returncode == 7
    assert not child._write_ends


def test_a_child_has_neither_the_current_folder_nor_an_empty_entry_on_its_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What PYTHONPATH names counts; the child's own children start so too."""
    here, named = tmp_path / "here", tmp_path / "named"
    for folder in (here, named):
        folder.mkdir()
    (named / "of_the_user.py").touch()
    for name in ("typing", "random", "runpy", "json", "sitecustomize", "usercustomize", "numpy", "taxel"):
        (here / f"{name}.py").write_text(f"open({str(tmp_path / 'RAN')!r}, 'w')")
    (here / "program.py").write_text(
        "import json, subprocess, sys, of_the_user; print(json.dumps(sys.path))\n"
        "print(subprocess.run([sys.executable, '-c', 'import json, sys; print(json.dumps(sys.path))'],"
        " stdout=subprocess.PIPE, text=True).stdout)"
    )
    monkeypatch.chdir(here)
    monkeypatch.setattr(sys, "path", ["", *sys.path])
    for entries in (["", named], [named, ""], [named, "", ""]):
        monkeypatch.setenv("PYTHONPATH", os.pathsep.join(map(str, entries)))
        with ChildProcess(Path("program.py"), stdout=subprocess.PIPE, text=True) as child:
            said, _ = child.communicate()
        for line in said.split("\n")[:2]:
            assert str(named) in json.loads(line)
            assert not {"", ".", str(here)} & {*json.loads(line)}
    assert "" not in search_path()
    assert not (tmp_path / "RAN").exists()


@pytest.mark.parametrize(
    ("before", "after"),
    [("", None), (":", None), ("a", "a"), (":a", "a"), ("a::b:", "a:b"), (".", "."), (None, None)],
)
def test_empty_entries_of_pythonpath_are_left_out(before: str | None, after: str | None) -> None:
    variables = {"HOME": "/h"} if before is None else {"HOME": "/h", "PYTHONPATH": before}
    make_safe(variables)
    assert variables == {"HOME": "/h", "PYTHONSAFEPATH": "1"} | ({} if after is None else {"PYTHONPATH": after})
