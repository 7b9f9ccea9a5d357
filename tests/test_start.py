"""The page *Start here* and the way of the README do what they say, in one folder.

What the page prints are whole lines, or their beginning before "...".
"""

from __future__ import annotations

import contextlib
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from live.boards import LOOPBACK
from loopback import free_port
from printed_pages import README, shell_lines
from shell import run, run_beside

DOCS = Path(__file__).parent.parent / "docs"
PAGE = DOCS / "start.md"
#: Commands that wait for another one beside them.
LISTENING = ("taxel record", "taxel live")
WAY = [
    line
    for line in shell_lines(README)
    if re.match(r"taxel (record|emulate|info|train|detect|live) ", line)
    and "--panel" not in line  # tests/panel opens it
]


class Shell:
    """Types lines of a page in the current folder, over loopback and a free port."""

    def __init__(self) -> None:
        self.port = free_port()

    def arguments(self, line: str) -> list[str]:
        # Ctrl-C ends what listens: a busy machine may need longer than a page says.
        line = line.replace("--port 5208", f"--port {self.port}").replace("--seconds 20", "--seconds 600")
        words = shlex.split(line, comments=True)[1:]
        receives = words[0] in ("record", "live") and "--source" not in words
        return [*words, *(["--host", LOOPBACK] if receives else [])]

    def run(self, line: str) -> str:
        done = run(*self.arguments(line))
        assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"
        return done.stdout

    def beside(self, line: str, other: str) -> str:
        """Run a command that listens and, beside it, a process of the other, then press Ctrl-C."""
        board = [sys.executable, "-m", "taxel", *self.arguments(other)]
        done = run_beside(
            lambda _: subprocess.run(board, capture_output=True, timeout=120, check=True), *self.arguments(line)
        )
        assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"
        return done.stdout


def blocks(page: Path) -> list[tuple[str, str]]:
    """Return the blocks of a page in order: their language ("" of commands) and their text; others are for people."""
    found = re.findall(r"^```(\w*)\n(.*?)^```", page.read_text(), re.MULTILINE | re.DOTALL)
    return [(language, text) for language, text in found if language in ("", "python", "text")]


def waits_for_another(line: str) -> bool:
    """Return whether a command waits for a board, which the next line emulates."""
    return line.startswith(LISTENING) and "--source" not in line


def command(line: str) -> str:
    """Return a line without its comment, and without the option that writes a report beside all else."""
    return re.sub(r"\s+#.*| --report \S+", "", line).strip()


def play(shell: Shell, by_line: dict[str, str]) -> None:
    """Do what the page says in the current folder; keep what each of its commands printed."""
    printed = ""
    for language, text in blocks(PAGE):
        lines = text.splitlines()
        if language == "python":
            exec(compile(text, PAGE.name, "exec"), {"__name__": "start"})
        elif language == "text":
            said = {" ".join(line.split()) for line in printed.splitlines()}
            for line in lines:
                whole, cut, _ = " ".join(line.split()).partition(" ...")
                found = whole in said or (cut and any(one.startswith(whole) for one in said))
                assert found, f"{line!r} is not in\n{printed}"
        elif waits_for_another(lines[0]):
            printed = by_line[command(lines[0])] = shell.beside(*lines)
            by_line[command(lines[1])] = ""
        else:
            by_line |= {command(line): shell.run(line) for line in lines}
            printed = "".join(by_line[command(line)] for line in lines)


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, str]]:
    """What the page says was done: the folder, and what each of its commands printed."""
    folder, by_line = tmp_path_factory.mktemp("start"), {}
    with contextlib.chdir(folder):
        play(Shell(), by_line)
    return folder, by_line


def test_the_page_works_as_printed(played: tuple[Path, dict[str, str]]) -> None:
    folder, _ = played
    assert {"touch.json", "press.json", "gait.json", "grasp.json"} <= {file.name for file in folder.iterdir()}


def test_the_readmes_way_works_as_printed(played: tuple[Path, dict[str, str]], monkeypatch: pytest.MonkeyPatch) -> None:
    """Its commands are those of an event board; then its Python, in the same folder."""
    folder, printed = played
    record, _, info, train, detect, live = WAY
    assert [line.split()[1] for line in WAY] == ["record", "emulate", "info", "train", "detect", "live"]
    assert set(WAY) <= printed.keys()
    assert "nothing lost" in printed[record]
    assert "4096 taxels" in printed[info] or "64 x 64 taxels" in printed[info]
    assert "written to touch.json" in printed[train]
    found = " ".join(printed[detect].split())
    [quoted] = re.findall(r"^```text\n(.*?)^```", README.read_text(), re.MULTILINE | re.DOTALL)
    for line in quoted.splitlines():
        assert " ".join(line.split()) in found, f"README: {line!r}"
    assert "detections" in printed[live]
    monkeypatch.chdir(folder)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    pieces = re.findall(r"^```python\n(.*?)^```", README.read_text(), re.MULTILINE | re.DOTALL)
    assert len(pieces) == 2
    for number, piece in enumerate(pieces):
        exec(compile(piece, f"README, piece {number}", "exec"), {"__name__": "readme"})
    assert os.path.getsize(folder / "ball.mcap") > 1_000_000
