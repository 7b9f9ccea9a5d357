"""What is run on which recordings, and in which folds: by person, by footfall, by time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from taxel.detect import Part
from taxel.spikes import to_us
from taxel_studies.gait.pieces import Piece
from taxel_studies.gait.recipes import PRINTED
from taxel_studies.gait.rules import RULES
from taxel_studies.gait.sources import encoded

#: The rows of the study.
ROWS = {
    "recipe": "the study's own recipe (tuned on the shared people, and flattered by that)",
    "chosen": "parameters chosen inside the training folds (missed + false first, then error): the honest row",
    "printed": "Table 6.2 as printed, B as a sum, reset (docs/readings.md)",
    "squared": "Table 6.2, B squared, keep",
    "searched": "the search of 6.5.2 around Table 6.2",
    **RULES,
}
#: Draws the folds.
SEED = 1
#: Classes of speed.
SPEEDS = ("slow", "middle", "fast")


@dataclass(frozen=True)
class Scope:
    """What is judged by itself: all people, or one person. Each fold tests one of its groups and trains on the others.

    Attributes
    ----------
    name : str
        "all people", or a person.
    groups : tuple of tuples of taxel.detect.Part
        By number of the source's pieces, in their order.
    """

    name: str
    groups: tuple[tuple[Part, ...], ...]


def by_person(pieces: Sequence[Piece], folds: int) -> list[Scope]:
    """Leave whole people out: as many folds as asked, each with its share of healthy people and patients.

    With no more people than folds each fold is one person.
    """
    rng = np.random.default_rng(SEED)
    people = [
        str(person)
        for group in sorted({p.group for p in pieces})
        for person in rng.permutation(sorted({p.person for p in pieces if p.group == group}))
    ]
    groups = [tuple(n for person in people[k::folds] for n in _of(pieces, person)) for k in range(folds)]
    return [Scope("all people", tuple(group for group in groups if group))]


def by_speed(pieces: Sequence[Piece], folds: int) -> list[Scope]:
    """Leave people out, by themselves among the slow, the middle and the fast: three classes of as many people."""
    speeds = {piece.person: piece.speed_m_s for piece in pieces if np.isfinite(piece.speed_m_s)}
    classes = np.array_split(sorted(speeds, key=lambda person: (speeds[person], person)), len(SPEEDS))
    scopes = []
    for name, people in zip(SPEEDS, classes, strict=True):
        order = np.random.default_rng(SEED).permutation(people)
        groups = (tuple(n for person in order[k::folds] for n in _of(pieces, person)) for k in range(folds))
        scopes.append(Scope(name, tuple(group for group in groups if group)))
    return scopes


def by_footfall(pieces: Sequence[Piece], folds: int) -> list[Scope]:
    """Split each person's footfalls at random: with 3 folds 40 of 60 train and 20 test."""
    rng = np.random.default_rng(SEED)
    scopes = []
    for person in sorted({p.person for p in pieces}):
        mine = _of(pieces, person)
        order = rng.permutation(len(mine))
        scopes.append(Scope(person, tuple(tuple(mine[k] for k in sorted(order[g::folds])) for g in range(folds))))
    return scopes


def by_time(pieces: Sequence[Piece], folds: int) -> list[Scope]:
    """Cut each person's recording into stretches of equal length, as 6.5.3 does."""
    scopes = []
    for person in sorted({p.person for p in pieces}):
        groups: list[list[Part]] = [[] for _ in range(folds)]
        for whole in _of(pieces, person):
            piece = pieces[whole.example]
            ends = np.linspace(*piece.scored, folds + 1)
            ends[0], ends[-1] = 0.0, piece.duration
            for g, part in enumerate(to_us(ends)[:-1]):
                groups[g].append(Part(whole.example, float(part), float(to_us(ends[g + 1]))))
        scopes.append(Scope(person, tuple(tuple(g) for g in groups)))
    return scopes


def _of(pieces: Sequence[Piece], person: str) -> list[Part]:
    return [Part(n) for n, piece in enumerate(pieces) if piece.person == person]


@dataclass(frozen=True)
class Protocol:
    """Describe how a source is split and what is run on it.

    Attributes
    ----------
    name, title : str
        `SPLITS` has its split by name.
    folds : int
    rows : tuple of str
        Of `ROWS`.
    train, search : dict
        How much each piece or person trains, in the folds and inside them: ``seconds`` or ``count``.
    """

    name: str
    title: str
    folds: int
    rows: tuple[str, ...]
    train: Mapping[str, int]
    search: Mapping[str, int]


#: How pieces are split, by protocol.
SPLITS = {
    "people left out": by_person,
    "four folds": by_speed,
    "own footfalls": by_footfall,
    "time within a person": by_time,
}
_NEURONS = ("recipe", "chosen", "printed")
PROTOCOLS: dict[str, tuple[Protocol, ...]] = {
    "plate": (
        Protocol(
            "people left out",
            "each person is tested by what five others trained",
            6,
            (*_NEURONS, "count", "labels' own rule"),
            {"count": 40},
            {"count": 10},
        ),
        Protocol(
            "own footfalls",
            "40 of a person's 60 footfalls train, 20 test; every footfall is tested once a split",
            3,
            (*_NEURONS, "squared", "searched"),
            {"count": 60},
            {"count": 60},
        ),
    ),
    "gaitpdb": (
        Protocol(
            "people left out",
            "four folds by person, half healthy, half patients",
            4,
            (*_NEURONS, "count", "labels' own rule"),
            {"seconds": 30},
            {"seconds": 15},
        ),
    ),
    "gaitpdb by speed": (
        Protocol(
            "four folds", "four folds by person in each class of speed (6.5.3)", 4, ("printed",), {"seconds": 30}, {}
        ),
    ),
    "gaitndd": (
        Protocol(
            "people left out",
            "four folds by person, healthy people and patients spread",
            4,
            (*_NEURONS, "count"),
            {"seconds": 120},
            {"seconds": 60},
        ),
        Protocol(
            "time within a person",
            "four folds by time within each person (6.5.3)",
            4,
            ("recipe", "chosen"),
            {"seconds": 300},
            {"seconds": 300},
        ),
    ),
}


def of(source: str, name: str) -> Protocol:
    """Return a source's protocol by its name."""
    return next(protocol for protocol in PROTOCOLS[source] if protocol.name == name)


@lru_cache(maxsize=32)
def scopes(folder: Path, source: str, name: str) -> tuple[Scope, ...]:
    """Split the recordings of a source's folder as one of its protocols says; scopes of one group are left out."""
    # Any encoder will do: the names and lengths of the pieces count.
    pieces = encoded(folder, source, next(iter(PRINTED[source].values()))["encoder"]).pieces
    split = SPLITS[name](pieces, of(source, name).folds)
    return tuple(scope for scope in split if len(scope.groups) > 1)
