"""Readouts on the page: one is trained on a recording, and run on others."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from subprocess import PIPE
from typing import Any

from taxel._base.child_process import ChildProcess
from taxel._base.progress import Steps
from taxel._core import ProblemError
from taxel.detect import load
from taxel.panel.shown_files import Opening, ShownFiles

#: The reason that a client sees of a training that was stopped.
_STOPPED = "the training was stopped: nothing was written"


def _scores(result: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield the scores of each label, of the neuron and of the plain rule, of a training."""
    plain = result["plain_rule"]
    for label in result["labels"]:
        rows = [(False, result["neurons"])]
        if plain is not None and plain["score"] is not None and plain["rules"].get(label) is not None:
            rows.append((True, plain["score"]))
        for is_plain_rule, score in rows:
            counts = score["by_label"][label]
            yield {
                "label": label,
                "is_plain_rule": is_plain_rule,
                "runs": is_plain_rule == (label in result["by_rule"]),
                "found": counts["found"],
                "missed": counts["missed"],
                "false": counts["false"],
                "delay_ms": counts["known_delay_ms"]["median"],
            }


def typed(path: Path) -> str:
    """Return a path as it is typed in the folder where taxel was started."""
    here = Path.cwd()
    name = str(path.relative_to(here) if path.is_relative_to(here) else path)
    # A name that begins with a dash is no option.
    return f"./{name}" if name.startswith("-") else name


class Training:
    """Train readouts in a separate process, one at a time, and run them on recordings.

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
        self._closed, self._stopped, self._lock = False, False, threading.Lock()

    def close(self) -> None:
        """End a training that runs, and begin no other: the server waits for no request that takes long."""
        with self._lock:
            self._closed = True
        self.end()

    def train(self, recording: Path, out: Path, progress: Callable[[str], object]) -> dict[str, Any]:
        """Train on the labels of a recording, and return what the page shows of it, with times as in the file.

        Each step calls `progress` with how far the training is, in words.
        """
        options = self._opening.options_of(recording).given()
        request = json.dumps({"recording": str(recording), "open": options, "out": typed(out)})
        with self._lock:
            if self._closed:
                raise ProblemError(_STOPPED)
            if self._training is not None:
                raise ProblemError("a training runs already: stop it first, or wait for its end")
            self._stopped = False
            # A separate process, so that it does not delay receiving.
            self._training = ChildProcess("taxel.panel.training_process", line=request, stdout=PIPE)
        try:
            with self._training:
                answer = self._answer(self._training, progress)
            code = self._training.returncode
        finally:
            self._training = None
        if answer["type"] == "error":
            raise ProblemError(answer["text"])
        if answer["type"] != "result":
            raise ProblemError(_STOPPED if self._stopped else f"the training ended with code {code}")
        lines = [*answer["lines"], *(f"warning: {text}" for text in answer["result"]["warnings"])]
        result = answer["result"]
        return {
            "text": "\n".join(lines),
            "judged_on": answer["lines"][0],
            "scores": list(_scores(result)),
            "mistakes": result["mistakes"],
            "next": answer["command"],
            "pictures": answer["pictures"],
        }

    def _answer(self, training: ChildProcess, progress: Callable[[str], object]) -> dict[str, Any]:
        """Wait until a training has ended, and return the last line that it wrote."""
        assert training.stdout is not None
        steps = Steps()
        line: dict[str, Any] = {"type": "progress"}
        for written in training.stdout:
            if not written.endswith("\n"):  # it was stopped while it wrote
                break
            line = json.loads(written)
            if line["type"] == "progress":
                steps.update(line["step"], line["done"], line["of"])
                progress(str(steps))
        training.wait()
        return line

    def end(self) -> None:
        """End the training that runs, if one does."""
        training = self._training
        if training is not None:
            self._stopped = True
            training.end()

    def detect(
        self, recording: Path, trial: str | None, readout: Path, use: str
    ) -> tuple[list[str], list[dict[str, Any]]]:
        """Detect by a readout in a recording or its trial.

        Returns
        -------
        tuple of list of str, and list of dict
            The readout's labels; the detections in the order in which they are known.
        """
        from taxel.options import DetectOptions  # noqa: PLC0415
        from taxel.tasks import detect  # noqa: PLC0415  the command line starts quickly

        loaded = load(readout)
        opened, _ = self._files.opened(recording, trial)
        detected = detect(loaded, opened, options=DetectOptions(use=use)).each
        names = [each.recording.label or "" if len(detected) > 1 else "" for each in detected]
        found = [(found, name) for each, name in zip(detected, names, strict=True) for found in each.outcome.found]
        found.sort(key=lambda one: one[0].known)
        messages = [{"label": found.label, "t_us": found.t, "source": name} for found, name in found]
        return list(loaded.labels), messages
