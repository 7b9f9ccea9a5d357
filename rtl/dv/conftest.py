"""Where a tool is missing, tests that simulate are skipped with its name."""

from __future__ import annotations

from pathlib import Path

import pytest

from verilated import missing


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Skip what simulates, where it cannot."""
    lacking = missing()
    if lacking is None:
        return
    for item in items:
        if item.path.is_relative_to(Path(__file__).parent):
            item.add_marker(pytest.mark.skip(reason=lacking))
