"""The requests of the panel's server to this program, a class for each concern."""

from __future__ import annotations

from taxel.live._requests.board import BoardRequests
from taxel.live._requests.files import FileRequests
from taxel.live._requests.labels import LabelRequests
from taxel.live._requests.presets import PresetRequests
from taxel.live._requests.training import TrainingRequests
from taxel.live._shown_files import Opening, ShownFiles

__all__ = ["Requests"]


class Requests:
    """Hold what handles the requests of a panel's server, which calls from several threads at a time.

    The text of an exception is the reason that the client shows.

    Parameters
    ----------
    opening : Opening
        How recordings are opened.
    board : BoardRequests
        The board; `close` closes its serial line.
    """

    def __init__(self, opening: Opening, board: BoardRequests) -> None:
        self._files = ShownFiles(opening)
        self.board = board
        self.files = FileRequests(opening, self._files)
        self.labels = LabelRequests(opening)
        self.training = TrainingRequests(opening, self._files)
        self.presets = PresetRequests()

    def close(self) -> None:
        """Close the serial line, end a training that runs, and remove temporary files."""
        self.training.close()
        self._files.close()
        self.board.close()
