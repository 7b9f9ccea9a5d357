"""What the tests of tables of labels share."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import taxel
from taxel.labels import Note
from taxel.live._label_join import Edit
from taxel.live._label_table import LabelTables

#: What a row of these tables may call the recording.
OWN = frozenset({"", "walk.mcap", "walk"})
#: What is saved beside the table.
SAVED = ".walk.notes.csv.acknowledged"


def mark(tables: LabelTables, table: Path, label: str, t: int):
    (outcome,), read = tables.change(table, OWN, [[Edit(None, Note(label, t))]])
    assert not isinstance(outcome, str)
    return read


def held(table: Path) -> Counter:
    return Counter((row.text, row.t) for row in taxel.Labels(table).rows)


def texts(rows) -> list[tuple[str, int]]:
    return sorted((row.text, row.t) for row in rows)
