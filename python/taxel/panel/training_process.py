"""Trains a readout in a process of its own, so that nothing that is received waits: the page starts it.

It reads one JSON object from standard input, to its end: `recording` (a path), `open` (fields of `FullReading` by which
it is opened) and `out` (where the readout is written, also over an older one). It writes one JSON object a line to
standard output::

    {"type": "progress", "step": "fold 2 of 5", "done": 1, "of": 5}
    {"type": "result", "result": {"labels": ["contact"], "warnings": [], ...}, "lines": [...], "command": "taxel ...",
     "pictures": [{"title": "...", "svg": "..."}]}
    {"type": "error", "kind": "ProblemError", "text": "walk.mcap: ..."}

Progress comes before each step; `of` is 0 where it is not known. The result is that of `Training.to_dict`, with its
lines for people, the command that detects by the readout, and the picture of its report. The exit code is 0, 2
after an error, and 130 of a training that was stopped, which writes no last line and leaves no file.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn

import matplotlib as mpl

from taxel._base.messages import collected, escaped
from taxel._base.progress import Progress
from taxel._base.stopping import leave, stop_on_signals
from taxel._core import Error, ProblemError
from taxel.options import FullReading
from taxel.report import compared
from taxel.report.svg import STYLE, image
from taxel.tasks.train import train

__all__ = ["run"]


def run(request: Mapping[str, Any], progress: Progress) -> dict[str, Any]:
    """Train by a request; return the line of its result.

    Parameters
    ----------
    request : mapping
        As this module describes it.
    progress : function of (step, done, all)

    Raises
    ------
    ProblemError : what the training raises; no label is learnt, and nothing is written
    """
    recording = Path(request["recording"])
    with collected() as warnings:
        progress(f"reading {recording}", 0, 0)
        training = train(FullReading(**request["open"]).open_sensors([recording]), progress=progress)
    if not training.learnt:
        why = "; ".join(text.replace("do not rely on this readout: ", "") for text in training.unreliable())
        raise ProblemError(
            f"no label is learnt, so nothing is written: {why}. Is each label at its event, and each event labelled?"
        )
    with mpl.rc_context(STYLE):
        figure = compared.nearest(training.outcomes, training.readout.labels)
        title = "Each nearest detection minus its label, over time"
        pictures = [] if figure is None else [{"title": title, "svg": image(figure)}]
    training.readout.save(request["out"], overwrite=True)
    found = training.to_dict()
    found["warnings"] = [*dict.fromkeys([*warnings, *found["warnings"]])]
    return {
        "type": "result",
        "result": found,
        "lines": training.lines(),
        "command": training.command(request["out"]),
        "pictures": pictures,
    }


def _say(line: Mapping[str, Any]) -> None:
    print(json.dumps(line), flush=True)


def _main() -> NoReturn:
    stop_on_signals()
    # Pictures are texts here, whatever windows the user draws in.
    mpl.use("Agg")
    try:
        _say(
            run(
                json.load(sys.stdin),
                lambda step, done, total: _say({"type": "progress", "step": step, "done": done, "of": total}),
            )
        )
    except KeyboardInterrupt:
        leave(130)
    except (Error, OSError, ImportError, MemoryError) as error:
        text = str(error) or type(error).__name__
        if isinstance(error, OSError) and error.filename is not None and error.strerror:
            text = escaped(f"{error.filename}: {error.strerror.lower()}")
        _say({"type": "error", "kind": type(error).__name__, "text": text})
        leave(2)
    leave(0)


if __name__ == "__main__":
    _main()
