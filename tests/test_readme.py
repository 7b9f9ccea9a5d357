"""Shell commands of README and docs: commands and options exist. `test_start.py` runs those of a reader's begin."""

import functools
import re
import shlex
from pathlib import Path

import pytest
import typer
from typer.core import TyperCommand, TyperGroup

from taxel.cli import app

ROOT = Path(__file__).parent.parent
README = ROOT / "README.md"
PAGES = [README, ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]


def shell_lines(page: Path) -> list[str]:
    """Return the shell commands of a page, without comments."""
    fenced = re.findall(r"^```(\S*)[^\n]*\n(.*?)^```", page.read_text(), re.MULTILINE | re.DOTALL)
    blocks = [block for language, block in fenced if language in ("", "bash", "console", "powershell", "sh", "shell")]
    lines = [re.sub(r"\s+#.*", "", line).strip() for block in blocks for line in block.splitlines()]
    return [line for line in lines if re.match(r"(taxel|make|source|pip|cargo|\.venv/bin/taxel) ", line)]


def inline(page: Path) -> list[str]:
    """Return the commands that a page names in running text."""
    return re.findall(r"`((?:taxel|make) [^`\n]+)`", page.read_text())


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
