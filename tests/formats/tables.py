"""Tables of text beside a layout file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import taxel

VALUES = np.array([[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], [6.5, 0.0, 1.0, 2.0, 3.0, 4.0], [9.0, 8.0, 7.0, 6.0, 5.0, 4.0]])


def table(folder: Path, text: str, layout: str, name: str = "step.txt") -> Any:
    (folder / name).write_text(text)
    (folder / f"{name.split('.', maxsplit=1)[0]}.layout.toml").write_text(layout)
    return taxel.open(folder / name)


def lines(values: np.ndarray, separator: str = ",") -> str:
    return "".join(separator.join(f"{v:g}" for v in row) + "\n" for row in values)
