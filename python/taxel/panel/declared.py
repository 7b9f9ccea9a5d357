"""Requests of the page: a method's annotated signature declares a request, its docstring documents it."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from typing import Annotated, Any, TypeVar, get_type_hints

import msgspec
from msgspec import Meta

from taxel._base.errors import refused

_Method = TypeVar("_Method", bound=Callable[..., Coroutine[Any, Any, Any]])

#: A text that is not of white space alone, without control characters; one that may be empty.
_TEXT, _LINE = r"^(?=.*\S)[^\x00-\x1f\x7f-\x9f]*$", r"^[^\x00-\x1f\x7f-\x9f]*$"

#: A time of the view, us.
Time = Annotated[int, Meta(ge=-(2**52), le=2**52, description="time, us")]


def whole(least: int, most: int) -> Meta:
    """Take whole numbers from `least` to `most`."""
    return Meta(ge=least, le=most)


def line(most: int, least: int = 1) -> Meta:
    """Take texts of `least` to `most` characters, without control characters, and not of white space alone."""
    return Meta(min_length=least, max_length=most, pattern=_TEXT if least else _LINE)


def long_request(method: _Method) -> _Method:
    """Declare a method to be a request that takes long: carried out beside others."""
    method.is_long = True  # type: ignore[attr-defined]
    return method


@dataclass(frozen=True)
class Request:
    """Hold a request as its method declares it.

    Parameters
    ----------
    method : coroutine function
        Of a session and the keys of the request.
    is_long : bool
        Whether it is carried out beside others.
    keys : type of msgspec.Struct
        A field for each key.
    """

    method: Callable[..., Coroutine[Any, Any, Any]]
    is_long: bool
    keys: type[msgspec.Struct]

    def read(self, keys: dict[str, Any]) -> dict[str, Any]:
        """Return the arguments of the method.

        Raises
        ------
        ProblemError : an unknown key, a missing one, or a value that does not fit (names the innermost key)
        """
        try:
            values = msgspec.convert(keys, self.keys)
        except msgspec.ValidationError as error:
            text, _, place = str(error).partition(" - at ")
            key = re.findall(r"field `(\w+)`", text) or re.findall(r"[a-z]\w*", place)
            text = "must have no control characters, and more than white space" if "regex" in text else text
            raise refused(key[-1], f": {text}") from None
        return {key: getattr(values, key) for key in self.keys.__struct_fields__}


def requests_of(session: type) -> dict[str, Request]:
    """Return the requests that a class declares by public methods, by name, in the order of these."""
    found: dict[str, Request] = {}
    for name, method in vars(session).items():
        if name.startswith("_") or not inspect.iscoroutinefunction(method):
            continue
        kinds = get_type_hints(method, include_extras=True)
        fields = [
            (key, kinds[key]) if one.default is one.empty else (key, kinds[key], one.default)
            for key, one in inspect.signature(method).parameters.items()
            if key in kinds
        ]
        keys = msgspec.defstruct(name, fields, forbid_unknown_fields=True, kw_only=True)
        found[name.rstrip("_")] = Request(method, hasattr(method, "is_long"), keys)
    return found
