"""The pages of *Start here* do what they say: their commands and Python in order, each page in its own folder.

What a page prints are whole lines, or their beginning before "...".
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from tests.test_readme import Shell

DOCS = Path(__file__).parent.parent / "docs"
PAGES = sorted(DOCS.glob("start-*.md"))
#: Commands that wait for another one beside them.
LISTENING = ("taxel record", "taxel live")


def blocks(page: Path) -> list[tuple[str, str]]:
    """Return the blocks of a page in order: their language ("" of commands) and their text."""
    return re.findall(r"^```(|python|text)\n(.*?)^```", page.read_text(), re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_page_works_as_printed(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    shell, printed = Shell(tmp_path), ""
    for language, text in blocks(page):
        if language == "python":
            exec(compile(text, page.name, "exec"), {"__name__": page.stem})
        elif language == "text":
            said = {" ".join(line.split()) for line in printed.splitlines()}
            for line in text.splitlines():
                whole, cut, _ = " ".join(line.split()).partition(" ...")
                found = whole in said or (cut and any(one.startswith(whole) for one in said))
                assert found, f"{page.name}: {line!r} is not in\n{printed}"
        else:
            lines, printed = text.splitlines(), ""
            printed = shell.beside(*lines) if lines[0].startswith(LISTENING) else "".join(map(shell.run, lines))


def test_each_page_is_named_where_a_reader_begins() -> None:
    begin = (DOCS / "start.md").read_text()
    assert len(PAGES) == 5
    for page in PAGES:
        assert f"{{doc}}`{page.stem}`" in begin
