"""Laws of classes with parameters: each takes a class, or a class and the name of a parameter with a range."""

import copy
import inspect
import math
import pickle
import re
import sys
from collections.abc import Iterator, Sequence
from typing import Any, get_args, get_type_hints

import pytest
from refusal import refused

import taxel
from taxel._base.parameters import Parameters, Value


def of(kind: type[Parameters]) -> Iterator[type[Parameters]]:
    for one in kind.__subclasses__():
        if not inspect.isabstract(one) and "_kind" in vars(one):
            yield one
        yield from of(one)


#: Every class with parameters, of rooms that are imported at their first use too.
ROOMS = (taxel.calibration, taxel.encode, taxel.learn, taxel.metrics, taxel.information)


KINDS = sorted(set(of(Parameters)), key=lambda kind: kind.__name__)


#: Values for parameters without a default.
REQUIRED: dict[str, Any] = {
    "levels": [1.0],
    "parts": {"area": taxel.encode.ContactArea()},
}


def make(kind: type[Parameters], **changes: Any) -> Any:
    return kind(**{**{name: REQUIRED[name] for name in kind._described()["required"]}, **changes})


def ranged(kinds: list[Any] = KINDS) -> list[Any]:
    return [
        pytest.param(kind, name, id=f"{kind.__name__}.{name}") for kind in kinds for name in kind._described()["ranges"]
    ]


def the_signature_shows_what_the_compiled_part_has(kind):
    """Names and defaults of the constructor, one by one; a group is None, which stands for its defaults."""
    known = kind._described()
    shown = {name: entry.default for name, entry in inspect.signature(kind).parameters.items()}
    assert [name for name, default in sorted(shown.items()) if default is inspect.Parameter.empty] == sorted(
        known["required"]
    )
    assert set(shown) - set(known["required"]) == set(known["defaults"])
    for name, default in known["defaults"].items():
        wanted = tuple(default) if isinstance(default, list) else None if isinstance(default, dict) else default
        assert shown[name] == wanted, name
        assert type(shown[name]) is type(wanted), name


def a_value_outside_its_range_is_refused(kind, name):
    rules = kind._described()["ranges"][name]
    wrong = [math.nan]
    if "least" in rules:
        wrong.append(rules["least"] - 1 if rules["least_in"] else rules["least"])
    if "most" in rules:
        wrong.append(rules["most"] * 2 + 1 if rules["most_in"] else rules["most"])
    default = kind._described()["defaults"].get(name)
    hint = get_type_hints(kind)[name]
    whole = hint in (int, int | None)
    entries = max(1, len(default)) if isinstance(default, list) else int(hint == Sequence[float] | None)
    for value in wrong:
        given = int(value) if whole and math.isfinite(value) else value
        with refused(argument=name):
            make(kind, **{name: [given] * entries if entries else given})


def documented(kind: Any, name: str) -> str:
    """The documentation of a parameter, or that of the class that it refers to."""
    lines = inspect.getdoc(kind).split("Attributes\n")[0].split("Returns\n")[0].splitlines()
    (place,) = (k for k, line in enumerate(lines) if re.match(rf"(\w+, )*{name}\b(, \w+)*( : |$)", line))
    there = re.search(r"[Aa]s (?:in|for) `(\w+)`", " ".join(lines[place + 1 : place + 3]))
    if there and not re.search(r"\d", lines[place].partition(" : ")[2]):
        return documented(getattr(sys.modules[kind.__module__.rpartition(".")[0]], there[1]), name)
    return lines[place]


def the_documentation_says_the_table_s_range_and_unit(kind, name):
    rules = kind._described()["ranges"][name]
    said = documented(kind, name)
    wanted = rules["must_be"].removesuffix(" and finite")
    if "number of us" in wanted:
        wanted = "whole us"
    if wanted != "finite":
        assert wanted.replace(" and ", ", ") in said.replace(" and ", ", "), f"{said}: {wanted}"
    if rules["unit"]:
        assert f", {rules['unit']}" in said.replace("percent", "%"), said


def the_words_of_a_choice_are_the_compiled_part_s(kind):
    """A value that the type does not list is refused with the list of valid ones."""
    for name, hint in get_type_hints(kind).items():
        words = [word for part in (hint, *get_args(hint)) for word in get_args(part) if isinstance(word, str)]
        if not words or name not in inspect.signature(kind).parameters:
            continue
        with refused(argument=name) as error:
            make(kind, **{name: "nonsense"})
        listed = str(error.value).partition(": must be ")[2].removeprefix("one of ")
        assert sorted(re.split(", | or ", listed.replace('"', ""))) == sorted(words)


def parameters_go_round(kind):
    """By `get_params`, a copy and a pickle; a constructor keeps the objects that it was given."""
    one = make(kind)
    again = type(one)(**one.get_params(deep=False))
    for other in (again, copy.deepcopy(one), pickle.loads(pickle.dumps(one))):
        assert type(other) is type(one)
        assert (other._json(), repr(other)) == (one._json(), repr(one))
        assert (other == one) is isinstance(one, Value)
    for name, value in one.get_params(deep=False).items():
        assert getattr(again, name) is value
    assert kind._compiled.check_parameters(kind._kind, one._json())


def a_wrong_value_changes_nothing(kind):
    one = make(kind)
    known = kind._described()
    before, name = one.get_params(), next(iter(known["ranges"] or known["defaults"] or known["required"]))
    for nonsense in ({name: math.nan}, {name: object()}, {"nonsense": 1}, {f"{name}__nonsense": 1}, {"__": 1}):
        with pytest.raises(taxel.ProblemError):
            one.set_params(**nonsense)
        assert all(held is before[key] for key, held in one.get_params(deep=False).items())
    with refused(argument="deep"):
        one.get_params(deep=2)


OF_A_KIND = [
    the_signature_shows_what_the_compiled_part_has,
    the_words_of_a_choice_are_the_compiled_part_s,
    parameters_go_round,
    a_wrong_value_changes_nothing,
]
OF_A_RANGE = [a_value_outside_its_range_is_refused, the_documentation_says_the_table_s_range_and_unit]
