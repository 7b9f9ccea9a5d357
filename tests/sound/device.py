"""Sound calls of `taxel.device`, on the serial line of an emulated board."""

import os
import pty
import threading
from collections.abc import Callable
from functools import cache
from typing import Any

import taxel
from sound.things import Sound, plain
from taxel.device import Cable, Device
from taxel.wire import Command


@cache
def line() -> str:
    """Begin to emulate a board, once for all calls; return its serial line, which stays open."""
    board, (end, other) = taxel.simulate.Board(), pty.openpty()

    def answer() -> None:
        while data := os.read(end, 5):
            os.write(end, board.command(data).encode())

    threading.Thread(target=answer, daemon=True).start()
    return os.ttyname(other)


def connect(opened: type[Cable] | type[Device], name: str | None = None) -> Callable[..., Any]:
    """Return a function that opens the line, calls a method where one is named, and closes the line."""

    def call(**arguments: Any) -> Any:
        if name is None:
            with opened(**{"place": line()} | arguments):
                return None
        with opened(line(), timeout=30.0) as there:
            result = getattr(there, name)(**arguments)
            if name == "floor":
                with result:
                    return None
            return result

    return call


#: A valid call of every public function and class with arguments, by its full name.
SOUND: dict[str, Sound] = {
    "taxel.device.Cable": lambda: (connect(Cable), {"place": line(), "baud": 115_200, "timeout": 30.0}),
    "taxel.device.Cable.command": plain(connect(Cable, "command"), command=Command(4, 140)),
    "taxel.device.Cable.floor": plain(connect(Cable, "floor"), ticks=0),
    "taxel.device.Cable.read": plain(connect(Cable, "read"), register=4),
    "taxel.device.Cable.reopen": plain(connect(Cable, "reopen"), within=30.0),
    "taxel.device.Device": lambda: (
        connect(Device),
        {"place": line(), "array": taxel.Array.thesis(), "baud": 115_200, "timeout": 30.0, "patience": 2.0},
    ),
    "taxel.device.Device.apply": plain(connect(Device, "apply"), registers="2 kHz"),
    "taxel.device.Device.record": plain(connect(Device, "record"), start=False),
}

#: For each type that only taxel constructs, a call that returns an instance.
RESULTS: dict[str, Callable[[], Any]] = {
    "taxel.device.Greeting": connect(Cable, "greeting"),
}

#: Names that are not tested, and the reason.
LEFT_OUT: dict[str, str] = {
    "taxel.device.Port": "a result of taxel.device.ports, and a machine may have no serial port",
}
