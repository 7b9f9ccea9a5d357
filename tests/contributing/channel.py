"""One force channel as text: a first line of names, then one line for each sample: time in us, force in N."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import taxel
from taxel.formats.layout import Layout
from taxel.reading import Facts, InMemory


def knows(path: Path) -> bool:
    """Return whether a file is of this kind."""
    return path.suffix == ".channel" and path.is_file()


def read(path: Path, _layout: Layout | None) -> list[InMemory]:
    """Return a reader of the channel.

    Raises
    ------
    FormatError : a line that is not two numbers (names the file)
    """
    try:
        t, force = np.loadtxt(path, skiprows=1, ndmin=2).reshape(-1, 2).T
        frames = taxel.Frames(force[:, None, None], t, unit="N")
    except (ValueError, taxel.ProblemError) as error:
        raise taxel.FormatError(f"{path}: {error}") from None
    return [InMemory(Facts(path=path, array=frames.array, kind="channel"), frames)]
