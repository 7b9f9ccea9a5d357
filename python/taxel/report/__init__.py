"""Pages with pictures, each one file that needs no other."""

import warnings
from typing import Any

from taxel._base.commit import code_version
from taxel._base.files import write_whole
from taxel.detect import Example, Outcome
from taxel.report.information import write_information
from taxel.report.listening import write_listening

__all__ = ["code_version", "write_information", "write_listening", "write_whole"]


def __getattr__(name: str) -> Any:
    """Return what had another name until version 0.1."""
    if name != "Listened":
        raise AttributeError(f"module 'taxel.report' has no attribute {name!r}")
    text = "taxel.report.Listened is taxel.detect.Outcome now, of a taxel.detect.Example"
    warnings.warn(text, DeprecationWarning, stacklevel=2)  # noqa: TID251  a fixed text
    return _listened


def _listened(name: str, source: Any, found: Any, tare: Any = None, truth: Any = None, score: Any = None) -> Outcome:
    return Outcome(name, Example(source, truth or {}, tare), found, score)
