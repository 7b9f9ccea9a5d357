"""Settings of all tests: random examples are the same each time, and a slow machine is no failure."""

import os
import signal
from collections.abc import Iterator

import pytest
from hypothesis import settings

settings.register_profile("taxel", deadline=None, derandomize=True)
settings.load_profile("taxel")

# Before NumPy and scikit-learn load: their threads wait for each other by computing, and each worker has one core.
os.environ.setdefault("OMP_NUM_THREADS", "1")

# A shell that starts the tests in the background makes them ignore Ctrl-C, which some tests send.
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(autouse=True, scope="session")
def no_progress_on_a_slow_machine() -> Iterator[None]:
    """Let commands run long before a line of progress, which tests of stderr do not expect."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("taxel.cli._recordings._REPORT_S", (600.0,))
        yield
