"""Works through many recordings: by processes or a cluster, and after a stop on from where it was."""

from __future__ import annotations

import hashlib
import json
import shutil
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import taxel
from taxel.tasks import Workers

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

__all__ = ["clear", "found_anywhere", "read", "run", "stamp", "why"]

#: The folder of what is known so far of a run that has not ended.
PARTS = ".parts"


class Named(Protocol):
    """A recording, or a person."""

    @property
    def name(self) -> str:
        """What it is called in messages."""


_T = TypeVar("_T", bound=Named)
#: A frozen dataclass.
_O = TypeVar("_O", bound="DataclassInstance")


def run(
    entries: Sequence[_T],
    work: Callable[[_T], dict[str, Any]],
    stamps: Sequence[str],
    folder: Path,
    workers: Workers,
    show: Callable[[str, int, int], object],
) -> tuple[list[Path | None], dict[str, str]]:
    """Return the file of what each recording or person gave (`read`), None where it failed, and why some failed.

    What is known so far is kept in the folder until `clear`: so a run that was stopped goes on, and memory holds the
    results of one at a time.

    Parameters
    ----------
    entries : sequence of Entry, or of Person
    work : function of one of them
        It returns plain values for JSON, and can be pickled.
    stamps : sequence of str
        Which results are the same (`stamp`).
    folder : Path
    workers : Workers
    show : function of a step, how many are done, and how many there are
    """
    from taxel.report import write_whole  # noqa: PLC0415  loads slowly

    parts = folder / PARTS
    parts.mkdir(exist_ok=True)
    files = [parts / f"{one}.json" for one in stamps]
    found = [file if file.exists() else None for file in files]
    wanted = [k for k, one in enumerate(found) if one is None]
    failed, done = dict[str, str](), len(entries) - len(wanted)
    for at, (result, failure) in workers.run(partial(_tried, work), [entries[k] for k in wanted]):
        k, done = wanted[at], done + 1
        show(entries[k].name, done, len(entries))
        if result is None:
            failed[entries[k].name] = failure
            continue
        found[k] = files[k]
        text = json.dumps(result).encode()
        write_whole(files[k], lambda file, text=text: file.write(text), overwrite=True)  # type: ignore[misc]
    return found, {entry.name: failed[entry.name] for entry in entries if entry.name in failed}


def read(file: Path) -> dict[str, Any]:
    """Return what a recording or a person gave."""
    return dict(json.loads(file.read_text()))


def found_anywhere(options: _O) -> _O:
    """Return options with whole paths: a worker of a cluster runs in another folder."""
    paths = {name: value.absolute() for name, value in vars(options).items() if isinstance(value, Path)}
    return replace(options, **paths)


def clear(folder: Path) -> None:
    """Forget what was kept of a run."""
    shutil.rmtree(folder / PARTS, ignore_errors=True)


def stamp(entry: object, files: Sequence[Path], *how: object) -> str:
    """Return a name of a result: another where a file, or how it is measured, is another.

    Parameters
    ----------
    entry : Entry or Person
    files : sequence of Path
        What the result depends on; they need not exist.
    *how : object
        Whose texts say how it is measured.
    """
    stats = [(file.stat().st_size, file.stat().st_mtime_ns) if file.exists() else None for file in files]
    text = repr((taxel.__version__, entry, stats, how))
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def why(error: Exception) -> str:
    """Return why a recording failed, in one line."""
    first, *more = str(error).splitlines() or [type(error).__name__]
    return first + " (taxel info FILE shows them)" * bool(more)


def _tried(work: Callable[[_T], dict[str, Any]], entry: _T) -> tuple[dict[str, Any] | None, str]:
    """Return what the work gives with its warnings, or why it failed."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            result = work(entry)
        except (taxel.Error, OSError, MemoryError) as error:
            return None, why(error)
    result["warnings"] = [*dict.fromkeys(str(one.message) for one in said), *result.get("warnings", ())]
    return result, ""
