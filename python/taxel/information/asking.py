"""The question of chapter 5, asked of a user's own sensor: how many bits, at which period, of how many taxels, when."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from taxel._base.arguments import callback, instance, number, several, shown, text, whole
from taxel._core import ProblemError
from taxel.encode import FA1, ChangeEvents, Encoder
from taxel.frames import Frames
from taxel.information.answers import Answer, Control, Point, is_told
from taxel.information.estimate import Estimate, estimate, zero_test
from taxel.information.keeping import Verdict, keeps
from taxel.information.nested import Nested, nested_predictions, training_curve
from taxel.information.rasters import event_grams, features, frame_grams
from taxel.information.sampling import (
    STEP_US,
    HeldValues,
    Spikes,
    checked_periods,
    contacts,
    finest_us,
    pictures_of,
    spikes_of,
)
from taxel.information.spiking import readout_responses
from taxel.information.trials import LabelledTrial
from taxel.information.wire_rate import kilobits_per_second
from taxel.spikes import to_ms, to_us

__all__ = ["CLASSIFIERS", "answer"]

#: Beside the discriminants of every answer, at the reference setting.
CLASSIFIERS = ("neighbours", "cone_r", "tempotron")
#: Numbers of neighbours that are tried.
NEIGHBOURS = (1, 3, 5, 9, 15)
#: Smoothings that are tried, in windows; the longest first.
SMOOTHINGS = (1.0, 0.3, 0.1, 0.03, 0.0)
#: From so many trials on their matrices are worth more than one thread.
_WORTH_THREADS = 1000
#: The steps of a default series of periods or windows.
_STEPS = (1, 2, 5)
#: Pictures are held against events where they fit in so many values.
_MOST_VALUES = 2**28


def answer(
    trials: Sequence[LabelledTrial],
    *,
    encoder: Encoder | None = None,
    window_ms: float | None = None,
    windows_ms: Sequence[float] | None = None,
    periods_ms: Sequence[float] | None = None,
    taxels: Sequence[int] | None = None,
    pools: Sequence[int] | None = None,
    taxels_at_ms: float | None = None,
    draws: int = 5,
    folds: int = 10,
    shuffles: int = 20,
    classifiers: Sequence[str] = ("neighbours",),
    seed: int = 0,
    progress: Callable[[str, int, int], object] | None = None,
) -> Answer:
    """Ask labelled trials how many bits their events hold about the labels, by period, time, taxels and cost.

    Parameters
    ----------
    trials : sequence of LabelledTrial
        Of one array.
    encoder : Encoder, optional
        `ChangeEvents` or `FA1`; its period is set. Left out: change events of one bit with the floor of `floor_of`.
    window_ms : float, ms, optional
        How far after the contact to look at most; needed where trials have no end. The shortest trial where left out.
    windows_ms, periods_ms : sequence of float, ms, optional
        Steps of 1, 2, 5 where they are left out: windows from a fortieth of the longest, periods from the finest that
        the recordings show, or a 500th of the window.
    taxels : sequence of int, optional
        Numbers of taxels that are drawn at random among those that ever send an event; 10, 30, 100, 300 where left out.
    pools : sequence of int, optional
        Taxels of so many by so many taken for one; 2, 4 and 7 where left out.
    taxels_at_ms : float, ms, optional
        The period at which taxels are taken away or pooled, one of those asked for; the finest where it is left out.
    draws : int, 1 or more
        Of sampling phases and of random taxels; answers are their means.
    folds : int, 2 or more
    shuffles : int, 1 or more
        Of the test against zero.
    classifiers : sequence of {"neighbours", "cone_r", "tempotron"}
        Beside the discriminants, at the full setting.
    seed : int, 0 or more
    progress : function of (what, done, all), optional
        What it raises ends the work.

    Returns
    -------
    Answer

    Raises
    ------
    ProblemError : as `taxel.information.folds`; a period finer than the recordings; trials of several arrays; no event
        in any trial
    """
    listed = [instance(f"trials[{k}]", one, LabelledTrial) for k, one in enumerate(several("trials", trials))]
    if progress is not None:
        callback("progress", progress)
    for name, value, least in (("draws", draws, 1), ("folds", folds, 2), ("shuffles", shuffles, 1), ("seed", seed, 0)):
        whole(name, value, least)
    also = [text("classifiers", one, CLASSIFIERS) for one in several("classifiers", classifiers)]
    asked = _Asked(listed, encoder, window_ms, int(draws), int(folds), int(seed), progress)
    asked.set_out(periods_ms, windows_ms, taxels, pools, taxels_at_ms, len(also), int(shuffles))
    # Threads that wait for each other over small matrices cost more than they bring, and very much on a busy machine.
    with threadpool_limits(1 if len(listed) < _WORTH_THREADS else None):
        return asked.answer(also, int(shuffles))


def floor_of(trials: Sequence[LabelledTrial]) -> float:
    """Return the change that counts where nobody says: 3 ticks, a step, else a 40th of the largest value."""
    first = trials[0].source
    if not isinstance(first, Frames):
        return 3.0 if first.intensity is not None else 0.5
    if first.unit == "ticks":
        return 3.0
    sources = {id(one.source): one.source for one in trials}.values()
    largest = max(float(np.abs(one.values).max(initial=0.0)) for one in sources if isinstance(one, Frames))
    if largest == 0:
        raise ProblemError("trials: every picture is 0")
    return float(f"{largest / 40:.2g}")


@dataclass(eq=False)
class _Asked:
    """Hold what is known of the trials before anything is answered."""

    trials: list[LabelledTrial]
    encoder: Encoder | None
    window_ms: float | None
    draws: int
    folds: int
    seed: int
    progress: Callable[[str, int, int], object] | None
    notes: list[str] = field(default_factory=list)
    done: int = 0
    steps: int = 1

    def __post_init__(self) -> None:
        from taxel.information.folds import folds  # noqa: PLC0415  the argument has its name

        if not self.trials:
            raise ProblemError("trials is []: must hold one at least")
        shape = self.trials[0].array.shape
        other = next((one for one in self.trials if one.array.shape != shape), None)
        if other is not None:
            sizes = " x ".join(map(str, other.array.shape)), " x ".join(map(str, shape))
            raise ProblemError(
                f"{other.name}: is of an array of {sizes[0]}, {self.trials[0].name} of {sizes[1]}: must all be of one"
            )
        self.labels = np.array([one.label for one in self.trials])
        groups = [one.group for one in self.trials]
        self.groups = np.array(groups) if any(groups) else None
        folds(self.labels, count=self.folds, groups=self.groups, seed=self.seed)
        if self.encoder is None:
            self.encoder = ChangeEvents(noise_floor=floor_of(self.trials))
        if not isinstance(self.encoder, ChangeEvents | FA1):
            raise ProblemError(f"encoder is {shown(self.encoder)}: must be ChangeEvents or FA1, one train a taxel")
        sources = {id(one.source): one.source for one in self.trials}
        held = {key: HeldValues(source) for key, source in sources.items()}
        self.held = [held[id(one.source)] for one in self.trials]
        self.finest = finest_us(list(sources.values()))
        if self.window_ms is None:
            endless = next((one for one in self.trials if one.stop_us is None), None)
            if endless is not None:
                raise ProblemError(f"{endless.name}: has no end; give window_ms, or every trial its stop_us")
            reach = np.inf
        else:
            reach = to_us(number("window_ms", self.window_ms))
            if not self.finest <= reach < 1e12:
                raise ProblemError(
                    f"window_ms is {shown(self.window_ms)}: must be {to_ms(self.finest):g} at least, and below 1e9"
                )
        self.contact = contacts(self.trials, self.held, self.encoder, self.finest, reach)
        if np.isnan(self.contact).all():
            lasts = max(int(np.ptp(one.source.t)) for one in self.trials if len(one.source))
            if lasts < STEP_US:
                raise ProblemError(
                    f"{self.trials[0].name}: its pictures all lie within {lasts} us, so they have no times; "
                    "give them some (taxel.Frames)"
                )
            raise ProblemError(f"trials: no event in any of them by {self.encoder!r}; a lower noise_floor may help")
        ends = np.array([np.inf if one.stop_us is None else one.stop_us for one in self.trials])
        self.ended = bool(np.isfinite(ends).all())
        lengths = (ends - self.contact)[~np.isnan(self.contact)]
        self.window_us = float(reach if np.isfinite(reach) else max(lengths.min(), self.finest))
        if np.isfinite(reach) and (lengths < self.window_us).any():
            short = int((lengths < self.window_us).sum())
            self.notes.append(
                f"{short} trials end before {to_ms(self.window_us):g} ms: what comes late may tell their length"
            )

    def set_out(
        self,
        periods_ms: Sequence[float] | None,
        windows_ms: Sequence[float] | None,
        taxels: Sequence[int] | None,
        pools: Sequence[int] | None,
        taxels_at_ms: float | None,
        classifiers: int,
        shuffles: int,
    ) -> None:
        """Choose the settings."""
        window = self.window_us
        if periods_ms is None:
            least = max(self.finest, window / 500)
            found = [p for p in _series(least, window / 5) if p >= least]
            self.periods = checked_periods([*([self.finest] if self.finest >= least else []), *found], self.finest)
            self.periods = self.periods[:7]
        else:
            given = [to_us(number("periods_ms", p)) for p in several("periods_ms", periods_ms)]
            if any(not 0 < p <= window or abs(p - round(p)) > 1e-6 for p in given):
                raise ProblemError(f"periods_ms is {shown(periods_ms)}: must be whole us, up to {to_ms(window):g} ms")
            self.periods = checked_periods([round(p) for p in given], self.finest)
        if windows_ms is None:
            self.windows = [*[float(w) for w in _series(max(window / 40, self.finest), window * 0.99)], window]
        else:
            wanted = sorted(to_us(number("windows_ms", w)) for w in several("windows_ms", windows_ms))
            if any(not self.finest <= w <= window for w in wanted):
                raise ProblemError(
                    f"windows_ms is {shown(windows_ms)}: must lie in {to_ms(self.finest):g} to {to_ms(window):g} ms"
                )
            self.windows = sorted({*wanted, window})
        self.taxels_at = self.periods[0]
        if taxels_at_ms is not None:
            at = to_us(number("taxels_at_ms", taxels_at_ms))
            self.taxels_at = next((p for p in self.periods if p == at), 0)
            if not self.taxels_at:
                listed = ", ".join(f"{to_ms(p):g}" for p in self.periods)
                raise ProblemError(f"taxels_at_ms is {shown(taxels_at_ms)}: must be one of the periods {listed} ms")
        self.active = np.unique(self.spikes(self.taxels_at, 0).taxel)
        there = len(self.active)
        numbers = [whole("taxels", n, 1) for n in several("taxels", (10, 30, 100, 300) if taxels is None else taxels)]
        if taxels is not None and any(n > there for n in numbers):
            raise ProblemError(f"taxels is {shown(taxels)}: {there} of the array's ever send an event")
        self.random_taxels = [n for n in numbers if n < there]
        sides = [whole("pools", n, 2) for n in several("pools", (2, 4, 7) if pools is None else pools)]
        rows, columns = self.trials[0].array.shape
        if pools is not None and any(n > max(rows, columns) for n in sides):
            raise ProblemError(f"pools is {shown(pools)}: the array is {rows} x {columns}")
        self.pools = [n for n in sides if n <= max(rows, columns)]
        self.columns = self._parameters()
        settings = len(self.random_taxels) + len(self.pools)
        self.steps = self.draws * (len(self.periods) * (2 + len(self.columns)) + settings) + shuffles + classifiers + 8

    def tell(self, what: str, steps: int = 1) -> None:
        self.done += steps
        if self.progress is not None:
            self.progress(what, min(self.done, self.steps), self.steps)

    def spikes(self, period: int, draw: int, pool: int = 1) -> Spikes:
        assert self.encoder is not None  # set where it was left out
        return spikes_of(
            self.trials,
            self.held,
            self.encoder,
            period_us=period,
            contact_us=self.contact,
            window_us=self.window_us,
            random=np.random.default_rng([self.seed, draw, period]),
            pool=pool,
        )

    def nested(
        self, grams: list[NDArray[np.float64]], sizes: list[int], y: Any = None, draw: int = 0, **ways: Any
    ) -> Nested:
        labels = self.labels if y is None else y
        return nested_predictions(
            grams, sizes, labels, groups=self.groups, count=self.folds, seed=self.seed + draw, **ways
        )

    def estimate(self, responses: Any, labels: Any = None) -> Estimate:
        truth = self.labels if labels is None else labels
        return estimate(truth, responses, groups=self.groups, seed=self.seed)

    def grams(self, spikes: Spikes, windows: Sequence[float]) -> list[list[NDArray[np.float64]]]:
        """Return by window the matrices of all smoothings that a period can tell apart."""
        taus = [to_ms(share * self.window_us) for share in SMOOTHINGS]
        taus = [tau for tau in taus if tau == 0 or to_us(tau) > spikes.period_us / 2]
        return [list(one) for one in zip(*(event_grams(spikes, windows, tau) for tau in taus), strict=True)]

    def answer(self, classifiers: list[str], shuffles: int) -> Answer:
        """Answer all."""
        values = isinstance(self.encoder, ChangeEvents) and self.encoder.bits > 1
        said: dict[tuple[int, float], list[Any]] = {}
        about: dict[tuple[int, float], list[tuple[float, float, float]]] = {}
        frames: dict[int, list[Any]] = {}
        by_column: dict[tuple[str, int], list[Any]] = {}
        reference: tuple[Spikes, list[NDArray[np.float64]], list[int], Nested] | None = None
        missing: set[str] = set()
        for period in self.periods:
            for draw in range(self.draws):
                self.tell(f"{to_ms(period):g} ms, draw {draw + 1}")
                spikes = self.spikes(period, draw)
                for window, grams in zip(self.windows, self.grams(spikes, self.windows), strict=True):
                    sizes = [features(spikes, window)] * len(grams)
                    found = self.nested(grams, sizes, draw=draw)
                    said.setdefault((period, window), []).append(found.responses)
                    about.setdefault((period, window), []).append(_about(spikes, window, values))
                    missing |= {f"fold {fold + 1} has no training trial of {name}" for fold, name in found.missing}
                    if reference is None and window == self.windows[-1]:
                        reference = spikes, grams, sizes, found
                for name, column in self.columns.items():
                    self.tell(f"{to_ms(period):g} ms, {name}")
                    by_column.setdefault((name, period), []).append(self.nested(grams, sizes, column, draw).responses)
                self.tell(f"{to_ms(period):g} ms, pictures")
                picture = self._pictures(spikes)
                if picture is not None:
                    frames.setdefault(period, []).append(self.nested(*picture, draw=draw).responses)
        assert reference is not None  # there are a period, a draw and a window at least
        estimates = {key: self.estimate(responses) for key, responses in said.items()}
        everything = len(self.active)
        points = []
        for (period, window), one in estimates.items():
            verdict = None
            if period != self.periods[0]:
                verdict = keeps(one, estimates[self.periods[0], window], groups=self.groups)
            points.append(_point(period, window, everything, "all", one, about[period, window], verdict))
        full = next(p for p in points if p.verdict is None and p.window_ms == to_ms(self.windows[-1]))
        spikes, grams, sizes, first = reference
        self.tell("labels shuffled", 0)
        zero = zero_test(
            lambda labels: self._shuffled(grams, sizes, labels),
            self.labels,
            full.found.bits,
            groups=self.groups,
            shuffles=shuffles,
            seed=self.seed,
        )
        self._warn(missing)
        taxels = self._by_taxels(full, values)
        if not is_told(full.found, zero):
            points = [_with_nothing(p) if p.window_ms == full.window_ms else p for p in points]
            taxels = tuple(map(_with_nothing, taxels))
        return Answer(
            labels={str(name): int(n) for name, n in zip(*np.unique(self.labels, return_counts=True), strict=True)},
            groups=0 if self.groups is None else len(np.unique(self.groups)),
            encoder=repr(self.encoder),
            full=full,
            points=tuple(points),
            taxels=taxels,
            frames={to_ms(period): self.estimate(responses) for period, responses in frames.items()},
            controls=self._controls(),
            zero=zero,
            training=self._training(grams, sizes, first),
            classifiers={name: self._classified(name, spikes, grams, sizes) for name in classifiers},
            parameters=self._columns_answered(by_column, about, everything),
            notes=tuple(self.notes),
            draws=self.draws,
            seed=self.seed,
        )

    def _shuffled(self, grams: list[NDArray[np.float64]], sizes: list[int], labels: Any) -> NDArray[np.generic]:
        self.tell("labels shuffled")
        return self.nested(grams, sizes, labels).responses

    def _pictures(self, spikes: Spikes) -> tuple[list[NDArray[np.float64]], list[int]] | None:
        """Return the pictures' inner products to the whole window; None without values, or where they are too many."""
        bins = int(spikes.bins_to(self.window_us).max(initial=0))
        active = len(np.unique(spikes.taxel))
        if not all(held.has_values for held in self.held) or not 0 < bins * active * spikes.trials <= _MOST_VALUES:
            return None
        values = pictures_of(self.trials, self.held, spikes, self.contact, bins)
        return frame_grams(values, spikes, [self.window_us]), [bins * active]

    def _by_taxels(self, full: Point, values: bool) -> tuple[Point, ...]:
        """Answer by number of taxels."""
        period = self.taxels_at
        window = self.window_us
        found = []
        for kind, size in [*(("random", n) for n in self.random_taxels), *(("pooled", n) for n in self.pools)]:
            said, about, taxels = [], [], size
            for draw in range(self.draws):
                self.tell(f"{size} taxels at random" if kind == "random" else f"taxels of {size} x {size}")
                if kind == "random":
                    random = np.random.default_rng([self.seed, draw, size, 1])
                    chosen = np.sort(random.choice(self.active, size, replace=False))
                    spikes = self.spikes(period, draw).of(chosen)
                else:
                    spikes = self.spikes(period, draw, size)
                    taxels = spikes.taxels
                grams = self.grams(spikes, [window])[0]
                said.append(self.nested(grams, [features(spikes, window)] * len(grams), draw=draw).responses)
                about.append(_about(spikes, window, values))
            one = self.estimate(said)
            found.append(_point(period, window, taxels, kind, one, about, keeps(one, full.found, groups=self.groups)))
        return tuple(found)

    def _controls(self) -> tuple[Control, ...]:
        self.tell("controls")
        finest, window = self.periods[0], self.window_us
        spikes = self.spikes(finest, 0)
        count = spikes.counts(window).astype(np.float64)
        found = [self._before()]
        last = np.zeros(len(self.trials))
        np.maximum.at(last, spikes.trial, to_ms(spikes.first_us[spikes.trial] + spikes.bin * float(finest)))
        if self.ended:
            length = to_ms(spikes.length_us)
            found.append(Control("length", self._scalar(length), "from contact to the trial's end"))
        else:
            found.append(Control("length", self._scalar(last), "from contact to the last event in the window"))
        found.append(Control("event count", self._scalar(count), "events to the whole window"))
        if all(isinstance(one.source, Frames) for one in self.trials):
            start = [
                held.at(np.array([t.start_us - finest]))[0] for held, t in zip(self.held, self.trials, strict=True)
            ]
            first = np.array(start, np.float64)
            if np.ptp(first, axis=0).any():
                gram = [first @ first.T]
                bits = self.estimate(self.nested(gram, [first.shape[1]]).responses)
                found.append(Control("first picture", bits, "the pressure itself before the start, no change since"))
        return tuple(found)

    def _scalar(self, value: NDArray[np.float64]) -> Estimate | None:
        value = np.nan_to_num(value)
        if np.ptp(value) == 0:
            return estimate(self.labels, np.full(len(value), self.labels[0]), groups=self.groups, seed=self.seed)
        unit = ((value - value.mean()) / value.std())[:, None]
        return self.estimate(self.nested([unit @ unit.T], [1]).responses)

    def _before(self) -> Control:
        """Ask the stretch before the contact: what it tells was there before the touch."""
        assert self.encoder is not None  # set where it was left out
        begin = np.array([float(one.source.t.min()) for one in self.trials])
        for source in {id(one.source) for one in self.trials}:
            mine = [k for k, one in enumerate(self.trials) if id(one.source) == source]
            mine.sort(key=lambda k: self.trials[k].start_us)
            for before, k in pairwise(mine):
                one = self.trials[before]
                end = self.contact[before] + self.window_us if one.stop_us is None else one.stop_us
                begin[k] = max(begin[k], np.nan_to_num(end, nan=one.start_us))
        room = np.nan_to_num(self.contact - begin, nan=0.0)
        length = min(self.window_us, float(np.quantile(room, 0.1)))
        if length < 5 * self.finest or (self.contact - begin >= length).sum() < len(self.trials) * 0.5:
            self.notes.append(
                "nothing is recorded before the contacts: what was there before the touch cannot be told apart"
            )
            return Control("before contact", None, "none recorded")
        moved = [
            replace(
                one, start_us=int(c - length) if r >= length else one.start_us, stop_us=int(c) if r >= length else None
            )
            if not np.isnan(c)
            else one
            for one, c, r in zip(self.trials, self.contact, room, strict=True)
        ]
        at = np.where(room >= length, self.contact - length, np.nan)
        period = max(self.periods[0], self.finest)
        random = np.random.default_rng([self.seed, 0, period, 2])
        spikes = spikes_of(
            moved, self.held, self.encoder, period_us=period, contact_us=at, window_us=length, random=random
        )
        grams = self.grams(spikes, [length])[0]
        found = self.estimate(self.nested(grams, [features(spikes, length)] * len(grams)).responses)
        without = int((room < length).sum())
        about = f"{to_ms(length):g} ms before it" + (
            f", {without} of {len(room)} have less and count as silent" if without else ""
        )
        return Control("before contact", found, about)

    def _training(
        self, grams: list[NDArray[np.float64]], sizes: list[int], first: Nested
    ) -> tuple[tuple[int, float], ...]:
        self.tell("by number of training trials")
        least = int(np.unique(self.labels, return_counts=True)[1].min())
        most = least - -(-least // self.folds)
        steps = sorted({max(2, most // k) for k in (12, 6, 3, 2)} - {most})
        steps = [n for n in steps if n < most]
        said = training_curve(grams, sizes, self.labels, first, steps, seed=self.seed)
        curve = [(n, estimate(self.labels, one, redraws=2).bits) for n, one in zip(steps, said, strict=True)]
        return (*curve, (most, estimate(self.labels, first.responses, redraws=2).bits))

    def _classified(self, name: str, spikes: Spikes, grams: list[NDArray[np.float64]], sizes: list[int]) -> Estimate:
        self.tell(name)
        if name == "neighbours":
            return self.estimate(self.nested(grams, sizes, neighbours=NEIGHBOURS).responses)
        fold = self.nested([grams[-1]], [sizes[-1]], ridges=[1.0]).folds
        return self.estimate(readout_responses(name, spikes, self.window_us, self.labels, fold))

    def _parameters(self) -> dict[str, NDArray[np.generic]]:
        """Return the columns that can be asked for like labels; the others are named in the notes."""
        from taxel.information.folds import folds  # noqa: PLC0415  the argument has its name

        found = {}
        for name in self.trials[0].parameters:
            column = np.array([one.parameters.get(name, "") for one in self.trials])
            if (column == self.labels).all():
                self.notes.append(f"parameter {name} is left out: it says what the label says")
                continue
            if (column == "").any():
                self.notes.append(f"parameter {name} is left out: some trials have none")
                continue
            try:
                folds(column, count=self.folds, groups=self.groups, seed=self.seed)
            except ProblemError as error:
                self.notes.append(f"parameter {name} is left out: {error}")
                continue
            found[name] = column
        return found

    def _columns_answered(
        self, by_column: dict[tuple[str, int], list[Any]], about: dict[Any, Any], everything: int
    ) -> dict[str, tuple[Point, ...]]:
        found: dict[str, list[Point]] = {}
        for (name, period), said in by_column.items():
            one = self.estimate(said, self.columns[name])
            found.setdefault(name, []).append(
                _point(period, self.windows[-1], everything, "all", one, about[period, self.windows[-1]], None)
            )
        return {name: tuple(points) for name, points in found.items()}

    def _warn(self, missing: set[str]) -> None:
        self.notes += sorted(missing)[:3]
        if self.groups is None:
            self.notes.append(
                "no groups are named: what trials of one person, session or pose share counts as the label's"
            )
        runs = 1 + int(np.count_nonzero(self.labels[1:] != self.labels[:-1]))
        # Recordings of a trial each may stand in any order.
        ordered = len({id(one.source) for one in self.trials}) < len(self.trials)
        if ordered and runs == len(np.unique(self.labels)) and len(self.labels) > 2 * runs:
            self.notes.append("each label's trials lie together: a drift of the sensor would count as the label's")
        if not self.ended:
            self.notes.append("trials have no end of their own: how long a touch lasts is known within the window only")


def _about(spikes: Spikes, window: float, values: bool) -> tuple[float, float, float]:
    counts = spikes.counts(window)
    return float(counts.mean()), float(np.mean(counts == 0)), kilobits_per_second(spikes, window, values=values)


def _point(
    period: int, window: float, taxels: int, kind: str, found: Estimate, about: list[Any], verdict: Verdict | None
) -> Point:
    events, silent, kbps = np.mean(about, axis=0)
    return Point(to_ms(period), to_ms(window), taxels, kind, found, float(events), float(silent), float(kbps), verdict)


def _with_nothing(point: Point) -> Point:
    """Return a setting that is held against one whose bits are not told from nothing."""
    return point if point.verdict is None else replace(point, verdict=replace(point.verdict, says="nothing"))


def _series(least: float, most: float) -> list[int]:
    """Return whole us in steps of 1, 2, 5 within limits."""
    found = [step * 10**power for power in range(10) for step in _STEPS]
    return [one for one in found if least <= one <= most]
