"""What is run on which recordings, and in which folds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from taxel_studies.gait import folds
from taxel_studies.gait.folds import Scope
from taxel_studies.gait.pieces import Piece
from taxel_studies.gait.recipes import ENCODERS, NOTES
from taxel_studies.gait.rules import RULES
from taxel_studies.gait.sources import encoded

__all__ = ["PROTOCOLS", "ROWS", "Protocol", "of", "scopes"]

#: The three rows of the study, and what stands beside them.
ROWS = {
    "notes": "the notes' recipe (tuned on the shared people, and flattered by that)",
    "chosen": "parameters chosen inside the training folds (missed + false first, then error): the honest row",
    "printed": "Table 6.2 as printed",
    "528: as printed": "528 settings of 6.5.2 searched, all else as printed",
    "528: recipe": "528 settings of 6.5.2 searched, all else as in the notes' recipe",
    "tonic": "the notes' recipe with tonic inputs (extension)",
    "others": "the notes' recipe, insole placed by other people's mean",
    **{f"rule: {name}": f"plain rule: {text}" for name, text in RULES.items()},
    **{f"encoder: {name}": f"encoder: {name}" for name in ENCODERS},
}


@dataclass(frozen=True)
class Protocol:
    """Say how a source is split and what is run on it.

    Attributes
    ----------
    name, title : str
    split : str
        "people", "footfalls", "time" or "pieces".
    folds : int
    repeats : int
        Of random splits.
    rows : tuple of str
        Of `ROWS`; "rules" and "encoders" stand for all of theirs.
    train, search : dict
        How much each piece or person trains, in the folds and inside them: ``seconds`` or ``count``.
    """

    name: str
    title: str
    split: str
    folds: int
    rows: tuple[str, ...]
    train: Mapping[str, int]
    search: Mapping[str, int]
    repeats: int = 1

    def scopes(self, all_pieces: Sequence[Piece]) -> list[Scope]:
        """Split pieces as this protocol says."""
        if self.split == "people":
            return folds.by_person(all_pieces, self.folds, seed=1)
        if self.split == "footfalls":
            return folds.by_count(all_pieces, self.folds, self.repeats, seed=1)
        if self.split == "time":
            return folds.by_time(all_pieces, self.folds)
        return folds.by_piece(all_pieces)


PROTOCOLS: dict[str, tuple[Protocol, ...]] = {
    "plate": (
        Protocol(
            "people left out",
            "each person is tested by what five others trained",
            "people",
            6,
            ("notes", "chosen", "printed", "others", "rules"),
            {"count": 40},
            {"count": 10},
        ),
        Protocol(
            "encoders compared",
            "two people are tested by what four others trained; each encoder has the same number of points",
            "people",
            3,
            ("encoders",),
            {"count": 20},
            {"count": 10},
        ),
        Protocol(
            "own footfalls",
            "40 of a person's 60 footfalls train, 20 test; every footfall is tested once a split",
            "footfalls",
            3,
            ("notes", "chosen", "printed"),
            {"count": 60},
            {"count": 60},
        ),
    ),
    "gaitpdb": (
        Protocol(
            "people left out",
            "four folds by person, half healthy, half patients",
            "people",
            4,
            ("notes", "chosen", "printed", "tonic", "rules"),
            {"seconds": 30},
            {"seconds": 15},
        ),
    ),
    "gaitndd": (
        Protocol(
            "people left out",
            "four folds by person, healthy people and patients spread",
            "people",
            4,
            ("notes", "chosen", "printed", "rules"),
            {"seconds": 120},
            {"seconds": 60},
        ),
        Protocol(
            "time within a person",
            "four folds by time within each person (6.5.3)",
            "time",
            4,
            ("notes", "chosen"),
            {"seconds": 300},
            {"seconds": 300},
        ),
    ),
    "moticon": (
        Protocol(
            "one recording trains, the other tests",
            "two recordings of one person",
            "pieces",
            2,
            ("notes", "rules"),
            {"seconds": 60},
            {"seconds": 60},
        ),
    ),
    "pedar": (
        Protocol(
            "one foot trains, the other tests",
            "two feet of one person",
            "pieces",
            2,
            ("notes", "rules"),
            {"seconds": 60},
            {"seconds": 60},
        ),
    ),
}


def of(source: str, name: str) -> Protocol:
    """Return a source's protocol by its name."""
    return next(protocol for protocol in PROTOCOLS[source] if protocol.name == name)


@lru_cache(maxsize=32)
def scopes(folder: Path, source: str, protocol: str, least: int = 2) -> tuple[Scope, ...]:
    """Split the recordings of a source's folder as one of its protocols says; scopes of fewer groups are left out."""
    encoder = next(iter(NOTES[source].values()))["encoder"]  # any will do: the pieces' names and lengths count
    pieces = list(encoded(folder, source, encoder).pieces.values())
    return tuple(scope for scope in of(source, protocol).scopes(pieces) if len(scope.groups) >= least)
