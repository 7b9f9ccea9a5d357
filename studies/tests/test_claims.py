"""Claims are well-formed data, each is judged, and what they add up to is counted by hand."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from taxel_studies.claims import CLAIMS, ERRATA, Claim, _verdict, summed, verdicts

ROOT = Path(__file__).parents[2]
KEPT = [json.loads(file.read_text()) for file in (ROOT / "benchmarks" / "results" / "figures").glob("*.json")]
JUDGEMENTS = [judged for section in KEPT for judged in section["judgements"]]


def judged(claim: int, reading: str, holds: bool | None) -> dict[str, Any]:
    return {"claim": claim, "reading": reading, "holds": holds, "ours": "ours", "why": ""}


def test_every_claim_has_a_place_and_one_state() -> None:
    for claim in CLAIMS.values():
        assert claim.says.endswith("."), claim
        assert bool(claim.line) != bool(claim.source), claim
        assert bool(claim.main) == bool(claim.fixed), claim
        assert not (claim.main and claim.open), claim
    assert all(error["line"] for error in ERRATA)
    assert {claim.number > 200 for claim in CLAIMS.values() if claim.source} == {True}
    assert {claim.number > 200 for claim in CLAIMS.values() if not claim.source} == {False}


def test_every_claim_is_judged_and_every_line_that_fixes_a_reading_stands_in_readings() -> None:
    assert {one["claim"] for one in JUDGEMENTS} == CLAIMS.keys()
    stated = set(map(int, re.findall(r"\bT(\d+)", (ROOT / "docs" / "readings.md").read_text())))
    assert {line for claim in CLAIMS.values() for line in claim.fixed} <= stated


def test_a_claim_is_judged_once_in_each_reading() -> None:
    for one in verdicts(JUDGEMENTS):
        readings = [j["reading"] for j in (one.main, *one.others) if j]
        assert len(set(readings)) == len(readings), one.claim


def test_a_claim_without_a_line_has_no_main_reading_and_another_only_the_one_that_is_fixed() -> None:
    both = [judged(1, "a", True), judged(1, "b", False)]
    fixed = _verdict(Claim(1, "1.1", "It is so.", line=1, main="b", fixed=(1,)), both)
    assert (fixed.main, fixed.others, fixed.beside) == (both[1], both[:1], "1 of 1")
    nothing = _verdict(Claim(1, "1.1", "It is so.", line=1, open="all"), [judged(1, "", True)])
    assert (nothing.main, len(nothing.others)) == (None, 1)
    missing = _verdict(Claim(1, "1.1", "It is so.", line=1, main="c", fixed=(1,)), both)
    assert summed([fixed, nothing, missing]) == (
        "0 of 3 hold in their main reading, 1 do not; of 1 it was not run, of 0 it cannot be judged, and of 1 no line "
        "fixes one; 1 hold in every reading that was judged, 0 in none"
    )
    assert summed([_verdict(CLAIMS[24], [judged(24, "", None)])]).startswith("0 of 1 hold")


def test_the_readme_quotes_what_the_results_count() -> None:
    pages = [(ROOT / page).read_text() for page in ("README.md", "docs/results.md")]
    quoted, counted = (re.search(r"(\d+ of \d+) (?:claims )?hold in their\s+main reading", page) for page in pages)
    assert quoted
    assert counted
    assert quoted[1] == counted[1]
