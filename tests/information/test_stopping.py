"""Ctrl-C while information is estimated: the command ends soon."""

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from .touches import folder

#: The processor time between the signal and its answer, s: another load of the machine does not count.
SOON_S = 1.5

STOPPED = """
import os, signal, sys, time
import taxel.information
from taxel.cli import main

asked, stopped = taxel.information.answer, []

def counted(*trials, progress=None, **ask):
    def stop(what, done, of):
        if done == int(sys.argv[1]):
            stopped.append(time.process_time())
            os.kill(os.getpid(), signal.SIGINT)
        progress(what, done, of)
    return asked(*trials, progress=stop, **ask)

taxel.information.answer = counted
try:
    main(sys.argv[2:])
finally:
    print(time.process_time() - stopped[0])
"""


def stopped(place: Path, *, after: int, more: Sequence[str] = ()) -> subprocess.CompletedProcess[str]:
    """Run the command on made touches, and send it SIGINT when so many steps are done."""
    recording, labels = folder(place, 60)
    asked = ["--window-ms", "60", "--windows", "10", "--periods", "1,10", "--draws", "3", "--taxels", "1"]
    command = ["information", str(recording), "--labels", str(labels), *asked, *more]
    script = [sys.executable, "-c", STOPPED, str(after), *command, "--report", str(place / "page.html")]
    return subprocess.run(script, capture_output=True, text=True, check=False, timeout=300)


def test_ctrl_c_ends_the_command_soon(tmp_path: Path) -> None:
    ended = stopped(tmp_path, after=5)
    assert ended.returncode == 130, ended.stderr
    assert float(ended.stdout) < SOON_S
    assert not (tmp_path / "page.html").exists()
