"""Base of all classes with parameters: defaults and ranges from the compiled part, and the JSON that it reads."""

from __future__ import annotations

import copy
import json
import sys
from collections.abc import Mapping
from functools import cache
from inspect import signature
from types import SimpleNamespace
from typing import Any, ClassVar, Self

from taxel import _core
from taxel._base.arguments import flag, instance, parameters, shown
from taxel._base.errors import refused
from taxel._core import ProblemError


@cache
def described(kind: str, compiled: Any = _core) -> dict[str, Any]:
    """Return the description of the parameters of a class by its compiled part: that of taxel, or another module.

    ``defaults`` by name, the names that are ``required``, and the ``ranges`` of numbers by name, with their ``unit``
    and the text of an error, ``must_be``.
    """
    found: dict[str, Any] = compiled.parameters(kind)
    return found


def defaults(kind: str, compiled: Any = _core) -> Any:
    """Return the defaults of a class as attributes, for its signature; None stands for a group of parameters."""

    def plain(value: object) -> object:
        return tuple(value) if isinstance(value, list) else None if isinstance(value, dict) else value

    return SimpleNamespace(**{name: plain(value) for name, value in described(kind, compiled)["defaults"].items()})


def ranges(kind: str, compiled: Any = _core) -> dict[str, Any]:
    """Return the ranges of the parameters of a class by name; empty for an unknown class."""
    try:
        return dict(described(kind, compiled)["ranges"])
    except ProblemError:
        return {}


class Parameters:
    """Hold the parameters of the constructor, unchanged, as attributes of the same names.

    A subclass defines its name (`_kind`) in the compiled part that has it (`_compiled`), and which of its parameters
    are groups of parameters themselves (`_nested`). Parameters are checked in the constructor and in `set_params`.

    The interface is scikit-learn's, which is not imported: `get_params`, `set_params`, nested names (``neuron__tau``),
    tags.
    """

    _kind: ClassVar[str]
    _compiled: ClassVar[Any] = _core
    _nested: ClassVar[Mapping[str, type[Parameters]]] = {}

    def __post_init__(self) -> None:
        self._check()

    @classmethod
    @cache
    def _names(cls) -> tuple[str, ...]:
        """Return the names of all parameters, in the order of the constructor."""
        return tuple(signature(cls).parameters)

    @classmethod
    def _described(cls) -> dict[str, Any]:
        """Return the description of the parameters by the compiled part."""
        return described(cls._kind, cls._compiled)

    @classmethod
    def _stands_for(cls, name: str) -> Parameters | None:
        """Return the group of defaults that None stands for in a parameter; None if the parameter is not a group."""
        kind = cls._nested.get(name)
        return kind() if kind is not None and isinstance(cls._described()["defaults"].get(name), dict) else None

    @classmethod
    def _from_values(cls, values: Mapping[str, Any]) -> Self:
        """Build an instance from JSON values."""
        read = {
            name: cls._nested[name]._from_values(value) if name in cls._nested and value is not None else value
            for name, value in values.items()
        }
        return cls(**read)

    def _values(self) -> dict[str, Any]:
        """Return the parameters by name, unchanged."""
        return {name: getattr(self, name) for name in self._names()}

    def _plain(self) -> dict[str, Any]:
        """Return the parameters as the compiled part reads them, which fills in the defaults of an omitted group."""
        plain: dict[str, Any] = {}
        for name, value in self._values().items():
            if value is None and self._stands_for(name) is not None:
                continue
            group = self._nested.get(name)
            if group is not None and value is not None:
                plain[name] = instance(name, value, group)._plain()
            else:
                plain[name] = value
        return plain

    def _json(self) -> str:
        return parameters(self._plain())

    def _check(self) -> None:
        self._compiled.check_parameters(self._kind, self._json())

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Return all parameters by name, unchanged.

        Parameters
        ----------
        deep : bool
            Whether to include the parameters of a group, as ``neuron__tau``; those of a group that is None are its
            defaults.
        """
        values = self._values()
        if flag("deep", deep):
            for name, value in list(values.items()):
                component: Any = self._stands_for(name) if value is None else value
                if hasattr(component, "get_params") and not isinstance(component, type):
                    values |= {f"{name}__{inner}": entry for inner, entry in component.get_params().items()}
        return values

    def set_params(self, **parameters: Any) -> Self:
        """Set parameters by name; results of a fit stay.

        Parameters
        ----------
        **parameters
            As `get_params` lists them. A nested one (``neuron__tau``) replaces the group by a changed copy, so that
            another object with the same group is not affected.

        Returns
        -------
        Self
            Itself.

        Raises
        ------
        ProblemError : a name that is not known, or an invalid value; all parameters are then as before
        """
        names = self._names()
        changes: dict[str, Any] = {}
        inner: dict[str, dict[str, Any]] = {}
        for name, value in parameters.items():
            outer, nested, rest = name.partition("__")
            if outer not in names:
                raise ProblemError(
                    f"{type(self).__name__} has no parameter {outer!r}; its parameters are {', '.join(names)}"
                )
            if nested:
                inner.setdefault(outer, {})[rest] = value
            else:
                changes[outer] = value
        for name, values in inner.items():
            component: Any = changes.get(name, getattr(self, name))
            component = self._stands_for(name) if component is None else component
            if not hasattr(component, "set_params") or isinstance(component, type):
                raise refused(name, f" is {shown(component)}: has no parameter {next(iter(values))!r}")
            changes[name] = copy.copy(component).set_params(**values)
        before = self._values()
        try:
            for name, value in changes.items():
                object.__setattr__(self, name, value)
            self._check()
        except BaseException:
            for name, value in before.items():
                object.__setattr__(self, name, value)
            raise
        return self

    def __sklearn_tags__(self) -> Any:
        # Only scikit-learn calls this, so it is installed.
        tags = sys.modules["sklearn.utils"]
        return tags.Tags(estimator_type=None, target_tags=tags.TargetTags(required=False), input_tags=tags.InputTags())

    def __repr__(self) -> str:
        plain, defaults = json.loads(self._json()), self._described()["defaults"]
        own = {name: value for name, value in self._values().items() if value is not None or not self._stands_for(name)}
        differ = (name for name in own if name in plain and (name not in defaults or plain[name] != defaults[name]))
        settings = (f"{name}={own[name]!r}" for name in differ)
        return f"{type(self).__name__}({', '.join(settings)})"


class Value(Parameters):
    """Base of classes whose instances are equal if their parameters are."""

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return bool(json.loads(self._json()) == json.loads(other._json()))

    __hash__ = None  # type: ignore[assignment]
