"""Runs one task in a separate process: ``python -m taxel.tasks NAME``.

It reads one JSON object from standard input, to its end, and writes one JSON object a line to standard output::

    {"recordings": ["walk.mcap"], "labels": "notes", "options": {"folds": 5}, "out": "walk.readout.json"}

    {"type": "progress", "step": "fold 2 of 5", "done": 1, "of": 5}
    {"type": "result", "result": {"labels": ["contact"], "warnings": [], ...}, "lines": ["held out: ...", ...]}

======================  ==============================================  ============================================
task                    keys of the request, beside `recordings`        what is written to `out`
======================  ==============================================  ============================================
train                   labels (default "notes"), options, out          the readout
detect                  readout, truth, options                         -
information             labels, options                                 -
calibrate               loads (a path, or a list), options, out         the calibration
encode                  options, out                                    the spike trains
info                    tare                                            -
rest                    tare, out                                       the tare
======================  ==============================================  ============================================

`recordings` are paths of files and folders, and `open` holds the fields of `TextOptions` by which they are opened.
`options` holds fields of the task's own options (`TrainOptions` and so on). Keys have the meaning of the function's
arguments in `taxel.tasks`; an unknown one is refused by its name. `out` is needed where it is in the table, and must
not exist unless `overwrite` is true. `encode`, `calibrate`, `info` and `rest` take one recording.

Progress is reported before each step: `done` of `of` parts are done, `of` is 0 where that is not known. The last line
is either the result, as of its `to_dict()`, with `lines` for people where a result has them, and of a training with
the `command` that detects by its readout (empty if the readout cannot be relied on); or an error::

    {"type": "error", "kind": "ProblemError", "text": "walk.mcap: ..."}

Exit codes are those of the command line: 0 done, 2 the request or its recordings are wrong, 3 the system (a disk that
is full), 130 stopped by Ctrl-C, SIGTERM or SIGHUP. A task that is stopped writes no last line and leaves no file.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, NoReturn, TypeAlias

from taxel._base.arguments import mapping, text
from taxel._base.files import check_writable
from taxel._base.messages import collected, escaped
from taxel._base.progress import Progress
from taxel._base.stopping import leave, stop_on_signals
from taxel._core import Error, ProblemError
from taxel.detect import load
from taxel.options import CalibrateOptions, DetectOptions, EncodeOptions, InformationOptions, TrainOptions
from taxel.recording import Recording
from taxel.recording.text_options import TextOptions
from taxel.tasks.calibrate import KnownLoad, calibrate
from taxel.tasks.detect import detect
from taxel.tasks.encode import encode
from taxel.tasks.info import info
from taxel.tasks.information import information
from taxel.tasks.rest import rest
from taxel.tasks.train import train
from taxel.tasks.train_result import Training

__all__ = ["run"]

#: A request without what every task has in common.
Request: TypeAlias = dict[str, Any]
#: Saves an object to the file that the request names.
_Save: TypeAlias = Callable[[Any], object]


def _train(recordings: Sequence[Recording], request: Request, progress: Progress, save: _Save) -> Any:
    options = _fields(TrainOptions, request)
    training = train(recordings, request.pop("labels", "notes"), options, progress=progress)
    if not training.learnt:
        raise ProblemError("; ".join(["no label is learnt, so nothing is written", *training.unreliable()]))
    save(training.readout)
    return training


def _detect(recordings: Sequence[Recording], request: Request, progress: Progress, _: _Save) -> Any:
    options, readout = _fields(DetectOptions, request), _needed(request, "readout")
    return detect(load(readout), recordings, request.pop("truth", None), options, progress=progress)


def _information(recordings: Sequence[Recording], request: Request, progress: Progress, _: _Save) -> Any:
    options = _fields(InformationOptions, request)
    return information(recordings, request.pop("labels", None), options, progress=progress)


def _calibrate(recordings: Sequence[Recording], request: Request, _: Progress, save: _Save) -> Any:
    loads, options = request.pop("loads", []), _fields(CalibrateOptions, request)
    if not isinstance(loads, str):
        loads = [_fields(KnownLoad, {"loads": load}, "loads") for load in loads]
    calibrated = calibrate(_one(recordings), loads, options)
    save(calibrated.calibration)
    return calibrated


def _encode(recordings: Sequence[Recording], request: Request, progress: Progress, save: _Save) -> Any:
    encoded = encode(_one(recordings), _fields(EncodeOptions, request), progress=progress)
    save(encoded.trains)
    return encoded


def _info(recordings: Sequence[Recording], request: Request, _: Progress, __: _Save) -> Any:
    return info(_one(recordings), request.pop("tare", None))


def _rest(recordings: Sequence[Recording], request: Request, _: Progress, save: _Save) -> Any:
    taken = rest(_one(recordings), request.pop("tare", None))
    save(taken.tare)
    return taken


#: Each task: what runs it, the keys that it knows, and whether each sensor of a recording is one of its own.
_TASKS: dict[str, tuple[Callable[[Sequence[Recording], Request, Progress, _Save], Any], tuple[str, ...]]] = {
    "train": (_train, ("labels", "options", "out")),
    "detect": (_detect, ("readout", "truth", "options")),
    "information": (_information, ("labels", "options")),
    "calibrate": (_calibrate, ("loads", "options", "out")),
    "encode": (_encode, ("options", "out")),
    "info": (_info, ("tare",)),
    "rest": (_rest, ("tare", "out")),
}
#: Tasks that take the feet of a file as one recording, as their commands do.
_JOINED = ("calibrate", "encode")


def run(name: str, request: Mapping[str, Any], progress: Progress) -> dict[str, Any]:
    """Run a task by a request; return the line of its result.

    Parameters
    ----------
    name : str
    request : mapping
        As this module describes it.
    progress : function of (step, done, all)

    Raises
    ------
    ProblemError : no such task, an unknown key or option (named), or what the task raises
    """
    work, known = _TASKS[text("the task", name, _TASKS)]
    left = mapping("the request", request)
    _refuse_unknown(left, ("recordings", "open", *known, *(["overwrite"] if "out" in known else [])), f"key of {name}")
    overwrite = left.pop("overwrite", False) is True
    save: _Save = lambda _: None  # noqa: E731
    if "out" in known:
        given = _needed(left, "out")
        out = Path(given)
        check_writable(out, overwrite=overwrite)
        save = lambda finished: finished.save(out, overwrite=overwrite)  # noqa: E731
    opener = _fields(TextOptions, left, "open")
    paths = [Path(path) for path in _needed(left, "recordings")]
    with collected() as warnings:
        progress(f"reading {', '.join(map(str, paths[:3]))}{' ...' * (len(paths) > 3)}", 0, 0)
        recordings = [opener.open_one(path) for path in paths] if name in _JOINED else opener.open_sensors(paths)
        result = work(recordings, left, progress, save)
    found = result.to_dict()
    found["warnings"] = [*dict.fromkeys([*warnings, *found.get("warnings", [])])]
    lines = {"lines": result.lines()} if hasattr(result, "lines") else {}
    if isinstance(result, Training):
        lines |= {"command": result.command(given)}
    return {"type": "result", "result": found, **lines}


def _fields(options: Callable[..., Any], request: Request, key: str = "options") -> Any:
    """Return a dataclass of options from the values of a key of the request."""
    values = mapping(key, request.pop(key, {}))
    _refuse_unknown(values, [field.name for field in fields(options)], f"field of {key}")  # type: ignore[arg-type]
    try:
        return options(**values)
    except TypeError:
        missing = [field.name for field in fields(options) if field.name not in values]  # type: ignore[arg-type]
        raise ProblemError(f"{key}: {missing[0]} is missing") from None


def _needed(request: Request, key: str) -> Any:
    if key not in request:
        raise ProblemError(f"{key} is missing in the request")
    return request.pop(key)


def _refuse_unknown(values: Mapping[str, Any], known: Sequence[str], noun: str) -> None:
    unknown = next((key for key in values if key not in known), None)
    if unknown is not None:
        raise ProblemError(f"{unknown} is not a {noun}: must be one of {', '.join(known)}")


def _one(recordings: Sequence[Recording]) -> Recording:
    if len(recordings) != 1:
        raise ProblemError(f"recordings: {len(recordings)} recordings; must be one")
    return recordings[0]


def _say(line: Mapping[str, Any]) -> None:
    print(json.dumps(line), flush=True)


def _show(step: str, done: int, total: int) -> None:
    _say({"type": "progress", "step": step, "done": done, "of": total})


def _main() -> NoReturn:
    stop_on_signals()
    try:
        name = sys.argv[1] if len(sys.argv) == 2 else ""
        try:
            request = json.load(sys.stdin)
        except ValueError as error:
            raise ProblemError(f"the request is not JSON: {error}") from None
        _say(run(name, request, _show))
    except KeyboardInterrupt:
        leave(130)
    except (Error, OSError, ImportError, MemoryError) as error:
        outside = isinstance(error, OSError | MemoryError) and not isinstance(
            error, FileNotFoundError | FileExistsError
        )
        _say({"type": "error", "kind": type(error).__name__, "text": _text(error)})
        leave(3 if outside else 2)
    leave(0)


def _text(error: BaseException) -> str:
    if isinstance(error, OSError) and error.filename is not None and error.strerror:
        return escaped(f"{error.filename}: {error.strerror.lower()}")
    return str(error) or type(error).__name__


if __name__ == "__main__":
    _main()
