"""Result of a check of a board."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.wire import Counts, Registers


@dataclass(frozen=True)
class Finding:
    """Hold the result of one check.

    Parameters
    ----------
    name : str
        Such as "address" or "values".
    good : bool or None
        Whether it is as it must be; None where it is only reported.
    text : str
        A sentence.

    Examples
    --------
    >>> print(Finding("version", True, "the datagrams are of version 2"))
    ok    version: the datagrams are of version 2
    """

    name: str
    good: bool | None
    text: str

    def __str__(self) -> str:
        return f"{ {True: 'ok', False: 'FAULT', None: 'note'}[self.good]:5} {self.name}: {self.text}"


@dataclass(frozen=True)
class Difference:
    """Hold a value that is not the pattern's.

    Parameters
    ----------
    t : int, us
        The board's time.
    x, y : int, 0 or more
        Column and row of the taxel.
    frame : int, 0 or more
        The number of the pattern's frame.
    expected, value : int, ticks
    meaning : str
        Possible cause.

    Examples
    --------
    >>> Difference(192, 3, 4, 1, expected=60, value=61, meaning="one bit differs").expected
    60
    """

    t: int
    x: int
    y: int
    frame: int
    expected: int
    value: int
    meaning: str


@dataclass(frozen=True)
class PatternCheck:
    """Hold what arrived while a board made its pattern.

    Parameters
    ----------
    registers : Registers
        Registers of the board, or, without its serial line, the preset that explains the values best.
    version : int, 1 or more
        The version of the wire.
    datagrams, events, frames : int, 0 or more
        Number of datagrams and events that arrived, and number of stamps with an event.
    counts : Counts
        Counts of data that were missing or damaged.
    taxels : int, 0 or more
        Number of taxels with an event.
    wrong : int, 0 or more
        Events whose value is not the pattern's.
    behind : int, 0 or more
        Taxels that, at the end of some frame, hold a value further from the pattern's than the noise floor.
    first : Difference or None
        The first difference of either kind.
    speed : float
        The board's time that passes in a second of the host's time, s; for a simulated board far below 1.

    Examples
    --------
    `check_board` makes it.
    """

    registers: Registers
    version: int
    datagrams: int
    events: int
    frames: int
    counts: Counts
    taxels: int
    wrong: int
    behind: int
    first: Difference | None
    speed: float


@dataclass(frozen=True)
class RestCheck:
    """Hold what a board reads at rest, with a noise floor of 0.

    Parameters
    ----------
    registers : Registers
    faults : int, 0 or more
        Number of times that a comparator had not returned when its ramp began.
    values : float, shape (rows, columns), ticks
        The mean of each taxel; nan if it gave no value, as a taxel that stays at 0 or 1 does.
    noise : float, shape (rows, columns), ticks
        The standard deviation of each taxel, nan likewise.
    silent, full : bool, shape (rows, columns)
        Taxels that gave no value; and those that stay at the ramp's end.

    Examples
    --------
    `check_board` makes it.
    """

    registers: Registers
    faults: int
    values: NDArray[np.float64]
    noise: NDArray[np.float64]
    silent: NDArray[np.bool_]
    full: NDArray[np.bool_]


@dataclass(frozen=True)
class BoardCheck:
    """Hold what a check of a board found.

    Parameters
    ----------
    findings : tuple of Finding
        Results in the order of the checks.
    pattern : PatternCheck or None
        None if no data arrived that could be compared.
    rest : RestCheck or None
        None if it was not checked: without the serial line, or if no datagram arrived.

    Examples
    --------
    >>> BoardCheck((Finding("datagrams", False, "none within 10 s"),), None, None).good
    False
    """

    findings: tuple[Finding, ...]
    pattern: PatternCheck | None
    rest: RestCheck | None

    @property
    def good(self) -> bool:
        """Whether no fault was found."""
        return all(finding.good is not False for finding in self.findings)
