"""Folds as data: who is trained on and who is tested, so that rivals can use the same.

A scope is judged by itself ("all" people, or one person). It has groups; each fold tests one group and trains on the
others. Parameters are chosen inside: each training group is tested once by what was trained on the rest of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from taxel_studies.gait.pieces import Piece

__all__ = ["Part", "Scope", "by_count", "by_person", "by_piece", "by_time", "from_json", "to_json"]


@dataclass(frozen=True)
class Part:
    """Name a piece, or a stretch of one in ms."""

    piece: str
    start_ms: float | None = None
    stop_ms: float | None = None

    def of(self, pieces: dict[str, Piece]) -> Piece:
        """Return the named piece or stretch."""
        piece = pieces[self.piece]
        if self.start_ms is None or self.stop_ms is None:
            return piece
        return piece.between(self.start_ms, self.stop_ms)


@dataclass(frozen=True)
class Scope:
    """Hold the groups of one judgement; each fold tests one of them and trains on the others.

    Attributes
    ----------
    name : str
        "all people", or a person.
    groups : tuple of tuples of Part
    """

    name: str
    groups: tuple[tuple[Part, ...], ...]


def by_person(pieces: Sequence[Piece], folds: int, seed: int) -> list[Scope]:
    """Leave whole people out: as many folds as asked, each with its share of healthy people and patients.

    With no more people than folds each fold is one person.
    """
    rng = np.random.default_rng(seed)
    groups: list[list[str]] = [[] for _ in range(folds)]
    k = 0
    for group in sorted({p.group for p in pieces}):
        people = sorted({p.person for p in pieces if p.group == group})
        for person in rng.permutation(people):
            groups[k % folds].append(str(person))
            k += 1
    of = {person: [Part(p.name) for p in pieces if p.person == person] for person in {p.person for p in pieces}}
    return [Scope("all people", tuple(tuple(part for person in g for part in of[person]) for g in groups if g))]


def by_count(pieces: Sequence[Piece], folds: int, repeats: int, seed: int) -> list[Scope]:
    """Split each person's footfalls at random: with 3 folds 40 of 60 train and 20 test, `repeats` times."""
    rng = np.random.default_rng(seed)
    scopes = []
    for person in sorted({p.person for p in pieces}):
        names = [p.name for p in pieces if p.person == person]
        for r in range(repeats):
            order = rng.permutation(len(names))
            groups = tuple(tuple(Part(names[k]) for k in sorted(order[g::folds])) for g in range(folds))
            scopes.append(Scope(person if repeats == 1 else f"{person}, split {r + 1}", groups))
    return scopes


def by_time(pieces: Sequence[Piece], folds: int) -> list[Scope]:
    """Cut each person's recording into stretches of equal length, as 6.5.3 does."""
    scopes = []
    for person in sorted({p.person for p in pieces}):
        groups: list[list[Part]] = [[] for _ in range(folds)]
        for piece in (p for p in pieces if p.person == person):
            ends = np.linspace(*piece.scored, folds + 1)
            ends[0], ends[-1] = 0.0, piece.duration
            for g in range(folds):
                groups[g].append(Part(piece.name, float(ends[g]), float(ends[g + 1])))
        scopes.append(Scope(person, tuple(tuple(g) for g in groups)))
    return scopes


def by_piece(pieces: Sequence[Piece]) -> list[Scope]:
    """Let one recording train and the other test; where there is only one, one foot trains and the other tests."""
    names = [p.name for p in pieces]
    recordings = sorted({name.rsplit(" ", 1)[0] for name in names})
    if len(recordings) > 1:
        groups = [[Part(n) for n in names if n.rsplit(" ", 1)[0] == recording] for recording in recordings]
    else:
        groups = [[Part(n)] for n in names]
    return [Scope("all", tuple(tuple(g) for g in groups))]


def to_json(scopes: Sequence[Scope]) -> list[dict[str, Any]]:
    """Return scopes as plain values: a part is a piece's name, or name, start and stop in ms."""

    def plain(part: Part) -> str | list[Any]:
        return part.piece if part.start_ms is None else [part.piece, part.start_ms, part.stop_ms]

    return [{"scope": s.name, "groups": [[plain(p) for p in g] for g in s.groups]} for s in scopes]


def from_json(said: Sequence[dict[str, Any]]) -> list[Scope]:
    """Return the scopes that `to_json` gave."""
    return [
        Scope(s["scope"], tuple(tuple(Part(*([p] if isinstance(p, str) else p)) for p in g) for g in s["groups"]))
        for s in said
    ]
