"""Cuts recordings: by time, by region, and around each note of a label."""

from __future__ import annotations

import numpy as np

from taxel._base.arguments import finite, instance, text, window
from taxel._core import ProblemError
from taxel.array import Array
from taxel.recording.recording import Recording


def cut(
    recording: Recording,
    *,
    start_us: float = -np.inf,
    stop_us: float = np.inf,
    columns: slice | None = None,
    rows: slice | None = None,
    label: str | None = None,
    before_us: float = 500_000.0,
    after_us: float = 500_000.0,
) -> list[Recording]:
    """Cut an interval of time, a region of the sensor, or an interval around each note with a label.

    Parameters
    ----------
    recording : Recording
    start_us, stop_us : float, us
        The interval to keep, by the board's clock: ``start_us <= t < stop_us``.
    columns, rows : slice, optional
        The rectangle to keep, within the array; it becomes a separate sensor, whose columns and rows count from 0.
        With all columns and rows the recording is unchanged.
    label : str, optional
        Cut around each note with this text; the result has one recording for each note, and may be empty.
    before_us, after_us : float, us
        Time to keep before and after the note.

    Returns
    -------
    list of Recording
        One recording, or one for each note, of the same file: nothing is read before it is asked for. Times do not
        change; its registers are those of the whole sensor.

    Raises
    ------
    ProblemError : a start after its stop, a time before or after a label below 0, or a region without a taxel or beyond
        the array

    Examples
    --------
    >>> import pathlib, tempfile, taxel
    >>> place = pathlib.Path(tempfile.mkdtemp()) / "two.npz"
    >>> events = taxel.Events([0, 200], [3, 4], [5, 5], [True, False], array=taxel.Array(8, 8))
    >>> _ = taxel.convert(events, place)
    >>> taxel.cut(taxel.open(place), start_us=100, columns=slice(4, 8))
    [Recording(two.npz: 1 event, 200 to 200 us, 8 x 4 taxels)]
    """
    instance("recording", recording, Recording)
    start_us, stop_us = window("us", start_us, stop_us)
    around = [finite(name, value, least=0.0) for name, value in (("before_us", before_us), ("after_us", after_us))]
    is_whole = (start_us, stop_us) == (-np.inf, np.inf)
    time_slice = recording if is_whole else recording.between(start_us, stop_us)
    if label is None:
        slices = [time_slice]
    else:
        text("label", label)
        times = [note.t for note in time_slice.notes if note.text == label and note.t is not None]
        slices = [time_slice.between(t - around[0], t + around[1]) for t in times]
    if columns is None and rows is None:
        return slices
    across, down = (slice(None) if chosen is None else chosen for chosen in (columns, rows))
    _check(recording.array, across, down)
    return [Recording({each._only.facts.label: each._only.region(across, down)}) for each in slices]


def _check(array: Array, columns: slice, rows: slice) -> None:
    """Refuse an end beyond an array, or a rectangle without a taxel."""
    (left, right), (top, bottom) = array.region(columns, rows)
    sides = (("columns", columns, array.columns), ("rows", rows, array.rows))
    ends = [(end, count) for _, chosen, count in sides for end in (chosen.start, chosen.stop) if end is not None]
    if right <= left or bottom <= top or any(not -count <= end <= count for end, count in ends):
        asked = [
            f"{name} {chosen.start or 0} to {'the last' if chosen.stop is None else chosen.stop}"
            for name, chosen, _ in sides
            if chosen != slice(None)
        ]
        has = f"the array has {array.columns} columns and {array.rows} rows"
        raise ProblemError(f"{' and '.join(asked)}: must be within the array, and hold a taxel; {has}")


def span_us(recording: Recording) -> tuple[int, int]:
    """Return the first and the last time of a recording; refuse an empty one."""
    times = recording.events.t if recording.has_events else recording.frames().t
    if not len(times):
        raise ProblemError(f"{recording.path}: contains nothing")
    return int(times.min()), int(times.max())
