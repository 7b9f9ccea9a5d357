"""Viewers in other programs: Rerun and Foxglove."""

from __future__ import annotations

import contextlib
import importlib.util
import json
import os
import re
import subprocess
import threading
from dataclasses import dataclass, field, replace
from types import TracebackType
from typing import Any

from taxel._base.arguments import finite, instance, number, shown, text
from taxel._base.child_process import ChildProcess
from taxel._base.errors import refused
from taxel._base.messages import escaped, installing
from taxel.encode import Encoder
from taxel.live._external_viewer import KINDS
from taxel.live.live import Live
from taxel.live.panel import Panel

__all__ = ["Viewer", "Viewing"]

_MOST_PORT = 65_535


@dataclass(frozen=True)
class Viewing:
    """Hold the state of a `Viewer`.

    Parameters
    ----------
    sent, lost : dict
        Numbers of pictures, times of the curves ("curves"), spikes, detections and notes that the viewer has received,
        and of those that were dropped because it was not connected or too slow.
    there : bool
        Whether a viewer is connected.
    trouble : str or None
        Why no viewer is connected, or what the panel's server refused.
    over : bool
        Whether all of a recording has been shown.

    Examples
    --------
    >>> Viewing(sent={"pictures": 3}, there=True).lost
    {}
    """

    sent: dict[str, int] = field(default_factory=dict)
    lost: dict[str, int] = field(default_factory=dict)
    there: bool = False
    trouble: str | None = None
    over: bool = False


class Viewer:
    """Show a board, or a recording, in a Rerun viewer or in Foxglove. A context manager.

    It is sent, on the board's time line: the picture above rest and the change, both with colours; force, area and
    centre of the contact as curves; an encoder's spikes, detections with their latency, a recording's notes. A process
    of its own passes them on, as one more client of the panel (whose server, on loopback, is started where none is
    given), so that a viewer that is missing, slow, stuck or ended delays nothing. 32 pictures and 1024 other messages
    wait for it; beyond that the oldest are dropped, and counted.

    Parameters
    ----------
    shows : Live, Panel or path
        A board, a panel that shows one, or a recording (`.mcap`, `.lsa`), which is played once,
        from when a viewer is connected.
    to : str
        "rerun", "rerun:HOST:PORT" or "rerun+http://HOST:PORT/proxy": a viewer that the user has started; taxel
        connects to it as soon as it runs. "foxglove" or "foxglove:PORT": a server on 127.0.0.1 that Foxglove
        connects to (any program of this machine may); port 0 finds a free one.
    encoder : Encoder, optional
        An encoder whose spikes are sent too. One that needs a tare must have it.
    speed : float, 0.001 to 100
        Of a recording: board time over real time.
    rate_hz : float, 1 to 60
        Maximum number of pictures a second.

    Raises
    ------
    ImportError : the viewer's library is not installed (``pip install 'taxel[rerun]'`` or ``'taxel[foxglove]'``)
    OSError : Foxglove's port is taken, the recording is not there
    ProblemError : arguments that are invalid

    Examples
    --------
    ``with Live() as live, Viewer(live, "rerun"): ...`` shows the board in the viewer that ``rerun`` started;
    ``Viewer("walk.mcap", "foxglove", speed=0.1).wait()`` plays a recording ten times slower.
    """

    def __init__(
        self,
        shows: Live | Panel | str | os.PathLike[str],
        to: str,
        *,
        encoder: Encoder | None = None,
        speed: float = 1.0,
        rate_hz: float = 30.0,
    ) -> None:
        where = _where(to)
        pace = finite("speed", speed, least=0.001, most=100.0)
        rate = finite("rate_hz", rate_hz, least=1.0, most=60.0)
        spikes = None if encoder is None else instance("encoder", encoder, Encoder).to_json()
        if encoder is not None and isinstance(shows, Live):
            encoder.stream(shows.array)
        _check_installed(where["what"])
        self._panel = None if isinstance(shows, Panel) else Panel(shows)
        panel = shows if isinstance(shows, Panel) else self._panel
        assert panel is not None  # one of the two
        options = {
            "to": where,
            "url": panel.url,
            "encoder": spikes,
            "speed": None if panel.live is not None else pace,
            "rate_hz": rate,
        }
        self._state, self._changed = Viewing(), threading.Condition()
        self._ended = self._stopping = False
        self._listener: threading.Thread | None = None
        self._process = ChildProcess(
            "taxel.live._viewer_process",
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            # The libraries' own messages are not for the user.
            env={"RUST_LOG": "off"},
        )
        try:
            self._place = self._begun(options)
        except BaseException:
            self.stop()
            raise
        self._listener = threading.Thread(target=self._listen, name="taxel-viewer", daemon=True)
        self._listener.start()

    def _begun(self, options: dict[str, Any]) -> str:
        """Send the options to the process; return where the viewer is."""
        assert self._process.stdin is not None  # asked for
        assert self._process.stdout is not None
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.write(json.dumps(options) + "\n")
            self._process.stdin.close()
        line = self._process.stdout.readline()
        if not line:
            raise OSError(f"{options['to']['what']}: its process ended while it started")
        answer = json.loads(line)
        if "error" in answer:
            raise OSError(answer["error"])
        return str(answer["place"])

    def _listen(self) -> None:
        assert self._process.stdout is not None  # asked for
        for line in self._process.stdout:
            with self._changed:
                self._state = Viewing(**json.loads(line))
                self._changed.notify_all()
        with self._changed:
            self._ended = True
            if not self._stopping:
                self._state = replace(self._state, there=False, trouble="its process has ended")
            self._changed.notify_all()

    @property
    def place(self) -> str:
        """The address of the viewer as text: "Rerun at 127.0.0.1:9876", "Foxglove at ws://127.0.0.1:8765"."""
        return self._place

    @property
    def state(self) -> Viewing:
        """The state, updated four times a second."""
        return self._state

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until all of a recording has been shown, or the board's server has ended; return whether that is so.

        Parameters
        ----------
        timeout : float, s, optional
            How long at most. Default: without limit.
        """
        limit = None if timeout is None else number("timeout", timeout)
        with self._changed:
            self._changed.wait_for(lambda: self._state.over or self._ended, limit)
            return self._state.over

    def stop(self) -> Viewing:
        """End, after at most 2 s for pending items, and return the last state; a second call returns the same."""
        self._stopping = True
        self._process.end()
        if self._listener is not None:
            self._listener.join()
        if self._process.stdout is not None:
            self._process.stdout.close()
        if self._panel is not None:
            self._panel.stop()
        return self._state

    def __enter__(self) -> Viewer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def __repr__(self) -> str:
        return escaped(f"Viewer({self._place}{', ended' if self._stopping else ''})")


def _where(to: object) -> dict[str, Any]:
    """Return what `to` names: the viewer's kind, host and port."""
    address = text("to", to)
    url = re.fullmatch(r"rerun\+http://([^/]+)/proxy", address)
    what, colon, place = (f"rerun:{url[1]}" if url else address).partition(":")
    kind = KINDS.get(what)
    if kind is not None and not colon:
        return {"what": what, "host": "127.0.0.1", "port": kind.port}
    plain = None if kind is None else re.fullmatch(r"(.+):([0-9]{1,5})" if kind.has_host else r"()([0-9]{1,5})", place)
    if plain is None or int(plain[2]) > _MOST_PORT:
        forms = [form for n, k in KINDS.items() for form in (n, f"{n}:{'HOST:' * k.has_host}PORT")]
        raise refused("to", f" is {shown(to)}: must be {', '.join(forms[:-1])} or {forms[-1]}")
    return {"what": what, "host": plain[1] or "127.0.0.1", "port": int(plain[2])}


def _check_installed(what: str) -> None:
    """Refuse a kind of viewer whose extra is not installed."""
    missing = [module for module in KINDS[what].needs if importlib.util.find_spec(module) is None]
    if missing:
        raise ImportError(f"{missing[0]} is not installed: {installing(what)}")
