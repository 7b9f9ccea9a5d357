"""Docstrings of what a user imports: parameters as in the signature, with shape and unit, and sources; the reference.

What holds for every function, `make lint` checks by pydoclint.
"""

import importlib
import inspect
import re
from pathlib import Path
from pkgutil import resolve_name, walk_packages
from typing import Any

from test_nonsense import modules, public, takes

import taxel

DOCS = Path(__file__).parents[1] / "docs"
#: Annotations of arrays of numbers, whose entries name a shape and a unit.
ARRAYS = re.compile(r"ArrayLike|NDArray")
#: What an entry of a number may name in place of a unit: a range, or a word for a number without one.
UNITS = re.compile(
    r"\b(us|ms|s|ns|Hz|kHz|mm|N|g|kPa|MPa|Pa|V|mV|kOhm|ohm|uS|ticks?|degrees|lines|taxels|bits|bytes|share|factor|words"
    r"|bool|texts?|unit|index|indices|numbers?|seed|columns?|rows?|labels?|classes|counts?|version|weights?|epochs?)\b"
    r"|%|1/ms|1/mm|1/s|above|or more|at most|between -?\d|\bAs (in|they were) |from -?\d| to \d"
)
SHAPE = re.compile(r"shape|\bAs (in|they were) |\(n?,? ?rows, columns\)|sequence|list|one number|scalar")


def sections(value: Any) -> dict[str, list[str]]:
    """Return the lines of each numpydoc section, and those before the first under an empty name."""
    found: dict[str, list[str]] = {"": []}
    lines, now = (inspect.getdoc(value) or "").splitlines(), ""
    for line, below in zip(lines, [*lines[1:], ""], strict=True):
        if below and set(below) == {"-"} and len(below) >= len(line.strip()) > 0:
            found[now := line.strip()] = []
        elif not (line and set(line) == {"-"}):
            found[now].append(line)
    return found


def entries(lines: list[str]) -> dict[str, str]:
    """Return each parameter's entry, type and description, by its name."""
    found: dict[str, str] = {}
    names: list[str] = []
    for line in lines:
        if line and not line.startswith(" "):
            listed, _, about = line.partition(" : ")
            names = [name.strip().lstrip("*") for name in listed.split(",")]
            assert not found.keys() & set(names), f"two entries of {names}"
            found |= dict.fromkeys(names, about)
        else:
            found |= {name: f"{found[name]} {line.strip()}" for name in names}
    return found


def faults_of_parameters(name: str, value: Any) -> list[str]:
    """Return where the section Parameters differs from the signature, or lacks a shape or a unit."""
    if not takes(value):
        return []
    parameters = [p for p in inspect.signature(value).parameters.values() if p.name not in ("self", "cls")]
    # A result type, which users receive but do not construct, may describe its fields as attributes.
    written = entries(
        sections(value).get("Parameters") or (sections(value).get("Attributes", []) if inspect.isclass(value) else [])
    )
    named = [p.name for p in parameters if p.kind is not p.VAR_KEYWORD]
    given = [key for key in written if key not in [p.name for p in parameters if p.kind is p.VAR_KEYWORD]]
    if given != named:
        return [f"{name}: Parameters names {', '.join(given) or 'nothing'}; the signature {', '.join(named)}"]
    faults = []
    for parameter in parameters:
        kind, about = str(parameter.annotation), written.get(parameter.name, "")
        if ARRAYS.search(kind) and not SHAPE.search(about):
            faults.append(f"{name}: {parameter.name} has no shape ({about})")
        if (ARRAYS.search(kind) or re.match(r"(float|int)\b", kind)) and not UNITS.search(about):
            faults.append(f"{name}: {parameter.name} has neither unit nor range ({about})")
    return faults


def test_parameters_are_those_of_the_signature_with_shape_and_unit() -> None:
    faults = [fault for name, value in public().items() for fault in faults_of_parameters(name, value)]
    assert not faults, "\n".join(faults)


def unnamed_sources(names: dict[str, Any]) -> list[str]:
    """List the options in the last column of docs/readings.md whose class does not cite the section of the row."""
    there = {name.rsplit(".", 1)[-1]: value for name, value in names.items() if inspect.isclass(value)}
    missing = []
    for row in (DOCS / "readings.md").read_text("utf-8").splitlines():
        cells = [cell.strip() for cell in row.strip("|").split("|")]
        if len(cells) != 3:
            continue
        sources = re.findall(r"\b\d\.\d+(?:\.\d)?\b", cells[0])
        for option in re.findall(r"`(\w+)\(\w+=", cells[2]):
            about = inspect.getdoc(there[option]) if option in there else None
            if about is not None and sources and not any(source in about for source in sources):
                missing.append(f"{option}: {', '.join(sources)}")
    return missing


def test_what_the_readings_list_names_its_source() -> None:
    assert not unnamed_sources(public())


def test_each_all_is_there() -> None:
    """Each name of each module's `__all__` can be imported, so that a star import works."""
    for module in walk_packages(taxel.__path__, "taxel."):
        if not module.name.endswith("__main__"):
            some = importlib.import_module(module.name)
            missing = [name for name in getattr(some, "__all__", ()) if not hasattr(some, name)]
            assert not missing, f"{module.name}.__all__: {missing}"


def test_all_names_what_is_public() -> None:
    for room in modules():
        own = {
            name
            for name, value in vars(room).items()
            if not name.startswith("_")
            and (inspect.isclass(value) or inspect.isfunction(value))
            and getattr(value, "__module__", "") == room.__name__
        }
        assert own <= set(room.__all__), f"{room.__name__}: {sorted(own - set(room.__all__))}: private, or in __all__"


def test_the_reference_shows_exactly_what_is_public() -> None:
    """Pages name whole modules (all of `__all__`) or single names; a name that stands in two rooms needs one page."""
    pages = "\n".join(page.read_text("utf-8") + "\n" for page in sorted((DOCS / "reference").glob("*.rst")))
    by_module = re.findall(r"\.\. automodule:: (\S+)\n((?:   :.*\n)*)", pages)
    by_name = set(re.findall(r"\.\. auto(?:class|function|exception):: (\S+)", pages))
    shown = {id(resolve_name(name)) for name in by_name}
    for name, options in by_module:
        if name.split(".")[0] == "taxel":
            left_out = re.search(r":exclude-members: (.*)", options)
            some = re.search(r":members: (.+)", options)
            names = some[1].split(", ") if some else resolve_name(name).__all__
            shown |= {id(getattr(resolve_name(name), one)) for one in names if not left_out or one not in left_out[1]}
    public_values = {
        f"{room.__name__}.{name}": getattr(room, name)
        for room in modules()
        for name in room.__all__
        if not inspect.ismodule(getattr(room, name))
    }
    assert not sorted(name for name, value in public_values.items() if id(value) not in shown)
    assert not sorted(name for name in by_name if id(resolve_name(name)) not in set(map(id, public_values.values())))
