"""The bench's modules are found; where a tool is missing, tests of the RTL are skipped with its name."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.extend(str(Path(__file__).parents[1] / folder) for folder in ("bench", "bench/modules"))

from logic import missing


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Skip what simulates, where it cannot."""
    lacking = missing()
    if lacking is None:
        return
    for item in items:
        if item.path.is_relative_to(Path(__file__).parent):
            item.add_marker(pytest.mark.skip(reason=lacking))
