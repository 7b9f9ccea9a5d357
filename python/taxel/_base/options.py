"""Options of a callable: a dataclass, whose fields make its signature and the options of the command line."""

from __future__ import annotations

import functools
import inspect
import re
from collections.abc import Callable
from dataclasses import field, fields
from typing import Any, Concatenate, ParamSpec, TypeVar

#: A parameter in a docstring: its name and its description.
_PARAMETER = re.compile(r"^(\w+) : .*((?:\n    .+)+)", re.MULTILINE)
_P = ParamSpec("_P")
_First = TypeVar("_First")
_Options = TypeVar("_Options")
_Result = TypeVar("_Result")


def option(default: Any, *, least: float | None = None, most: float | None = None, **typed: str) -> Any:
    """Return a field with its default, the range of its values, and how it is `typed`; its class describes it."""
    return field(default=default, metadata={"min": least, "max": most, "typed": typed})


def about(options: Any, name: str) -> dict[str, Any]:
    """Return the description and the range of an option, for the command line: help, min, max."""
    [metadata] = [entry.metadata for entry in fields(options) if entry.name == name]
    described = dict(_PARAMETER.findall(inspect.getdoc(options) or ""))
    limits = {key: metadata[key] for key in ("min", "max") if metadata[key] is not None}
    return {"help": " ".join(described.get(name, "").split()), **limits}


def with_fields_of(
    options: Callable[_P, _Options],
) -> Callable[[Callable[[_First, _Options], _Result]], Callable[Concatenate[_First, _P], _Result]]:
    """Make a function of one argument and a dataclass of options accept the fields of that dataclass as arguments."""

    def decorate(work: Callable[[_First, _Options], _Result]) -> Callable[Concatenate[_First, _P], _Result]:
        def call(*arguments: Any, **keywords: Any) -> _Result:
            given = signature.bind(*arguments, **keywords)
            return work(given.args[0], options(*given.args[1:], **given.kwargs))

        functools.update_wrapper(call, work)
        stated = inspect.signature(work)
        parameters = [next(iter(stated.parameters.values())), *inspect.signature(options).parameters.values()]
        signature = stated.replace(parameters=parameters)
        call.__signature__ = signature  # type: ignore[attr-defined]
        return call

    return decorate
