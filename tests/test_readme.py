"""Shell commands of README and docs: commands and options exist. `test_start.py` runs those of a reader's begin."""

import re
import shlex
from pathlib import Path

import cyclopts
import pytest
from printed_pages import README, ROOT, TARGETS, shell_lines

from taxel.cli._commands import command
from taxel.cli.app import own_commands, rows

PAGES = [README, ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]


def inline(page: Path) -> list[str]:
    """Return the commands that a page names in running text."""
    return re.findall(r"`((?:taxel|make) [^`\n]+)`", page.read_text())


CASES = [(page, line) for page in PAGES for line in [*shell_lines(page), *inline(page)]]


@pytest.mark.parametrize(("page", "line"), CASES, ids=[f"{page.stem}: {line}" for page, line in CASES])
def test_a_line_to_type_names_a_command_and_options_that_exist(page: Path, line: str) -> None:
    program, *arguments = shlex.split(line.split(" | ", maxsplit=1)[0])
    if program == "make":
        assert {argument for argument in arguments if "=" not in argument} <= TARGETS, page
    elif program.endswith("taxel"):
        check(arguments, in_full=line in shell_lines(page))


def check(arguments: list[str], *, in_full: bool) -> None:
    """Parse arguments as the command line does; what only names a command need not have all that it wants."""
    if arguments[0] in ("NAME", "--version", "--help"):
        return
    app, words = command(arguments[0]), arguments[1:]
    assert app is not None, arguments
    while own_commands(app) and words and words[0] in app:
        app, words = app[words[0]], words[1:]
    if app.default_command is None:
        assert not words or words[0] in ("NAME", "--help"), arguments
    elif in_full:
        try:
            app.parse_args(words, exit_on_error=False, print_error=False)
        except cyclopts.CycloptsError as error:
            pytest.fail(str(error))
    else:
        options = {name for row in rows(app) for name in row.names} | {"--help", "-h"}
        typed = {word.partition("=")[0] for word in words if word.startswith("-")}
        assert typed <= options | {f"--no-{name[2:]}" for name in options}, arguments
