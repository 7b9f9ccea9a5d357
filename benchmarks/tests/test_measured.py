"""The page of everything measured holds every kept result; other pages quote at most ten, each with a link to it."""

import importlib.util
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
_spec = importlib.util.spec_from_file_location("measured", ROOT / "docs" / "measured.py")
assert _spec is not None
assert _spec.loader is not None
measured = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(measured)
PAGE = measured.PAGE.read_text()


def test_the_page_is_made_from_the_kept_results() -> None:
    assert measured.page() == PAGE, "run docs/measured.py"


def test_every_kept_result_is_on_the_page() -> None:
    kept = {file for folder in ("", "figures") for file in (measured.RESULTS / folder).glob("*.json")}
    linked = {(measured.DOCS / link).resolve() for link in re.findall(r"\[all numbers\]\((.*?)\)", PAGE)}
    assert len(kept) > 50
    assert linked == kept


def test_other_pages_quote_at_most_ten_results_that_stand_on_the_page() -> None:
    pages = [ROOT / "README.md", ROOT / "ROADMAP.md", *(ROOT / "docs").glob("*.md")]
    quotes = [
        quote
        for page in pages
        for quote in re.findall(r"\[([^]]*\d[^]]*)\]\(\S*measured\.md#(\w+)\)", page.read_text())
    ]
    headings = re.findall(r"^### (\S+)$", PAGE, re.MULTILINE)
    assert 0 < len(quotes) <= 10, quotes
    assert {heading for _, heading in quotes} <= set(headings)
