"""The page of everything measured holds every kept result, that of results what other pages cite; both are made."""

import importlib.util
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
_spec = importlib.util.spec_from_file_location("measured", ROOT / "docs" / "measured.py")
assert _spec is not None
assert _spec.loader is not None
measured = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(measured)
MEASURED = measured.measured()
RESULTS = (measured.DOCS / "results.md").read_text()
#: A page that anybody can read to its end.
LONGEST = 60


def test_the_page_of_results_is_made_from_the_kept_results() -> None:
    assert measured.results() == RESULTS, "run docs/measured.py"
    assert len(RESULTS.splitlines()) <= LONGEST


def test_every_kept_result_is_on_the_page_of_all() -> None:
    kept = {file for folder in ("", "figures") for file in (measured.RESULTS / folder).glob("*.json")}
    linked = {(measured.DOCS / link).resolve() for link in re.findall(r"\[all numbers\]\((.*?)\)", MEASURED)}
    assert len(kept) > 50
    assert linked == kept


def test_other_pages_quote_at_most_ten_results_that_stand_on_the_page() -> None:
    pages = [ROOT / "README.md", ROOT / "FEATURES.md", *(ROOT / "docs").glob("*.md")]
    quotes = [
        quote
        for page in pages
        for quote in re.findall(r"\[([^]]*\d[^]]*)\]\(\S*results\.md#([\w-]+)\)", page.read_text())
    ]
    assert 0 < len(quotes) <= 10, quotes
    sections = {part.split("\n")[0].lower().replace(" ", "-"): part for part in RESULTS.split("\n## ")[1:]}
    # Of detections, those of what runs: the first column of numbers.
    sections["detections"] = re.sub(r"^(\| .*? \| .*? \|).*", r"\1", sections["detections"], flags=re.MULTILINE)
    for text, heading in quotes:
        numbers = re.findall(r"\d+(?:\.\d+)?", text)
        assert all(re.search(rf"(?<![\d.]){re.escape(number)}(?![\d.])", sections[heading]) for number in numbers), text


def test_no_page_links_to_the_page_that_is_only_built() -> None:
    for page in (*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")):
        assert "measured.md)" not in page.read_text(), page.name
