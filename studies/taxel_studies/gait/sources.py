"""The recordings of the study: where each lies, what its truth can show, and its pieces as spikes."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel import ProblemError
from taxel.array import Array
from taxel.encode import Encoder
from taxel.frames import Frames
from taxel.spikes import to_ms
from taxel_studies.datasets import DataSet, Trial, data_set, plate
from taxel_studies.datasets import files as files_of
from taxel_studies.datasets import trials as trials_of
from taxel_studies.gait import insole
from taxel_studies.gait.pieces import Piece

#: The sensors under the heel of gaitpdb, and at which share of their peak of a step the heel is off.
HEEL, HEEL_OFF = slice(3), 0.05
#: Silence before each footfall of the plate, ms: random, so that its length does not reveal when events come.
SILENCE_MS = (300, 900)
#: A footfall's piece ends so long after foot-off, ms; by then the encoder's latency and the delay are over.
TAIL_MS = 100
#: How long a row of footfalls stays silent at its end, ms.
END_MS = 500


@dataclass(frozen=True)
class Source:
    """Describe one set of recordings.

    Attributes
    ----------
    folder : str
        Its name under the study's data folder.
    events : tuple of str
    truth, shows : str
        Where the truth comes from; what it can and cannot show.
    by_threshold : tuple of str
        The events whose labels are thresholds of a sum over the sensors.
    by_minute : bool
        Whether it has minutes of walking, not footfalls.
    data : str
        The data set, if it has another name.
    """

    name: str
    folder: str
    title: str
    events: tuple[str, ...]
    truth: str
    shows: str
    by_threshold: tuple[str, ...] = ()
    by_minute: bool = True
    data: str = ""


SOURCES = {
    source.name: source
    for source in (
        Source(
            "plate",
            "plate",
            "Footfalls on a plate, cut to an insole of 92 taxels",
            ("contact", "heel_off", "foot_off"),
            "The full plate itself: contact and foot-off are its first and last loaded frame (2 ms), heel-off the fall "
            "of the heel region below 5 % of its own peak.",
            "Whether 92 taxels without a view of the future find what the whole plate shows in hindsight. Not the "
            "ground: the plate starts itself, so contact can never be early, and a sum over all taxels is near perfect "
            "by construction. The placement looks at the first loaded frame and at the person's other footfalls.",
            ("heel_off",),
            by_minute=False,
        ),
        Source(
            "gaitpdb",
            "insole_gaitpdb",
            "Continuous walking, 8 force sensors a foot (PhysioNet gaitpdb)",
            ("contact", "foot_off"),
            "The foot's own total force: contact above 50 N, foot-off below 25 N (100 Hz).",
            "Contact and off in real walking with turns, healthy and sick, to within a sample of 10 ms. Not the true "
            "time at the ground. The truth is a threshold on the sum of the inputs, so a counter or a sum can be near "
            "perfect.",
            ("contact", "foot_off"),
        ),
        Source(
            "gaitpdb by speed",
            "insole_gaitpdb",
            "The same walks in three classes of speed, eight people each (PhysioNet gaitpdb)",
            ("contact", "heel_off", "foot_off"),
            "As gaitpdb; heel-off, as we define it, is the fall of sensors 1 to 3 below 5 % of their peak of a step.",
            "Whether one neuron serves people of about one speed (6.5.3 has one person at three speeds).",
            data="gaitpdb",
        ),
        Source(
            "gaitndd",
            "insole_gaitndd",
            "Five minutes of walking, one channel, left foot (PhysioNet gaitndd)",
            ("contact", "foot_off"),
            "Step times of the data's authors, derived from this very channel (300 Hz).",
            "Timing against step times that somebody else derived; not against the ground, and not independent of the "
            "channel. Turns and long pauses are in it.",
        ),
    )
}


def present(data: Path, wanted: Sequence[str]) -> dict[str, Path]:
    """Return those of the wanted sources of which a folder holds files, each with its own folder.

    Raises
    ------
    ProblemError : a source that is none
    """
    if unknown := [name for name in wanted if name not in SOURCES]:
        raise ProblemError(f"sources is {unknown[0]!r}: must be one of {', '.join(map(repr, SOURCES))}")
    folders = {name: data / SOURCES[name].folder for name in wanted}
    return {name: at for name, at in folders.items() if at.is_dir() and files_of(_data_set(name), at)}


@lru_cache(maxsize=8)
def _trials(folder: Path, name: str) -> tuple[Trial, ...]:
    """Read all of a source's files, once.

    Raises
    ------
    FormatError : a file that breaks its format (names it)
    """
    return tuple(_boxed(trial) if name == "plate" else trial for trial in trials_of(_data_set(name), folder))


def _data_set(name: str) -> DataSet:
    return data_set(SOURCES[name].data or name)


def fingerprint(folder: Path, name: str) -> str:
    """Return a short digest of a source's files: names and contents."""
    digest = hashlib.sha256()
    beside = [f for f in sorted(folder.iterdir()) if f.suffix in {".csv", ".let", ".ts"}]
    for file in [*files_of(_data_set(name), folder), *beside]:
        digest.update(file.name.encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()[:16]


class Encoded(NamedTuple):
    """The pieces of a source, and what the encoder costs."""

    pieces: list[Piece]
    latency_ms: float
    levels: int
    """How many levels a sensor has, so that trains can be told apart; 1 where the encoder has none."""


def encoded(folder: Path, name: str, encoder: Mapping[str, Any]) -> Encoded:
    """Return a source's pieces, encoded; they stay in memory, as many fits need the same.

    Parameters
    ----------
    folder : Path
    name : str
        Of `SOURCES`.
    encoder : mapping
        Its `name` and parameters.
    """
    return _encoded(folder, name, json.dumps(encoder, sort_keys=True))


@lru_cache(maxsize=12)
def _encoded(folder: Path, name: str, encoder: str) -> Encoded:
    built = Encoder.from_json(encoder)
    pieces = (_footfalls if name == "plate" else _walks)(folder, name, built)
    return Encoded(pieces, float(built.latency_ms), len(json.loads(encoder).get("levels", [0])))


def _walks(folder: Path, name: str, encoder: Encoder) -> list[Piece]:
    pieces = []
    for trial in _trials(folder, name):
        if not any(len(times) for times in trial.truth.values()):
            continue
        start, stop = (to_ms(float(t)) for t in (trial.frames.t[0], trial.frames.t[-1]))
        spikes = encoder.encode(trial.frames).split_by_sign()
        spikes = _moved(spikes, -start, stop - start)
        truth = dict(trial.truth) | ({"heel_off": _heel_offs(trial)} if "heel_off" in SOURCES[name].events else {})
        pieces.append(
            Piece(
                name=trial.name,
                person=trial.person,
                group=trial.group,
                spikes=spikes,
                truth={e: to_ms(times) - start for e, times in truth.items()},
                scored=(to_ms(trial.scored[0]) - start, to_ms(trial.scored[1]) - start),
                load=(to_ms(trial.frames.t) - start, trial.series["total"]) if trial.series else Piece.load,
                speed_m_s=float(trial.about.get("speed_m_s", np.nan)),
            )
        )
    return pieces


def _heel_offs(trial: Trial) -> NDArray[np.int64]:
    """Return when the heel's load falls for good below a share of its peak, in each step where it does, us."""
    t, load = trial.frames.t, trial.frames.values[:, 0, HEEL].sum(axis=1)
    times = []
    for begin, end in zip(trial.truth["contact"], trial.truth["foot_off"], strict=True):
        first, stop = np.searchsorted(t, [begin, end])
        step = load[first:stop]
        last = first + int(np.flatnonzero(step >= HEEL_OFF * step.max())[-1]) + 1
        if last < stop:
            times.append(t[last])
    return np.array(times, np.int64)


def _footfalls(folder: Path, name: str, encoder: Encoder) -> list[Piece]:
    all_cuts = cuts(folder, name)
    pieces = []
    for person in dict.fromkeys(c.person for c in all_cuts):
        pieces += _row([c for c in all_cuts if c.person == person], encoder)
    return pieces


def _row(cuts: list[Trial], encoder: Encoder) -> list[Piece]:
    """Encode a person's footfalls as one row with random silences, and take it apart again into pieces."""
    rng = np.random.default_rng([int.from_bytes(hashlib.sha256(cuts[0].person.encode()).digest()[:4])])
    order = rng.permutation(len(cuts))
    step = plate.FRAME_US // 1000
    silences = rng.integers(SILENCE_MS[0] // step, SILENCE_MS[1] // step + 1, len(cuts)) * step
    lengths = np.array([(len(c.frames) - 1) * step for c in cuts])
    begins = np.cumsum(silences + np.concatenate([[0], lengths[order][:-1]]))
    values = np.zeros(((int(begins[-1] + lengths[order[-1]]) + END_MS) // step, insole.TAXELS), np.float32)
    for at, k in zip(begins, order, strict=True):
        values[at // step : at // step + len(cuts[k].frames)] = cuts[k].frames.values[:, 0]
    t = np.arange(len(values)) * plate.FRAME_US
    frames = Frames(values[:, None, :], t, unit="counts", array=Array(1, insole.TAXELS, name="insole"))
    spikes = encoder.encode(frames).split_by_sign()
    heel = values[:, insole.HEEL].sum(axis=1, dtype=np.float64)
    pieces = []
    for at, silence, k in zip(begins, silences, order, strict=True):
        start, stop = float(at - silence), float(at + lengths[k])
        if at > silences[0]:  # the first spikes still belong to the footfall before
            start += TAIL_MS
        stop += TAIL_MS
        rows = slice(int(start) // step, int(stop) // step)
        part = spikes.between(start, stop)
        pieces.append(
            Piece(
                name=cuts[k].name,
                person=cuts[k].person,
                group="healthy",
                spikes=_moved(part, -start, stop - start),
                truth={e: to_ms(times) + at - start for e, times in cuts[k].truth.items()},
                scored=(0.0, stop - start),
                load=(to_ms(t[rows]) - start, heel[rows]),
            )
        )
    return pieces


@lru_cache(maxsize=4)
def cuts(folder: Path, name: str) -> tuple[Trial, ...]:
    """Return every footfall as the insole measures it, once all footprints are known."""
    feet = _trials(folder, name)
    origins, prints = zip(*(insole.footprint(trial) for trial in feet), strict=True)
    footfalls = []
    for k, trial in enumerate(feet):
        others = [prints[n] for n, other in enumerate(feet) if n != k and other.person == trial.person]
        footfalls.append(replace(trial, frames=insole.cut(trial, origins[k], insole.placement(others))))
    return tuple(footfalls)


def _boxed(trial: Trial) -> Trial:
    """Return a footfall without the plate around it: the frames of all people together have to fit in memory."""
    loaded = np.any(trial.frames.values, axis=0)
    rows, columns = np.flatnonzero(np.any(loaded, axis=1)), np.flatnonzero(np.any(loaded, axis=0))
    y, x = slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)
    return replace(trial, frames=trial.frames.region(x, y))


def _moved(spikes: Any, by: float, stop: float) -> Any:
    return type(spikes)(np.clip(spikes.times + by, 0.0, stop), spikes.offsets, 0.0, stop)
