"""Reasons of refusals that a person can read."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

from taxel._core import ProblemError


@contextlib.contextmanager
def reasons() -> Iterator[None]:
    """Turn errors of the operating system into reasons that a person can read."""
    try:
        yield
    except (FileExistsError, FileNotFoundError, PermissionError) as error:
        words = {FileExistsError: "exists already", FileNotFoundError: "no such file or device"}
        raise ProblemError(f"{error.filename}: {words.get(type(error), 'permission denied')}") from None
    except OSError as error:
        where = "" if error.filename is None else f"{error.filename}: "
        raise ProblemError(f"{where}{error.strerror or error}") from None
