"""Fixtures of several files of tests."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from taxel.live._label_table import LabelTables


@pytest.fixture
def table(tmp_path: Path) -> Path:
    return tmp_path / "walk.notes.csv"


@pytest.fixture
def tables() -> Iterator[LabelTables]:
    one = LabelTables()
    yield one
    one.close()
