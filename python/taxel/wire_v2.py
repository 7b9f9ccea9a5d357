"""The old names of wire version 2, which are removed in the next version; use `taxel.wire`."""

from __future__ import annotations

import json
import warnings
from dataclasses import dataclass
from typing import Any

from taxel import _core, wire
from taxel._base.arguments import buffer_bytes
from taxel.array import Array
from taxel.events import Events


@dataclass(frozen=True, eq=False)
class _Heard:
    """Hold the events and the status of one datagram (now the result of `push`, and `Decoder.last`)."""

    events: Events
    until: int | None
    intact: bool


class _Decoder(wire.Decoder):
    """Turn one board's datagrams into events (now `taxel.wire.Decoder(version=2)`)."""

    def __init__(self, *, array: Array | None = None) -> None:
        super().__init__(2, array=array)

    def push(self, datagram: Any, arrived: int | None = None) -> _Heard:  # type: ignore[override]
        """Decode a datagram."""
        events, last = super().push(datagram, arrived), self.last
        return _Heard(events, None if last is None else last.until, last is not None and last.intact)


def _decode(
    data: Any, *, array: Array | None = None, columns: wire.Columns | None = None
) -> tuple[Events, wire.Counts, int]:
    """Decode a stream of datagrams (now `taxel.wire.decode(data, version=2)`); return events, counts, bytes skipped."""
    sensor, stream = Array._of(array), buffer_bytes(data)
    room, own = wire.Columns._or_fresh(columns, _core.wire_rows(2, len(stream)))
    filled, counts, skipped = _core.decode_datagrams(stream, sensor._parts(), room._parts())
    return (room._owning if own else room._first)(sensor, *filled), wire.Counts(**json.loads(counts)), skipped


#: By old name: the object, and the name that replaces it.
_MOVED: dict[str, tuple[Any, str]] = {
    "Counts": (wire.Counts, "Counts"),
    "Decoder": (_Decoder, "Decoder(version=2), whose push gives Events and whose last gives what Heard gave"),
    "Heard": (_Heard, "Received, which Decoder(version=2).last gives"),
    "Status": (wire.Status, "Status"),
    "StreamReader": (wire.StreamReader, "StreamReader"),
    "decode": (_decode, "decode(data, version=2), which gives Events; Decoder(version=2).counts has the counts"),
}


def __getattr__(name: str) -> Any:
    """Return the object of an old name, with a warning that names the new one."""
    if name not in _MOVED:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    old, new = _MOVED[name]
    warnings.warn(f"taxel.wire_v2.{name} is now taxel.wire.{new}", DeprecationWarning, stacklevel=2)  # noqa: TID251  a fixed text
    return old


def __dir__() -> list[str]:
    """List the old names."""
    return sorted(_MOVED)
