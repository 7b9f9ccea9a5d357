"""Detections of a readout: label, time of the event, and the earliest time at which it could be detected."""

from __future__ import annotations

import csv
import io
import math
import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel import _core
from taxel._base.arguments import checked_path, column, instance, nth, several, shown, window
from taxel._base.columns import FrozenColumns, frozen, frozen_column, frozen_copy
from taxel._base.drawing import draw
from taxel._base.errors import refused, unreadable
from taxel._base.files import write_whole
from taxel._base.header_table import HeaderTable, text_of
from taxel._base.messages import escaped
from taxel._core import ProblemError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["Detection", "Detections"]

_CSV = ("label", "t_us", "known_us", "slope_mv_per_ms")
_REPORTED, _REPAIRED = "reported_us", "repaired"


class Detection(NamedTuple):
    """Hold one detection of a readout, live or from a recording.

    Parameters
    ----------
    label : str
    t : int, us
        Time of the event by the board's clock: the crossing less the encoder's latency and the trained delay. Where the
        recipe aligned its labels (`taxel.detect.Recipe`), the event is the time at which the sensor felt it.
    known : int, us
        Earliest time of detection: the end of the board's frame in which the potential crosses the threshold.
    slope : float, mV/ms
        Slope of the potential as it reaches the threshold; on a grid its mean over the last step. The steeper the
        slope, the less noise moves `t`. NaN if unknown.
    reported : int, us, optional
        Time of the report, by the host's clock less the estimated offset between the clocks.
    reported_ns : int, ns since 1970, optional
        The same by the host's clock, for a detection that is reported live.
    repaired : bool
        Whether it may depend on values that states of wire version 2 repaired after a loss.

    Examples
    --------
    >>> Detection("contact", 1000, 1344, 0.8, reported=1500).latency
    156
    """

    label: str
    t: int
    known: int
    slope: float = math.nan
    reported: int | None = None
    reported_ns: int | None = None
    repaired: bool = False

    @property
    def latency(self) -> int | None:
        """The time from `known` to the report, us; None if it is unknown."""
        return None if self.reported is None else self.reported - self.known


class Detections(FrozenColumns):
    """Hold the detections of a readout: label, time of the event, earliest time of detection, and slope.

    All times are us of the board's clock.

    Parameters
    ----------
    label : str, shape (n,), text
    t : int64, shape (n,), us
        Time of the event: the crossing less the encoder's latency and the trained delay, as in `Detection`.
    known : int64, shape (n,), us
        Earliest time of detection: the end of the frame in which the potential crosses the threshold.
    slope : float, shape (n,), mV/ms, optional
        Slope of the potential, as in `Detection`; None for a detection without one, which reads back as NaN. Default:
        NaN for all.
    reported : int64, shape (n,), us, optional
        Time of the report, by the host's clock less the estimated offset.
    repaired : bool, shape (n,), optional
        Whether it may depend on values that states of wire version 2 repaired after a loss: the event may have happened
        before `t`. Default: none.

    Raises
    ------
    ProblemError : columns of unequal length, or invalid values

    Examples
    --------
    >>> found = Detections(["contact", "lift"], [1000, 9000], [1344, 9600], [0.8, 0.5])
    >>> found
    Detections(2: contact 1, lift 1; 1000 to 9000 us)
    >>> found["lift"].t
    array([9000])
    >>> found[0].known
    1344
    >>> [d.label for d in found]
    ['contact', 'lift']
    >>> len(found.between(0, 5000))
    1
    """

    _COMPARED: ClassVar[tuple[str, ...]] = ("label", "t", "known", "slope", "reported", "repaired")

    def __init__(
        self,
        label: ArrayLike,
        t: ArrayLike,
        known: ArrayLike,
        slope: ArrayLike | None = None,
        reported: ArrayLike | None = None,
        repaired: ArrayLike | None = None,
    ) -> None:
        self._hold(label, t, known, None if slope is None else _slopes(slope), reported, repaired)

    @classmethod
    def _of(
        cls,
        label: ArrayLike,
        t: ArrayLike,
        known: ArrayLike,
        slope: ArrayLike | None = None,
        reported: ArrayLike | None = None,
        repaired: ArrayLike | None = None,
    ) -> Self:
        """Build detections from columns; the slope of a detection without one is NaN."""
        detections = cls.__new__(cls)
        detections._hold(label, t, known, slope, reported, repaired)
        return detections

    def _hold(
        self,
        label: ArrayLike,
        t: ArrayLike,
        known: ArrayLike,
        slope: ArrayLike | None,
        reported: ArrayLike | None,
        repaired: ArrayLike | None,
    ) -> None:
        try:
            labels = np.asarray(label)
            labels = labels.astype(np.str_) if labels.size == 0 else labels
        except (TypeError, ValueError) as error:
            raise ProblemError(f"label: {error}") from None
        if labels.ndim != 1 or labels.dtype.kind != "U":
            raise refused("label", f" is {shown(label)}: must be a list of texts")
        self.label: NDArray[np.str_] = frozen_copy(labels, label)
        self.t: NDArray[np.int64] = frozen_column("t", t, np.int64, "us")
        self.known: NDArray[np.int64] = frozen_column("known", known, np.int64, "us")
        slopes = frozen(np.full(len(labels), np.nan)) if slope is None else slope
        self.slope: NDArray[np.float64] = frozen_column("slope", slopes, np.float64)
        self.reported: NDArray[np.int64] | None = (
            None if reported is None else frozen_column("reported", reported, np.int64, "us")
        )
        if self.reported is not None and len(self.reported) != len(labels):
            raise refused("reported", f" has {len(self.reported)} entries: must be {len(labels)}, one per detection")
        marks = frozen(np.zeros(len(labels), np.bool_)) if repaired is None else repaired
        self.repaired: NDArray[np.bool_] = frozen_column("repaired", marks, np.bool_)
        _core.check_detections(self._parts())

    def __len__(self) -> int:
        return len(self.t)

    @property
    def labels(self) -> tuple[str, ...]:
        """The labels that occur, in alphabetical order."""
        return tuple(str(name) for name in np.unique(self.label))

    def __iter__(self) -> Iterator[Detection]:
        reported = [None] * len(self) if self.reported is None else self.reported.tolist()
        columns = (self.label, self.t, self.known, self.slope)
        return map(
            Detection, *(column.tolist() for column in columns), reported, [None] * len(self), self.repaired.tolist()
        )

    @overload
    def __getitem__(self, chosen: int) -> Detection: ...
    @overload
    def __getitem__(self, chosen: str | slice | NDArray[Any]) -> Detections: ...
    def __getitem__(self, chosen: int | str | slice | NDArray[Any]) -> Detection | Detections:
        """Return one detection by its number, those of one label, or those chosen by slice, mask or numbers."""
        if isinstance(chosen, int | np.integer) and not isinstance(chosen, bool):
            n = nth("detection", chosen, len(self))
            return next(iter(self[n : n + 1]))
        rows: Any = self.label == chosen if isinstance(chosen, str) else chosen
        try:
            rows = np.arange(len(self))[rows]
        except (IndexError, TypeError, ValueError) as error:
            raise ProblemError(f"detections: choose by a label, a slice, a mask or numbers: {error}") from None
        if rows.ndim != 1:
            raise ProblemError(f"detections: {shown(chosen)} has {rows.ndim} dimensions: must have one")
        reported = None if self.reported is None else self.reported[rows]
        label, t, known, slope = self.label[rows], self.t[rows], self.known[rows], self.slope[rows]
        return Detections._of(label, t, known, slope, reported, self.repaired[rows])

    def between(self, start: float, stop: float) -> Detections:
        """Return the detections of ``start <= t < stop`` (us).

        Parameters
        ----------
        start, stop : float, us

        Raises
        ------
        ProblemError : a start after the stop, or a time that is not a number

        Examples
        --------
        >>> len(Detections(["a", "b"], [10, 20], [11, 22]).between(15, 25))
        1
        """
        start, stop = window("us", start, stop)
        return self[(self.t >= start) & (self.t < stop)]

    def __add__(self, other: Detections) -> Detections:
        """Return the detections of both in order of `t`, those of the first before the other's at equal times.

        Raises
        ------
        ProblemError : only one of the two has the times of its reports (`reported`)
        """
        if not isinstance(other, Detections):
            return NotImplemented
        if (self.reported is None) != (other.reported is None):
            raise ProblemError("some detections have `reported` and others do not: these cannot be merged")
        order = np.argsort(np.concatenate([self.t, other.t]), kind="stable")
        names = ["label", "t", "known", "slope", "repaired"] + ([] if self.reported is None else ["reported"])
        columns = {name: np.concatenate([getattr(self, name), getattr(other, name)])[order] for name in names}
        return Detections._of(**columns)

    def to_numpy(self) -> NDArray[np.void]:
        """Return a record for each detection: ``label t known slope``; ``reported`` if known, ``repaired`` if any."""
        reported = ["reported"] * (self.reported is not None)
        return self._records(["label", "t", "known", "slope", *reported, *[_REPAIRED] * bool(self.repaired.any())])

    @classmethod
    def from_list(cls, detections: Iterable[Detection]) -> Detections:
        """Build detections from a list of `Detection`, as `taxel.live.Live` reports them.

        Parameters
        ----------
        detections : sequence of Detection

        Raises
        ------
        ProblemError : something that is not a detection

        Examples
        --------
        >>> Detections.from_list([Detection("contact", 1000, 1344)])
        Detections(1: contact 1; 1000 to 1000 us)
        """
        entries = [instance("detections", detection, Detection) for detection in several("detections", detections)]
        columns: list[tuple[Any, ...]] = list(zip(*entries, strict=True)) or [()] * len(Detection._fields)
        label, t, known, slope, reported, _, repaired = columns
        return cls._of(label, t, known, slope, None if None in reported else reported, repaired)

    def to_csv(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
        """Write a table ``label,t_us,known_us,slope_mv_per_ms[,reported_us][,repaired]`` and return its path.

        Parameters
        ----------
        path : path
        overwrite : bool
            Whether an existing file may be replaced.

        Returns
        -------
        Path

        Raises
        ------
        FileExistsError : the file is there already and `overwrite` is false
        """
        text = self._csv().encode()
        return write_whole(path, lambda file: file.write(text), overwrite=overwrite)

    def _csv(self, repaired: bool | None = None, recording: str | None = None) -> str:
        """Return the table; the column ``repaired`` is in it if any detection is repaired, or on request.

        Of several recordings each row begins with its recording's name.
        """
        text = io.StringIO()
        table = csv.writer(text, lineterminator="\n")
        more = {} if self.reported is None else {_REPORTED: self.reported.tolist()}
        shown = self.repaired.any() if repaired is None else repaired
        more |= {_REPAIRED: self.repaired.astype(int).tolist()} if shown else {}
        of = {} if recording is None else {"recording": [recording] * len(self)}
        table.writerow([*of, *_CSV, *more])
        columns = [self.label.tolist(), self.t.tolist(), self.known.tolist(), map(repr, self.slope.tolist())]
        table.writerows(zip(*of.values(), *columns, *more.values(), strict=True))
        return text.getvalue()

    @classmethod
    def from_csv(cls, path: str | os.PathLike[str]) -> Detections:
        """Read a table that `to_csv` wrote.

        Parameters
        ----------
        path : path

        Raises
        ------
        FormatError : another header, or an invalid value (names the line)
        FileNotFoundError : no such file

        Examples
        --------
        >>> import tempfile
        >>> place = Detections(["a"], [10], [11]).to_csv(Path(tempfile.mkdtemp()) / "found.csv")
        >>> Detections.from_csv(place)
        Detections(1: a 1; 10 to 10 us)
        """
        file = Path(checked_path("path", path))
        table = HeaderTable.read(file, text_of(file))
        header = tuple(table.header)
        more: dict[str, list[int]] = {name: [] for name in (_REPORTED, _REPAIRED) if name in header}
        if header != (*_CSV, *more):
            raise unreadable(f"contains {','.join(table.header) or 'nothing'}; must be {','.join(_CSV)}", file, line=1)
        rows: list[tuple[str, int, int, float]] = []
        for line, row in table:
            try:
                rows.append((row["label"], int(row["t_us"]), int(row["known_us"]), float(row["slope_mv_per_ms"])))
                for name, values in more.items():
                    values.append(int(row[name]))
            except ValueError as error:
                raise unreadable(f"{error}", file, line=line) from None
        label, t, known, slope = zip(*rows, strict=True) if rows else ((), (), (), ())
        repaired = [value != 0 for value in more[_REPAIRED]] if _REPAIRED in more else None
        return cls._of(label, t, known, slope, more.get(_REPORTED), repaired)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw each label's detections as marks over time (s)."""
        return draw("detections", self, ax)  # type: ignore[no-any-return]

    def _parts(
        self,
    ) -> tuple[list[str], NDArray[np.int64], NDArray[np.int64], NDArray[np.float64], NDArray[np.bool_]]:
        return self.label.tolist(), self.t, self.known, self.slope, self.repaired

    @classmethod
    def _from_parts(cls, parts: tuple[Any, ...]) -> Detections:
        label, *columns = parts
        t, known, slope, repaired = map(frozen, columns)
        return cls._of(label, t, known, slope, repaired=repaired)

    def __repr__(self) -> str:
        if not len(self):
            return "Detections(none)"
        counts = ", ".join(f"{name} {np.count_nonzero(self.label == name)}" for name in self.labels)
        return escaped(f"Detections({len(self)}: {counts}; {self.t.min()} to {self.t.max()} us)")


def _slopes(slope: ArrayLike) -> NDArray[np.float64]:
    """Return a caller's slopes, each finite; None becomes NaN."""
    if isinstance(slope, list | tuple):
        none = np.array([value is None for value in slope], bool)
        values = np.full(len(slope), np.nan)
        values[~none] = column("slope", [value for value in slope if value is not None], np.float64)
    else:
        values, none = column("slope", slope, np.float64), np.zeros(np.shape(slope), bool)
    wrong = np.flatnonzero(~np.isfinite(values) & ~none)
    if len(wrong):
        k = int(wrong[0])
        raise refused("slope", f"[{k}] is {values[k]}: must be finite, or None where it is not known")
    return values
