"""The Python code of the documentation runs, each page in its own folder; tutorials show its output and pictures.

The files of this repository that a page names exist, and so do the targets of `make`.
"""

from __future__ import annotations

import doctest
import importlib.util
import re
from pathlib import Path

import pytest
from printed_pages import TARGETS

DOCS = Path(__file__).parent.parent / "docs"
PAGES = sorted(
    page for page in DOCS.glob("*.md") if "```python" in page.read_text() and not page.stem.startswith("start-")
)

_spec = importlib.util.spec_from_file_location("pieces", DOCS / "pieces.py")
assert _spec is not None
assert _spec.loader is not None
pieces = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(pieces)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_python_piece_of_a_page_runs_in_order_and_does_what_the_page_says(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    count = 0
    for done in pieces.run(page):
        count += 1
        where = f"{page.name}, piece {done.number}: run docs/pieces.py on the page"
        if page.stem.startswith("tutorial"):
            same = doctest.OutputChecker().check_output(done.said or "", done.printed, doctest.NORMALIZE_WHITESPACE)
            assert same, f"{where}: prints\n{done.printed}"
            assert len(done.pictures) == len(done.figures), where
        assert all((DOCS / picture).exists() for picture in done.pictures), where
    assert count == page.read_text().count("```python")


ROOT = DOCS.parent
PROSE = sorted(page for kind in ("*.md", "docs/*.md", "docs/reference/*.md", "*/README.md") for page in ROOT.glob(kind))
FOLDERS = "benchmarks|bridge|crates|docs|fuzz|gait|makers|python|rtl|rules|studies|tests|tools|viewers"
_PATH = re.compile(rf"(?<![\w./-])(?:{FOLDERS})/[\w./-]+")
#: What `make` builds, and a folder of another project.
ELSEWHERE = ("rtl/build/", "tests/testdata")


@pytest.mark.parametrize("page", PROSE, ids=lambda page: str(page.relative_to(ROOT)))
def test_the_paths_and_make_targets_of_a_page_exist(page: Path) -> None:
    prose = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)
    for code in re.findall(r"`([^`]+)`", prose):
        for path in _PATH.findall(code):
            known = "NAME" in path or path.startswith(ELSEWHERE)
            assert known or (ROOT / path).exists() or (page.parent / path).exists(), f"{page.name}: no file {path}"
        for target in re.findall(r"\bmake ([a-z][\w-]*)", code):
            assert target in TARGETS, f"{page.name}: no target {target} in the Makefile"


def headings(page: Path) -> set[str]:
    """Return the anchors of a page's headings, as GitHub makes them."""
    prose = re.sub(r"^ *```.*?^ *```", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)
    return {re.sub(r"[^\w -]", "", line).lower().replace(" ", "-") for line in re.findall(r"^#+ (.+)$", prose, re.M)}


@pytest.mark.parametrize("page", PROSE, ids=lambda page: str(page.relative_to(ROOT)))
def test_the_links_of_a_page_lead_somewhere_on_github_too(page: Path) -> None:
    prose = re.sub(r"^ *```.*?^ *```", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)
    assert not re.findall(r"\{(?:doc|ref|term|py:\w+)\}`", prose), "a role, which GitHub shows as raw text"
    for link in re.findall(r"\]\(([^)\s]+)\)", prose):
        path, _, anchor = link.partition("#")
        target = page.parent / path if path else page
        if not link.startswith("http"):
            assert target.exists(), link
            assert not anchor or target.suffix != ".md" or anchor in headings(target), link
