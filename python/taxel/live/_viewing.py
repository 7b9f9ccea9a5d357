"""A process of its own between a panel's server and a viewer of somebody else's: whatever that does, capture goes on.

A page of the panel (`_page`), a bounded queue, and a thread that hands over (`_sink`). It is told what to do by one
line of JSON on its standard input, whose end is its own; it tells by lines of JSON on its standard output how it goes.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from collections import Counter, deque
from typing import Any

from taxel._core import Error
from taxel.live._page import Item, Page, Picture, Subject
from taxel.live._sink import Gone, Sink

__all__ = ["Waiting", "main"]

#: So many pictures wait at most, and so many other messages: curves, spikes, detections, notes.
MOST_PICTURES, MOST_OTHERS = 32, 1024

#: How often it tells how it goes, how often it looks for a viewer, and how long what waits may take at the end, s.
_TELL_EVERY_S, _LOOK_EVERY_S, _WITHIN_S = 0.25, 0.1, 2.0


class Waiting:
    """What waits for a viewer. Of what finds no room the oldest goes, and is counted."""

    def __init__(self) -> None:
        self._items: deque[tuple[Subject, Item]] = deque()
        self._pictures = 0
        self._new = threading.Condition()
        self._in_hand = 0
        self.lost: Counter[str] = Counter()

    def put(self, subject: Subject, item: Item) -> None:
        """Let one more wait."""
        with self._new:
            is_picture = isinstance(item, Picture)
            if is_picture and self._pictures == MOST_PICTURES:
                self._drop(pictures=True)
            elif not is_picture and len(self._items) - self._pictures == MOST_OTHERS:
                self._drop(pictures=False)
            self._items.append((subject, item))
            self._pictures += is_picture
            self._new.notify()

    def _drop(self, *, pictures: bool) -> None:
        for n, (_, item) in enumerate(self._items):
            if isinstance(item, Picture) == pictures:
                del self._items[n]
                self._pictures -= pictures
                self.lost[item.kind] += item.count
                return

    def take(self, timeout: float) -> list[tuple[Subject, Item]]:
        """Return all that waits; nothing where nothing comes within so many s."""
        with self._new:
            self._new.wait_for(lambda: self._items, timeout)
            taken = list(self._items)
            self._items.clear()
            self._pictures, self._in_hand = 0, len(taken)
            return taken

    def __len__(self) -> int:
        """How many wait, with those that were taken last."""
        with self._new:
            return len(self._items) + self._in_hand

    def settle(self) -> None:
        """Say that those that were taken last wait no more."""
        with self._new:
            self._in_hand = 0


class Handover:
    """Hand on what a page shows.

    Parameters
    ----------
    page : Page
    sink : Sink
    speed : float, optional
        Of a recording, which waits for who looks.
    """

    def __init__(self, page: Page, sink: Sink, speed: float | None) -> None:
        self._page, self._sink, self._speed = page, sink, speed
        self._waiting = Waiting()
        self._sent: Counter[str] = Counter()
        self._lost: Counter[str] = Counter()
        self._in_hand: Counter[str] = Counter()
        self._over, self._there = threading.Event(), False

    def begin(self) -> None:
        """Begin, in two threads."""
        for work in (self._read, self._hand_over):
            threading.Thread(target=work, name=f"taxel-{work.__name__}", daemon=True).start()

    def _read(self) -> None:
        try:
            for subject, item in self._page:
                self._waiting.put(subject, item)
        finally:
            self._over.set()

    def _hand_over(self) -> None:
        current: Subject | None = None
        while True:
            if not self._sink.meet():
                self._there = False
                time.sleep(_LOOK_EVERY_S)
                continue
            if not self._there and self._speed is not None:
                self._page.play(self._speed)
                self._speed = None
            self._there = True
            batch = self._waiting.take(_LOOK_EVERY_S)
            count = _counted(batch)
            self._in_hand = count
            try:
                for subject, item in batch:
                    if subject is not current:
                        self._sink.begin(subject)
                        current = subject
                    self._sink.show(subject, item)
                if batch:
                    self._sink.settle()
                self._sent += count
            except Gone:
                current = None
                self._lost += count
            self._in_hand = Counter()
            self._waiting.settle()

    def said(self, *, last: bool = False) -> dict[str, Any]:
        """Return how it goes: what was handed on, what was lost, whether somebody is there."""
        lost = self._lost + self._waiting.lost
        if last:
            # What a viewer that is stuck has taken in part counts as lost, too.
            lost += self._in_hand + _counted(self._waiting.take(0.0))
        troubles = [None if self._there else self._sink.trouble, self._page.trouble]
        trouble = "; ".join(filter(None, troubles)) or None
        return {"sent": self._sent, "lost": lost, "there": self._there, "trouble": trouble, "over": self._is_done()}

    def _is_done(self) -> bool:
        return self._over.is_set() and not len(self._waiting)

    def finish(self) -> None:
        """Let what waits go where it was meant to, for a while."""
        self._page.close()
        until = time.monotonic() + _WITHIN_S
        while time.monotonic() < until and not self._is_done() and self._there:
            time.sleep(_LOOK_EVERY_S)


def _counted(items: list[tuple[Subject, Item]]) -> Counter[str]:
    count: Counter[str] = Counter()
    for _, item in items:
        count[item.kind] += item.count
    return count


def main() -> None:
    """Begin, tell how it goes, and end with the standard input."""
    asked = json.loads(sys.stdin.readline())
    try:
        sink = _sink(asked["to"])
        page = Page(
            asked["address"],
            asked["token"],
            rate_hz=asked["rate_hz"],
            encoder=asked["encoder"],
            opens=asked["opens"],
        )
    except (OSError, Error) as error:
        _tell({"error": str(error)})
        return
    _tell({"place": sink.place})
    handover = Handover(page, sink, asked["speed"] if asked["opens"] else None)
    handover.begin()
    ends = threading.Event()
    threading.Thread(target=_until, args=(ends,), name="taxel-until", daemon=True).start()
    while not ends.wait(_TELL_EVERY_S):
        _tell(handover.said())
    handover.finish()
    _tell(handover.said(last=True))
    # A thread may wait for a viewer that reads nothing, and so would the library's own end.
    os._exit(0)


def _sink(to: dict[str, Any]) -> Sink:
    if to["what"] == "foxglove":
        from taxel.live._to_foxglove import ToFoxglove  # noqa: PLC0415  an extra

        return ToFoxglove(to["port"])
    from taxel.live._to_rerun import ToRerun  # noqa: PLC0415  an extra

    return ToRerun(to["host"], to["port"])


def _until(ends: threading.Event) -> None:
    sys.stdin.read()
    ends.set()


def _tell(said: dict[str, Any]) -> None:
    try:
        sys.stdout.write(json.dumps(said) + "\n")
        sys.stdout.flush()
    except BrokenPipeError:
        os._exit(0)


if __name__ == "__main__":
    main()
