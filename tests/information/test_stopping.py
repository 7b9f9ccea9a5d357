"""Ctrl-C while information is estimated: the command ends soon."""

import os
import signal
import time
from importlib import import_module
from pathlib import Path

import pytest
from shell import run

from .touches import folder

#: The processor time between the signal and its answer, s: another load of the machine does not count.
SOON_S = 1.5


def test_ctrl_c_ends_the_command_soon(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    task = import_module("taxel.tasks.information")
    answer, stopped = task.answer, []

    def interrupted(*trials, progress, **asked):
        def stop(what, done, of):
            if done == 5:
                stopped.append(time.process_time())
                os.kill(os.getpid(), signal.SIGINT)
            progress(what, done, of)

        return answer(*trials, progress=stop, **asked)

    monkeypatch.setattr(task, "answer", interrupted)
    recording, labels = folder(tmp_path, 60)
    asked = ["--window-ms", "60", "--windows", "10", "--periods", "1,10", "--draws", "3", "--taxels", "1"]
    ended = run("information", recording, "--labels", labels, *asked)
    assert ended.returncode == 130, ended.stderr
    assert time.process_time() - stopped[0] < SOON_S
