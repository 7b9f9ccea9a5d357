"""Requests about the user's presets of the board's registers."""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Mapping
from pathlib import Path

from taxel._base.documents import read_toml
from taxel._base.files import whole_file
from taxel.live._requests.reasons import reasons


def _path() -> Path:
    """Return the file of the user's own presets: taxel/presets.toml in the folder of user settings."""
    return Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config") / "taxel" / "presets.toml"


class PresetRequests:
    """Read and write the file of the user's presets."""

    def __init__(self) -> None:
        self._lock = threading.Lock()

    def read(self) -> tuple[Path, dict[str, dict[str, object]]]:
        """Return the file of the user's presets, and the presets: value by register name."""
        path = _path()
        with reasons():
            presets = read_toml(path) if path.exists() else {}
        return path, {name: values for name, values in presets.items() if isinstance(values, dict)}

    def write(self, presets: Mapping[str, Mapping[str, object]]) -> None:
        """Write the user's presets."""
        path = _path()
        lines = [
            "# Presets of the panel: one table for each preset; registers are in the units of taxel's docs, registers."
        ]
        for name, values in sorted(presets.items()):
            # A basic string of TOML has the escapes of JSON.
            lines += ["", f"[{json.dumps(name)}]"]
            lines += [f"{register} = {json.dumps(value)}" for register, value in values.items()]
        with reasons(), self._lock:
            path.parent.mkdir(parents=True, exist_ok=True)
            with whole_file(path, overwrite=True) as part:
                part.write_text("\n".join(lines) + "\n", "utf-8", newline="\n")
