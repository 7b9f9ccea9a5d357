"""Slower sampling of recorded trials: held values at other times, and the events between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.arguments import several
from taxel._core import ProblemError
from taxel.array import Array
from taxel.encode import ChangeEvents
from taxel.events import Events
from taxel.frames import Frames
from taxel.information.trials import LabelledTrial
from taxel.spikes import to_ms, to_us

__all__ = [
    "STEP_US",
    "HeldValues",
    "SampledEvents",
    "checked_periods",
    "contacts",
    "finest_us",
    "spikes_of",
]

#: The finest grid on which a touch's beginning is searched, us.
STEP_US = 100


class HeldValues:
    """Return what every taxel holds at any time: the last frame, or the last intensity that came.

    Events without intensities count as steps of one, up or down, from the beginning of the recording.

    Parameters
    ----------
    source : Events or Frames
    """

    def __init__(self, source: Events | Frames) -> None:
        self.source, self.array = source, source.array
        exists = np.ones(self.array.shape, bool) if self.array.exists is None else self.array.exists
        self.taxels = np.flatnonzero(exists)
        if isinstance(source, Frames):
            values = source.values.reshape(len(source), exists.size)
            self._values = values if exists.all() else values[:, self.taxels]
        else:
            self._held = _core.HeldValues(source, self.taxels.astype(np.uint32), None)

    def __reduce__(self) -> tuple[type[HeldValues], tuple[Events | Frames]]:
        """Pickle what it is made of, for other processes."""
        return HeldValues, (self.source,)

    def at(self, times: NDArray[np.int64]) -> NDArray[np.float32]:
        """Return the held values, shape (times, existing taxels); before the first frame, the first frame.

        Parameters
        ----------
        times : int64, us, ascending
        """
        if isinstance(self.source, Frames):
            rows = np.searchsorted(self.source.t, times, side="right") - 1
            return np.asarray(self._values[np.maximum(rows, 0)])
        return self._held.at(np.ascontiguousarray(times, np.int64)).reshape(len(times), len(self.taxels))


@dataclass(frozen=True, eq=False)
class SampledEvents:
    """The events of all trials, sampled at one period and one draw of its phases.

    Attributes
    ----------
    period_us : int
    taxels : int
        Trains.
    trial, taxel, bin : int64, shape (spikes,)
        In the order of bins; bin 0 holds each trial's first event.
    value : float32, shape (spikes,)
        +1 or -1; with more bits, the step.
    first_us : float64, shape (trials,), us
        Time from the true contact to the first event; infinite in a silent trial.
    length_us : float64, shape (trials,), us
        From the true contact to the trial's end.
    """

    period_us: int
    taxels: int
    trial: NDArray[np.int64]
    taxel: NDArray[np.int64]
    bin: NDArray[np.int64]
    value: NDArray[np.float32]
    first_us: NDArray[np.float64]
    length_us: NDArray[np.float64]

    @property
    def trials(self) -> int:
        """How many trials there are, silent ones among them."""
        return len(self.first_us)

    def bins_to(self, window_us: float) -> NDArray[np.int64]:
        """Return how many bins of each trial are within so much time after the contact and before the trial's end."""
        stop = np.minimum(window_us, self.length_us)
        with np.errstate(invalid="ignore"):
            bins = np.ceil((stop - self.first_us) / self.period_us - 1e-9)
        return np.where(np.isfinite(self.first_us), np.maximum(np.nan_to_num(bins, neginf=0.0), 0.0), 0.0).astype(
            np.int64
        )

    def counts(self, window_us: float) -> NDArray[np.int64]:
        """Return each trial's events within a window after the contact."""
        inside = self.bin < self.bins_to(window_us)[self.trial]
        return np.bincount(self.trial[inside], minlength=self.trials)

    def select(self, taxels: NDArray[np.int64]) -> SampledEvents:
        """Return the events of some taxels alone, aligned on the first of theirs."""
        number = np.full(self.taxels, -1)
        number[taxels] = np.arange(len(taxels))
        chosen = np.flatnonzero(number[self.taxel] >= 0)
        trial, bins = self.trial[chosen], self.bin[chosen]
        begin = np.full(self.trials, np.iinfo(np.int64).max)
        np.minimum.at(begin, trial, bins)
        silent = begin == np.iinfo(np.int64).max
        first = np.where(silent, np.inf, self.first_us + np.where(silent, 0, begin) * float(self.period_us))
        return SampledEvents(
            self.period_us,
            len(taxels),
            trial,
            number[self.taxel[chosen]],
            bins - begin[trial],
            self.value[chosen],
            first,
            self.length_us,
        )


def finest_us(sources: Sequence[Events | Frames]) -> int:
    """Return the finest period that recordings can show, us: between frames, or what all stamps are multiples of."""
    periods = [
        int(np.median(np.diff(source.t))) for source in sources if isinstance(source, Frames) and len(source) > 1
    ]
    stamps = [int(np.gcd.reduce(np.append(source.t, 0))) for source in sources if not isinstance(source, Frames)]
    return max(1, int(np.gcd.reduce([0, *stamps])), *periods)


def contacts(
    trials: Sequence[LabelledTrial],
    values_of: Sequence[HeldValues],
    encoder: ChangeEvents,
    period_us: int,
    window_us: float,
) -> NDArray[np.float64]:
    """Return when each touch begins, us: the first event at or after its start at the finest period; NaN without one.

    The search ends at the trial's end, or after the length of a window; events are searched at their own times.
    """
    onsets = np.full(len(trials), np.nan)
    for k, (trial, values) in enumerate(zip(trials, values_of, strict=True)):
        stop = trial.start_us + window_us if trial.stop_us is None else trial.stop_us
        t, step = trial.source.t, max(period_us, STEP_US)
        if isinstance(trial.source, Events):
            grid = np.unique(np.append(t[(t >= trial.start_us) & (t < stop)], trial.start_us - 1))
        else:
            grid = np.arange(trial.start_us - step, int(stop), step)
        bins, _, _ = _encoded(encoder, values, grid)
        if len(bins):
            onsets[k] = grid[bins.min()]
    return onsets


def spikes_of(
    trials: Sequence[LabelledTrial],
    held: Sequence[HeldValues],
    encoder: ChangeEvents,
    *,
    period_us: int,
    contact_us: NDArray[np.float64],
    window_us: float,
    random: np.random.Generator,
) -> SampledEvents:
    """Sample all trials at one period, each at a phase that is drawn, and encode the samples.

    Parameters
    ----------
    trials : sequence of LabelledTrial
    held : sequence of HeldValues
        Of each trial's recording.
    encoder : ChangeEvents
    period_us : int, us
    contact_us : float64, shape (trials,), us
        The true contact; NaN where there is none, and the trial is silent.
    window_us : float, us
        Time after the contact that counts.
    random : numpy.random.Generator
        Source of the random phases.

    Returns
    -------
    SampledEvents
    """
    several("trials", trials)
    parts: list[tuple[Any, ...]] = []
    first = np.full(len(trials), np.inf)
    length = np.zeros(len(trials))
    phases = random.random(len(trials))
    taxels = 1
    for k, (trial, values) in enumerate(zip(trials, held, strict=True)):
        taxels = len(values.taxels)
        if np.isnan(contact_us[k]):
            continue
        length[k] = np.inf if trial.stop_us is None else trial.stop_us - contact_us[k]
        stop = contact_us[k] + min(length[k], window_us)
        # The first sample is before the start; the next is the first that may see the touch.
        begin = trial.start_us - period_us + int(phases[k] * period_us)
        grid = np.arange(begin, int(np.ceil(stop)), period_us)
        if len(grid) < 2:
            continue
        bins, taxel, value = _encoded(encoder, values, grid)
        late = grid[bins] >= contact_us[k]
        bins, taxel, value = bins[late], taxel[late], value[late]
        if not len(bins):
            continue
        zero = int(bins.min())
        first[k] = grid[zero] - contact_us[k]
        parts.append((np.full(len(bins), k), taxel, bins - zero, value))
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)] if parts else [np.empty(0, np.int64)] * 4
    order = np.argsort(columns[2], kind="stable")
    trial_, taxel_, bin_, value_ = (column[order] for column in columns)
    return SampledEvents(period_us, taxels, trial_, taxel_, bin_, value_.astype(np.float32), first, length)


def _encoded(
    encoder: ChangeEvents, held: HeldValues, grid: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float32]]:
    """Return bin, taxel and value of the events that an encoder makes of the values held at a grid of times."""
    values = held.at(grid)
    frames = Frames(values[:, None, :], grid, unit="held", array=Array(1, values.shape[1]))
    trains = encoder.encode(frames)
    taxel = np.repeat(np.arange(len(trains)), trains.counts)
    bins = np.searchsorted(grid, np.rint(to_us(trains.times)).astype(np.int64))
    value = np.ones(len(bins), np.float32) if trains.values is None else trains.values
    return bins, taxel, value


def checked_periods(periods_us: Sequence[int], finest: int) -> list[int]:
    """Return the periods, ascending; refuse one that is finer than the recording."""
    periods = sorted(set(periods_us))
    if not periods:
        raise ProblemError("periods is []: must name at least one")
    if periods[0] < finest:
        raise ProblemError(
            f"period {to_ms(periods[0]):g} ms is shorter than the recordings resolve: must be at least "
            f"{to_ms(finest):g} ms"
        )
    return periods
