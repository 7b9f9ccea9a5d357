"""The live panel: a server on this machine for browsers and other clients that show a board or recordings."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from taxel._base.arguments import callback, checked_path, instance, integer, text
from taxel._base.errors import refused
from taxel._base.files import named
from taxel._core import ProblemError
from taxel.device import Cable
from taxel.formats.roles import OpenRolesError
from taxel.live import Live
from taxel.options import FullReading
from taxel.panel.hub import Hub
from taxel.panel.server import Server
from taxel.panel.shown_files import Opening
from taxel.recording import Recording
from taxel.recording.frames import period_us
from taxel.recording.kinds import check_recording, is_folder, recordings_in


class Panel(contextlib.AbstractContextManager["Panel"]):
    """Serve the live panel until it is stopped; a context manager.

    A separate thread serves all clients. A client that reads slowly, or never, delays neither the others nor what is
    received and recorded.

    Parameters
    ----------
    shows : Live or path
        A live board; or a recording to show first, any file or folder that `taxel.open` reads; from a folder, its first
        recording. The page can open the other recordings of the folder.
    control : str, optional
        The board's serial line ("COM3", "/dev/ttyACM0", host:port), with which the page reads and sets registers.
    folder : path, optional
        The folder of recordings, also of new ones. Default: that of the recording, or the current one.
    port : int, 0 to 65535
        The TCP port; 0 finds a free one, see `url`.
    host : str
        The address of this machine to listen on. On any address except loopback, every user with the token of the
        panel's address can see the board and set registers, over a connection that is not encrypted.
    opens : function of a path, optional
        Opens the recording that is shown first, or each file of a folder, and returns its trials; it must use
        `options`. Default: `FullReading.open_trials`.
    options : taxel.options.FullReading, optional
        Facts that the files do not hold; the page uses them for training too. If `rate_hz` gives the times of frames,
        labels are saved as numbers of frames.
    labels : str
        The end of the names of the tables of labels that the page shows and changes: "notes" for NAME.notes.csv,
        "steps" for those that ``taxel steps`` wrote.

    Raises
    ------
    OSError : the port is taken, the folder or the recording is not there, the serial line cannot be opened
    ProblemError : arguments that are invalid

    Examples
    --------
    >>> with Live(0, host="127.0.0.1") as live, Panel(live) as panel:
    ...     panel.url.startswith("http://127.0.0.1:"), panel.viewers
    (True, 0)
    """

    def __init__(
        self,
        shows: Live | str | os.PathLike[str],
        *,
        control: str | None = None,
        folder: str | os.PathLike[str] | None = None,
        port: int = 0,
        host: str = "127.0.0.1",
        opens: Callable[[Path], Sequence[Recording]] | None = None,
        options: FullReading | None = None,
        labels: str = "notes",
    ) -> None:
        live = shows if isinstance(shows, Live) else None
        opened, shown = None, None
        how = FullReading() if options is None else instance("options", options, FullReading)
        if live is None:
            shown_path = Path(checked_path("shows", shows))
            if control is not None:
                raise refused("control", ": a recording has no board; give a taxel.live.Live")
            if folder is not None:
                raise refused("folder", ": must be left out, because a recording is shown with its folder")
            folder, opened = _folder_and_name(shown_path, how)
            opens = how.open_trials if opens is None and how.given() else opens
            shown = None if is_folder(shown_path) else folder / opened
        if how.rate_hz is not None:
            period_us("rate_hz", how.rate_hz)
        if not text("labels", labels).isidentifier():
            raise refused("labels", f" is {labels!r}: must be a word, for example steps for NAME.steps.csv")
        opening = Opening(first=opened, labels=labels)
        if opens is not None:
            opening = replace(opening, opens=callback("opens", opens), file=shown, options=how)
        address = text("host", host), integer("port", port, 0, 65_535)
        place = Path.cwd() if folder is None else Path(checked_path("folder", folder)).resolve(strict=True)
        cable = None if control is None else Cable(text("control", control))
        try:
            self._hub = Hub(live, place, opening, cable)
            self._server = Server(self._hub, *address)
        except BaseException:
            if cable is not None:
                cable.close()
            raise
        self._stopped = False
        self._url = self._server.url(opened)

    @property
    def url(self) -> str:
        """The address for a browser; the part behind # is the token that gives access."""
        return self._url

    @property
    def address(self) -> tuple[str, int]:
        """Host and port on which it listens."""
        return self._server.address

    @property
    def token(self) -> str:
        """The token with which a client connects (see the protocol)."""
        return self._server.token

    @property
    def viewers(self) -> int:
        """Number of connected clients."""
        return len(self._hub.sessions)

    @property
    def live(self) -> Live | None:
        """The live source; another `Live` after a client has connected another sensor. Waits while one begins."""
        return self._hub.live

    def _connect(self, control: str) -> None:
        """Connect the board's serial line, which something else has used until now."""
        self._server.call(self._hub.connect(Cable(control)))

    def stop(self) -> None:
        """End the server, and a `Live` that a client has begun; clients are notified."""
        if not self._stopped:
            self._stopped = True
            self._server.stop()
            self._hub.close()

    def __exit__(self, *_: object) -> None:
        self.stop()

    def __repr__(self) -> str:
        # Without the token, because printed text may be stored.
        return f"Panel({'ended' if self._stopped else self._url.partition('#')[0]})"


def _folder_and_name(path: Path, options: FullReading) -> tuple[Path, str]:
    """Return the folder of a recording and its name there; of a folder its first recording.

    The server indexes it when a client opens it; a file that is not a recording is refused now.
    """
    if is_folder(path):
        files = recordings_in(path, options.layout)
        if not files:
            raise ProblemError(f"{path}: contains no recording; name a file, or one of the folders in it")
        path = files[0]
    if not path.exists():
        raise FileNotFoundError(2, "no such recording", str(path))
    # The page asks for what is open.
    with contextlib.suppress(OpenRolesError):
        check_recording(path, options.layout)
    # A link is a recording of the folder in which it is, as elsewhere: its labels are beside it.
    path = named(path)
    path = path.parent.resolve() / path.name
    try:
        path.name.encode()
    except UnicodeEncodeError:
        raise ProblemError(f"{path}: its name is not UTF-8, so the page cannot show it; rename it") from None
    return path.parent, path.name
