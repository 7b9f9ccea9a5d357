"""A study: a protocol, its parameters, the published values as data, a picture, and judged statements."""

from __future__ import annotations

import base64
import io
import json
import platform
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any, BinaryIO

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from taxel import FormatError, ProblemError, __version__
from taxel.report import write_whole
from taxel_studies.commit import code_version
from taxel_studies.durations import forecast
from taxel_studies.runner import Results, SharedFolder, Task, Workers, one_of, run, whole

__all__ = [
    "Parameters",
    "Row",
    "Section",
    "Statement",
    "Study",
    "Summary",
    "Table",
    "drawn",
    "logarithmic",
    "machine",
    "one_task",
    "one_task_per_seed",
    "only_result",
    "read_section",
    "refuse",
    "svg",
]

#: Experiment parameters by name: what JSON can hold.
Parameters = Mapping[str, Any]
#: The results of a study, as JSON holds them: enough to judge its statements and to draw its picture.
Summary = dict[str, Any]
#: One study's part of the page, as ``summary.json`` holds it.
Section = dict[str, Any]


@dataclass(frozen=True)
class Statement:
    """A published statement with its value and ours.

    Attributes
    ----------
    says : str
        The statement, in the source's words or close to them.
    published : str
        Its value.
    ours : str
    holds : bool, optional
        None: it cannot be judged (the published picture is lost, or too little was run).
    why : str
        Why it does not hold; or the reading under which it does.
    """

    says: str
    published: str
    ours: str
    holds: bool | None
    why: str = ""


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
    folded : bool
        Shown on the page only where it is opened, and not by the command.
    """

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""
    folded: bool = False


@dataclass(frozen=True)
class Row:
    """One realisation, its result and the CPU seconds that it took."""

    params: dict[str, Any]
    seed: int
    result: Any
    seconds: float = 0.0


#: What a module must define to be a study, and what it may define.
_REQUIRED = ("WHERE", "PROTOCOL", "PARAMETERS", "SIZES", "tasks", "realise", "summarise", "statements", "draw")
_OPTIONAL = ("then", "tables", "unread", "DATA", "COURSES", "NEEDS")


@dataclass(frozen=True)
class Study:
    """Describe a study: everything that the runner, the page and the command line need.

    A study is a module: `of` reads the attributes below from its constants, whose names are in capital letters
    (``WHERE``, ``PROTOCOL`` ...), and from its functions (``tasks``, ``realise`` ...).

    Of studies on recordings `tasks`, `then`, `realise` and `summarise` are also given ``data``, the folder of them; of
    studies on simulated contact `realise` and `summarise` are also given ``courses``, a `SharedFolder` in the report's.

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
    statements : function of (parameters, summary)
    draw : function of (parameters, summary)
        The picture, as the source draws it; or several.
    then : function of (parameters, rows), optional
        The realisations that depend on the results of others: asked again until it lists nothing new.
    tables : function of (parameters, summary), optional
        Tables below the picture.
    unread : function of (parameters, data), optional
        Which files of the recordings cannot be read, and why. It raises `FormatError` where none can.
    data : tuple of str
        Folders of recordings that it needs.
    courses : bool
        Whether it is on simulated contact.
    needs : tuple of str
        Modules of the extra ``studies`` that it needs.
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
    statements: Callable[[Parameters, Summary], Sequence[Statement]]
    draw: Callable[[Parameters, Summary], Figure | Sequence[Figure]]
    then: Callable[..., Sequence[Task]] | None = None
    tables: Callable[[Parameters, Summary], Sequence[Table]] | None = None
    unread: Callable[[Parameters, Path], Mapping[str, str]] = lambda _parameters, _data: {}
    data: tuple[str, ...] = ()
    courses: bool = False
    needs: tuple[str, ...] = ()

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
        one_of(f"{self.name}: size", size, ("full", *self.sizes))
        values = {**self.parameters, **self.sizes.get(size, {})}
        for name, value in changes.items():
            if name not in values:
                raise ProblemError(f"{self.name} has no parameter {name!r}: its parameters are {', '.join(values)}")
            if not _alike(value, values[name]):
                raise ProblemError(f"{name} is {value!r}: must be {_kind(values[name])}, as {values[name]!r}")
            values[name] = value
        if "realisations" in values:
            whole("realisations", values["realisations"], 1)
        return values

    @property
    def lacks(self) -> str | None:
        """The modules that are not installed, in words; None where all are."""
        missing = [name for name in self.needs if find_spec(name) is None]
        return f'it needs {", ".join(missing)}: pip install "taxel[studies]"' if missing else None

    def cannot_run(self, data: Path | None) -> str | None:
        """Say what a run would miss: all of its recordings, or modules; None where it can begin."""
        if self.data and (data is None or not any((data / folder).is_dir() for folder in self.data)):
            return f"it needs any of {', '.join(self.data)} (--data)"
        return self.lacks

    def run(
        self,
        report: Path,
        *,
        size: str = "full",
        changes: Mapping[str, Any] | None = None,
        data: Path | None = None,
        workers: Workers | None = None,
        strict: bool = False,
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
        strict : bool
            A file of recordings that cannot be read ends the study before it begins; else it is left out, and named.
        quiet : bool
            No progress line, nor one on stderr while recordings are read.

        Returns
        -------
        dict

        Raises
        ------
        ProblemError : an unknown size or parameter; a module that is not installed
        FormatError : recordings that it needs are not there, or cannot be read (none of them; one, with `strict`)
        """
        workers = Workers() if workers is None else workers
        parameters = self.set(size, **(changes or {}))
        if self.lacks is not None:
            raise ProblemError(f"{self.name}: {self.lacks}")
        given: dict[str, Any] = {}
        unread: Mapping[str, str] = {}
        if self.data:
            given["data"] = self._recordings(data)
            if not quiet:
                print(f"{self.name}: reading the recordings in {data}; hundreds of them take minutes", file=sys.stderr)
                # What is there already is known once they are read.
                self._say_how_long(size, 1.0, workers)
            unread = self.unread(parameters, given["data"])
            refuse(unread, strict=strict)
        folder = report / self.name
        folder.mkdir(parents=True, exist_ok=True)
        listing = dict(given)
        code = code_version("taxel", "taxel_rules", "taxel_studies")
        if self.courses:
            given["courses"] = SharedFolder(report / "courses", code)
            given["courses"].path.mkdir(exist_ok=True)
        results = Results(folder / "results.jsonl", code)
        if not (quiet or self.data):
            kept = {t.key("") for t in self.tasks(self.set(size))}
            left = [t for t in self.tasks(parameters) if t not in results]
            self._say_how_long(size, len(left) / max(1, len(kept)), workers)
        begun = time.time()
        rows: dict[str, Row] = {}

        def phase(title: str, wanted: Sequence[Task]) -> None:
            run(partial(self.realise, **given), wanted, results, workers=workers, title=title, quiet=quiet)
            for t in wanted:
                rows[t.key("")] = Row(t.params, t.seed, results[t], results.seconds([t]))

        phase(self.name, self.tasks(parameters, **listing))
        while self.then is not None:
            wanted = [t for t in self.then(parameters, list(rows.values()), **listing) if t.key("") not in rows]
            if not wanted:
                break
            phase(f"{self.name}, next", wanted)
        summary = self.summarise(parameters, list(rows.values()), **given)
        section = {
            "name": self.name,
            "title": self.title,
            "where": self.where,
            "protocol": self.protocol,
            "size": size,
            "parameters": parameters,
            "changed": sorted(changes or {}),
            "unread": dict(unread),
            "realisations": len(rows),
            "statements": [asdict(s) for s in self.statements(parameters, summary)],
            "tables": [asdict(t) for t in self.tables(parameters, summary)] if self.tables is not None else [],
            "said": summary,
            "cpu_seconds": round(sum(row.seconds for row in rows.values()), 1),
            "wall_seconds": round(time.time() - begun, 1),
            "commit": code,
            **machine(),
        }
        _write_section(folder, section, drawn(self, parameters, summary))
        return section

    def _say_how_long(self, size: str, share: float, workers: Workers) -> None:
        """Print about how long a share of the study takes, if that is more than a minute and known."""
        if text := forecast(self.name, size, share, workers.jobs):
            print(f"{self.name}: {text}", file=sys.stderr)

    def _recordings(self, data: Path | None) -> Path:
        if data is not None and not data.is_dir():
            raise FileNotFoundError(2, "No such folder", str(data))
        missing = [name for name in self.data if data is None or not (data / name).is_dir()]
        if data is None or len(missing) == len(self.data):
            raise FormatError(
                f"{data or self.name}: contains no recordings; give a folder with any of {', '.join(self.data)} by "
                "--data (taxel study gait --help says where you get them)"
            )
        return data


def refuse(unread: Mapping[str, str], *, strict: bool) -> None:
    """Raise `FormatError` for the first file that cannot be read, where that ends a study."""
    if strict and unread:
        file, why = next(iter(unread.items()))
        more = f" ({len(unread) - 1} more cannot be read)" if len(unread) > 1 else ""
        raise FormatError(f"{file}: {why}{more}")


def _alike(value: Any, other: Any) -> bool:
    if isinstance(other, bool) or isinstance(value, bool):
        return isinstance(value, bool) and isinstance(other, bool)
    if isinstance(other, int | float):
        return isinstance(value, int | float) and (isinstance(value, int) or isinstance(other, float))
    if isinstance(other, list | tuple):
        return isinstance(value, list | tuple) and all(_alike(v, other[0]) for v in value if other)
    return isinstance(value, type(other))


def _kind(value: Any) -> str:
    """Return the kind of value that is allowed, in words."""
    kinds = {bool: "true or false", int: "a whole number", float: "a number", list: "a list", tuple: "a list"}
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


def one_task(p: Parameters) -> list[Task]:
    """List the one realisation of a study, with its parameters' seed."""
    return [Task({k: v for k, v in p.items() if k != "seed"}, p["seed"])]


def only_result(_p: Parameters, rows: Sequence[Row]) -> Summary:
    """Return the result of the one realisation of a study."""
    summary: Summary = rows[0].result
    return summary


def one_task_per_seed(p: Parameters, count: str = "realisations") -> list[Task]:
    """List as many realisations as the parameter of this name says, each with a seed of its own."""
    shared = {k: v for k, v in p.items() if k != count}
    return [Task(shared, seed) for seed in range(p[count])]


def svg(figure: Figure) -> bytes:
    """Return a picture as SVG, the same bytes for the same numbers."""
    buffer = io.BytesIO()
    with rc_context({"svg.hashsalt": "taxel", "svg.fonttype": "none"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None}, bbox_inches="tight", facecolor="white")
    return buffer.getvalue()


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
