"""TAXEL_INSTRUCTIONS names the widest vector instructions to use; that all sets compute alike, Rust's tests hold."""

from __future__ import annotations

import os
import subprocess
import sys


def test_an_unknown_set_is_refused_in_one_line() -> None:
    program = "import sys; sys.argv = ['taxel', '--help']; from taxel_start import main; main()"
    environment = {**os.environ, "TAXEL_INSTRUCTIONS": "avx3"}
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 2
    assert 'TAXEL_INSTRUCTIONS is "avx3": must be plain, avx2, avx512' in done.stderr
    assert done.stderr.count("\n") == 1, done.stderr
