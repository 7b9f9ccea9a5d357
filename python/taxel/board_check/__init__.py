"""Check of a board: its link by the pattern that it makes itself, then its converter at rest."""

from taxel.board_check.check import check_board
from taxel.board_check.results import BoardCheck, Difference, Finding, PatternCheck, RestCheck

__all__ = ["BoardCheck", "Difference", "Finding", "PatternCheck", "RestCheck", "check_board"]
