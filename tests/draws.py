"""Examples of a law: some of them in `make test`, all of them with the slow tests, as property tests have more then."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import pytest


def _marked(case: Sequence[Any], quick: bool, name: str | None = None) -> Any:
    return pytest.param(*case, id=name, marks=() if quick else pytest.mark.slow)


def seeds(count: int, *, quick: int) -> list[Any]:
    """Return the numbers from 0 on, of which the first few are quick: values of a parameter."""
    return [_marked([seed], seed < quick) for seed in range(count)]


def mixed(*values: Sequence[Any]) -> list[Any]:
    """Return all combinations of the values of several parameters; those are quick that try each value once."""
    sizes = [len(each) for each in values]
    quick = {tuple(k % size for size in sizes) for k in range(max(sizes))}
    places = itertools.product(*map(range, sizes))
    return [_marked([each[k] for each, k in zip(values, place, strict=True)], place in quick) for place in places]
