"""The option of CONTRIBUTING: seen in the help of the command line, in Python and on the page."""

import inspect

import pytest
from tests.panel.pages import opened, shows

from taxel.cli import main
from taxel.live import Live, Panel


def test_the_option_is_seen_everywhere(chromium, capsys):
    with pytest.raises(SystemExit):
        main(["live", "--help"])
    assert "--mounted-on" in (shown := capsys.readouterr().out)
    assert "The surface that the sensor" in shown
    assert inspect.signature(Live).parameters["mounted_on"].default == "table"
    assert "mounted_on : str\n" in Live.__doc__
    with (
        Live(0, host="127.0.0.1", mounted_on="robot hand") as live,
        Panel(live) as panel,
        opened(chromium, panel.url) as page,
    ):
        shows(page, "session-options", "mounted_on: robot hand")
