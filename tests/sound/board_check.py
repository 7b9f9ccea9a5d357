"""Sound calls of `taxel.board_check`; its results are made by hand, as a check waits for a board."""

from collections.abc import Callable
from typing import Any

import numpy as np

from sound.things import Sound
from taxel.board_check import BoardCheck, Difference, Finding, PatternCheck, RestCheck
from taxel.wire import Decoder, Registers

#: A valid call of every public function and class with arguments, by its full name.
SOUND: dict[str, Sound] = {}

FINDING = Finding("version", True, "the datagrams are of version 2")
DIFFERENCE = Difference(192, 3, 4, 1, expected=60, value=61, meaning="one bit differs")


def pattern() -> PatternCheck:
    """Return what a check with the pattern makes of one wrong value."""
    return PatternCheck(Registers.preset("5.2 kHz"), 2, 9, 90, 9, Decoder(2).counts, 64, 1, 0, DIFFERENCE, 1.0)


def rest() -> RestCheck:
    """Return what a check at rest makes of four taxels."""
    values, flags = np.full((2, 2), 50.0), np.zeros((2, 2), bool)
    return RestCheck(Registers.preset("5.2 kHz"), 0, values, values / 100, flags, flags)


#: For each type that only taxel constructs, a call that returns an instance.
RESULTS: dict[str, Callable[[], Any]] = {
    "taxel.board_check.BoardCheck": lambda: BoardCheck((FINDING,), pattern(), rest()),
    "taxel.board_check.Difference": lambda: DIFFERENCE,
    "taxel.board_check.Finding": lambda: FINDING,
    "taxel.board_check.PatternCheck": pattern,
    "taxel.board_check.RestCheck": rest,
}

#: Names that are not tested, and the reason.
LEFT_OUT: dict[str, str] = {
    "taxel.board_check.check_board": "it waits for a board; tests/live/test_board_check.py passes it what is refused",
}
