"""Settings of the product's tests: which begin first, and what several of them share."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from playwright.sync_api import Browser

#: Scripts that made kept data need packages that are not installed; examples of CONTRIBUTING run where they are added.
collect_ignore_glob = ["data/*", "contributing/*"]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the files that look at pages or type one: they take longest, and the last keeps all others waiting."""
    items.sort(key=lambda item: not {"chromium", "played"} & set(getattr(item, "fixturenames", ())))


@pytest.fixture(scope="session")
def chromium() -> Iterator[Browser]:
    """Start one browser for all pages of a process."""
    from tests.panel.browser import started_chromium  # the wheels' tests on other systems see no page

    with started_chromium() as browser:
        yield browser


@pytest.fixture
def drawn() -> None:
    """Asked for by a test that looks at the pictures of a report, among others that do not."""


@pytest.fixture
def undrawn(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Reports whose pictures are empty, as to draw them takes most of their time; unless a test asks for `drawn`."""
    if "drawn" not in request.fixturenames:
        monkeypatch.setattr("taxel.report.svg._svg", lambda figure: "<svg></svg>")


@pytest.fixture
def full_device() -> Iterator[Path]:
    """Give a disk that is always full to one test at a time, as a recording locks its file."""
    if not Path("/dev/full").exists():
        pytest.skip("needs /dev/full, a disk that is always full")
    import fcntl

    with (Path(tempfile.gettempdir()) / "taxel-tests-of-dev-full").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield Path("/dev/full")
