"""The live panel: a server on this machine for browsers and other clients that show a board or recordings."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType

import numpy as np

from taxel import _core
from taxel._base.arguments import callback, checked_path, flag, instance, integer, text
from taxel._base.errors import refused
from taxel._base.files import named
from taxel._core import ProblemError
from taxel.detect import load
from taxel.device import Cable
from taxel.frames import Frames
from taxel.live._requests import Requests
from taxel.live._requests.board import BoardRequests
from taxel.live._shown_files import Opening
from taxel.live.live import Live
from taxel.recording import Recording
from taxel.recording.frames import period_us
from taxel.recording.opening import check_recording, is_folder, recordings_in
from taxel.recording.text_options import TextOptions
from taxel.tare import Tare


class Panel:
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
        `options`. Default: `TextOptions.open_trials`.
    options : taxel.recording.text_options.TextOptions, optional
        Facts that the files do not hold; the page uses them for training too. If `rate_hz` gives the times of frames,
        labels are saved as numbers of frames.

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
        options: TextOptions | None = None,
    ) -> None:
        # Locked while one `Live` replaces another.
        self._restarting = threading.Lock()
        self._live = shows if isinstance(shows, Live) else None
        opened, shown = None, None
        how = TextOptions() if options is None else instance("options", options, TextOptions)
        if self._live is None:
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
        opening = Opening() if opens is None else Opening(callback("opens", opens), shown, how)
        cable = None if control is None else Cable(text("control", control))
        board = BoardRequests(self.listen, self.read_source, self.delta_intensity, self.read_out, cable)
        self._requests = Requests(opening, board)
        stated = self._live is not None and self._live._registers_stated
        try:
            self._core = _core.Panel(
                text("host", host),
                integer("port", port, 0, 65_535),
                Path.cwd() if folder is None else Path(checked_path("folder", folder)),
                opened,
                opens is not None,
                control,
                stated,
                None if self._live is None else self._live._core,
                self._requests,
            )
        except BaseException:
            self._requests.close()
            raise
        self._first, self._stopped = self._live, False
        self._url = self._core.url()

    @property
    def url(self) -> str:
        """The address for a browser; the part behind # is the token that gives access."""
        return self._url

    @property
    def address(self) -> tuple[str, int]:
        """Host and port on which it listens."""
        return self._core.address()

    @property
    def token(self) -> str:
        """The token with which a client connects (see the protocol)."""
        return self._core.token()

    @property
    def viewers(self) -> int:
        """Number of connected clients."""
        return self._core.viewers()

    @property
    def live(self) -> Live | None:
        """The live board; another `Live` after a client has chosen another address. Waits while one begins."""
        with self._restarting:
            return self._live

    def listen(self, host: str, port: int) -> None:
        """Receive on another address, with all other options unchanged.

        Parameters
        ----------
        host : str
            The address of this machine to listen on.
        port : int, 0 to 65535
            The UDP port.

        Raises
        ------
        ProblemError : the panel shows recordings only; a recording was begun with this address, or the board is another
            computer's
        OSError : the port is taken; the old address stays in use
        """
        with self._restarting:
            before = self._restartable("listen")
            self._attach(before._again(port=port, host=host, sources=None))
            before.stop()

    def read_source(self, source: str) -> None:
        """Receive another source, as `sources` of `taxel.live.Live` names it, with all other options unchanged.

        Parameters
        ----------
        source : str
            For example "serial:/dev/ttyACM0,array=16x16"; for a board "board:127.0.0.1:5208".

        Raises
        ------
        ProblemError : as `listen`; a text that is not a source, or lines that do not fit it
        OSError : the place cannot be opened; the source before stays in use

        Examples
        --------
        >>> with Live(0, host="127.0.0.1") as live, Panel(live) as panel:
        ...     panel.read_source("skin=given,array=2x2,rate=100")
        ...     panel.live.array
        Array(2x2: 2 rows x 2 columns, 4 taxels, of unknown pitch)
        """
        with self._restarting:
            before = self._restartable("read_source")
            chosen = text("source", source)
            # A serial line has one reader at a time.
            before.stop()
            try:
                after = before._again(port=None, host=None, sources=chosen)
            except Exception:
                self._attach(before._again())
                raise
            self._attach(after)

    def delta_intensity(self, on: bool) -> None:
        """Interpret intensities as differences from the previous value, or as values, from this time.

        Earlier events were decoded the other way, so they are discarded: time, values, a readout and its tare restart,
        on the same address.

        Parameters
        ----------
        on : bool
            Differences (true) or values.

        Raises
        ------
        ProblemError : as `listen`
        OSError : another program has opened the port in the meantime
        """
        with self._restarting:
            before = self._restartable("delta_intensity")
            if flag("on", on) == before._options.differences:
                return
            before.stop()
            self._attach(before._again(differences=on))

    def read_out(self, readout: str | os.PathLike[str]) -> None:
        """From this time, read the board out with another readout: time, values and past restart, on the same address.

        A readout that needs a tare uses the tare of the board, if there is one; else the present values of the taxels
        are their rest, so the sensor must be unloaded.

        Parameters
        ----------
        readout : path
            A file of a readout or of a plain rule.

        Raises
        ------
        ProblemError : as `listen`; the readout does not fit the board
        FormatError : the file is not a readout
        OSError : there is no such file; another program has opened the port in the meantime
        """
        with self._restarting:
            before = self._restartable("read_out")
            loaded = load(checked_path("readout", readout))
            tare = before.tare or (before._options.tare if before._options.readout is not None else None)
            if tare is None:
                tare = _rest_of_held(before)
            before.stop()
            try:
                after = before._again(readout=loaded, tare=tare)
            except Exception:
                # The sensor stays in sight, whatever the readout lacks.
                self._attach(before._again())
                raise
            self._attach(after)

    def _attach(self, live: Live) -> None:
        """Show another `Live` from this time."""
        self._core.attach(live._core)
        self._live = live

    def _connect(self, control: str) -> None:
        """Connect the board's serial line, which something else has used until now."""
        self._requests.board.connect(control)
        self._core.connected(control)

    def _restartable(self, action: str) -> Live:
        if self._live is None:
            raise ProblemError(f"{action}: this panel shows recordings only")
        if self._live._options.record is not None:
            raise ProblemError(f"{action}: a recording from this address is running; end it first")
        return self._live

    def stop(self) -> None:
        """End the server, and the `Live` that `listen` or `delta_intensity` began; clients are notified."""
        if not self._stopped:
            self._stopped = True
            self._requests.training.close()
            self._core.stop()
            self._requests.close()
            if self._live is not None and self._live is not self._first:
                self._live.stop()

    def __enter__(self) -> Panel:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def __repr__(self) -> str:
        # Without the token, because printed text may be stored.
        return f"Panel({'ended' if self._stopped else self._url.partition('#')[0]})"


def _folder_and_name(path: Path, options: TextOptions) -> tuple[Path, str]:
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
    check_recording(path, options.layout_of(path))
    # A link is a recording of the folder in which it is, as elsewhere: its labels are beside it.
    path = named(path)
    path = path.parent.resolve() / path.name
    try:
        path.name.encode()
    except UnicodeEncodeError:
        raise ProblemError(f"{path}: its name is not UTF-8, so the page cannot show it; rename it") from None
    return path.parent, path.name


def _rest_of_held(live: Live) -> Tare:
    """Return the values that the taxels hold now as their rest."""
    values = live.frame.astype(float)
    if not np.nan_to_num(values).any():
        raise ProblemError(
            "read_out: no values of taxels have arrived yet, so their rest is unknown; wait for the board"
        )
    return Tare.take(
        Frames([values, values], [0, 1], unit=live.unit, array=live.array), note="the values when the readout began"
    )
