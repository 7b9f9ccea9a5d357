"""The one reader of files of readouts and plain rules."""

from __future__ import annotations

import os

from taxel import _core
from taxel._base.saved import read
from taxel.detect.plain_rule import PlainRule
from taxel.detect.readout import Readout

__all__ = ["load"]


def load(path: str | os.PathLike[str]) -> Readout | PlainRule:
    """Read the file of a readout or of a plain rule, whichever it is.

    Parameters
    ----------
    path : path

    Returns
    -------
    Readout or PlainRule

    Raises
    ------
    FormatError : neither, or one of another version (names the file)
    FileNotFoundError : no such file
    """

    def of_text(text: str) -> Readout | PlainRule:
        return PlainRule.from_json(text) if _core.is_plain_rule(text) else Readout.from_json(text)

    return read(path, "readout", of_text)
