"""Docstrings of what a user imports: parameters as in the signature, with shape and unit, errors, sources, examples.

`ROOMS` names the modules that pass; whoever completes another adds it here.
"""

import inspect
import re
from pathlib import Path
from typing import Any

import pytest
from test_nonsense import SOUND, public, takes

import taxel

#: Rooms whose docstrings are whole, and single names of rooms that are not yet.
ROOMS = (
    "taxel.simulate.Layer",
    "taxel.simulate.Scene",
    "taxel.simulate.Flaws",
    "taxel.simulate.Faults",
    "taxel.simulate.circuit.Converter",
    "taxel.simulate.emulate",
    "taxel.live",
    "taxel.device",
)

READINGS = Path(__file__).parents[1] / "docs" / "readings.md"
#: Annotations of arrays, whose entries name a shape.
ARRAYS = re.compile(r"ArrayLike|NDArray")
#: What an entry of a number may name in place of a unit: a range, or a word for a number without one.
UNITS = re.compile(
    r"\b(us|ms|s|ns|Hz|kHz|mm|N|g|kPa|MPa|Pa|V|mV|kOhm|ohm|uS|ticks?|degrees|lines|taxels|bits|share|factor)\b|%|1/ms|1/mm"
    r"|above|or more|at most|from -?\d| to \d"
)


def of_rooms() -> dict[str, Any]:
    return {
        name: value
        for name, value in public().items()
        if any(name == room or name.startswith(f"{room}.") for room in ROOMS)
    }


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
    """Return the first line of each parameter's entry, by its name."""
    found = {}
    for line in lines:
        if line and not line.startswith(" "):
            names, _, about = line.partition(" : ")
            found |= {name.strip().lstrip("*"): about or line for name in names.split(",")}
    return found


def short(value: Any) -> bool:
    """Return whether a docstring is one line that needs no sections: a method without parameters."""
    return not takes(value)


@pytest.mark.parametrize("name", of_rooms())
def test_parameters_are_those_of_the_signature_with_shape_and_unit(name: str) -> None:
    value = of_rooms()[name]
    if short(value):
        return
    parameters = [p for p in inspect.signature(value).parameters.values() if p.name not in ("self", "cls")]
    written = entries(sections(value).get("Parameters", []))
    named = [p.name for p in parameters if p.kind is not p.VAR_KEYWORD]
    given = [key for key in written if key not in [p.name for p in parameters if p.kind is p.VAR_KEYWORD]]
    assert given == named, f"{name}: Parameters and signature differ"
    for parameter in parameters:
        kind, about = str(parameter.annotation), written.get(parameter.name, "")
        if ARRAYS.search(kind):
            assert re.search(r"shape|\(n?,? ?rows, columns\)|sequence", about), f"{name}: {parameter.name} has no shape"
        if ARRAYS.search(kind) or re.match(r"(float|int)\b", kind):
            assert UNITS.search(about), f"{name}: {parameter.name} has neither unit nor range"


@pytest.mark.parametrize("name", [name for name in of_rooms() if name in SOUND])
def test_what_refuses_an_argument_has_raises(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    value = of_rooms()[name]
    for argument in SOUND[name]()[1]:
        function, arguments = SOUND[name]()
        try:
            function(**{**arguments, argument: object()})
        except taxel.Error:
            assert "Raises" in sections(value), f"{name}: {argument} is refused, and there is no Raises"
            return


def test_at_least_half_show_an_example_that_is_run() -> None:
    """`make docs` and the doctests run every example; here they are counted."""
    there = of_rooms()
    shown = [name for name, value in there.items() if ">>>" in (inspect.getdoc(value) or "")]
    assert len(shown) >= len(there) / 2, sorted(set(there) - set(shown))


def test_what_the_readings_list_names_its_source() -> None:
    """The options in the last column of docs/readings.md: their class cites the section or equation of the row."""
    there = {name.rsplit(".", 1)[-1]: value for name, value in of_rooms().items() if inspect.isclass(value)}
    missing = []
    for row in READINGS.read_text("utf-8").splitlines():
        cells = [cell.strip() for cell in row.strip("|").split("|")]
        if len(cells) != 4:
            continue
        sources = re.findall(r"\b\d\.\d+(?:\.\d)?\b", cells[1])
        for option in re.findall(r"`(\w+)\(\w+=", cells[3]):
            about = inspect.getdoc(there[option]) if option in there else None
            if about is not None and sources and not any(source in about for source in sources):
                missing.append(f"{option}: {', '.join(sources)}")
    assert not missing


def test_all_names_what_is_public() -> None:
    for room in (taxel.simulate, taxel.simulate.circuit, taxel.calibration):
        own = {
            name
            for name, value in vars(room).items()
            if not name.startswith("_")
            and (inspect.isclass(value) or inspect.isfunction(value))
            and getattr(value, "__module__", "") == room.__name__
        }
        assert own <= set(room.__all__), room.__name__
