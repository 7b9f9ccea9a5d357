"""The recordings of the study: where each lies, what its truth can show, and its pieces as spikes."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel import FormatError, ProblemError
from taxel.array import Array
from taxel.encode import Encoder, RunningRange
from taxel.frames import Frames
from taxel.spikes import to_ms
from taxel_studies.datasets import Trial, data_set, plate
from taxel_studies.datasets import files as files_of
from taxel_studies.gait import insole
from taxel_studies.gait.pieces import Piece
from taxel_studies.gait.recipes import RULE_ENCODERS
from taxel_studies.study import refuse

__all__ = ["SOURCES", "Cut", "Source", "cuts", "encoded", "fingerprint", "readable", "readings", "unread"]

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
    sums : mapping from event to name of a sum
        Whose threshold the labels are.
    """

    name: str
    folder: str
    title: str
    events: tuple[str, ...]
    truth: str
    shows: str
    sums: Mapping[str, str]
    by_minute: bool = True


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
            {"heel_off": "heel"},
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
            {"contact": "total", "foot_off": "total"},
        ),
        Source(
            "gaitndd",
            "insole_gaitndd",
            "Five minutes of walking, one channel, left foot (PhysioNet gaitndd)",
            ("contact", "foot_off"),
            "Step times of the data's authors, derived from this very channel (300 Hz).",
            "Timing against step times that somebody else derived; not against the ground, and not independent of the "
            "channel. Turns and long pauses are in it.",
            {},
        ),
    )
}


def _present(folder: Path, wanted: Sequence[str]) -> dict[str, Path]:
    """Return those of the wanted sources of which a folder holds files, each with its own folder."""
    if not folder.is_dir():
        raise FileNotFoundError(2, "No such folder", str(folder))
    folders = {}
    for name in [one_of("sources", name, SOURCES) for name in wanted]:
        place = folder / SOURCES[name].folder
        if place.is_dir() and files_of(data_set(name), place):
            folders[name] = place
    return folders


@dataclass(frozen=True)
class Readings:
    """The trials that a source's files hold.

    Attributes
    ----------
    trials : tuple of Trial
    files : tuple of Path
        That were read.
    unread : mapping from file (its folder before it) to why it could not be read
    """

    trials: tuple[Trial, ...]
    files: tuple[Path, ...]
    unread: Mapping[str, str]


@lru_cache(maxsize=8)
def readings(folder: Path, name: str) -> Readings:
    """Read all of a source's files, once; what cannot be read, or is too short to be encoded, is left out."""
    source, least_s = data_set(name), _least_s(name)
    trials: list[Trial] = []
    read, unread = [], {}
    for file in files_of(source, folder):
        try:
            own = list(source.trials(file))
        except (FormatError, OSError) as error:
            why = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
            unread[f"{folder.name}/{file.name}"] = why.removeprefix(str(file)).removeprefix(file.name).lstrip(":, ")
        else:
            long = [trial for trial in own if _lasts_s(trial) >= least_s]
            short = [trial for trial in own if _lasts_s(trial) < least_s]
            for trial in short if long else short[:1]:
                which = trial.name if long else file.name
                unread[f"{folder.name}/{which}"] = (
                    f"lasts {_lasts_s(trial):g} s, and levels in shares of the running range want {least_s:g} s"
                )
            trials += map(_boxed, long) if name == "plate" else long
            if long:
                read.append(file)
    return Readings(tuple(trials), tuple(read), unread)


def _lasts_s(trial: Trial) -> float:
    return (int(trial.frames.t[-1]) - int(trial.frames.t[0])) / 1e6


def _least_s(name: str) -> float:
    """Return how long a source's recordings must last at least: until its encoders' running ranges are full, s."""
    ranges = [encoder["running_range"] for encoder in RULE_ENCODERS[name].values() if "running_range" in encoder]
    return max((one.get("window_s", RunningRange().window_s) for one in ranges), default=0.0)


def readable(folder: Path, wanted: Sequence[str]) -> dict[str, Path]:
    """Return those of the wanted sources of which a folder holds files that can be read, each with its own folder."""
    return {name: place for name, place in _present(folder, wanted).items() if readings(place, name).trials}


def unread(folder: Path, wanted: Sequence[str]) -> dict[str, str]:
    """Return which files of the wanted sources cannot be read, and why.

    Raises
    ------
    FormatError : none of the sources is there; or there are files, and none can be read (says why, of the first)
    ProblemError : a source that is none
    """
    here = _present(folder, wanted)
    if not here:
        names = ", ".join(SOURCES[name].folder for name in wanted)
        raise FormatError(f"{folder}: holds no recordings; must have one or more of the folders {names}")
    files = {file: why for name, place in here.items() for file, why in readings(place, name).unread.items()}
    refuse(files, strict=not readable(folder, wanted))
    return files


def fingerprint(folder: Path, name: str) -> str:
    """Return a short digest of a source's files that can be read: names, sizes and contents."""
    digest = hashlib.sha256()
    beside = [f for f in sorted(folder.iterdir()) if f.suffix in {".csv", ".let", ".ts"}]
    for file in [*readings(folder, name).files, *beside]:
        digest.update(file.name.encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()[:16]


@dataclass(frozen=True)
class Encoded:
    """Pieces of a source, and what the encoder costs.

    Attributes
    ----------
    pieces : dict of Piece by name
    latency_ms : float
    levels : int
        How many levels a sensor has, so that trains can be told apart; 1 where the encoder has none.
    """

    pieces: dict[str, Piece]
    latency_ms: float
    levels: int


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
    make = _footfalls if name == "plate" else _walks
    pieces = {p.name: p for p in make(folder, name, built)}
    return Encoded(pieces, float(built.latency_ms), len(json.loads(encoder).get("levels", [0])))


def _walks(folder: Path, name: str, encoder: Encoder) -> list[Piece]:
    pieces = []
    for trial in readings(folder, name).trials:
        if not any(len(times) for times in trial.truth.values()):
            continue
        start, stop = (to_ms(float(t)) for t in (trial.frames.t[0], trial.frames.t[-1]))
        spikes = encoder.encode(trial.frames).split_by_sign()
        spikes = _moved(spikes, -start, stop - start)
        pieces.append(
            Piece(
                name=trial.name,
                unit=trial.name,
                person=trial.person,
                group=trial.group,
                spikes=spikes,
                truth={e: to_ms(times) - start for e, times in trial.truth.items()},
                scored=(to_ms(trial.scored[0]) - start, to_ms(trial.scored[1]) - start),
                sums={name: (to_ms(trial.frames.t) - start, column) for name, column in trial.series.items()},
            )
        )
    return pieces


def _footfalls(folder: Path, name: str, encoder: Encoder) -> list[Piece]:
    all_cuts = cuts(folder, name)
    pieces = []
    for person in dict.fromkeys(c.person for c in all_cuts):
        pieces += _row([c for c in all_cuts if c.person == person], encoder)
    return pieces


def _row(cuts: list[Cut], encoder: Encoder) -> list[Piece]:
    """Encode a person's footfalls as one row with random silences, and take it apart again into pieces."""
    rng = np.random.default_rng([int.from_bytes(hashlib.sha256(cuts[0].person.encode()).digest()[:4])])
    order = rng.permutation(len(cuts))
    step = plate.FRAME_US // 1000
    silences = rng.integers(SILENCE_MS[0] // step, SILENCE_MS[1] // step + 1, len(cuts)) * step
    lengths = np.array([(len(c.values) - 1) * step for c in cuts])
    begins = np.cumsum(silences + np.concatenate([[0], lengths[order][:-1]]))
    values = np.zeros(((int(begins[-1] + lengths[order[-1]]) + END_MS) // step, insole.TAXELS), np.float32)
    for at, k in zip(begins, order, strict=True):
        values[at // step : at // step + len(cuts[k].values)] = cuts[k].values
    t = np.arange(len(values)) * plate.FRAME_US
    frames = Frames(values[:, None, :], t, unit="counts", array=Array(1, insole.TAXELS, name="insole"))
    spikes = encoder.encode(frames).split_by_sign()
    total, heel = values.sum(axis=1, dtype=np.float64), values[:, insole.HEEL].sum(axis=1, dtype=np.float64)
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
                unit=cuts[k].person,
                person=cuts[k].person,
                group="healthy",
                spikes=_moved(part, -start, stop - start),
                truth={e: times + at - start for e, times in cuts[k].truth.items()},
                scored=(0.0, stop - start),
                sums={"total": (to_ms(t[rows]) - start, total[rows]), "heel": (to_ms(t[rows]) - start, heel[rows])},
            )
        )
    return pieces


@dataclass(frozen=True)
class Cut:
    """One footfall as the insole measures it; truth in ms from its first frame."""

    name: str
    person: str
    values: NDArray[np.float32]
    truth: dict[str, NDArray[np.float64]]


@lru_cache(maxsize=4)
def cuts(folder: Path, name: str) -> tuple[Cut, ...]:
    """Cut every footfall, once all footprints are known."""
    feet = readings(folder, name).trials
    prints = [insole.footprint(t) for t in feet]
    footfalls = []
    for k, trial in enumerate(feet):
        others = [prints[n] for n, other in enumerate(feet) if n != k and other.person == trial.person]
        frames = insole.cut(trial, prints[k].origin_mm, insole.placement(others))
        truth = {e: to_ms(times) for e, times in trial.truth.items()}
        footfalls.append(Cut(trial.name, trial.person, frames.values[:, 0, :], truth))
    return tuple(footfalls)


def _boxed(trial: Trial) -> Trial:
    """Return a footfall without the plate around it: the frames of all people together have to fit in memory."""
    loaded = np.any(trial.frames.values, axis=0)
    rows, columns = np.flatnonzero(np.any(loaded, axis=1)), np.flatnonzero(np.any(loaded, axis=0))
    y, x = slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)
    return replace(trial, frames=trial.frames.region(x, y))


def _moved(spikes: Any, by: float, stop: float) -> Any:
    return type(spikes)(np.clip(spikes.times + by, 0.0, stop), spikes.offsets, 0.0, stop)


def one_of(name: str, value: object, allowed: Collection[str]) -> str:
    """Return a word of a closed list.

    Raises
    ------
    ProblemError : any other value (names the parameter and the list)
    """
    if not isinstance(value, str) or value not in allowed:
        raise ProblemError(f"{name} is {value!r}: must be one of {', '.join(map(repr, allowed))}")
    return value
