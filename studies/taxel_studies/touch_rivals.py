"""What the study of touch compares the neuron with: simple features behind a threshold, and linear discriminants."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel.encode import ContactArea
from taxel.frames import Frames
from taxel.information import folds
from taxel_studies.discriminants import LDA

Floats = NDArray[np.float64]

#: What a loaded taxel reads above rest at least, ticks.
ABOVE = ContactArea().above
#: Rows and columns of a frame around the touch (thesis 5.6.2).
AROUND = 16
#: Ridges of the LDA; the one that does best inside the training scenes.
RIDGES = (0.1, 1.0, 10.0, 100.0)


def best_rule(train: Frames, test: Frames, kinds: NDArray[np.int64]) -> tuple[str, NDArray[np.int64]]:
    """Return the feature whose threshold classifies most training scenes right, and its answers for the others."""
    best: tuple[float, str, float, int] = (-1.0, "", 0.0, 1)
    for name, values in _features(train).items():
        edges = np.sort(values)
        for edge in (edges[1:] + edges[:-1]) / 2:
            for sign in (1, -1):
                share = float(np.mean((sign * values > sign * edge) == kinds))
                best = max(best, (share, name, float(edge), sign))
    _, name, edge, sign = best
    return name, (sign * _features(test)[name] > sign * edge).astype(np.int64)


def _features(frames: Frames) -> dict[str, Floats]:
    """Return the simple features of each frame: area, total, peak and their ratios."""
    area, total, peak = frames.area(ABOVE), frames.total(), frames.peak()
    some = np.maximum(area, 1.0), np.maximum(total, 1.0), np.maximum(peak, 1.0)
    return {
        "area": area,
        "total": total,
        "peak": peak,
        "peak / area": peak / some[0],
        "total / area": total / some[0],
        "area2 / total": area**2 / some[1],
        "total / peak": total / some[2],
    }


def numbers(frames: Frames) -> Floats:
    """Return the logarithms of area, total and peak of each frame."""
    return np.log(np.maximum(np.stack([frames.area(ABOVE), frames.total(), frames.peak()], axis=1), 1.0))


def around(frames: Frames) -> Floats:
    """Return the values of 16 x 16 taxels around the centre of what is loaded, frame by frame; beyond the edge 0.

    A touch is anywhere on the array, and weights learnt for the taxels of one place are of no use at another. Where
    nothing is loaded, the taxels are those in the middle of the array.
    """
    values = frames.values.astype(np.float64)
    loaded = np.where(values >= ABOVE, values, 0.0)
    all_of = loaded.sum(axis=(1, 2))
    padded = np.pad(values, ((0, 0), (AROUND, AROUND), (AROUND, AROUND)))
    index: list[NDArray[np.int64]] = []
    for axis, size in enumerate(values.shape[1:]):
        middle = np.full(len(values), (size - 1) / 2)
        np.divide(loaded.sum(axis=2 - axis) @ np.arange(size), all_of, out=middle, where=all_of > 0)
        index.append((np.rint(middle).astype(np.int64) + AROUND - AROUND // 2)[:, None] + np.arange(AROUND))
    row, column = index
    which = np.arange(len(values))[:, None, None]
    return np.asarray(padded[which, row[:, :, None], column[:, None, :]].reshape(len(values), -1))


def lda(values: ArrayLike, classes: NDArray[Any]) -> Callable[[ArrayLike], NDArray[Any]]:
    """Return a linear discriminant with the ridge that does best in folds of what it is trained on."""
    x, fold = np.asarray(values, np.float64), folds(classes, count=5)
    right = []
    for ridge in RIDGES:
        answers = [
            LDA(ridge=ridge).fit(x[fold != k], classes[fold != k]).predict(x[fold == k]) for k in np.unique(fold)
        ]
        right.append(sum(int(np.sum(s == classes[fold == k])) for k, s in zip(np.unique(fold), answers, strict=True)))
    return LDA(ridge=RIDGES[int(np.argmax(right))]).fit(x, classes).predict
