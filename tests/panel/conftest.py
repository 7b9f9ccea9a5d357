"""A live source and its panel, for the tests of the server; the browser, for those of the page."""

import pytest
from tests.panel.browser import started_chromium

from taxel.live import Live
from taxel.panel import Panel

__all__ = ["started_chromium"]


@pytest.fixture
def live():
    with Live(0, host="127.0.0.1") as live:
        yield live


@pytest.fixture
def panel(live, tmp_path):
    with Panel(live, folder=tmp_path) as panel:
        yield panel
