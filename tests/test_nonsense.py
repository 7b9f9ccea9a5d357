"""Nonsense in every argument of every public function: one clear error of taxel's, or Python's own for files."""

from pathlib import Path

import matplotlib as mpl
import pytest
from nonsense import check, modules, public, takes
from sound import LEFT_OUT, OBJECTS, SMALL, USES, VALUES, write_files

mpl.use("Agg")


def room_of(name: str) -> str:
    """Return the room of a public name: "taxel" for what stands at the root."""
    return max((m.__name__ for m in modules() if name.startswith(f"{m.__name__}.")), key=len)


@pytest.fixture
def somewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make a folder with the files that sound calls read the current one."""
    monkeypatch.chdir(tmp_path)
    write_files()


@pytest.mark.filterwarnings("ignore")
@pytest.mark.usefixtures("somewhere")
@pytest.mark.parametrize("room", [module.__name__ for module in modules()])
def test_nonsense_in_an_argument_is_one_clear_error(room: str) -> None:
    check({name: value for name, value in public().items() if room_of(name) == room})


def test_no_sound_value_is_left_of_what_is_gone() -> None:
    there = [(name.split(".")[-2:], takes(value)) for name, value in public().items()]
    arguments = {
        key for (owner, last), taken in there for a in taken for key in (a, f"{last}.{a}", f"{owner}.{last}.{a}")
    }
    callables = {key for (owner, last), _ in there for key in (owner, last, f"{owner}.{last}")}
    assert set(VALUES) <= arguments
    assert {*OBJECTS, *SMALL, *USES, *LEFT_OUT} <= callables
