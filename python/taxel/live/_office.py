"""What the panel's server asks of Python: the board's serial line, health, cutting, labels, presets."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import socket
import struct
import threading
import tomllib
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from taxel._base.files import whole_file
from taxel._core import ProblemError
from taxel.device import Cable, ports
from taxel.labels import Labels, write_labels
from taxel.recording import open_recording
from taxel.recording.about import array_of
from taxel.recording.convert import convert
from taxel.recording.cut import cut
from taxel.recording.health import Told, judged
from taxel.wire import Command

__all__ = ["Office", "own_addresses", "presets_path"]

#: SIOCGIFADDR of Linux (netdevice(7)).
_ADDRESS_OF = 0x8915


def presets_path() -> Path:
    """Return the file of one's own presets: taxel/presets.toml where the user's settings are."""
    return Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config") / "taxel" / "presets.toml"


def own_addresses() -> list[tuple[str, str]]:
    """Return the IPv4 addresses of this machine: name of the network interface and address."""
    found = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asked:
        for _, name in socket.if_nameindex():
            # An interface that is down has none. struct ifreq: the name, then the address from byte 20 on.
            with contextlib.suppress(OSError):
                told = fcntl.ioctl(asked, _ADDRESS_OF, struct.pack("256s", name.encode()[:15]))
                found.append((name, socket.inet_ntoa(told[20:24])))
    return found


class Listener(Protocol):
    """What listens to a board, and can begin anew."""

    def listen(self, host: str, port: int) -> None:
        """Listen on another address."""

    def delta_intensity(self, on: bool) -> None:
        """Take intensities for differences, or for values."""


class Office:
    """Answer the server's questions, from whichever thread asks."""

    def __init__(self, panel: Listener, cable: Cable | None) -> None:
        self._panel, self._cable = panel, cable
        self._at_cable, self._at_files = threading.Lock(), threading.Lock()

    def answer(self, what: str, asked: str) -> str:
        """Return the answer to a question, both JSON; what is raised, a person reads."""
        try:
            return json.dumps(getattr(self, f"_{what}")(json.loads(asked)))
        except (FileExistsError, FileNotFoundError, PermissionError) as error:
            said = {FileExistsError: "exists already", FileNotFoundError: "no such file or device"}
            raise ProblemError(f"{error.filename}: {said.get(type(error), 'permission denied')}") from None
        except OSError as error:
            where = "" if error.filename is None else f"{error.filename}: "
            raise ProblemError(f"{where}{error.strerror or error}") from None

    def close(self) -> None:
        """Let go of the serial line."""
        with self._at_cable:
            if self._cable is not None:
                self._cable.close()
                self._cable = None

    def _command(self, asked: Mapping[str, Any]) -> object:
        with self._at_cable:
            return {"value": self._connected().command(Command(asked["register"], asked["value"]))}

    def _greeting(self, _: Mapping[str, Any]) -> object:
        with self._at_cable:
            return {"channels": self._connected().greeting().channels}

    def _connected(self) -> Cable:
        if self._cable is None:
            raise ProblemError("the board's serial line is not connected")
        return self._cable

    def _lines(self, _: Mapping[str, Any]) -> object:
        with self._at_cable:
            said = [] if self._cable is None else self._cable.said()
            return {"said": said, "resets": 0 if self._cable is None else self._cable.resets}

    def _control(self, asked: Mapping[str, Any]) -> object:
        self.close()
        if asked["place"] is not None:
            cable = Cable(asked["place"])
            with self._at_cable:
                self._cable = cable
        return {}

    def _listen(self, asked: Mapping[str, Any]) -> object:
        self._panel.listen(asked["host"], asked["port"])
        return {}

    def _differences(self, asked: Mapping[str, Any]) -> object:
        self._panel.delta_intensity(asked["on"])
        return {}

    def _places(self, _: Mapping[str, Any]) -> object:
        return {
            "serial": [asdict(port) for port in ports()],
            "addresses": [{"host": host, "name": name} for name, host in own_addresses()],
        }

    def _health(self, asked: Mapping[str, Any]) -> object:
        said = dict(asked["array"])
        if said.get("exists") is not None:
            said["exists"] = [digit == "1" for digit in said["exists"]]
        array = array_of(said)
        # Without intensities nothing is known of what was held.
        names = ("activity", "moved") if asked["values"] is None else Told._fields
        told = Told(*(np.array(asked[name], np.int64).reshape(array.shape) for name in names))
        return judged(array, told).named()

    def _cut(self, asked: Mapping[str, Any]) -> object:
        recording = open_recording(asked["path"])
        (part,) = cut(recording, start_us=asked["start_us"], stop_us=asked["stop_us"])
        return {"lost": convert(part, asked["out"])}

    def _labels_read(self, asked: Mapping[str, Any]) -> object:
        labels = Labels(asked["path"])
        name = labels.named(asked["recording"])
        return [{"label": row.label, "t_us": row.t_us} for row in labels.rows if row.recording == name]

    def _labels_write(self, asked: Mapping[str, Any]) -> object:
        with self._at_files:
            write_labels(asked["path"], [(row["label"], row["t_us"]) for row in asked["rows"]])
        return {}

    def _presets_read(self, _: Mapping[str, Any]) -> object:
        place = presets_path()
        try:
            own = tomllib.loads(place.read_text("utf-8")) if place.exists() else {}
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise ProblemError(f"{place}: no table of presets: {error}") from None
        return {"path": str(place), "own": {name: held for name, held in own.items() if isinstance(held, dict)}}

    def _presets_write(self, asked: Mapping[str, Any]) -> object:
        place = presets_path()
        place.parent.mkdir(parents=True, exist_ok=True)
        lines = ["# Presets of the panel: a table each, every register in its own unit (taxel's docs, registers)."]
        for name, held in sorted(asked["own"].items()):
            # A basic string of TOML takes JSON's escapes.
            lines += ["", f"[{json.dumps(name)}]", *(f"{field} = {json.dumps(value)}" for field, value in held.items())]
        with self._at_files, whole_file(place, overwrite=True) as part:
            part.write_text("\n".join(lines) + "\n", "utf-8")
        return {}
