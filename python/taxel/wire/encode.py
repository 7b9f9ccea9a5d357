"""Encodes events as bytes of version 1 (thesis, Appendix 1, Table 5.4)."""

from __future__ import annotations

from taxel import _core
from taxel._base.arguments import instance
from taxel.events import Events


def encode(events: Events) -> bytes:
    """Return events as bytes: each change followed by its intensity, each marker before the first event not earlier.

    Parameters
    ----------
    events : Events
        Events on columns 0 to 63 and rows 0 to 63.

    Returns
    -------
    bytes, 5 for each change, 5 for each intensity, 5 for each marker

    Raises
    ------
    ProblemError : a column or row above 63, which a word of version 1 has no bits for

    Notes
    -----
    Thesis, Appendix 1, Table 5.4. Version 1 holds times in steps of 100 us, rounded down as the board does, and modulo
    6.5536 s: a reader restores pauses of up to 6.45 s.

    Examples
    --------
    >>> from taxel import Array
    >>> events = Events([500], [3], [4], [True], array=Array(64, 64), intensity=[40])
    >>> encode(events).hex(" ", 5)
    'c000050304 e000280304'
    """
    return _core.wire_encode(instance("events", events, Events))
