"""The claims of the thesis, as data, and what the studies' judgements of them add up to."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

#: A judgement as a section of the page holds it: the fields of `taxel_studies.study.Judgement`.
Judged = Mapping[str, Any]


@dataclass(frozen=True)
class Claim:
    """One claim, in words of our own.

    Attributes
    ----------
    number : int
        It stays with the claim; from 201 on of other papers and of our own.
    at : str
        Section of the thesis; its first figure is the chapter.
    says : str
    value : str
        As published.
    line : int
        Of the thesis' text; 0 where the claim is not the thesis'.
    main : str
        The reading in which it is judged; "": it has one reading, or `open` says why none is main.
    fixed : tuple of int
        The lines of the thesis that fix the main reading.
    open : str
        What no line fixes.
    source : str
        Who claims it, if not the thesis.
    """

    number: int
    at: str
    says: str
    value: str = ""
    line: int = 0
    main: str = ""
    fixed: tuple[int, ...] = ()
    open: str = ""
    source: str = ""

    @property
    def where(self) -> str:
        """Section and line, or section and source."""
        return f"{self.at}, {self.source or f'T{self.line}'}"


_FILE = tomllib.loads(Path(__file__).with_name("claims.toml").read_text(encoding="utf-8"))
#: All claims by number.
CLAIMS: dict[int, Claim] = {
    one["number"]: Claim(**{**one, "fixed": tuple(one.get("fixed", ()))}) for one in _FILE["claim"]
}
#: Sentences of the thesis that contradict it: section, line, what it prints, and what stands instead.
ERRATA: list[dict[str, Any]] = _FILE["erratum"]


class Verdict(NamedTuple):
    """A claim with its judgements: in its main reading, None where that was not run or none is main; in all others."""

    claim: Claim
    main: Judged | None
    others: list[Judged]

    @property
    def judged(self) -> list[bool]:
        """Whether it holds, in each reading in which it can be judged."""
        return [one["holds"] for one in (self.main, *self.others) if one is not None and one["holds"] is not None]

    @property
    def beside(self) -> str:
        """In how many of the other readings it holds: "k of n"; "" without any."""
        held = [one["holds"] for one in self.others if one["holds"] is not None]
        return f"{sum(held)} of {len(held)}" if held else ""


def verdicts(judgements: Iterable[Judged]) -> list[Verdict]:
    """Put judgements together, claim by claim; of a claim that nobody judged both are missing."""
    by: dict[int, list[Judged]] = {number: [] for number in CLAIMS}
    for one in judgements:
        by[one["claim"]].append(one)
    return [_verdict(CLAIMS[number], here) for number, here in sorted(by.items())]


def _verdict(claim: Claim, here: list[Judged]) -> Verdict:
    main = [one for one in here if not claim.open and one["reading"] == claim.main]
    return Verdict(claim, main[0] if main else None, [one for one in here if one not in main])


def summed(found: Iterable[Verdict]) -> str:
    """Count, in words, the thesis' claims that hold in their main reading, in every reading and in none."""
    own = [one for one in found if not one.claim.source]
    main = [one for one in own if not one.claim.open]
    held = [one.main["holds"] for one in main if one.main]
    always, never = (sum(bool(one.judged) and way(one.judged) for one in own) for way in (all, _none))
    return (
        f"{held.count(True)} of {len(own)} hold in their main reading, {held.count(False)} do not; of "
        f"{len(main) - len(held)} it was not run, of {held.count(None)} it cannot be judged, and of "
        f"{len(own) - len(main)} no line fixes one; {always} hold in every reading that was judged, {never} in none"
    )


def _none(held: Iterable[bool]) -> bool:
    return not any(held)
