"""Docstrings of what a user imports: parameters as in the signature, with shape and unit; the reference.

What holds for every function, `make lint` checks by pydoclint.
"""

import importlib
import inspect
import re
from pathlib import Path
from pkgutil import resolve_name, walk_packages

from docstrings import faults_of_parameters
from nonsense import modules, public

import taxel

DOCS = Path(__file__).parents[1] / "docs"


def test_parameters_are_those_of_the_signature_with_shape_and_unit() -> None:
    faults = [fault for name, value in public().items() for fault in faults_of_parameters(name, value)]
    assert not faults, "\n".join(faults)


def test_each_all_is_there() -> None:
    """Each name of each module's `__all__` can be imported, so that a star import works."""
    for module in walk_packages(taxel.__path__, "taxel."):
        if not module.name.endswith("__main__"):
            some = importlib.import_module(module.name)
            missing = [name for name in getattr(some, "__all__", ()) if not hasattr(some, name)]
            assert not missing, f"{module.name}.__all__: {missing}"


def test_all_names_what_is_public() -> None:
    for room in modules():
        own = {
            name
            for name, value in vars(room).items()
            if not name.startswith("_")
            and (inspect.isclass(value) or inspect.isfunction(value))
            and getattr(value, "__module__", "") == room.__name__
        }
        assert own <= set(room.__all__), f"{room.__name__}: {sorted(own - set(room.__all__))}: private, or in __all__"


def test_the_reference_shows_exactly_what_is_public() -> None:
    """Pages name whole modules (all of `__all__`) or single names; a name that stands in two rooms needs one page."""
    pages = "\n".join(page.read_text("utf-8") + "\n" for page in sorted((DOCS / "reference").glob("*.rst")))
    by_module = re.findall(r"\.\. automodule:: (\S+)\n((?:   :.*\n)*)", pages)
    by_name = set(re.findall(r"\.\. auto(?:class|function|exception):: (\S+)", pages))
    shown = {id(resolve_name(name)) for name in by_name}
    for name, options in by_module:
        if name.split(".")[0] == "taxel":
            left_out = re.search(r":exclude-members: (.*)", options)
            some = re.search(r":members: (.+)", options)
            names = some[1].split(", ") if some else resolve_name(name).__all__
            shown |= {id(getattr(resolve_name(name), one)) for one in names if not left_out or one not in left_out[1]}
    public_values = {
        f"{room.__name__}.{name}": getattr(room, name)
        for room in modules()
        for name in room.__all__
        if not inspect.ismodule(getattr(room, name))
    }
    assert not sorted(name for name, value in public_values.items() if id(value) not in shown)
    assert not sorted(name for name in by_name if id(resolve_name(name)) not in set(map(id, public_values.values())))
