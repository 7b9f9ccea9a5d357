"""A live source and its panel, for the tests of the server."""

import pytest

from taxel.live import Live
from taxel.panel import Panel


@pytest.fixture
def live():
    with Live(0, host="127.0.0.1") as live:
        yield live


@pytest.fixture
def panel(live, tmp_path):
    with Panel(live, folder=tmp_path) as panel:
        yield panel
