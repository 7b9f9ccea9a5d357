"""novel pedar insoles as taxel reads them, with reference events of the insole's own sum."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import taxel
from taxel_studies.datasets import Trial, scored_around, stances

__all__ = ["contacts", "knows", "trials"]

_SOURCE = "the sum of the same insole, at 10 % of its largest value: not independent of the readings"


def knows(path: Path) -> bool:
    """Return whether a file is one of the data set: ``.asc`` with pressures."""
    return path.suffix == ".asc" and b"pressure values" in path.read_bytes()[:4096]


def trials(path: Path) -> Iterator[Trial]:
    """Yield the left and the right insole of one recording.

    The recording has no reference events: contact and foot-off are the times at which the sum of the foot crosses 10 %
    of its maximum.

    Raises
    ------
    FormatError : a file that breaks the format (names the file)
    """
    for foot, recording in taxel.open(path).sources.items():
        frames = recording.frames()
        total = frames.total()
        samples = contacts(total)
        truth = {"contact": frames.t[samples[:, 0]], "foot_off": frames.t[samples[:, 1]]}
        yield Trial(
            name=f"{path.stem} {foot}",
            person=path.stem,
            frames=frames,
            truth=truth,
            source=_SOURCE,
            foot=foot,
            scored=scored_around(truth),
            series={"total": total},
        )


def contacts(total: NDArray[np.float64]) -> NDArray[np.int64]:
    """Find stances: from the first sample of at least 10 % of the largest sum to the next one below, shape (n, 2).

    Stances that begin or end outside the recording are excluded.

    Examples
    --------
    >>> contacts(np.array([9.0, 0.0, 5.0, 10.0, 1.0, 0.5, 0.0]))
    array([[2, 5]])
    """
    edges = np.diff((total >= 0.1 * total.max()).astype(np.int8))
    return stances(np.flatnonzero(edges > 0) + 1, np.flatnonzero(edges < 0) + 1)
