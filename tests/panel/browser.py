"""A browser, for the tests that look at the page."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from playwright.sync_api import Browser, sync_playwright
from tools.chromium import LACKING, chromium

#: Timeout for any action on a machine at load 20, s.
PATIENCE = 90
FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--autoplay-policy=no-user-gesture-required",
]
#: The browser's program, found while no Playwright runs.
CHROMIUM = chromium()


def installed() -> str:
    """Return the browser's program, or fail where there is none."""
    if CHROMIUM is None:
        pytest.fail(LACKING, pytrace=False)
    return CHROMIUM


@contextmanager
def started_chromium() -> Iterator[Browser]:
    """Start the browser, with one page for most tests."""
    with sync_playwright() as started:
        browser = started.chromium.launch(executable_path=installed(), args=FLAGS)
        browser.new_context().new_page()
        yield browser
        browser.close()
