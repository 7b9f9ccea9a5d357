"""The process between a panel's server and an external viewer: whatever the viewer does, capture goes on.

It holds a `PanelClient`, a bounded queue, and a thread that passes the items to the viewer. One line of JSON on the
standard input holds its options. SIGTERM, which it gets when its parent ends (`taxel._base.child_process`), ends it. It
reports its state by lines of JSON on the standard output.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
import time
from collections import Counter, deque
from typing import Any

from taxel._core import Error
from taxel.detections import Detection
from taxel.encode import Encoder
from taxel.labels import Note
from taxel.live._external_viewer import KINDS, Disconnected, ExternalViewer
from taxel.live.client import Curves, Item, PanelClient, Picture, Spikes, Subject

#: The largest numbers of waiting pictures and of other waiting items: curves, spikes, detections, notes.
MOST_PICTURES, MOST_OTHERS = 32, 1024

#: Interval of reports, interval of checks for a viewer, and time for the pending items at the end, s.
_REPORT_EVERY_S, _POLL_EVERY_S, _FLUSH_WITHIN_S = 0.25, 0.1, 2.0


class BoundedQueue:
    """The items that wait for a viewer. In a full queue the oldest item of the same kind is dropped, and counted."""

    def __init__(self) -> None:
        self._items: deque[tuple[Subject, Item]] = deque()
        self._pictures = 0
        self._changed = threading.Condition()
        self._in_hand = 0
        self.lost: Counter[str] = Counter()

    def put(self, subject: Subject, item: Item) -> None:
        """Append an item."""
        with self._changed:
            is_picture = isinstance(item, Picture)
            if is_picture and self._pictures == MOST_PICTURES:
                self._drop(pictures=True)
            elif not is_picture and len(self._items) - self._pictures == MOST_OTHERS:
                self._drop(pictures=False)
            self._items.append((subject, item))
            self._pictures += is_picture
            self._changed.notify()

    def _drop(self, *, pictures: bool) -> None:
        for n, (_, item) in enumerate(self._items):
            if isinstance(item, Picture) == pictures:
                del self._items[n]
                self._pictures -= pictures
                kind, number = _kind_and_count(item)
                self.lost[kind] += number
                return

    def take_all(self, timeout: float) -> list[tuple[Subject, Item]]:
        """Return all items, which stay in hand until `done`; an empty list if none arrives within `timeout` s."""
        with self._changed:
            self._changed.wait_for(lambda: self._items, timeout)
            items = list(self._items)
            self._items.clear()
            self._pictures, self._in_hand = 0, len(items)
            return items

    def __len__(self) -> int:
        """How many items wait, with those in hand."""
        with self._changed:
            return len(self._items) + self._in_hand

    def done(self) -> None:
        """Note that the items in hand have been passed on."""
        with self._changed:
            self._in_hand = 0


class Relay:
    """Pass on what a panel shows to an external viewer.

    Parameters
    ----------
    client : PanelClient
    viewer : ExternalViewer
    speed : float, optional
        Of a recording, which is played from when a viewer is connected.
    """

    def __init__(self, client: PanelClient, viewer: ExternalViewer, speed: float | None) -> None:
        self._client, self._viewer, self._speed = client, viewer, speed
        self._queue = BoundedQueue()
        self._sent: Counter[str] = Counter()
        self._lost: Counter[str] = Counter()
        self._in_hand: Counter[str] = Counter()
        self._over, self._connected = threading.Event(), False

    def begin(self) -> None:
        """Begin, in two threads."""
        for work in (self._receive, self._pass_on):
            threading.Thread(target=work, name=f"taxel{work.__name__}", daemon=True).start()

    def _receive(self) -> None:
        try:
            for subject, item in self._client:
                self._queue.put(subject, item)
        finally:
            self._over.set()

    def _pass_on(self) -> None:
        current: Subject | None = None
        while True:
            if not self._viewer.is_connected():
                self._connected = False
                time.sleep(_POLL_EVERY_S)
                continue
            if not self._connected and self._speed is not None:
                self._client.play(self._speed)
                self._speed = None
            self._connected = True
            items = self._queue.take_all(_POLL_EVERY_S)
            count = _counted(items)
            self._in_hand = count
            try:
                for subject, item in items:
                    if subject is not current:
                        self._viewer.begin(subject)
                        current = subject
                    self._viewer.show(subject, item)
                if items:
                    self._viewer.flush()
                self._sent += count
            except Disconnected:
                current = None
                self._lost += count
            self._in_hand = Counter()
            self._queue.done()

    def state(self, *, last: bool = False) -> dict[str, Any]:
        """Return the state, as `Viewing` has it."""
        lost = self._lost + self._queue.lost
        if last:
            # What a stuck viewer has read in part counts as lost too.
            lost += self._in_hand + _counted(self._queue.take_all(0.0))
        troubles = [None if self._connected else self._viewer.why_not_connected, self._client.warning]
        trouble = "; ".join(filter(None, troubles)) or None
        return {"sent": self._sent, "lost": lost, "there": self._connected, "trouble": trouble, "over": self._is_done()}

    def _is_done(self) -> bool:
        return self._over.is_set() and not len(self._queue)

    def finish(self) -> None:
        """Disconnect from the panel, and give pending items some time."""
        self._client.close()
        until = time.monotonic() + _FLUSH_WITHIN_S
        while time.monotonic() < until and not self._is_done() and self._connected:
            time.sleep(_POLL_EVERY_S)


def _kind_and_count(item: Item) -> tuple[str, int]:
    """Return an item's key in the counts of a viewer, and the number that is added there."""
    match item:
        case Picture():
            return "pictures", 1
        case Curves():
            return "curves", len(item.t)
        case Spikes():
            return "spikes", len(item.t)
        case Detection():
            return "detections", 1
        case Note():
            return "notes", 1


def _counted(items: list[tuple[Subject, Item]]) -> Counter[str]:
    count: Counter[str] = Counter()
    for _, item in items:
        kind, number = _kind_and_count(item)
        count[kind] += number
    return count


def main() -> None:
    """Run until SIGTERM."""
    options = json.loads(sys.stdin.readline())
    encoder = None if options["encoder"] is None else Encoder.from_json(options["encoder"])
    try:
        to = options["to"]
        viewer = KINDS[to["what"]].open(to["host"], to["port"])
        client = PanelClient(options["url"], rate_hz=options["rate_hz"], encoder=encoder)
    except (OSError, Error) as error:
        _report({"error": str(error)})
        return
    ends = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: ends.set())
    _report({"place": viewer.place})
    relay = Relay(client, viewer, options["speed"])
    relay.begin()
    while not ends.wait(_REPORT_EVERY_S):
        _report(relay.state())
    relay.finish()
    _report(relay.state(last=True))
    # A thread may wait for a viewer that does not read, and so may the clean-up of its library.
    os._exit(0)


def _report(state: dict[str, Any]) -> None:
    try:
        sys.stdout.write(json.dumps(state) + "\n")
        sys.stdout.flush()
    except BrokenPipeError:
        os._exit(0)


if __name__ == "__main__":
    main()
