"""The kept figures: whether each still counts, and how that is shown without running it again at full size.

A figure is kept as its numbers, ``NAME.json``, with the digest of every source that they were computed from
(``made_of``). It is stale when one of these has changed since. Beside it, ``coarse/NAME.json`` holds what the study
gives at size toy: where a change moves that by rounding at most, the figure is confirmed, and gets the digests of
today.
"""

from __future__ import annotations

import json
import math
import tempfile
import time
from pathlib import Path
from typing import Any

from taxel import FormatError, ProblemError
from taxel.report import write_whole
from taxel_studies import STUDIES, load
from taxel_studies.study import Section

__all__ = ["COARSE", "changed", "coarse_result", "confirm", "keep_coarse", "stale_figures"]

#: The size of the coarse result.
COARSE = "toy"
#: Times differ from run to run, so they are not compared.
_TIMES = ("cpu_seconds",)


def changed(section: Section) -> list[str]:
    """Return the sources that have changed since a study's section was made, by name; none where it still counts."""
    if "made_of" not in section:
        return ["its sources were not recorded"]
    before, now = section["made_of"], load(section["name"]).made_of
    return sorted(name for name in before.keys() | now.keys() if before.get(name) != now.get(name))


def stale_figures(folder: Path) -> dict[str, list[str]]:
    """Return the kept figures that are stale, and what has changed of each.

    Raises
    ------
    FormatError : the folder holds no kept figure
    """
    sections = {name: _kept(folder, name) for name in STUDIES}
    if not any(sections.values()):
        raise FormatError(f"{folder}: holds no kept figure; run this in a checkout, or name its folder by --figures")
    return {name: parts for name, section in sections.items() if section is not None and (parts := changed(section))}


def _kept(folder: Path, name: str) -> Section | None:
    file = folder / f"{name}.json"
    return json.loads(file.read_text(encoding="utf-8")) if file.exists() else None


def coarse_result(name: str, data: Path | None = None, *, strict: bool = False) -> dict[str, Any]:
    """Run a study at its smallest size, and return its parameters and results without times."""
    with tempfile.TemporaryDirectory() as report:
        section = load(name).run(Path(report), size=COARSE, data=data, strict=strict, quiet=True)
    result = {"parameters": section["parameters"], "unread": section["unread"], "said": _timeless(section["said"])}
    plain: dict[str, Any] = json.loads(json.dumps(result))
    return plain


def _timeless(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _timeless(inner) for key, inner in value.items() if key not in _TIMES}
    return [_timeless(inner) for inner in value] if isinstance(value, list | tuple) else value


def confirm(name: str, folder: Path, *, data: Path | None = None, strict: bool = False) -> str:
    """Run a study at coarse size, and renew its figure's digests where the coarse result is the kept one.

    Where there is no coarse result yet this one is kept, and the figure gets its first digests.

    Parameters
    ----------
    name : str
        Of a study whose figure is kept.
    folder : Path
        Of the kept figures.
    data : Path, optional
        Folder of recordings.
    strict : bool
        Whether a recording that cannot be read ends it.

    Returns
    -------
    str
        What was done.

    Raises
    ------
    ProblemError : the figure is not kept; the coarse result is another one than the kept one
    """
    section = _kept(folder, name)
    if section is None:
        raise ProblemError(f"{folder}: holds no figure of {name}; taxel study {name} makes one")
    file = folder / "coarse" / f"{name}.json"
    if file.exists():
        before, now = json.loads(file.read_text(encoding="utf-8")), coarse_result(name, data, strict=strict)
        differs = list(_differences(before, now))
        if differs:
            more = f" and {len(differs) - 3} more" if len(differs) > 3 else ""
            raise ProblemError(f"{name}: its coarse result is another one: {'; '.join(differs[:3])}{more}")
        done = "confirmed"
    else:
        keep_coarse(name, folder, data=data, strict=strict)
        done = "first coarse result kept"
    _write(folder / f"{name}.json", section | {"made_of": load(name).made_of, "confirmed": _today()})
    return done


def keep_coarse(name: str, folder: Path, *, data: Path | None = None, strict: bool = False) -> None:
    """Run a study at coarse size, and keep what it gives beside its figure."""
    (folder / "coarse").mkdir(exist_ok=True)
    _write(folder / "coarse" / f"{name}.json", coarse_result(name, data, strict=strict))


def _differences(kept: Any, now: Any, where: str = "") -> Any:
    """List where two results differ."""
    if isinstance(kept, dict) and isinstance(now, dict) and kept.keys() == now.keys():
        for key in kept:
            yield from _differences(kept[key], now[key], f"{where}.{key}".lstrip("."))
    elif isinstance(kept, list) and isinstance(now, list) and len(kept) == len(now):
        for k, (a, b) in enumerate(zip(kept, now, strict=True)):
            yield from _differences(a, b, f"{where}[{k}]")
    elif json.dumps(kept) != json.dumps(now) and not _rounded_otherwise(kept, now):
        yield f"{where} was {str(kept)[:40]}, is {str(now)[:40]}"


def _rounded_otherwise(kept: Any, now: Any) -> bool:
    """Whether two numbers differ by rounding alone, which another processor or version of NumPy does otherwise."""
    both = isinstance(kept, float) and isinstance(now, float)
    return both and math.isclose(kept, now, rel_tol=1e-9, abs_tol=1e-12)


def _write(file: Path, value: Any) -> None:
    text = json.dumps(value) + "\n"
    write_whole(file, lambda into: into.write(text.encode()), overwrite=True)


def _today() -> str:
    return time.strftime("%Y-%m-%d", time.gmtime())
