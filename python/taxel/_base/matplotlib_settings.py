"""Lets matplotlib read no settings from the current folder, which may hold a stranger's ``matplotlibrc``.

Such a file can name a program that runs as the writer of a film. Settings of the user's own folder, and those that the
variable MATPLOTLIBRC names, count as before.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType


class _Finder:
    """Finds matplotlib as the finders behind it do; no file of its name in the current folder exists while it loads."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return how matplotlib is loaded; None for any other module."""
        if name != "matplotlib":
            return None
        behind = sys.meta_path[sys.meta_path.index(self) + 1 :]
        spec = next(filter(None, (finder.find_spec(name, path, target) for finder in behind)), None)
        if spec is None or spec.loader is None:
            return spec
        load = spec.loader.exec_module

        def load_without(module: ModuleType) -> None:
            # matplotlib looks for this name first, relative to the current folder, and has no option against it.
            exists = os.path.exists
            os.path.exists = lambda path: path != "matplotlibrc" and exists(path)
            try:
                load(module)
            finally:
                os.path.exists = exists

        spec.loader.exec_module = load_without  # type: ignore[method-assign]
        return spec


def ignore_current_folder() -> None:
    """Ignore a ``matplotlibrc`` of the current folder when matplotlib is loaded; one that was loaded before counts."""
    sys.meta_path.insert(0, _Finder())
