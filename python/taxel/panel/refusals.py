"""Why a request of the page is refused, and which of its keys is at fault."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

from taxel import _core
from taxel.formats.roles import OpenRolesError


def reason(error: Exception) -> str:
    """Return why a request is refused, for a person."""
    if isinstance(error, _core.Error):
        return str(error)
    if isinstance(error, OSError):
        words = {FileExistsError: "exists already", FileNotFoundError: "no such file or device"}
        where = "" if error.filename is None else f"{error.filename}: "
        what = "permission denied" if isinstance(error, PermissionError) else words.get(type(error))
        return f"{where}{what or error.strerror or error}"
    return f"failed within taxel; please report it: {type(error).__name__}: {error}"


def field_of(error: Exception) -> str | None:
    """Return the key or register at fault; "roles" where something of a file is open."""
    if isinstance(error, OpenRolesError):
        return "roles"
    return getattr(error, "field", None) or getattr(error, "argument", None)


@contextlib.contextmanager
def at_field(name: str) -> Iterator[None]:
    """Note the key at fault where an error names none of the request."""
    try:
        yield
    except (OSError, _core.Error) as error:
        if getattr(error, "argument", None) is None:
            error.field = name  # type: ignore[union-attr]
        raise
