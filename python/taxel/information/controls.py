"""Controls: how many bits about the labels come from something else than the pattern of events."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from taxel.frames import Frames
from taxel.information.answers import Control
from taxel.information.estimate import Estimate, estimate
from taxel.information.nested import Matrices
from taxel.information.question import Question
from taxel.information.sampling import (
    spikes_of,
)
from taxel.spikes import to_ms

__all__ = ["controls"]


def controls(question: Question) -> tuple[Control, ...]:
    """Return the bits of the stretch before the contact, the length, the count of events and the first frame."""
    finest, window = question.periods[0], question.window_us
    spikes = question.spikes(finest, 0)
    count = spikes.counts(window).astype(np.float64)
    results = [_before(question)]
    last = np.zeros(len(question.trials))
    np.maximum.at(last, spikes.trial, to_ms(spikes.first_us[spikes.trial] + spikes.bin * float(finest)))
    if question.ended:
        length = to_ms(spikes.length_us)
        results.append(Control("length", _scalar(question, length), "from contact to the trial's end"))
    else:
        results.append(Control("length", _scalar(question, last), "from contact to the last event in the window"))
    results.append(Control("event count", _scalar(question, count), "number of events in the whole window"))
    if all(isinstance(trial.source, Frames) for trial in question.trials):
        start = [
            held.at(np.array([t.start_us - finest]))[0] for held, t in zip(question.held, question.trials, strict=True)
        ]
        first = np.array(start, np.float64)
        if np.ptp(first, axis=0).any():
            gram = Matrices([first @ first.T], [first.shape[1]])
            bits = question.estimate(question.nested(gram).responses)
            results.append(Control("first frame", bits, "the pressure before the start, without later changes"))
    return tuple(results)


def _scalar(question: Question, value: NDArray[np.float64]) -> Estimate | None:
    value = np.nan_to_num(value)
    if np.ptp(value) == 0:
        return estimate(
            question.labels, np.full(len(value), question.labels[0]), groups=question.groups, seed=question.seed
        )
    unit = ((value - value.mean()) / value.std())[:, None]
    return question.estimate(question.nested(Matrices([unit @ unit.T], [1])).responses)


def _before(question: Question) -> Control:
    """Return the bits of the stretch before the contact, which the touch cannot have caused."""
    assert question.encoder is not None  # the question has set the default
    begin = np.array([float(trial.source.t.min()) for trial in question.trials])
    for source in {id(trial.source) for trial in question.trials}:
        neighbours = [k for k, trial in enumerate(question.trials) if id(trial.source) == source]
        neighbours.sort(key=lambda k: question.trials[k].start_us)
        for before, k in pairwise(neighbours):
            trial = question.trials[before]
            end = question.contact[before] + question.window_us if trial.stop_us is None else trial.stop_us
            begin[k] = max(begin[k], np.nan_to_num(end, nan=trial.start_us))
    room = np.nan_to_num(question.contact - begin, nan=0.0)
    length = min(question.window_us, float(np.quantile(room, 0.1)))
    if length < 5 * question.finest or (question.contact - begin >= length).sum() < len(question.trials) * 0.5:
        question.notes.append(
            "nothing is recorded before the contacts: information from before the touch cannot be separated"
        )
        return Control("before contact", None, "none recorded")
    moved = [
        replace(
            trial, start_us=int(c - length) if r >= length else trial.start_us, stop_us=int(c) if r >= length else None
        )
        if not np.isnan(c)
        else trial
        for trial, c, r in zip(question.trials, question.contact, room, strict=True)
    ]
    at = np.where(room >= length, question.contact - length, np.nan)
    period = max(question.periods[0], question.finest)
    random = np.random.default_rng([question.seed, 0, period, 2])
    spikes = spikes_of(
        moved, question.held, question.encoder, period_us=period, contact_us=at, window_us=length, random=random
    )
    estimate = question.estimate(question.nested(question.matrices(spikes, [length])[0]).responses)
    without = int((room < length).sum())
    about = f"{to_ms(length):g} ms before the contact" + (
        f"; {without} of {len(room)} trials have less time before it and count as silent" if without else ""
    )
    return Control("before contact", estimate, about)
