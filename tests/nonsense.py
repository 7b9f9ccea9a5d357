"""Public callables, and nonsense in each of their arguments."""

import functools
import inspect
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from sound import LEFT_OUT, OBJECTS, SMALL, USES, VALUES

import taxel
from taxel._base.saved import Saved
from taxel.learn._learner import SpikeLearner

NONSENSE: dict[str, Any] = {
    "None": None,
    "a text": "nonsense",
    "NaN": math.nan,
    "infinity": math.inf,
    "a negative number": -1,
    "far too large": 10**30,
    "nothing in a list": [],
    "a wrong shape": np.zeros((2, 3, 4)),
}


def modules() -> list[Any]:
    """Return the package and the rooms that it offers; the command line has tests of its own."""
    rooms = [room for name in taxel.__all__ if inspect.ismodule(room := getattr(taxel, name))]
    return [taxel, *rooms, taxel.simulate.circuit]


@functools.cache
def public() -> dict[str, Any]:
    """Return every public callable of taxel."""
    return public_of(modules())


def public_of(rooms: list[Any]) -> dict[str, Any]:
    """Return what takes arguments, by its shortest name: functions, classes, methods of these and of private bases."""
    names: set[int] = set()
    found: dict[str, Any] = {}
    for module in rooms:
        for name in getattr(module, "__all__", ()):
            value = getattr(module, name)
            if not callable(value) or id(value) in names:
                continue
            names.add(id(value))
            found[f"{module.__name__}.{name}"] = value
            if inspect.isclass(value) and not issubclass(value, BaseException):
                shared = (Saved, SpikeLearner)
                own = [b for b in reversed(value.__mro__) if b is value or b.__name__.startswith("_") or b in shared]
                for part in {part for base in own for part in vars(base)}:
                    member = getattr(value, part)
                    if (
                        not part.startswith("_")
                        and part != "plot"
                        and (inspect.isfunction(member) or inspect.ismethod(member))
                    ):
                        found[f"{module.__name__}.{name}.{part}"] = member
    return {name: value for name, value in found.items() if takes(value)}


def takes(value: Any) -> dict[str, bool]:
    """Return the names of what a callable takes, and whether each needs a value."""
    try:
        parameters = inspect.signature(value).parameters.values()
    except ValueError:  # exceptions that the compiled part makes
        return {}
    named = [p for p in parameters if p.kind not in (p.VAR_KEYWORD, p.VAR_POSITIONAL) and p.name not in ("self", "cls")]
    return {p.name: p.default is p.empty for p in named}


def is_result(value: Any) -> bool:
    """Whether users receive a class, but do not construct it: its fields are described as attributes."""
    return inspect.isclass(value) and "\nParameters\n" not in (inspect.getdoc(value) or "")


def value_of(name: str, argument: str) -> Any:
    """Return a sound value for an argument of a callable."""
    owner, last = name.split(".")[-2:]
    names = [f"{owner}.{last}.{argument}", f"{last}.{argument}", argument]
    return next(VALUES[key] for key in names if key in VALUES)()


def call(name: str, value: Any, argument: str = "", nonsense: Any = None) -> None:
    """Call with sound values, and nonsense for one argument."""
    owner, last = name.split(".")[-2:]
    method = "self" in inspect.signature(value).parameters
    arguments = {one: value_of(name, one) for one, needed in takes(value).items() if needed and one != argument}
    arguments |= SMALL.get(f"{owner}.{last}", SMALL.get(last, {}))
    if argument:
        arguments[argument] = nonsense
    made = (getattr(OBJECTS.get(f"{owner}.{last}", OBJECTS.get(owner))(), last) if method else value)(**arguments)
    USES.get(last, lambda _: None)(made)


def faults(name: str, value: Any) -> Iterator[str]:
    """Yield where nonsense in an argument is neither taken nor one clear error."""
    for argument in takes(value):
        for kind, nonsense in NONSENSE.items():
            try:
                call(name, value, argument, nonsense)
            except (taxel.Error, OSError) as error:
                said = str(error)
                if not said or "\n" in said or "a bug in taxel" in said or len(said) > 400:
                    yield f"{name}: {argument} = {kind}: {type(error).__name__}: {said!r}"
            except BaseException as error:  # what else comes out is a fault, a panic too
                yield f"{name}: {argument} = {kind}: {type(error).__name__}: {error}"


def check(there: dict[str, Any]) -> None:
    """Check that sound calls are sound, and that nonsense in any of their arguments is one clear error."""
    found = []
    for name, value in there.items():
        owner, last = name.split(".")[-2:]
        if not is_result(value) and not {last, f"{owner}.{last}"} & LEFT_OUT:
            call(name, value)
            found += faults(name, value)
    assert not found, "\n".join(found)
