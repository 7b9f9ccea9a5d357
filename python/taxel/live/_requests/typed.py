"""Paths as they are typed in a shell."""

from __future__ import annotations

from pathlib import Path


def typed(path: Path) -> str:
    """Return a path as it is typed in the folder where taxel was started."""
    here = Path.cwd()
    name = str(path.relative_to(here) if path.is_relative_to(here) else path)
    # A name that begins with a dash is no option.
    return f"./{name}" if name.startswith("-") else name
