"""Requests about readouts: training one on a recording, and running it on another."""

from __future__ import annotations

import shlex
import subprocess
import threading
from pathlib import Path

from taxel._base.child_process import ChildProcess
from taxel._core import ProblemError
from taxel.detect import load, run
from taxel.detections import Detection
from taxel.frames import Frames
from taxel.live._requests.reasons import reasons
from taxel.live._shown_files import Opening, ShownFiles
from taxel.recorded import recorded
from taxel.recording import Recording
from taxel.recording.lain import without_what_lay
from taxel.recording.opening import sensors
from taxel.recording.rest import by_unit
from taxel.tare import Tare

__all__ = ["TrainingRequests"]

#: Code with which a command ends after Ctrl-C.
_INTERRUPTED = 130

#: The reason that a client sees of a training that was stopped.
_STOPPED = "the training was stopped: nothing was written"

#: A label that a person set may be late: the rest before it ends so much earlier, and lasts so long at least, us.
_BEFORE_US, _LEAST_REST_US = 20_000, 10_000

#: Rest at the beginning of a recording without labels, us.
_REST_US = 50_000


def _rest(recording: Recording) -> Tare:
    """Return the taxels' rest: 0 by the unit, or before the first label and the start marker, or at the beginning."""
    source = recorded(recording)
    if isinstance(source, Frames) and (rest := by_unit(source)) is not None:
        return rest
    first = int(source.t[0]) if len(source) else 0
    ends = [note.t - _BEFORE_US for note in recording.notes if note.t is not None]
    ends += [t for t, start in getattr(source, "markers", ()) if start]
    stop = min((t for t in ends if t - first >= _LEAST_REST_US), default=first + _REST_US)
    tare, _ = without_what_lay(recording, stop)
    return Tare.take(source, stop_us=stop, note=str(recording.path)) if tare is None else tare


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
        #: What the training has said on stderr, line by line.
        self._lines: list[str] = []
        self._closed, self._lock = False, threading.Lock()

    def close(self) -> None:
        """End a training that runs, and begin no other: the server waits for no request that takes long."""
        with self._lock:
            self._closed = True
        self.end()

    def train(self, recording: Path, out: Path) -> str:
        """Train on the labels of a recording as ``taxel train`` does; return what it prints, then its warnings."""
        words = [*self._words(recording, out), "--overwrite"]
        with self._lock:
            if self._closed:
                raise ProblemError(_STOPPED)
            if self._training is not None:
                raise ProblemError("a training runs already: stop it first, or wait for its end")
            # A process of its own, so that it takes no time from what arrives.
            self._training = ChildProcess("taxel", words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        try:
            printed, errors = self._heard(self._training)
            code = self._training.returncode
        finally:
            self._training = None
        if code < 0 or code == _INTERRUPTED:
            raise ProblemError(_STOPPED)
        if code:
            lines = [line for line in errors.splitlines() if line.strip()]
            raise ProblemError(lines[-1].removeprefix("taxel: ") if lines else f"the training ended with code {code}")
        warned = [line.removeprefix("taxel: ") for line in errors.splitlines() if line.startswith("taxel: warning: ")]
        return "\n".join([printed.strip(), *warned])

    def _heard(self, training: ChildProcess) -> tuple[str, str]:
        """Wait until a training has ended; return what it printed, and what it said on stderr."""
        assert training.stdout is not None
        assert training.stderr is not None
        self._lines = []
        listener = threading.Thread(target=self._lines.extend, args=(training.stderr,))
        listener.start()
        printed = training.stdout.read()
        listener.join()
        training.wait()
        return printed, "".join(self._lines)

    def progress(self) -> str:
        """Return how far the training that runs is, as ``taxel train`` says it; empty if it has not said so yet."""
        said = [line for line in self._lines if ", after " in line] if self._training is not None else []
        return said[-1].removeprefix("taxel: ").strip() if said else ""

    def command(self, recording: Path, out: Path) -> str:
        """Return the command that trains the same in a shell, in the folder where taxel was started."""
        return shlex.join(["taxel", *self._words(recording, out)])

    def _words(self, recording: Path, out: Path) -> list[str]:
        """Return the words of a training on a recording; paths are from the folder where taxel was started."""
        here = Path.cwd()
        near = (str(path.relative_to(here) if path.is_relative_to(here) else path) for path in (recording, out))
        # A name that begins with a dash is no option.
        named, written = (f"./{name}" if name.startswith("-") else name for name in near)
        return ["train", named, "--labels", "notes", "-o", written, *self._opening.options_of(recording)]

    def end(self) -> None:
        """End the training that runs, if one does."""
        training = self._training
        if training is not None:
            training.end()

    def detect(self, recording: Path, trial: str | None, readout: Path) -> tuple[list[str], list[tuple[str, int, int]]]:
        """Return a readout's labels, and its detections in a recording or its trial: label, time, when known."""
        with reasons():
            loaded = load(readout)
            opened, _ = self._files.opened(recording, trial)
            found: list[Detection] = []
            for one in sensors(opened):
                registers = one.registers
                frame_us = None if registers is None else registers.frame_us
                found += run(loaded, one, frame_us=frame_us, tare=_rest(one))
        return list(loaded.labels), sorted(((one.label, one.t, one.known) for one in found), key=lambda one: one[2])
