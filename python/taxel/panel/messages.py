"""Messages to the page as text, without holding the interpreter for long."""

from __future__ import annotations

import asyncio
import json
from typing import Any

#: Bytes of a message of a client, at most; 5000 labels are fewer.
MOST_BYTES = 1 << 20

#: Entries of a list that are written at a time: less than half a millisecond.
_PIECE = 200


def dumps(value: object) -> str:
    """Return a value as JSON, without white space."""
    return json.dumps(value, separators=(",", ":"))


async def text_of(message: dict[str, Any]) -> str:
    """Return a message as JSON; between the pieces of a long list other work goes on."""
    return "{" + ",".join([f"{dumps(key)}:{await _value(value)}" for key, value in message.items()]) + "}"


async def _value(value: object) -> str:
    if not isinstance(value, list) or len(value) <= _PIECE:
        return dumps(value)
    pieces = []
    for k in range(0, len(value), _PIECE):
        pieces.append(dumps(value[k : k + _PIECE])[1:-1])
        await asyncio.sleep(0)
    return f"[{','.join(pieces)}]"
