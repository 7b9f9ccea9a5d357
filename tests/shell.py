"""The command line as a shell calls it."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import pytest

from taxel.cli import main


def call(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    """Run a command in this process; return its exit code, output and errors."""
    with pytest.raises(SystemExit) as ended:
        main([str(a) for a in arguments])
    said = capsys.readouterr()
    return int(ended.value.code or 0), said.out, said.err


def run(*arguments: object, **how: Any) -> subprocess.CompletedProcess[str]:
    """Run a command in a process of its own, with further keywords of `subprocess.run`."""
    command = [sys.executable, "-m", "taxel", *map(str, arguments)]
    return subprocess.run(command, check=False, capture_output=True, text=True, **how)
