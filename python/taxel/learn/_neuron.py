"""A neuron's parameters among those of a learner."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from taxel.neuron import Neuron

__all__ = ["split"]

_NAMES = frozenset(Neuron.__init__.__kwdefaults__ or ())


def split(values: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return those that are a `Neuron`'s, and the others."""
    neuron = {name: value for name, value in values.items() if name in _NAMES}
    return neuron, {name: value for name, value in values.items() if name not in _NAMES}
