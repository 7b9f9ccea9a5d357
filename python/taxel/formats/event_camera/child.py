"""Reads an event camera's file by faery in a child process, which `taxel._base.reading_child` runs by its path.

faery panics, aborts and reads memory that is not its own at damaged files. After the line that says that it runs, the
child sends the size of the sensor. To each request it answers with lines, and with columns of events after those that
state how many; the last one is of what it counted.
"""

import json
import sys
from collections.abc import Iterator
from typing import Any

#: Bytes that the child may take beyond its libraries, and events that it sends at once.
MEMORY, PIECE = 256 << 20, 1 << 16
#: Events after which a line says that reading goes on.
_ALIVE = 1 << 22


def main() -> None:
    """Answer requests until there are no more."""
    path = sys.argv[1]
    sys.path[:] = json.loads(sys.stdin.readline())
    import faery  # noqa: PLC0415  its path was read just now

    from taxel._base.h5_child import bound_memory, memory, orders, send  # noqa: PLC0415

    send(running=True)
    bound_memory(memory() + MEMORY)
    try:
        for order in orders():
            # A header without a size has that of no event.
            stream = faery.events_stream_from_file(path, file_type=order["kind"], dimensions_fallback=(0, 0))
            if "bounds" not in order:
                send(size=stream.dimensions())
                continue
            count = total = alive = 0
            ends: list[int] = []
            for events in pieces(stream):
                ends = [min([*ends[:1], int(events["t"].min())]), max([*ends[1:], int(events["t"].max())])]
                total += len(events)
                kept = chosen(events, order["bounds"], order["polarity"])
                count += len(kept)
                if order["columns"]:
                    send(*columns(kept, order["bounds"], order["side"]), events=len(kept))
                elif total - alive > _ALIVE:
                    alive = total
                    send(alive=True)
            send(count=count, total=total, ends=ends)
    # faery's panics are exceptions of no documented class.
    except BaseException as error:
        send(error=(str(error).splitlines() or [type(error).__name__])[0][:200])


def pieces(stream: Any) -> Iterator[Any]:
    """Yield the events of a file, some at a time."""
    for packet in stream:
        for begin in range(0, len(packet), PIECE):
            yield packet[begin : begin + PIECE]


def chosen(events: Any, bounds: list[int], polarity: str) -> Any:
    """Return the events of a region and a polarity."""
    left, right, top, bottom = bounds
    x, y = events["x"], events["y"]
    kept = (x >= left) & (x < right) & (y >= top) & (y < bottom)
    if polarity != "both":
        kept &= events["on"] == (polarity == "on")
    return events if kept.all() else events[kept]


def columns(events: Any, bounds: list[int], side: int) -> Iterator[bytes]:
    """Yield time, column, row and polarity of events on taxels of several pixels."""
    yield events["t"].tobytes()
    for name, begin in (("x", bounds[0]), ("y", bounds[2])):
        yield ((events[name] - begin) // side if side > 1 or begin else events[name]).astype("<u2").tobytes()
    yield events["on"].tobytes()


if __name__ == "__main__":
    main()
