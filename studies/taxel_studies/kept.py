"""The kept figures, and whether today's code still gives their toy results.

A figure is kept as its numbers, ``NAME.json``, with the commit, the date and the machine that computed them. Beside it,
``toy/NAME.json`` holds what the study gave at size toy: a check in minutes, where a figure takes hours.
"""

from __future__ import annotations

import json
import math
import tempfile
from pathlib import Path
from typing import Any

from taxel import FormatError, ProblemError
from taxel.report import write_whole
from taxel_studies import STUDIES, load

__all__ = ["TOY", "confirm", "keep_toy", "kept_figures", "toy_result"]

#: The size of the toy result.
TOY = "toy"
#: What is compared of a result; the rest says by which code, when and where it was computed.
_COMPARED = ("parameters", "unread", "said")
#: Times differ from run to run, so they are not compared.
_TIMES = ("cpu_seconds",)


def kept_figures(folder: Path) -> list[str]:
    """Return the studies whose figures are kept.

    Raises
    ------
    FormatError : the folder holds no kept figure
    """
    names = [name for name in STUDIES if (folder / f"{name}.json").exists()]
    if not names:
        raise FormatError(
            f"{folder}: contains no saved figure; run this in a checkout, or give its folder of figures by --figures"
        )
    return names


def toy_result(name: str, data: Path | None = None, *, strict: bool = False) -> dict[str, Any]:
    """Run a study at its smallest size; return parameters and results without times, commit, date and machine."""
    with tempfile.TemporaryDirectory() as report:
        section = load(name).run(Path(report), size=TOY, data=data, strict=strict, quiet=True)
    result = {key: section[key] for key in (*_COMPARED, "commit", "date", "machine")}
    plain: dict[str, Any] = json.loads(json.dumps(result | {"said": _timeless(section["said"])}))
    return plain


def _timeless(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _timeless(inner) for key, inner in value.items() if key not in _TIMES}
    return [_timeless(inner) for inner in value] if isinstance(value, list | tuple) else value


def confirm(name: str, folder: Path, *, data: Path | None = None, strict: bool = False) -> None:
    """Run a study at toy size, and compare the result with the kept one.

    Parameters
    ----------
    name : str
        The name of a study whose toy result is kept.
    folder : Path
        Of the kept figures.
    data : Path, optional
        Folder of recordings.
    strict : bool
        Whether a recording that cannot be read ends it.

    Raises
    ------
    ProblemError : no toy result is kept; the result differs from the kept one by more than rounding
    """
    file = folder / "toy" / f"{name}.json"
    if not file.exists():
        raise ProblemError(
            f"{file}: contains no toy result of {name}; docs/figures.py saves a toy result with each figure"
        )
    before, now = json.loads(file.read_text(encoding="utf-8")), toy_result(name, data, strict=strict)
    differences = [line for key in _COMPARED for line in _differences(before[key], now[key], key)]
    if differences:
        more = f" and {len(differences) - 3} more" if len(differences) > 3 else ""
        raise ProblemError(f"{name}: the toy result differs from the saved one: {'; '.join(differences[:3])}{more}")


def keep_toy(name: str, folder: Path, *, data: Path | None = None) -> None:
    """Run a study at toy size, and keep the result beside its figure."""
    (folder / "toy").mkdir(exist_ok=True)
    text = json.dumps(toy_result(name, data)) + "\n"
    write_whole(folder / "toy" / f"{name}.json", lambda into: into.write(text.encode()), overwrite=True)


def _differences(kept: Any, now: Any, where: str) -> Any:
    """List where two results differ."""
    if isinstance(kept, dict) and isinstance(now, dict) and kept.keys() == now.keys():
        for key in kept:
            yield from _differences(kept[key], now[key], f"{where}.{key}")
    elif isinstance(kept, list) and isinstance(now, list) and len(kept) == len(now):
        for k, (a, b) in enumerate(zip(kept, now, strict=True)):
            yield from _differences(a, b, f"{where}[{k}]")
    elif json.dumps(kept) != json.dumps(now) and not _rounded_otherwise(kept, now):
        yield f"{where} was {str(kept)[:40]}, is {str(now)[:40]}"


def _rounded_otherwise(kept: Any, now: Any) -> bool:
    """Whether two numbers differ by rounding alone, which another processor or version of NumPy does otherwise."""
    both = isinstance(kept, float) and isinstance(now, float)
    return both and math.isclose(kept, now, rel_tol=1e-9, abs_tol=1e-12)
