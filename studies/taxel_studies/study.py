"""A study: a protocol, its parameters, the published values as data, a picture, and judged claims."""

from __future__ import annotations

import base64
import io
import json
import platform
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from importlib import metadata
from inspect import signature
from pathlib import Path
from types import ModuleType
from typing import Any, BinaryIO

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from taxel import FormatError, ProblemError, __version__
from taxel.report import write_whole
from taxel.tasks import Workers
from taxel_studies.commit import code_version
from taxel_studies.runner import Kept, Row, Task, grid, make, run

__all__ = [
    "Judgement",
    "Kept",
    "Parameters",
    "Row",
    "Section",
    "Study",
    "Summary",
    "Table",
    "Task",
    "drawn",
    "grid",
    "listed",
    "logarithmic",
    "machine",
    "one_task",
    "only_result",
    "read_section",
    "results",
    "subplots",
    "svg",
]

#: Experiment parameters by name: what JSON can hold.
Parameters = Mapping[str, Any]
#: The results of a study, as JSON holds them: enough to judge claims and to draw its picture.
Summary = dict[str, Any]
#: One study's part of the page, as ``summary.json`` holds it.
Section = dict[str, Any]


@dataclass(frozen=True)
class Judgement:
    """A claim of ``claims.toml`` judged by our result, in one reading of it.

    Attributes
    ----------
    claim : int
        Its number.
    ours : str
    holds : bool, optional
        None: it cannot be judged (the published picture is lost, or too little was run).
    why : str
        Why it does not hold, or what counts as holding.
    reading : str
        "" where it has one alone.
    """

    claim: int
    ours: str
    holds: bool | None
    why: str = ""
    reading: str = ""


@dataclass(frozen=True)
class Table:
    """A table of the page.

    Attributes
    ----------
    title : str
    head : sequence of str
    rows : sequence of sequences of str
        The first cell names the row.
    note : str
        An explanation below it.
    """

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""


#: What a module must define to be a study, and what it may define.
_REQUIRED = ("WHERE", "PROTOCOL", "PARAMETERS", "SIZES", "tasks", "realise", "summarise", "judge", "draw")
_OPTIONAL = ("shared", "tables", "DATA")


@dataclass(frozen=True)
class Study:
    """Describe a study: everything that the runner, the page and the command line need.

    A study is a module: `of` reads the attributes below from its constants, whose names are in capital letters
    (``WHERE``, ``PROTOCOL`` ...), and from its functions (``tasks``, ``realise`` ...).

    Of these functions those that name them are also given ``data``, the folder of recordings, and ``kept``, a `Kept` of
    the report, by which studies share what takes long.

    Attributes
    ----------
    name, title : str
        As in ``taxel_studies.STUDIES``.
    where : str
        Its place in the source.
    protocol : str
        What is done, in plain words, with the readings that were used.
    parameters : mapping
        The experiment at full size.
    sizes : mapping of mappings
        What other sizes change of it; "toy" shows that it runs, in seconds.
    tasks : function of parameters
        The realisations.
    realise : function of (params, seed)
        Pure.
    summarise : function of (parameters, rows)
        Plain values for JSON: numbers and curves.
    judge : function of (parameters, summary)
        Judges claims.
    draw : function of (parameters, summary)
        The picture, as the source draws it; or several.
    shared : function of parameters, optional
        What `Kept.made` makes for many realisations, a function and its arguments each: made first, side by side.
    tables : function of (parameters, summary), optional
        Tables below the picture.
    data : tuple of str
        Folders of recordings that it needs.
    """

    name: str
    title: str
    where: str
    protocol: str
    parameters: Parameters
    sizes: Mapping[str, Parameters]
    tasks: Callable[..., Sequence[Task]]
    realise: Callable[..., Any]
    summarise: Callable[..., Summary]
    judge: Callable[[Parameters, Summary], Iterable[Judgement]]
    draw: Callable[[Parameters, Summary], Figure | Sequence[Figure]]
    shared: Callable[[Parameters], Sequence[tuple[Any, ...]]] | None = None
    tables: Callable[[Parameters, Summary], Iterable[Table]] | None = None
    data: tuple[str, ...] = ()

    @classmethod
    def of(cls, name: str, title: str, module: ModuleType) -> Study:
        """Return the study that a module defines.

        Raises
        ------
        ProblemError : the module lacks constants or functions of a study (names them)
        """
        missing = [wanted for wanted in _REQUIRED if not hasattr(module, wanted)]
        if missing:
            raise ProblemError(f"{module.__name__} is not a study: it lacks {', '.join(missing)}")
        defined = {wanted.lower(): vars(module)[wanted] for wanted in _REQUIRED + _OPTIONAL if hasattr(module, wanted)}
        return cls(name, title, **defined)

    def set(self, size: str = "full", **changes: Any) -> dict[str, Any]:
        """Return the parameters of a size, with changes.

        Raises
        ------
        ProblemError : an unknown size or parameter, or a value of another kind
        """
        if size not in ("full", *self.sizes):
            allowed = ", ".join(map(repr, ("full", *self.sizes)))
            raise ProblemError(f"{self.name}: size is {size!r}: must be one of {allowed}")
        values = {**self.parameters, **self.sizes.get(size, {})}
        for name, value in changes.items():
            if name not in values:
                raise ProblemError(f"{self.name} has no parameter {name!r}: its parameters are {', '.join(values)}")
            if not _alike(value, values[name]):
                raise ProblemError(f"{name} is {value!r}: must be {_kind(values[name])}, as {values[name]!r}")
            values[name] = value
        if values.get("realisations", 1) < 1:
            raise ProblemError(f"realisations is {values['realisations']}: must be a whole number, 1 or more")
        return values

    def cannot_run(self, data: Path | None) -> str | None:
        """Say that a run would miss all of its recordings; None where it can begin."""
        if self.data and (data is None or not any((data / folder).is_dir() for folder in self.data)):
            return f"it needs any of {', '.join(self.data)} (--data)"
        return None

    def run(
        self,
        report: Path,
        *,
        size: str = "full",
        changes: Mapping[str, Any] | None = None,
        data: Path | None = None,
        workers: Workers | None = None,
        quiet: bool = False,
    ) -> Section:
        """Run what is not in `report` yet, draw, judge; leave ``summary.json`` and the picture there.

        Results that are there count if the same commit computed them, without local changes.

        Parameters
        ----------
        report : Path
            The folder of all studies; this one's folder in it has its name.
        size : str
            "full", "toy" ...
        changes : mapping, optional
            Parameters that differ from the size's.
        data : Path, optional
            Where the recordings lie, for the studies that need some.
        workers : Workers, optional
            Default: this process alone.
        quiet : bool
            No progress line, nor one on stderr while recordings are read.

        Returns
        -------
        dict

        Raises
        ------
        ProblemError : an unknown size or parameter
        FormatError : recordings that it needs are not there, or one cannot be read
        """
        workers = Workers() if workers is None else workers
        parameters = self.set(size, **(changes or {}))
        begun = time.time()
        kept = Kept(report / "cache", code_version("taxel", "taxel_rules", "taxel_studies"))
        given: dict[str, Any] = {"kept": kept}
        if self.data:
            given["data"] = self._recordings(data)
            _say(quiet, f"{self.name}: reading the recordings in {data}; hundreds of them take minutes")
        tasks = self.tasks(parameters, **_named(self.tasks, given))
        options: dict[str, Any] = {"kept": kept, "workers": workers, "quiet": quiet}
        first = [Task({"call": call}) for call in (self.shared(parameters) if self.shared else ())]
        made = run(make, first, given=given, title=f"{self.name}, what is shared", **options) if first else []
        rows = run(self.realise, tasks, given=_named(self.realise, given), title=self.name, **options)
        summary = self.summarise(parameters, rows, **_named(self.summarise, given))
        section = {
            "name": self.name,
            "title": self.title,
            "where": self.where,
            "protocol": self.protocol,
            "size": size,
            "parameters": parameters,
            "changed": sorted(changes or {}),
            "realisations": len(rows),
            "fits": fits(rows),
            "judgements": [asdict(one) for one in self.judge(parameters, summary)],
            "tables": [asdict(t) for t in self.tables(parameters, summary)] if self.tables is not None else [],
            "said": summary,
            "cpu_seconds": round(sum(row.seconds for row in [*made, *rows]), 1),
            "wall_seconds": round(time.time() - begun, 1),
            "commit": kept.code,
            **machine(),
        }
        _write_section(report / self.name, section, drawn(self, parameters, summary))
        return section

    def _recordings(self, data: Path | None) -> Path:
        if data is not None and not data.is_dir():
            raise FileNotFoundError(2, "No such folder", str(data))
        if data is None or not any((data / name).is_dir() for name in self.data):
            raise FormatError(
                f"{data or self.name}: contains no recordings; give a folder with any of {', '.join(self.data)} by "
                "--data (taxel's documentation says on the page Files where you get them)"
            )
        return data


def _named(function: Callable[..., Any], offered: Mapping[str, Any]) -> dict[str, Any]:
    """Return those of the arguments on offer that a function names."""
    wanted = signature(function).parameters
    return {name: value for name, value in offered.items() if name in wanted}


def _say(quiet: bool, text: str) -> None:
    if not quiet:
        print(text, file=sys.stderr)


def _alike(value: Any, other: Any) -> bool:
    if isinstance(other, list):
        return isinstance(value, list) and all(_alike(v, other[0]) for v in value if other)
    return type(value) is type(other) or (type(value), type(other)) == (int, float)


def _kind(value: Any) -> str:
    """Return the kind of value that is allowed, in words."""
    kinds = {bool: "true or false", int: "a whole number", float: "a number", list: "a list"}
    return kinds.get(type(value), "a text")


def machine() -> dict[str, Any]:
    """Return what times depend on: processor, versions, date."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    cpu = next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), platform.processor())
    return {
        "machine": f"{platform.machine()}, {cpu}",
        "versions": {
            "python": platform.python_version(),
            "taxel": __version__,
            **{name: metadata.version(name) for name in ("numpy", "scipy", "matplotlib")},
        },
        "date": time.strftime("%Y-%m-%d", time.gmtime()),
    }


def fits(rows: Sequence[Row]) -> dict[str, Any]:
    """Return how many fits a study made, how many of them did not close, and their largest gap."""
    gaps = [gap for row in rows for gap in row.gaps]
    return {"count": len(gaps), "open": sum(gap > 0.0 for gap in gaps), "largest_gap": max(gaps, default=0.0)}


def results(rows: Sequence[Row], **axes: Any) -> list[Any]:
    """Return the results of the realisations that were given these parameters."""
    return [row.result for row in rows if all(row.params[name] == value for name, value in axes.items())]


def one_task(p: Parameters) -> list[Task]:
    """List the one realisation of a study, with its parameters' seed."""
    return [Task({k: v for k, v in p.items() if k != "seed"}, p["seed"])]


def only_result(_p: Parameters, rows: Sequence[Row]) -> Summary:
    """Return the result of the one realisation of a study."""
    summary: Summary = rows[0].result
    return summary


def listed(values: Iterable[float | None], places: Iterable[float], form: str = ".2f", place: str = "{:g}") -> str:
    """Return values in words, each with its place.

    Examples
    --------
    >>> listed([1.0, None], [1, 5], place="{:g} ms")
    '1.00 at 1 ms, none at 5 ms'
    """
    words = ["none" if value is None else f"{value:{form}}" for value in values]
    return ", ".join(f"{word} at {place.format(at)}" for word, at in zip(words, places, strict=True))


def svg(figure: Figure) -> bytes:
    """Return a picture as SVG, the same bytes for the same numbers."""
    buffer = io.BytesIO()
    with rc_context({"svg.hashsalt": "taxel", "svg.fonttype": "none"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None}, bbox_inches="tight", facecolor="white")
    return buffer.getvalue()


def subplots(width: float, height: float, *shape: int, **options: Any) -> tuple[Figure, Any]:
    """Return a picture of this size, inches, and its axes, as `Figure.subplots` gives them."""
    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots(*shape, **options)


def logarithmic(axes: Axes, *, x: Sequence[float] = (), y: Sequence[float] = ()) -> None:
    """Make the horizontal axis, the vertical one, or both logarithmic, marked in plain numbers at these places."""
    if x:
        axes.set_xscale("log")
        axes.set_xticks(x, [f"{place:g}" for place in x])
        axes.set_xticks([], minor=True)
    if y:
        axes.set_yscale("log")
        axes.set_yticks(y, [f"{place:g}" for place in y])
        axes.set_yticks([], minor=True)


def drawn(study: Study, parameters: Parameters, summary: Summary) -> list[bytes]:
    """Return the pictures of a study's results, as SVG."""
    figures = study.draw(parameters, summary)
    return [svg(figure) for figure in (figures if isinstance(figures, Sequence) else [figures])]


def _write_section(folder: Path, section: Section, pictures: Sequence[bytes]) -> None:
    """Write a study's summary and its pictures, each whole; the summary names the pictures."""
    folder.mkdir(parents=True, exist_ok=True)
    names = ["figure.svg"] if len(pictures) == 1 else [f"figure-{k}.svg" for k in range(1, len(pictures) + 1)]
    for name, picture in zip(names, pictures, strict=True):
        write_whole(folder / name, partial(_put, picture), overwrite=True)
    text = json.dumps(section | {"pictures": names}) + "\n"
    write_whole(folder / "summary.json", partial(_put, text.encode()), overwrite=True)


def _put(data: bytes, file: BinaryIO) -> None:
    file.write(data)


def read_section(folder: Path) -> Section | None:
    """Return the section that a run saved, with pictures as data addresses; None where nothing was run."""
    path = folder / "summary.json"
    if not path.exists():
        return None
    try:
        section: Section = json.loads(path.read_text(encoding="utf-8"))
        names = section["pictures"]
    except (ValueError, KeyError, TypeError):
        raise FormatError(f"{path}: is not a summary of a study; give another folder by --report") from None
    section["images"] = [
        f"data:image/svg+xml;base64,{base64.b64encode((folder / name).read_bytes()).decode()}" for name in names
    ]
    return section
