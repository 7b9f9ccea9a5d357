"""What the tests of all studies share."""

from collections.abc import Iterator

import pytest

#: Programs that other engines run: not tests, and they need packages that are not installed.
collect_ignore_glob = ["press_by_*.py"]


@pytest.fixture(scope="session", autouse=True)
def _one_commit() -> Iterator[None]:
    """Let runs be of one commit: in a checkout with local changes none would use the results of another."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("taxel_studies.study.code_version", lambda *packages: "0123abc")
        yield
