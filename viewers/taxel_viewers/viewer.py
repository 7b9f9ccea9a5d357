"""Passes what a panel shows to a viewer in another program: whatever the viewer does, the panel goes on."""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections import Counter, deque
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from types import TracebackType

from taxel import Detection, Note, ProblemError
from taxel.encode import Encoder
from taxel.live import Panel, PanelClient
from taxel.live.client import Curves, Frame, Item, Spikes, Subject
from taxel_viewers.kinds import Disconnected, viewer_at

__all__ = ["MOST_FRAMES", "MOST_OTHERS", "BoundedQueue", "Viewer", "Viewing"]

#: The largest numbers of waiting frames and of other waiting items: curves, spikes, detections, notes.
MOST_FRAMES, MOST_OTHERS = 32, 1024

#: The least and the greatest speed of a recording: board time over real time.
SPEEDS = 0.001, 100.0

#: Interval of checks for a viewer, and time for the pending items at the end, s.
_POLL_EVERY_S, _FLUSH_WITHIN_S = 0.1, 2.0


@dataclass(frozen=True)
class Viewing:
    """Hold the state of a `Viewer`.

    Parameters
    ----------
    sent, lost : dict
        Numbers of frames, times of the curves ("curves"), spikes, detections and notes that the viewer has received,
        and of those that were dropped because it was not connected or too slow.
    there : bool
        Whether a viewer is connected.
    trouble : str or None
        Why no viewer is connected, or what the panel's server refused.
    over : bool
        Whether all of a recording has been shown, or the panel's server has ended.

    Examples
    --------
    >>> Viewing(sent={"frames": 3}, there=True).lost
    {}
    """

    sent: dict[str, int] = field(default_factory=dict)
    lost: dict[str, int] = field(default_factory=dict)
    there: bool = False
    trouble: str | None = None
    over: bool = False


class BoundedQueue:
    """The items that wait for a viewer. In a full queue the oldest item of the same kind is dropped, and counted."""

    def __init__(self) -> None:
        self._items: deque[tuple[Subject, Item]] = deque()
        self._frames = 0
        self._changed = threading.Condition()
        self._in_hand: list[tuple[Subject, Item]] = []
        self.lost: Counter[str] = Counter()

    def put(self, subject: Subject, item: Item) -> None:
        """Append an item."""
        with self._changed:
            is_frame = isinstance(item, Frame)
            if is_frame and self._frames == MOST_FRAMES:
                self._drop(frames=True)
            elif not is_frame and len(self._items) - self._frames == MOST_OTHERS:
                self._drop(frames=False)
            self._items.append((subject, item))
            self._frames += is_frame
            self._changed.notify()

    def _drop(self, *, frames: bool) -> None:
        oldest = next(n for n, (_, item) in enumerate(self._items) if isinstance(item, Frame) == frames)
        self.lost += _counted([self._items[oldest]])
        del self._items[oldest]
        self._frames -= frames

    def take_all(self, timeout: float) -> list[tuple[Subject, Item]]:
        """Return all items, which stay in hand until `done`; an empty list if none arrives within `timeout` s."""
        with self._changed:
            self._changed.wait_for(lambda: self._items, timeout)
            self._in_hand = list(self._items)
            self._items.clear()
            self._frames = 0
            return self._in_hand

    def waiting(self) -> Counter[str]:
        """Return the numbers of what waits, with what is in hand."""
        with self._changed:
            return _counted([*self._in_hand, *self._items])

    def done(self) -> None:
        """Note that the items in hand have been passed on."""
        with self._changed:
            self._in_hand = []


class Viewer:
    """Show a board, or a recording, in a Rerun viewer or in Foxglove. A context manager.

    It is sent, on the board's time line: the frame above rest and the change, both with colours; force, area and
    centre of the contact as curves; an encoder's spikes, detections with their latency, a recording's notes. It is one
    more client of the panel, with threads of its own, so that a viewer that is missing, slow, stuck or ended delays
    nothing. 32 frames and 1024 other messages wait for it; beyond that the oldest are dropped, and counted.

    Parameters
    ----------
    shows : str or path
        The address of a panel, as `taxel.live.Panel.url` holds it and ``taxel live --panel`` prints it; or a recording,
        which is played once, from when a viewer is connected.
    to : str
        "rerun", "rerun:HOST:PORT" or "rerun+http://HOST:PORT/proxy": a viewer that the user has started; taxel
        connects to it as soon as it runs. "foxglove" or "foxglove:PORT": a server on 127.0.0.1 that Foxglove
        connects to (any program of this machine may); port 0 finds a free one.
    encoder : Encoder, optional
        An encoder whose spikes are sent too. One that needs a tare must have it.
    speed : float, 0.001 to 100
        Of a recording: board time over real time.
    rate_hz : float, 1 to 60
        Maximum number of frames a second.

    Raises
    ------
    ImportError : the viewer's library is not installed (``pip install 'taxel[rerun]'`` or ``'taxel[foxglove]'``)
    OSError : Foxglove's port is taken, no panel listens at the address, the recording is not there
    ProblemError : arguments that are invalid

    Examples
    --------
    ``with Live() as live, Panel(live) as panel, Viewer(panel.url, "rerun"): ...`` shows the board in the viewer that
    ``rerun`` started; ``Viewer("walk.mcap", "foxglove", speed=0.1).wait()`` plays a recording ten times slower.
    """

    def __init__(
        self,
        shows: str | os.PathLike[str],
        to: str,
        *,
        encoder: Encoder | None = None,
        speed: float = 1.0,
        rate_hz: float = 30.0,
    ) -> None:
        open_viewer = viewer_at(to)
        if not SPEEDS[0] <= speed <= SPEEDS[1]:
            raise ProblemError(f"speed is {speed}: must be from {SPEEDS[0]:g} to {SPEEDS[1]:g}")
        with contextlib.ExitStack() as begun:
            url = os.fspath(shows)
            if not url.startswith("http://"):
                url = begun.enter_context(Panel(url)).url
            self._client = begun.enter_context(PanelClient(url, rate_hz=rate_hz, encoder=encoder))
            self._viewer = open_viewer()
            self._begun = begun.pop_all()
        # The address of a panel names the recording that it shows, if any.
        self._speed = speed if "open=" in url.partition("#")[2] else None
        self._queue, self._sent, self._lost = BoundedQueue(), Counter[str](), Counter[str]()
        self._connected = False
        self._over, self._stopping = threading.Event(), threading.Event()
        self._last: Viewing | None = None
        self.reads = True
        for work in (self._receive, self._pass_on):
            threading.Thread(target=work, name=f"taxel_viewers{work.__name__}", daemon=True).start()

    def _receive(self) -> None:
        try:
            for subject, item in self._client:
                self._queue.put(subject, item)
        finally:
            self._over.set()

    def _pass_on(self) -> None:
        current: Subject | None = None
        while not self._stopping.is_set():
            if not self._viewer.is_connected():
                self._connected = False
                self._stopping.wait(_POLL_EVERY_S)
                continue
            if self._speed is not None:
                self._client.play(self._speed)
                self._speed = None
            self._connected = True
            items = self._queue.take_all(_POLL_EVERY_S)
            try:
                for subject, item in items:
                    if subject is not current:
                        self._viewer.begin(subject)
                        current = subject
                    self._viewer.show(subject, item)
                if items:
                    self._viewer.flush()
                self._sent += _counted(items)
            except Disconnected:
                current = None
                self._lost += _counted(items)
            self._queue.done()

    @property
    def place(self) -> str:
        """The address of the viewer as text: "Rerun at 127.0.0.1:9876", "Foxglove at ws://127.0.0.1:8765"."""
        return self._viewer.place

    @property
    def state(self) -> Viewing:
        """What was sent and lost so far, and whether a viewer is connected."""
        if self._last is not None:
            return self._last
        troubles = [None if self._connected else self._viewer.why_not_connected, self._client.warning]
        trouble = "; ".join(filter(None, troubles)) or None
        lost = self._lost + self._queue.lost
        return Viewing(dict(self._sent), dict(lost), self._connected, trouble, self._is_done())

    def _is_done(self) -> bool:
        return self._over.is_set() and not self._queue.waiting()

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until all of a recording has been shown, or the panel's server has ended; return whether that is so.

        Parameters
        ----------
        timeout : float, s, optional
            How long at most. Default: without limit.
        """
        until = None if timeout is None else time.monotonic() + timeout
        while not self.state.over and (until is None or time.monotonic() < until):
            time.sleep(_POLL_EVERY_S)
        return self.state.over

    def stop(self) -> Viewing:
        """End, after at most 2 s for pending items, and return the last state; a second call returns the same."""
        if self._last is None:
            self._begun.close()
            until = time.monotonic() + _FLUSH_WITHIN_S
            while time.monotonic() < until and not self._is_done() and self._connected:
                time.sleep(_POLL_EVERY_S)
            self._stopping.set()
            state = self.state
            # What a stuck viewer has read in part counts as lost too.
            self._last = replace(state, lost=dict(Counter(state.lost) + self._queue.waiting()))
            self.reads = self._viewer.close()
        return self._last

    def __enter__(self) -> Viewer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()


def _counted(items: Iterable[tuple[Subject, Item]]) -> Counter[str]:
    """Return how many there are of each kind, by its key in the counts of a viewer."""
    count: Counter[str] = Counter()
    for _, item in items:
        match item:
            case Frame():
                count["frames"] += 1
            case Curves():
                count["curves"] += len(item.t)
            case Spikes():
                count["spikes"] += len(item.t)
            case Detection():
                count["detections"] += 1
            case Note():
                count["notes"] += 1
    return count
