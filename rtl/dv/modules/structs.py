"""The packed structs of the logic's packages, as their sources have them: values of fields, and fields of a value."""

import re
from types import SimpleNamespace
from typing import Any

from verilated import SOURCES

_TEXT = "".join(re.sub(r"//.*", "", (SOURCES / f"taxel_{name}.sv").read_text()) for name in ("types", "registers"))

#: Named numbers: sizes, and the values of enums.
NUMBERS = {name: int(value) for name, value in re.findall(r"localparam int (\w+) = (\d+);", _TEXT)}
_BITS: dict[str, int] = {"logic": 1}
_FIELDS: dict[str, list[tuple[str, str]]] = {}


def _bits(kind: str) -> int:
    """Return how many bits a type has."""
    of_range = re.fullmatch(r"logic\s*\[(\w+)(-1)?:0\]", kind)
    if of_range is None:
        return _BITS[kind]
    high = of_range[1]
    return (int(high) if high.isdigit() else NUMBERS[high]) + (0 if of_range[2] else 1)


for _what, _name in re.findall(r"typedef ((?:struct packed |enum [^{]*)\{.*?\}|logic[^;{]*?) (\w+);", _TEXT, re.DOTALL):
    if _what.startswith("struct"):
        _FIELDS[_name] = [(n, " ".join(k.split())) for k, n in re.findall(r"(\w+(?:\s*\[[^]]+\])?)\s+(\w+);", _what)]
        _BITS[_name] = sum(_bits(kind) for _, kind in _FIELDS[_name])
    else:
        kind, _, names = _what.removeprefix("enum ").partition("{")
        _BITS[_name] = _bits(kind.strip())
        NUMBERS |= {value: k for k, value in enumerate(re.findall(r"\w+", names))}


def pack(struct: str, **fields: Any) -> int:
    """Return the bits of a struct; a field that is one itself may be a mapping, and what is not given is 0."""
    value = 0
    for name, kind in _FIELDS[struct]:
        field = fields.pop(name, 0)
        value = value << _bits(kind) | (pack(kind, **field) if isinstance(field, dict) else int(field))
    if fields:
        raise KeyError(f"{struct} has no {', '.join(fields)}")
    return value


def unpack(struct: str, value: Any) -> SimpleNamespace:
    """Return the fields of a struct by their names; one that is a struct itself has fields too."""
    left, fields = int(value), {}
    for name, kind in reversed(_FIELDS[struct]):
        bits = _bits(kind)
        field = left & (1 << bits) - 1
        fields[name] = unpack(kind, field) if kind in _FIELDS else field
        left >>= bits
    return SimpleNamespace(**fields)
