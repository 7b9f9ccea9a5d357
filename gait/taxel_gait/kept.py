"""``NAME.steps.csv``: the contacts and lifts that were found in a recording, as a table of labels that people edit.

What a person takes out of it or moves stays so in the next run: each row holds the number of its step, of how many, and
the time that was found (`found_us`), so a number that is missing was taken out, and a time that differs was moved.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel import Note
from taxel.labels import rows_of, text_with
from taxel_gait.feet import Foot
from taxel_gait.stances import Stances
from taxel_gait.walk import Step

__all__ = ["Kept", "keep", "read", "write"]

#: A stance that begins within this time of a row's is that of the row, us.
_SAME_US = 150_000
_LABELS = ("contact", "lift")
#: The columns beside those of every table of labels.
_COLUMNS = ("step", "of", "found_us")


def keep(feet: Sequence[Foot], steps: Sequence[Step], found: Sequence[Stances], of: int, trial: str) -> list[Note]:
    """Return the rows of the steps of a foot, without those that a person took out.

    Parameters
    ----------
    feet, steps
        Of the walk.
    found : sequence of Stances
        Of each foot, before what people changed.
    of : int
        The number of the foot.
    trial : str
        Which of the recording's trials it is; "" of a recording of one.
    """
    foot, own, rows = feet[of], found[of], []
    for step in steps:
        k = step.number - 1
        if step.foot != of or step.used == "by hand":
            continue
        for label, at, first, t_s in zip(
            _LABELS, (step.first, step.end), (own.contact[k], own.lift[k]), (step.contact_s, step.lift_s), strict=True
        ):
            if not np.isnan(t_s):
                cells = (step.number, len(own.contact), foot.frames.t[first])
                others = tuple((name, str(cell)) for name, cell in zip(_COLUMNS, cells, strict=True))
                rows.append(Note(label, int(foot.frames.t[at]), source=foot.source, recording=trial, others=others))
    return rows


def write(path: Path, rows: Iterable[Note]) -> None:
    """Write a table of labels in the place of the one before."""
    from taxel.report import write_whole  # noqa: PLC0415  loads slowly

    text = text_with(rows, ("t_us", "label", "source", *_COLUMNS))
    write_whole(path, lambda file: file.write(text.encode()), overwrite=True)


def read(path: Path) -> tuple[Note, ...]:
    """Return the rows of a table of labels; none where there is no file.

    Raises
    ------
    FormatError : it is no table of labels (names the line)
    """
    return rows_of(path, path.read_text("utf-8").splitlines())[0] if path.exists() else ()


@dataclass(frozen=True)
class Kept:
    """Hold what people changed of the steps of one foot.

    Parameters
    ----------
    there : tuple of int, us
        The times that were found of the contacts that are there.
    out : tuple of (float, float), us
        Between which times contacts were taken out.
    moved : dict from (label, int us) to int us
        By the time that was found, the time that a person gave.
    """

    there: tuple[int, ...] = ()
    out: tuple[tuple[float, float], ...] = ()
    moved: dict[tuple[str, int], int] = field(default_factory=dict)

    @classmethod
    def of(cls, rows: Iterable[Note], source: str, trial: str) -> Kept:
        """Return the changes in the rows of a foot."""
        numbered, there, moved, of = {}, [], {}, 0
        for row in rows:
            others = dict(row.others)
            cells = [others.get(name, "") for name in _COLUMNS]
            if (row.source, row.recording) != (source, trial) or row.t is None or not all(map(str.isdecimal, cells)):
                continue
            number, of, found = map(int, cells)
            if row.t != found:
                moved[row.text, found] = row.t
            if row.text == _LABELS[0]:
                numbered[number] = found
                there.append(found)
        missing = [number for number in range(1, of + 1) if number not in numbered]
        known = sorted(numbered)
        out = []
        for number in missing:
            k = int(np.searchsorted(known, number))
            low = numbered[known[k - 1]] if k else -np.inf
            out.append((low, numbered[known[k]] if k < len(known) else np.inf))
        return cls(tuple(there), tuple(dict.fromkeys(out)), moved)

    def apply(self, foot: Foot, found: Stances) -> tuple[Stances, NDArray[np.bool_]]:
        """Return the stances of a foot with the times that people gave, and which of them were taken out."""
        t, there = foot.frames.t, np.array(self.there or [np.iinfo(np.int64).min // 2])
        contact, lift = found.contact.copy(), found.lift.copy()
        begin = t[found.contact]
        is_there = np.array([np.abs(there - one).min() <= _SAME_US for one in begin], bool)
        by_hand = np.array([any(low < one < high for low, high in self.out) for one in begin], bool) & ~is_there
        # A stance that the recording cuts has no row.
        by_hand &= ~found.cut_at_contact
        for (label, at), to in self.moved.items():
            edges = contact if label == _LABELS[0] else lift
            if not len(edges):
                continue
            times = t[np.minimum(edges, len(t) - 1)]
            nearest = int(np.abs(times - at).argmin())
            if abs(int(times[nearest]) - at) <= _SAME_US:
                edges[nearest] = min(int(np.searchsorted(t, to)), len(t) - 1)
        return Stances(contact, lift, found.cut_at_contact, found.cut_at_lift), by_hand
