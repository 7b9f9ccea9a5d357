"""A sound call of everything public that takes anything, a module a room; what nonsense and docstrings are tried with.

A room is added as a module with `SOUND` (by full name a function that gives a callable and all its arguments),
`RESULTS` (of each type that a user never makes a function that returns one) and `LEFT_OUT` (by full name why there is
neither).
"""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

ROOMS = [
    import_module(f"sound.{path.stem}")
    for path in sorted(Path(__file__).parent.glob("*.py"))
    if path.stem not in ("__init__", "things")
]

SOUND: dict[str, Callable[[], tuple[Callable[..., Any], dict[str, Any]]]] = {
    name: sound for room in ROOMS for name, sound in room.SOUND.items()
}
LEFT_OUT: dict[str, str] = {name: why for room in ROOMS for name, why in room.LEFT_OUT.items()}
RESULTS: dict[str, Callable[[], Any]] = {name: result for room in ROOMS for name, result in room.RESULTS.items()}
