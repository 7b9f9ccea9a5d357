"""Settings of all tests: random examples are those of the committed tree, and a slow machine is no failure."""

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator

import pytest
from hypothesis import is_hypothesis_test, settings

#: Scripts that made kept data: not tests, and they need packages that are not installed.
collect_ignore = ["rules/tests/data"]

settings.register_profile("slow", deadline=None, max_examples=500)
settings.register_profile("quick", settings.get_profile("slow"), max_examples=20)

# Before NumPy and scikit-learn load: their threads wait for each other by computing, and each worker has one core.
os.environ.setdefault("OMP_NUM_THREADS", "1")

# A shell that starts the tests in the background makes them ignore Ctrl-C, which some tests send.
signal.signal(signal.SIGINT, signal.default_int_handler)
# So does nohup with SIGHUP: processes that tests start do not inherit a handler.
if sys.platform != "win32" and signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, lambda *_: None)

# Each start of taxel by a test would compile all of it where nothing compiled may be stored.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False


def tree_seed() -> int:
    """Return a seed made of the committed tree: a change draws other examples, and everybody draws the same ones.

    A copy that is no checkout draws by 0, and so does a machine without git.
    """
    if shutil.which("git") is None:
        return 0
    command = ["git", "rev-parse", "HEAD^{tree}"]
    done = subprocess.run(command, cwd=os.path.dirname(__file__), capture_output=True, check=False)
    return 0 if done.returncode else int(done.stdout[:8], 16)


@pytest.hookimpl(tryfirst=True)
def pytest_configure(config: pytest.Config) -> None:
    """Choose how many random examples a property test runs, and which, unless a seed is given."""
    settings.load_profile("slow" if config.option.markexpr == "slow" else "quick")
    if config.option.hypothesis_seed is None:
        config.option.hypothesis_seed = str(tree_seed())


def pytest_report_header(config: pytest.Config) -> str:
    """Say how the random examples of this run are drawn again."""
    return f"random examples: --hypothesis-seed={config.option.hypothesis_seed}"


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Run property tests with the slow tests too, which have more random examples then."""
    if config.option.markexpr == "slow":
        for item in items:
            if is_hypothesis_test(getattr(item, "obj", None)):
                item.add_marker("slow")


@pytest.fixture(autouse=True, scope="session")
def no_progress_on_a_slow_machine() -> Iterator[None]:
    """Let commands run long before a line of progress, which tests of stderr do not expect."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("taxel.cli.task._REPORT_S", (600.0,))
        yield
