"""What is run on which recordings, in which folds; and what that comes to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from taxel.studies.gait import folds
from taxel.studies.gait.folds import Scope
from taxel.studies.gait.pieces import Piece
from taxel.studies.gait.recipes import ENCODERS
from taxel.studies.gait.rules import RULES

__all__ = ["PROTOCOLS", "ROWS", "Outcome", "Protocol", "Unit"]

#: The three rows of the study, and what stands beside them.
ROWS = {
    "notes": "the notes' recipe (tuned on the shared people)",
    "chosen": "parameters chosen inside the training folds",
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


@dataclass(frozen=True)
class Unit:
    """What was found at one foot in one fold."""

    name: str
    person: str
    group: str
    events: int
    false: int
    minutes: float
    errors: tuple[float, ...]
    delays: tuple[float, ...]


@dataclass(frozen=True)
class Outcome:
    """One row of the study: a source, a protocol, an event, a row's name, and every foot.

    Attributes
    ----------
    points : list
        The parameters of each fold, where they were chosen inside.
    seconds : float
        CPU time of the folds' own fits.
    """

    source: str
    protocol: str
    event: str
    row: str
    units: tuple[Unit, ...]
    points: list[Any] = field(default_factory=list)
    seconds: float = 0.0
