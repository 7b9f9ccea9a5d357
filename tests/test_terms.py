"""The page *Terms* knows every public name and every option of the command line, and none that is gone."""

from __future__ import annotations

import importlib
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import typer

import taxel
from taxel import _core
from taxel._base.parameters import Parameters
from taxel.cli import app
from taxel.encode import Encoder

PAGE = (Path(__file__).parents[1] / "docs" / "terms.md").read_text()
NAMES, OPTIONS = PAGE.split("## Names")[1].split("## Options of the command line")
#: The names that `import taxel` shows, and the subpackages that are imported by their own names.
ROOMS = [*(f"taxel.{n}" for n in taxel.__all__ if isinstance(getattr(taxel, n), ModuleType)), "taxel"]
ROOMS += ["taxel.report", "taxel.simulate.circuit", "taxel_studies", "taxel_rules"]


def first_cells(part: str) -> set[str]:
    """Return what stands in the first cells of a part's tables."""
    rows = [line.split("|")[1] for line in part.splitlines() if line.startswith("| `")]
    return {name for cell in rows for name in re.findall(r"`([^`]+)`", cell)}


def public() -> set[str]:
    return {name for room in ROOMS for name in importlib.import_module(room).__all__}


def registered() -> set[str]:
    """Return encoders, learners and metrics: a new one needs no line, its docstring stands on the page of its room."""
    learners = {n for n, kind in vars(taxel.learn).items() if isinstance(kind, type) and issubclass(kind, Parameters)}
    return learners | {kind.__name__ for kind in Encoder._by_name.values()} | set(_core.metric_names())


def options(command: Any) -> set[str]:
    """Return the long options of a command and of those below it."""
    names = command.list_commands(None) if hasattr(command, "list_commands") else []
    below = [command.get_command(None, name) for name in names]
    own = {said for p in command.params for said in (*p.opts, *p.secondary_opts) if said.startswith("--")}
    return own.union(*(options(one) for one in below)) - {"--help"}


def test_every_public_name_has_its_line() -> None:
    known, said = public(), first_cells(NAMES)
    without = known - said - registered()
    assert not without, f"docs/terms.md: add what {', '.join(sorted(without))} is, with its source"
    assert not said - known, f"docs/terms.md: {', '.join(sorted(said - known))} is no public name"


def test_every_place_is_there() -> None:
    """The last column names files and folders of `python/taxel`."""
    rows = [line.split("|")[4] for line in NAMES.splitlines() if line.startswith("| `")]
    roots = Path(taxel.__file__).parent, Path(__file__).parents[1]
    places = {place for row in rows for place in re.findall(r"`([^`]+)`", row)}
    gone = sorted(place for place in places if not any((root / place).exists() for root in roots))
    assert not gone, f"docs/terms.md: {', '.join(gone)} is no file or folder of taxel or of what stands beside it"


def test_every_option_has_its_line() -> None:
    known, said = options(typer.main.get_command(app)), first_cells(OPTIONS)
    assert not known - said, f"docs/terms.md: add what {', '.join(sorted(known - said))} says"
    assert not said - known, f"docs/terms.md: no command has {', '.join(sorted(said - known))}"
