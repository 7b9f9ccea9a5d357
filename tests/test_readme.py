"""Shell commands of README and docs: those of the README work in order; of all others command and options exist."""

import functools
import os
import re
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import typer
from live.boards import LOOPBACK
from loopback import free_port
from typer.core import TyperCommand, TyperGroup

from taxel.cli import app

ROOT = Path(__file__).parent.parent
README = ROOT / "README.md"
PAGES = [README, ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]


def shell_lines(page: Path) -> list[str]:
    """Return the shell commands of a page, without comments."""
    blocks = re.findall(r"^```(?:sh|bash|shell|console)?\n(.*?)^```", page.read_text(), re.MULTILINE | re.DOTALL)
    lines = [re.sub(r"\s+#.*", "", line).strip() for block in blocks for line in block.splitlines()]
    return [line for line in lines if re.match(r"(taxel|make|source|pip|cargo|\.venv/bin/taxel) ", line)]


def inline(page: Path) -> list[str]:
    """Return the commands that a page names in running text."""
    return re.findall(r"`((?:taxel|make) [^`\n]+)`", page.read_text())


WAY = [
    line
    for line in shell_lines(README)
    if re.match(r"taxel (record|emulate|info|train|detect|live) ", line)
    and "--panel" not in line  # tests/panel opens it
]
CASES = [(page, line) for page in PAGES for line in [*shell_lines(page), *inline(page)]]


@functools.cache
def commands() -> TyperGroup | TyperCommand:
    return typer.main.get_command(app)


@pytest.mark.parametrize(("page", "line"), CASES, ids=[f"{page.stem}: {line}" for page, line in CASES])
def test_a_line_to_type_names_a_command_and_options_that_exist(page: Path, line: str) -> None:
    program, *arguments = shlex.split(line.split(" | ", maxsplit=1)[0])
    if program == "make":
        targets = re.findall(r"^([a-z0-9-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
        assert {argument for argument in arguments if "=" not in argument} <= set(targets), page
    elif program.endswith("taxel"):
        check(commands(), arguments, in_full=line in shell_lines(page))


def check(command: TyperGroup | TyperCommand, arguments: list[str], *, in_full: bool) -> None:
    """Parse arguments as the command line does; what only names a command need not have all that it wants."""
    while isinstance(command, TyperGroup) and arguments and arguments[0] not in ("NAME", "--version", "--help"):
        # `taxel study` is found by an entry point, when it is asked for.
        found = command.get_command(command.make_context("taxel", [], resilient_parsing=True), arguments[0])
        assert found is not None, arguments
        command, arguments = found, arguments[1:]
    if isinstance(command, TyperGroup):
        return
    if in_full:
        command.make_context("taxel", list(arguments))
    else:
        every = {option for one in command.params for option in (*one.opts, *one.secondary_opts)}
        options = every | {"--help", "-h"}
        assert {argument for argument in arguments if argument.startswith("-")} <= options, arguments


class Shell:
    """Types lines of the README in a folder, over loopback and a free port."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.port = folder, free_port()

    def arguments(self, line: str) -> list[str]:
        # Ctrl-C ends what listens: a busy machine may need longer than a page says.
        line = line.replace("--port 5208", f"--port {self.port}").replace("--seconds 20", "--seconds 600")
        words = shlex.split(line, comments=True)[1:]
        here = ["--host", LOOPBACK] if words[0] in ("record", "live") else []
        return [sys.executable, "-m", "taxel", *words, *here]

    def run(self, line: str) -> str:
        done = subprocess.run(
            self.arguments(line), cwd=self.folder, capture_output=True, text=True, timeout=120, check=False
        )
        assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"
        return done.stdout

    def beside(self, line: str, other: str) -> str:
        """Start a command that listens, run the other beside it, then press Ctrl-C."""
        with subprocess.Popen(
            self.arguments(line), cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        ) as process:
            try:
                assert process.stderr is not None
                assert any("listening" in said for said in process.stderr), line
                self.run(other)
                process.send_signal(signal.SIGINT)
                said, error = process.communicate(timeout=60)
            finally:
                process.kill()
        assert process.returncode == 0, f"{line}\n{said}\n{error}"
        return said


def test_the_readmes_way_works_as_printed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Record and emulate side by side, look, train, detect, listen live; then its Python, in the same folder."""
    record, emulate, info, train, detect, live = WAY
    assert [line.split()[1] for line in WAY] == ["record", "emulate", "info", "train", "detect", "live"]
    shell = Shell(tmp_path)
    assert "nothing lost" in shell.beside(record, emulate)
    assert "4096 taxels" in shell.run(info) or "64 x 64 taxels" in shell.run(info)
    assert "written to touch.json" in shell.run(train)
    found = " ".join(shell.run(detect).split())
    [quoted] = re.findall(r"^```text\n(.*?)^```", README.read_text(), re.MULTILINE | re.DOTALL)
    for line in quoted.splitlines():
        assert " ".join(line.split()) in found, f"README: {line!r}"
    again = emulate.replace(" --truth ball.notes.csv", "")
    assert again != emulate
    assert "detections" in shell.beside(live, again)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    pieces = re.findall(r"^```python\n(.*?)^```", README.read_text(), re.MULTILINE | re.DOTALL)
    assert len(pieces) == 2
    for number, piece in enumerate(pieces):
        exec(compile(piece, f"README, piece {number}", "exec"), {"__name__": "readme"})
    assert os.path.getsize(tmp_path / "ball.mcap") > 1_000_000
