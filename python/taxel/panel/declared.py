"""Requests of the page: a method's annotated signature declares a request, its docstring documents it."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from types import UnionType
from typing import (
    Annotated,
    Any,
    Literal,
    NotRequired,
    TypeAlias,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
    is_typeddict,
)
from unicodedata import category

from taxel._base.errors import refused

#: Makes a value of a request of one of JSON; a ValueError says what would be right.
_Read: TypeAlias = Callable[[Any], Any]

_Method = TypeVar("_Method", bound=Callable[..., Coroutine[Any, Any, Any]])


@dataclass(frozen=True)
class Whole:
    """Take whole numbers from `least` to `most`; `words` describe them."""

    least: int
    most: int
    words: str = ""

    def __str__(self) -> str:
        return self.words or f"whole number, {self.least} to {self.most}"

    def read(self, value: Any) -> int:
        """Return a value of JSON; a ValueError says what would be right."""
        if type(value) is not int or not self.least <= value <= self.most:
            raise ValueError(f"must be a whole number from {self.least} to {self.most}")
        return value


@dataclass(frozen=True)
class Number:
    """Take numbers from `least` to `most`."""

    least: float
    most: float

    def __str__(self) -> str:
        return f"number, {self.least:g} to {self.most:g}"

    def read(self, value: Any) -> float:
        """Return a value of JSON; a ValueError says what would be right."""
        if type(value) not in (int, float) or not self.least <= value <= self.most:
            raise ValueError(f"must be a number from {self.least:g} to {self.most:g}")
        return float(value)


@dataclass(frozen=True)
class Text:
    """Take texts of `least` to `most` characters, without control characters, and not of white space alone."""

    most: int
    least: int = 1

    def __str__(self) -> str:
        return f"text, {self.least} to {self.most} characters"

    def read(self, value: Any) -> str:
        """Return a value of JSON; a ValueError says what would be right."""
        if (
            not isinstance(value, str)
            or not self.least <= len(value) <= self.most
            or (self.least and not value.strip())
            or any(category(letter) == "Cc" for letter in value)
        ):
            raise ValueError(f"must be a text of {self.least} to {self.most} characters")
        return value


@dataclass(frozen=True)
class Several:
    """Take lists of 1 to `most` entries."""

    most: int


#: A time of the view, us.
Time = Annotated[int, Whole(-(2**52), 2**52, "time, us")]


def request(method: _Method) -> _Method:
    """Declare a method to be a request, carried out before the client's next one."""
    method.is_long = False  # type: ignore[attr-defined]
    return method


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
    kinds : dict of type by str
        The annotation of each key.
    optional : frozenset of str
        The keys that may be left out.
    """

    method: Callable[..., Coroutine[Any, Any, Any]]
    is_long: bool
    kinds: dict[str, Any]
    optional: frozenset[str]

    def read(self, keys: dict[str, Any]) -> dict[str, Any]:
        """Return the arguments of the method.

        Raises
        ------
        ProblemError : an unknown key, a missing one, or a value that does not fit (names the innermost key)
        """
        return _read_keys(self.kinds, self.optional, keys)


def requests_of(session: type) -> dict[str, Request]:
    """Return the requests that a class declares, by name, in the order of its methods."""
    found: dict[str, Request] = {}
    for name, method in vars(session).items():
        if not hasattr(method, "is_long"):
            continue
        kinds = get_type_hints(method, include_extras=True)
        kinds.pop("return", None)
        parameters = inspect.signature(method).parameters
        optional = frozenset(key for key in kinds if parameters[key].default is not inspect.Parameter.empty)
        found[name.rstrip("_")] = Request(method, method.is_long, kinds, optional)
    return found


def _read_keys(kinds: dict[str, Any], optional: frozenset[str], keys: dict[str, Any]) -> dict[str, Any]:
    """Return the values of an object of JSON by its declared keys; null is as left out."""
    for key in keys:
        if key not in kinds:
            raise refused(key, f": is not known here; must be one of {', '.join(kinds)}" if kinds else ": is not known")
    values = {}
    for key, kind in kinds.items():
        value = keys.get(key)
        if value is None and key in optional:
            continue
        if value is None and key not in keys:
            raise refused(key, ": is missing")
        try:
            values[key] = _reader(kind)(value)
        except ValueError as error:
            raise refused(key, f": {error}") from None
    return values


def _reader(kind: Any) -> _Read:  # noqa: PLR0911  a line for each kind
    """Return what reads values of a type."""
    arguments = get_args(kind)
    if get_origin(kind) is Annotated:
        base, rule = arguments
        return _list_reader(base, rule.most) if isinstance(rule, Several) else rule.read
    if get_origin(kind) is NotRequired:
        return _reader(arguments[0])
    if get_origin(kind) in (Union, UnionType):
        (inner,) = (one for one in arguments if one is not type(None))
        read = _reader(inner)
        return lambda value: None if value is None else read(value)
    if get_origin(kind) is Literal:
        return _checked(lambda value: value in arguments, f"must be {' or '.join(map(str, arguments))}")
    if get_origin(kind) is tuple:
        return _pair_reader([_reader(one) for one in arguments])
    if is_typeddict(kind):
        kinds = get_type_hints(kind, include_extras=True)
        optional = frozenset(key for key, one in kinds.items() if get_origin(one) is NotRequired)
        checked = _checked(lambda value: isinstance(value, dict), "must be an object")
        return lambda value: _read_keys(kinds, optional, checked(value))
    if kind is bool:
        return _checked(lambda value: isinstance(value, bool), "must be true or false")
    return _checked(lambda value: isinstance(value, dict), "must be an object")


def _checked(fits: Callable[[Any], bool], text: str) -> _Read:
    def read(value: Any) -> Any:
        if not fits(value):
            raise ValueError(text)
        return value

    return read


def _list_reader(kind: Any, most: int) -> _Read:
    read = _reader(get_args(kind)[0])

    def read_all(value: Any) -> list[Any]:
        if not isinstance(value, list) or not 1 <= len(value) <= most:
            raise ValueError(f"must be a list of 1 to {most}")
        return [read(one) for one in value]

    return read_all


def _pair_reader(each: list[_Read]) -> _Read:
    def read(value: Any) -> tuple[Any, ...]:
        if not isinstance(value, list) or len(value) != len(each):
            raise ValueError(f"must be a list of {len(each)}")
        return tuple(one(part) for one, part in zip(each, value, strict=True))

    return read


def described(kind: Any) -> str:  # noqa: PLR0911  a line for each kind
    """Return a type of a key in words, for the documentation."""
    arguments = get_args(kind)
    if get_origin(kind) is Annotated:
        base, rule = arguments
        if isinstance(rule, Several):
            return f"1 to {rule.most} of: {described(get_args(base)[0])}"
        return str(rule)
    if get_origin(kind) is NotRequired:
        return described(arguments[0])
    if get_origin(kind) in (Union, UnionType):
        (inner,) = (one for one in arguments if one is not type(None))
        return f"{described(inner)}, or null"
    if get_origin(kind) is Literal:
        return " or ".join(f"`{one}`" for one in arguments)
    if get_origin(kind) is tuple:
        return f"[{', '.join(map(described, arguments))}]"
    if is_typeddict(kind):
        keys = get_type_hints(kind, include_extras=True)
        return "{" + "; ".join(f"`{key}` {described(one)}" for key, one in keys.items()) + "}"
    return "true or false" if kind is bool else "object"
