"""Where a docstring names other parameters than the signature, or lacks a shape or a unit."""

import inspect
import re
from typing import Any

from nonsense import takes

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
