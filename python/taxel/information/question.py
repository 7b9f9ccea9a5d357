"""The settings that an analysis compares, and the labels, contacts and windows of its trials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from taxel._base.arguments import instance, integer, number, several, shown
from taxel._base.errors import refused
from taxel._base.messages import are, counted
from taxel._core import ProblemError
from taxel.encode import ChangeEvents
from taxel.frames import Frames
from taxel.information.estimate import Estimate, estimate
from taxel.information.folds import Split, split
from taxel.information.folds import folds as stratified
from taxel.information.nested import Matrices, Nested, predictions
from taxel.information.rasters import event_grams, features
from taxel.information.sampling import (
    STEP_US,
    HeldValues,
    SampledEvents,
    checked_periods,
    contacts,
    finest_us,
    spikes_of,
)
from taxel.information.trials import LabelledTrial
from taxel.spikes import to_ms, to_us

__all__ = ["Question"]

#: Smoothings that are tried, in windows; the longest first.
SMOOTHINGS = (1.0, 0.3, 0.1, 0.03, 0.0)
#: The steps of a default series of periods or windows.
_STEPS = (1, 2, 5)


@dataclass(eq=False)
class Question:
    """Labelled trials, and the settings at which their information is estimated."""

    trials: list[LabelledTrial]
    encoder: ChangeEvents | None
    window_ms: float | None
    draws: int
    folds: int
    seed: int
    notes: list[str] = field(default_factory=list)
    _splits: dict[int, Split] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        if not self.trials:
            raise refused("trials", " is []: must contain at least one")
        shape = self.trials[0].array.shape
        differing = next((trial for trial in self.trials if trial.array.shape != shape), None)
        if differing is not None:
            sizes = " x ".join(map(str, differing.array.shape)), " x ".join(map(str, shape))
            raise ProblemError(
                f"{differing.name}: the array has {sizes[0]} taxels, but that of {self.trials[0].name} has "
                f"{sizes[1]}: all arrays must have the same size"
            )
        self.labels = np.array([trial.label for trial in self.trials])
        groups = [trial.group for trial in self.trials]
        self.groups = np.array(groups) if any(groups) else None
        stratified(self.labels, count=self.folds, groups=self.groups, seed=self.seed)
        if self.encoder is None:
            self.encoder = ChangeEvents(noise_floor=floor_of(self.trials))
        instance("encoder", self.encoder, ChangeEvents)
        sources = {id(trial.source): trial.source for trial in self.trials}
        held = {key: HeldValues(source) for key, source in sources.items()}
        self.held = [held[id(trial.source)] for trial in self.trials]
        self.finest = finest_us(list(sources.values()))
        if self.window_ms is None:
            endless = next((trial for trial in self.trials if trial.stop_us is None), None)
            if endless is not None:
                raise ProblemError(
                    f"{endless.name}: the trial has no end; give window_ms, or a stop_us for every trial"
                )
            reach = np.inf
        else:
            reach = to_us(number("window_ms", self.window_ms))
            if not self.finest <= reach < 1e12:
                raise refused(
                    "window_ms", f" is {shown(self.window_ms)}: must be at least {to_ms(self.finest):g}, and below 1e9"
                )
        self.contact = contacts(self.trials, self.held, self.encoder, self.finest, reach)
        if np.isnan(self.contact).all():
            lasts = max(int(np.ptp(trial.source.t)) for trial in self.trials if len(trial.source))
            if lasts < STEP_US:
                raise ProblemError(
                    f"{self.trials[0].name}: all frames are within {lasts} us, so they have no times; to give "
                    "times, write rate_hz in a layout file, or set t of taxel.Frames"
                )
            raise refused("trials", f": {self.encoder!r} found no event in any trial; a lower noise_floor may help")
        ends = np.array([np.inf if trial.stop_us is None else trial.stop_us for trial in self.trials])
        self.ended = bool(np.isfinite(ends).all())
        lengths = (ends - self.contact)[~np.isnan(self.contact)]
        self.window_us = float(reach if np.isfinite(reach) else max(lengths.min(), self.finest))
        if np.isfinite(reach) and (lengths < self.window_us).any():
            short = int((lengths < self.window_us).sum())
            self.notes.append(
                f"{counted(short, 'trial')} {are(short)} shorter than the window of {to_ms(self.window_us):g} ms, so "
                "late events may show the length of a trial; with a shorter window they cannot"
            )

    def set_out(
        self,
        periods_ms: Sequence[float] | None,
        windows_ms: Sequence[float] | None,
        taxels: Sequence[int] | None,
    ) -> None:
        """Choose the settings."""
        window = self.window_us
        if periods_ms is None:
            least = max(self.finest, window / 500)
            coarser = [p for p in _series(least, window / 5) if p >= least]
            self.periods = checked_periods([*([self.finest] if self.finest >= least else []), *coarser], self.finest)
            self.periods = self.periods[:7]
        else:
            chosen = [to_us(number("periods_ms", p)) for p in several("periods_ms", periods_ms)]
            if any(not 0 < p <= window or abs(p - round(p)) > 1e-6 for p in chosen):
                raise refused("periods_ms", f" is {shown(periods_ms)}: must be whole us, up to {to_ms(window):g} ms")
            self.periods = checked_periods([round(p) for p in chosen], self.finest)
        if windows_ms is None:
            self.windows = [*[float(w) for w in _series(max(window / 40, self.finest), window * 0.99)], window]
        else:
            chosen_windows = sorted(to_us(number("windows_ms", w)) for w in several("windows_ms", windows_ms))
            if any(not self.finest <= w <= window for w in chosen_windows):
                raise refused(
                    "windows_ms",
                    f" is {shown(windows_ms)}: must be from {to_ms(self.finest):g} to {to_ms(window):g} ms",
                )
            self.windows = sorted({*chosen_windows, window})
        spikes = self.spikes(self.periods[0], 0)
        self.active = np.unique(spikes.taxel)
        there = len(self.active)
        numbers = [integer("taxels", n, 1) for n in several("taxels", (10, 30, 100, 300) if taxels is None else taxels)]
        if taxels is not None and any(n > there for n in numbers):
            raise refused(
                "taxels", f" is {shown(taxels)}: must be at most {there}, because only these taxels send events"
            )
        self.random_taxels = [n for n in numbers if n < there]

    def spikes(self, period: int, draw: int) -> SampledEvents:
        """Return the spikes of all trials at a period (us), in one draw of the sampling phases."""
        assert self.encoder is not None  # the constructor has set the default
        return spikes_of(
            self.trials,
            self.held,
            self.encoder,
            period_us=period,
            contact_us=self.contact,
            window_us=self.window_us,
            random=np.random.default_rng([self.seed, draw, period]),
        )

    def nested(self, matrices: Matrices, draw: int = 0) -> Nested:
        """Return the predictions for all trials in nested folds."""
        if draw not in self._splits:
            self._splits[draw] = self.split(self.labels, draw)
        return predictions(matrices, self._splits[draw])

    def split(self, labels: Any, draw: int = 0) -> Split:
        """Return labels dealt out to folds."""
        return split(labels, len(self.trials), count=self.folds, groups=self.groups, seed=self.seed + draw)

    def estimate(self, responses: Any) -> Estimate:
        """Return the information of responses (or draws of them) about the labels."""
        return estimate(self.labels, responses, groups=self.groups, seed=self.seed)

    def smoothings(self, period: int) -> list[float]:
        """Return the smoothings, ms, that a period (us) can tell apart."""
        taus = [to_ms(share * self.window_us) for share in SMOOTHINGS]
        return [tau for tau in taus if tau == 0 or to_us(tau) > period / 2]

    def matrices(self, spikes: SampledEvents, windows: Sequence[float]) -> list[Matrices]:
        """Return by window the matrices of all smoothings that a period can tell apart."""
        taus = self.smoothings(spikes.period_us)
        by_tau = [event_grams(spikes, windows, tau) for tau in taus]
        sizes = features(spikes, windows)
        return [Matrices(grams, [size] * len(taus)) for size, *grams in zip(sizes, *by_tau, strict=True)]


def floor_of(trials: Sequence[LabelledTrial]) -> float:
    """Return the default floor (the largest change without an event): 3 ticks, a step, else a 40th of the maximum."""
    first = trials[0].source
    if not isinstance(first, Frames):
        return 3.0 if first.intensity is not None else 0.5
    if first.unit == "ticks":
        return 3.0
    sources = {id(trial.source): trial.source for trial in trials}.values()
    largest = max(float(np.abs(source.values).max(initial=0.0)) for source in sources if isinstance(source, Frames))
    if largest == 0:
        raise refused("trials", ": all values are 0: must contain a touch")
    return float(f"{largest / 40:.2g}")


def _series(least: float, most: float) -> list[int]:
    """Return whole us in steps of 1, 2, 5 within limits."""
    steps = [step * 10**power for power in range(10) for step in _STEPS]
    return [step for step in steps if least <= step <= most]
