"""Processes that tests of the bridge begin, and end."""

import os
import signal
import subprocess
import sys


class Process:
    """Python in a process of its own, ended at the end; `before` it stands what runs it elsewhere."""

    def __init__(self, *arguments, before=()):
        self.process = subprocess.Popen(
            [*before, sys.executable, *map(str, arguments)],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            env=os.environ | {"PYTHONUNBUFFERED": "1"},
        )  # fmt: skip

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.kill()
        self.process.communicate()

    def says(self, what):
        """Wait until a line on stderr holds this."""
        assert self.process.stderr is not None
        for line in self.process.stderr:
            if what in line:
                return line
        raise AssertionError(f"ended with {self.process.wait()} before it said {what!r}")

    def end(self, how=signal.SIGINT):
        """End it as a person does; return what it printed and what it said."""
        self.process.send_signal(how)
        return self.process.communicate(timeout=120)


def command(*arguments):
    """Begin a command of ours."""
    return Process("-m", "taxel", *arguments)
