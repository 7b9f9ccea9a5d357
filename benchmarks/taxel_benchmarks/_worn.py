"""What becomes of taxels after a tare: readings that drift, taxels that stick or flicker."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel import Events, ProblemError

__all__ = ["worn"]

#: The unit of added stamps, us: that of version 1 of the wire.
_STAMP_US = 100
#: How long a flickering taxel stays as it is, on average, us.
_FLICKER_US = 20_000
#: The largest value of an event, ticks; one more means unknown.
_MOST = 65_534
_MINUTE_US = 60_000_000


class _Added(NamedTuple):
    """Values of taxels, by their places, from times on (us)."""

    t: NDArray[np.int64]
    place: NDArray[np.int64]
    value: NDArray[np.int64]
    rising: NDArray[np.bool_]


def worn(
    events: Events,
    since_us: int,
    *,
    seed: int,
    drift: float = 0.0,
    age_min: float = 0.0,
    stuck: int = 0,
    flickering: int = 0,
    pairs: int = 0,
) -> Events:
    """Return events as a board sends them whose taxels changed after a tare, by changing the values that they hold.

    What comes before a time, as the tare, stays. From then on every taxel's values are drawn away from those of the
    tare by its own steady drift; some taxels stick, and some flicker.

    Parameters
    ----------
    events : Events
        With intensities.
    since_us : int, us
        When the tare ends.
    seed : int, 0 or more
        Draws drifts, taxels and values.
    drift : float, ticks a minute
        Standard deviation over taxels.
    age_min : float, min
        How old the tare is at `since_us`: for so long taxels have drifted.
    stuck, flickering, pairs : int, 0 or more
        How many taxels hold one value, drawn from 0 to the largest of the recording; how many are at random now at
        rest, now at such a value above it, 20 ms each on average; and how many pairs of neighbours in a row flicker
        together.

    Returns
    -------
    Events
        The changes of the drift have an event for every tick.

    Raises
    ------
    ProblemError : more bad taxels than there are

    Examples
    --------
    >>> from taxel import Array
    >>> events = Events([0, 0, 90], [0, 1, 0], [0, 0, 0], [True] * 3, array=Array(1, 2), intensity=[50, 60, 80])
    >>> worn(events, 40, seed=1, drift=2.0, age_min=10.0).intensity
    array([50, 60, 57, 76, 87], dtype=uint16)
    """
    rng = np.random.default_rng([seed])
    held = _Held(events)
    stop = max([since_us, *events.t[-1:].tolist(), *(t for t, _ in events.markers)])
    rates = rng.normal(0.0, drift, held.taxels) / _MINUTE_US
    bad, changes = _bad(rng, held, since_us, stop, (stuck, flickering, pairs))
    drifting = np.setdiff1d(held.known(since_us), bad)
    added = [
        *changes,
        *(_steps(held, place, float(rates[place]), age_min * _MINUTE_US, since_us, stop) for place in drifting),
    ]
    shifted = np.rint(held.value + rates[held.place] * (age_min * _MINUTE_US + held.t - since_us)).astype(np.int64)
    value = np.where(held.t < since_us, held.value, shifted)
    kept = (held.t < since_us) | ~np.isin(held.place, bad)
    return _merged(events, held, value, kept, added)


class _Held:
    """The values of events, by taxel."""

    def __init__(self, events: Events) -> None:
        rows, self.columns = events.array.shape
        self.taxels = rows * self.columns
        self.t, self.place = events.t, events.y.astype(np.int64) * self.columns + events.x
        assert events.intensity is not None
        self.value = events.intensity.astype(np.int64)
        assert events.present is not None
        mine = np.flatnonzero(events.present)
        mine = mine[np.lexsort((self.t[mine], self.place[mine]))]
        self._t, self._value = self.t[mine], self.value[mine]
        self._offsets = np.searchsorted(self.place[mine], np.arange(self.taxels + 1))

    def known(self, t_us: int) -> NDArray[np.int64]:
        """Return the places of the taxels that have a value before a time."""
        known = np.flatnonzero(np.diff(self._offsets))
        return known[self._t[self._offsets[known]] < t_us]

    def at(self, place: int, times: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return what a taxel holds at times, of which none lies before its first event."""
        mine = slice(*self._offsets[place : place + 2])
        held: NDArray[np.int64] = self._value[mine][np.searchsorted(self._t[mine], times, side="right") - 1]
        return held


def _steps(held: _Held, place: int, rate: float, age_us: float, since: int, stop: int) -> _Added:
    """Return the values of a taxel whose reading has drifted: at once, and whenever that has become a tick more."""
    nearest = sorted(round(rate * (age_us + t)) for t in (0, stop - since))
    ticks = np.arange(nearest[0], nearest[1]) + 0.5
    exact = since + ticks / rate - age_us if len(ticks) else np.empty(0)
    times = np.sort(np.ceil(exact / _STAMP_US).astype(np.int64) * _STAMP_US)
    t = np.concatenate([[since], times[(times > since) & (times <= stop)]]).astype(np.int64)
    value = held.at(place, t) + np.rint(rate * (age_us + t - since)).astype(np.int64)
    return _Added(t, np.full(len(t), place), value, np.full(len(t), rate > 0))


def _bad(
    rng: np.random.Generator, held: _Held, since: int, stop: int, counts: tuple[int, int, int]
) -> tuple[NDArray[np.int64], list[_Added]]:
    """Return the places of bad taxels, and their values."""
    stuck, flickering, pairs = counts
    known, top = held.known(since), int(held.value.max(initial=1))
    left = set(known.tolist())
    added = []
    for n in range(stuck + flickering + pairs):
        beside = {place for place in left if place + 1 in left and (place + 1) % held.columns}
        choice = sorted(beside if n >= stuck + flickering else left)
        if not choice:
            raise ProblemError(f"{stuck} stuck, {flickering} flickering, {pairs} pairs: there are {len(known)} taxels")
        first = int(rng.choice(choice))
        worn = [first, first + 1] if n >= stuck + flickering else [first]
        left -= set(worn)
        t, up = np.array([since]), np.array([True])
        if n >= stuck:
            apart = rng.exponential(_FLICKER_US, 10 + 4 * (stop - since) // _FLICKER_US)
            later = since + np.cumsum(apart).astype(np.int64) // _STAMP_US * _STAMP_US
            t = np.concatenate([t, np.unique(later[(later > since) & (later <= stop)])])
            up = np.arange(len(t)) % 2 == 1
        for place in worn:
            rest = int(held.at(place, np.array([since - 1]))[0])
            value = int(rng.integers(0, top + 1))
            values = np.where(up, value if n < stuck else rest + value, rest)
            added.append(_Added(t, np.full(len(t), place), values, values > rest))
    return np.array(sorted(set(known.tolist()) - left), np.int64), added


def _merged(
    events: Events, held: _Held, value: NDArray[np.int64], kept: NDArray[np.bool_], added: list[_Added]
) -> Events:
    """Return the events that stay, with their new values, among those that were added; at one time these come first."""
    t, place, new, up = (
        np.concatenate([np.empty(0, np.int64), *(events[k] for events in added)]) for k in range(len(_Added._fields))
    )
    mine = np.flatnonzero(kept)
    every = np.concatenate([t, held.t[mine]])
    order = np.argsort(every, kind="stable")
    places = np.concatenate([place, held.place[mine]])[order]
    values = np.clip(np.concatenate([new, value[mine]]), 0, _MOST)[order]
    rising = np.concatenate([up.astype(bool), events.p[mine]])
    present, repaired = (
        None if column is None else np.concatenate([np.full(len(t), filled), column[mine]])[order]
        for column, filled in ((events.present, True), (events.repaired, False))
    )
    return Events(
        every[order], places % held.columns, places // held.columns, rising[order], array=events.array,
        intensity=values, present=present, repaired=repaired, markers=events.markers,
    )  # fmt: skip
