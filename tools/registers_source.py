"""Read registers.toml, from which the tables of Rust and the docs, and the RTL's package are made."""

from __future__ import annotations

import ast
import tomllib
from pathlib import Path
from typing import Any

#: The operators of its arithmetic, which are the same in all languages.
OPERATOR = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*"}

Table = dict[str, Any]


def read(path: Path) -> Table:
    """Return the source with every value filled in."""
    source = tomllib.loads(path.read_text())
    for field in source["field"]:
        field.setdefault("offset", 0)
        field.setdefault("least", field["offset"])
        field.setdefault("greatest", 2 ** field["bits"] - 1 + field["offset"])
    for rule in source["rule"]:
        rule.setdefault("warns", False)
    return source


def power_law(source: Table) -> list[int]:
    """Return ticks to the power of alpha, rounded, in fixed point."""
    law = source["power_law"]
    return [round(tick ** law["exponent"] * 2 ** law["fraction_bits"]) for tick in range(law["entries"])]


def parsed(text: str) -> ast.expr:
    """Read one expression."""
    return ast.parse(text, mode="eval").body
