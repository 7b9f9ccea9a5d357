"""Digests of sources: what is followed, what counts, what does not."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import taxel
from taxel import _core
from taxel.report import Sources, installed_sources

PACKAGE = {
    "__init__.py": '"""A package."""\nfrom toy.learning import Learner\nfrom toy.metrics import distance\n',
    "learning.py": "from toy import _core_like\nfrom toy.neuron import run\n\nclass Learner:\n    run = run\n",
    "_core_like.py": "",
    "neuron.py": '"""Run."""\nfrom taxel import _core\n'
    'def run(x):\n    """Say it."""\n    return _core.neuron_run(x)  # now\n',
    "metrics.py": "from taxel._core import distance\n",
    "recipes/__init__.py": "from pathlib import Path\nFOUND = list(Path(__file__).parent.glob('*.toml'))\n",
    "recipes/touch.toml": "tau = 3\n",
    "by_name.py": "from importlib import import_module\ndef load(n):\n    return import_module(f'toy.{n}')\n",
    "drawn.py": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from toy.metrics import distance\n",
    "study.py": "import toy\nfrom toy import Learner, recipes\nprint(toy.distance, recipes.FOUND)\n",
    "whole.py": "import toy\nprint(vars(toy))\n",
    "circle_a.py": "from toy.circle_b import b\na = 1\n",
    "circle_b.py": "from toy.circle_a import a\nb = 1\n",
}
COMPILED = {"neuron_run": "n1", "distance": "d1", "other": "o1"}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, text in PACKAGE.items():
        file = tmp_path / "toy" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    return tmp_path / "toy"


def parts(folder: Path, module: str, compiled: dict[str, str] = COMPILED) -> dict[str, str]:
    return Sources({"toy": folder}, compiled).parts(module)


def moved(folder: Path, file: str, old: str, new: str, module: str = "toy.study") -> list[str]:
    """Return which parts move when a piece of a file is another one."""
    before = parts(folder, module)
    text = (folder / file).read_text()
    assert old in text
    (folder / file).write_text(text.replace(old, new))
    after = parts(folder, module)
    (folder / file).write_text(text)
    return sorted(name for name in before.keys() | after.keys() if before.get(name) != after.get(name))


def test_imports_are_followed_to_where_names_are_defined(folder: Path) -> None:
    """Not the package that hands them on, and not what else that one hands on."""
    found = set(parts(folder, "toy.study"))
    assert {"toy.study", "toy.learning", "toy.neuron", "toy.recipes", "toy/recipes/touch.toml"} <= found
    assert {"taxel._core.neuron_run", "taxel._core.distance"} <= found
    assert not {"toy", "toy.by_name", "toy.whole", "taxel._core.other", "toy.metrics"} & found


def test_what_a_module_takes_for_types_alone_is_not_followed(folder: Path) -> None:
    assert set(parts(folder, "toy.drawn")) == {"toy.drawn"}


def test_a_package_that_is_handed_on_whole_counts_whole(folder: Path) -> None:
    assert {"toy", "toy.learning", "toy.neuron", "taxel._core.distance"} <= set(parts(folder, "toy.whole"))


def test_a_module_that_computes_a_name_brings_its_package_along(folder: Path) -> None:
    assert {f"toy.{Path(name).stem}" for name in PACKAGE if "/" not in name and "__" not in name} <= set(
        parts(folder, "toy.by_name")
    )


def test_modules_that_import_each_other_end(folder: Path) -> None:
    assert set(parts(folder, "toy.circle_a")) == {"toy.circle_a", "toy.circle_b"}


def test_comments_docstrings_and_formatting_do_not_count(folder: Path) -> None:
    assert moved(folder, "neuron.py", "# now", "# then") == []
    assert moved(folder, "neuron.py", '"""Say it."""', '"""Say it twice.\n\n    At length.\n    """') == []
    assert moved(folder, "neuron.py", '"""Run."""', '"""Runs."""') == []
    assert moved(folder, "neuron.py", "_core.neuron_run(x)", "_core.neuron_run(\n        x,\n    )") == []


def test_code_data_and_the_compiled_part_count(folder: Path) -> None:
    assert moved(folder, "neuron.py", "return _core", "_core") == ["toy.neuron"]
    assert moved(folder, "recipes/touch.toml", "3", "4") == ["toy/recipes/touch.toml"]
    before, after = parts(folder, "toy.study"), parts(folder, "toy.study", COMPILED | {"neuron_run": "n2"})
    assert [name for name in before if before[name] != after[name]] == ["taxel._core.neuron_run"]
    assert parts(folder, "toy.study", COMPILED | {"other": "o2"}) == before


def test_every_name_of_the_compiled_part_has_a_digest() -> None:
    public = {name for name in dir(_core) if not name.startswith("_")}
    assert public == set(_core.source_digests())
    assert len(set(_core.source_digests().values())) > 10


def test_the_private_base_is_left_out_and_what_stands_above_is_not_reached() -> None:
    found = installed_sources().parts("taxel.neuron")
    assert "taxel.neuron" in found
    assert not [name for name in found if name.startswith(("taxel._base", "taxel.learn", "taxel.cli"))]


def test_a_planted_change_is_found_in_a_copy_of_taxel(tmp_path: Path) -> None:
    """`Neuron.run` that returns nothing."""
    shutil.copytree(
        Path(taxel.__file__).parent, tmp_path / "taxel", ignore=shutil.ignore_patterns("*.so", "__pycache__")
    )
    copy = Sources({"taxel": tmp_path / "taxel"}, _core.source_digests())
    here = installed_sources()
    assert copy.parts("taxel.learn.cone_x") == here.parts("taxel.learn.cone_x")
    file = tmp_path / "taxel" / "neuron.py"
    text = file.read_text()
    changed = text.replace("    def run(", "    def run(self, *_: object) -> None:\n        return\n\n    def _run(", 1)
    assert changed != text
    file.write_text(changed)
    after = Sources({"taxel": tmp_path / "taxel"}, _core.source_digests())
    assert after.parts("taxel.learn.cone_x")["taxel.neuron"] != here.parts("taxel.learn.cone_x")["taxel.neuron"]
    assert after.digest("taxel.metrics.victor_purpura") == here.digest("taxel.metrics.victor_purpura")
