"""What is wrong is refused by class, argument and place; sentences stand in tests/messages alone."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from taxel import Error, ProblemError
from taxel._base.errors import Place


@contextmanager
def refused(
    kind: type[Error] = ProblemError, argument: str | None = None, place: Place | None = None
) -> Iterator[pytest.ExceptionInfo[Error]]:
    """Expect an error of this class, argument and place, of one line; a file is compared by its name."""
    with pytest.raises(kind) as caught:
        yield caught
    error = caught.value
    assert (error.argument, _by_name(error.place)) == (argument, place), error
    assert "\n" not in str(error)


def _by_name(place: Place | None) -> Place | None:
    return place if place is None or place.file is None else replace(place, file=Path(place.file).name)


def messages(calls: dict[str, Callable[[Path], object]], folder: Path) -> dict[str, str]:
    """Return class, argument and sentence of each wrong call, which may write into a folder, shown as DIR."""
    said = {}
    for name, call in calls.items():
        try:
            call(folder)
        except Error as error:
            said[name] = f"{type(error).__name__}({error.argument or ''}): {error}".replace(str(folder), "DIR")
        assert len(said.get(name, "").splitlines()) == 1, name
    return said
