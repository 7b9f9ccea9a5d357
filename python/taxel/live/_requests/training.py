"""Requests about readouts: training one on a recording, and running it on another."""

from __future__ import annotations

import contextlib
import json
import shlex
import threading
from operator import itemgetter
from pathlib import Path
from subprocess import PIPE
from typing import Any

from taxel._base.child_process import ChildProcess
from taxel._base.progress import Steps
from taxel._core import ProblemError
from taxel.detect import Readout, load
from taxel.live._requests.reasons import reasons
from taxel.live._shown_files import Opening, ShownFiles

#: Code with which a task ends that was stopped.
_INTERRUPTED = 130

#: The reason that a client sees of a training that was stopped.
_STOPPED = "the training was stopped: nothing was written"


def _typed(path: Path) -> str:
    """Return a path as it is typed in the folder where taxel was started."""
    here = Path.cwd()
    name = str(path.relative_to(here) if path.is_relative_to(here) else path)
    # A name that begins with a dash is no option.
    return f"./{name}" if name.startswith("-") else name


class TrainingRequests:
    """Train readouts in a process of their own, one at a time, and run them on recordings.

    Parameters
    ----------
    opening : Opening
        How recordings are opened.
    files : ShownFiles
        Reads them.
    """

    def __init__(self, opening: Opening, files: ShownFiles) -> None:
        self._opening, self._files = opening, files
        self._training: ChildProcess | None = None
        self._steps = Steps()
        self._closed, self._lock = False, threading.Lock()

    def close(self) -> None:
        """End a training that runs, and begin no other: the server waits for no request that takes long."""
        with self._lock:
            self._closed = True
        self.end()

    def train(self, recording: Path, out: Path) -> tuple[str, str, list[str]]:
        """Train on the labels of a recording.

        Returns
        -------
        tuple of str, str and list of str
            The result and its warnings as lines for people; the command that detects by the readout; which options of
            ``taxel train`` may help.
        """
        request = {"recordings": [str(recording)], "open": self._opening.options_of(recording).given()}
        with self._lock:
            if self._closed:
                raise ProblemError(_STOPPED)
            if self._training is not None:
                raise ProblemError("a training runs already: stop it first, or wait for its end")
            self._steps = Steps()
            # A process of its own, so that it takes no time from what arrives.
            self._training = ChildProcess("taxel.tasks", ["train"], stdin=PIPE, stdout=PIPE, text=True)
        try:
            answer = self._answer(self._training, request | {"out": str(out), "overwrite": True})
            code = self._training.returncode
        finally:
            self._training = None
        if answer["type"] == "error":
            raise ProblemError(answer["text"])
        if answer["type"] != "result":
            stopped = code < 0 or code == _INTERRUPTED
            raise ProblemError(_STOPPED if stopped else f"the training ended with code {code}")
        following = shlex.join(["taxel", "detect", "RECORDING", "--readout", _typed(out)])
        lines = [*answer["lines"], *(f"warning: {text}" for text in answer["result"]["warnings"])]
        return "\n".join(lines), following, answer["result"]["options"]

    def _answer(self, training: ChildProcess, request: dict[str, Any]) -> dict[str, Any]:
        """Ask for a training, wait until it has ended, and return the last line that it wrote."""
        assert training.stdin is not None
        assert training.stdout is not None
        line: dict[str, Any] = {"type": "progress"}
        # A training that was stopped meanwhile reads nothing.
        with contextlib.suppress(BrokenPipeError), training.stdin:
            training.stdin.write(json.dumps(request))
        for written in training.stdout:
            if not written.endswith("\n"):  # it was stopped while it wrote
                break
            line = json.loads(written)
            if line["type"] == "progress":
                self._steps.update(line["step"], line["done"], line["of"])
        training.wait()
        return line

    def progress(self) -> str:
        """Return how far the training that runs is; empty if none runs."""
        return str(self._steps) if self._training is not None else ""

    def command(self, recording: Path, out: Path) -> str:
        """Return the command that trains the same in a shell, in the folder where taxel was started."""
        words = self._opening.options_of(recording).words()
        return shlex.join(["taxel", "train", _typed(recording), "--labels", "notes", "-o", _typed(out), *words])

    def end(self) -> None:
        """End the training that runs, if one does."""
        training = self._training
        if training is not None:
            training.end()

    def detect(
        self, recording: Path, trial: str | None, readout: Path
    ) -> tuple[list[str], str | None, list[tuple[str, int, int]]]:
        """Detect by a readout in a recording or its trial.

        Returns
        -------
        tuple of list of str, str or None, and list of (str, int, int)
            The readout's labels; its encoder, as JSON, with the tare that it read with (none for several sensors, each
            of which has its own); the detections: label, time, when known, in order of the last.
        """
        from taxel.tasks import detect  # noqa: PLC0415  the command line starts quickly

        with reasons():
            loaded = load(readout)
            opened, _ = self._files.opened(recording, trial)
            detected = detect(loaded, opened).each
        encoder = loaded.encoder if isinstance(loaded, Readout) else None
        if encoder is not None and len(detected) == 1 and detected[0].rest is not None:
            encoder = encoder.with_tare(detected[0].rest.tare)
        found = [(found.label, found.t, found.known) for each in detected for found in each.outcome.found]
        return list(loaded.labels), None if encoder is None else encoder.to_json(), sorted(found, key=itemgetter(2))
