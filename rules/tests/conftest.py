"""Rules are tried with the laws of taxel's learners and public names, which stand in taxel's own tests."""

import sys
from pathlib import Path

TESTS = Path(__file__).parents[2] / "tests"
#: Scripts that made kept data: not tests, and they need packages that are not installed.
collect_ignore_glob = ["data/*"]

sys.path += [str(TESTS), str(TESTS / "learn")]
