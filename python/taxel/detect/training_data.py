"""Summarise the data of a training, and find in what a recording differs from them: no label is needed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.messages import are, counted, three_digits
from taxel._base.progress import reporting
from taxel._base.times import beginning_us
from taxel._core import ProblemError
from taxel.detect.detector import _Detector
from taxel.detect.examples import Example, check_examples
from taxel.detect.floors import floor_of
from taxel.detect.label_times import PEAK
from taxel.detect.loads import Loads, clock_of, lacks_neighbours, largest
from taxel.detect.tares import TOUCH
from taxel.detections import Detections
from taxel.events import Events
from taxel.formats.event_camera import are_counts
from taxel.frames import Frames
from taxel.recorded import recorded
from taxel.recording.analysis.rest import TIMES_NOISE
from taxel.spikes import SpikeTrains, to_ms, to_us

#: A touch has a detection at most so far before its begin or after its end, ms.
_NEAR_MS = 100.0
#: Noise is measured in so many stretches of so many frames, of which this share is quiet.
_STRETCHES, _FRAMES, _QUIET = 64, 16, 0.1
#: At most so many frames are looked at for the taxels that touches load; a taxel is loaded in this share of them.
_LOOKS, _LOADED = 2000, 0.05
#: A touch has this share of the strength of those that are detected in the training: weaker loads are noise.
_TOUCH = 0.1
#: The strength is by the sum: the peak is in units of the recording's own noise.
_SUM = "total"
#: Noise and strength differ from these times on. The strength is this quantile of touches, so that a stretch of strong
#: ones counts.
_NOISIER, _WEAKER, _STRONGER, _STRONG = 1.5, 0.6, 1.7, 0.75
#: Touches are weaker where this quantile is, too; a load that lasts longer than this share of its recording stays, if
#: it lasts longer than a step in a short trial, us.
_STRONGEST, _STAYS, _STAYS_US = 0.95, 0.5, 3_000_000
#: From so many times the noise on the loads are not compared.
_MUCH_NOISE = 2.0
#: Noise is that of the sum at so many moments from so long before a load until as long after it, us; the median
#: difference of two normal values, standard deviations.
_SAMPLES, _AROUND_US, _NORMAL_APART = 64, 1_000_000, 0.954
#: So many touches tell something; this share fewer of them with a detection, or of the loaded taxels, is a difference.
_LEAST, _FEWER = 5, 0.2
#: The last such part of a recording is compared with the first; a taxel has moved by so many times the noise, and by
#: that share of what the most loaded taxel reads in a touch.
_PARTS, _MOVED, _OF_TOUCH = 8, 5.0, 0.05
#: Values come in steps where the noise is below this share of the training's, and each change is so many times that,
#: and that share of what a touch reads, at least; they are held where such a share of frames equals the one before.
_STILL, _STEP, _HELD = 0.25, 5.0, 0.5
#: A taxel jumps below its rest where it changes there by so many times the noise (mean), in so many stretches.
_JUMPS, _SPELLS = 5.0, 2
#: A channel that counts alone has moved by so many times its own noise.
_ALONE = 10.0
#: Two detections are close at this part of the shortest time between labels; this share of close ones is a difference.
_CLOSE, _MANY = 0.5, 0.05


#: When a quantity changes, us, and what it is then.
_Values: TypeAlias = NDArray[np.float64]
_Changes: TypeAlias = tuple[NDArray[np.int64], _Values]


@dataclass(frozen=True, eq=False)
class _Measured:
    """Hold what was measured in an example: its loads are those that rise above the noise around them."""

    noise: float
    peaks: NDArray[np.float64]
    """The largest sum of all taxels above rest in each load, ..."""
    rises: NDArray[np.float64]
    """... and how much more its taxels read then than before it: strong ones are touches."""
    begins: NDArray[np.int64]
    ends: NDArray[np.int64]
    loaded: NDArray[np.bool_]
    """Which taxels touches load often, shape (rows, columns), and ..."""
    reached: NDArray[np.bool_]
    """... which they load at all."""
    reading: float
    """Reading of the most loaded taxel above rest, median over loads."""
    stays: bool
    """Whether a load lasts so long that the loads are not touches."""

    def are_touches(self, strength: float) -> NDArray[np.bool_]:
        """Return which loads are touches, if those of the training are so strong."""
        return self.rises >= _TOUCH * strength

    def detected(self, t: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return which loads have a detection."""
        near, ordered = round(to_us(_NEAR_MS)), np.sort(t)
        first = np.searchsorted(ordered, self.begins - near)
        return np.asarray(np.searchsorted(ordered, self.ends + near, side="right") > first)

    def peaks_at(self, t: NDArray[np.int64]) -> _Values:
        """Return the peak of the strongest load at each of some times; nothing of those far from any load."""
        near = round(to_us(_NEAR_MS))
        first, stop = np.searchsorted(self.ends, t - near), np.searchsorted(self.begins, t + near, side="right")
        return np.array([self.peaks[i:k].max() for i, k in zip(first.tolist(), stop.tolist(), strict=True) if i < k])


def training_data(examples: Sequence[Example], found: Sequence[Detections]) -> dict[str, Any] | None:
    """Return a summary of the data of a training, as a readout's file holds it; None of spike trains or without a rest.

    Parameters
    ----------
    examples : sequence of Example
    found : sequence of Detections
        What the readout detects in each of them.
    """
    sound = check_examples(examples)
    measured = [_measured(example) for example in examples]
    known = [each for each in measured if each is not None and not each.stays]
    if len(known) < len(measured) or not known:
        return None
    shape = tuple(int(size) for size in np.max([each.loaded.shape for each in known], axis=0))
    touched = np.any([_within(each.loaded, shape) for each in known], axis=0)
    has = np.concatenate([each.detected(detections.t) for each, detections in zip(known, found, strict=True)])
    labels = [np.concatenate([*example.labels.values(), np.empty(0, np.int64)]) for example in sound]
    strength = _strength(np.concatenate([each.peaks_at(t) for each, t in zip(known, labels, strict=True)]))
    are_touches = np.concatenate([each.are_touches(strength) for each in known])
    return {
        "shape": list(shape),
        "touched": "".join("1" if loaded else "0" for loaded in touched.flat),
        "noise": float(np.median([each.noise for each in known])),
        "strength": strength,
        "detected": float(has[are_touches].mean()) if are_touches.any() else 0.0,
        "apart_ms": _apart_ms(sound),
    }


def _strength(peaks: NDArray[np.float64]) -> float:
    """Return the strength of touches by their peaks; 0 of none."""
    return float(np.quantile(peaks, _STRONG)) if len(peaks) else 0.0


def _usual(values: NDArray[np.float64]) -> float:
    """Return the median; 0 of no value."""
    return float(np.median(values)) if len(values) else 0.0


def _apart_ms(examples: Sequence[Example]) -> dict[str, float]:
    """Return the shortest time between two labels of each name, ms; nothing of a name that has but one a recording."""
    shortest: dict[str, float] = {}
    for example in examples:
        for label, times in example.labels.items():
            apart = np.diff(np.unique(times))
            if len(apart):
                shortest[label] = min(shortest.get(label, np.inf), float(to_ms(apart.min())))
    return shortest


class Unlike(NamedTuple):
    """In what a recording differs from the training."""

    sensor: Sequence[str] = ()
    """Noise, touches and taxels: what may keep detections away, or make false ones."""
    detections: Sequence[str] = ()
    """Touches without a detection, detections that follow one another too soon, and labels without a detection."""

    def lines(self) -> list[str]:
        """Return all as lines."""
        return [f"unlike the training: {text}" for text in (*self.sensor, *self.detections)]


def unlike(readout: _Detector, example: Example, found: Detections) -> Unlike:
    """Return in what a recording and its detections differ from the training; nothing where that is not known.

    Parameters
    ----------
    readout : Readout or PlainRule
    example : Example
        The recording, with its rest: without one only its noise and the detections are compared.
    found : Detections
    """
    data: dict[str, Any] | None = readout._parts.get("training")
    if data is None:
        return Unlike()
    measured = _measured(example)
    source = recorded(example.source, hold=False)
    noise = 0.0 if isinstance(source, SpikeTrains) else _noise(source)
    is_counts = readout.unit is not None and are_counts(readout.unit)
    noisier = noise / data["noise"] if data["noise"] > 0.0 else 1.0
    sensor, detections = list(_of_noise(noisier, is_counts=is_counts)), list[str]()
    if isinstance(source, Frames) and not is_counts and len(source) >= 2 * _FRAMES:
        if noisier < _STILL:
            sensor += _of_steps(source, data["noise"], 0.0 if measured is None else measured.reading)
        if example.tare is not None:
            sensor += _of_jumps(source, example.tare.rest, data["noise"])
    if measured is not None and (count := _moved(source, data["noise"], measured.reading)):
        # Touches are measured above the rest.
        sensor.append(
            f"{counted(count, 'taxel')} {'has' if count == 1 else 'have'} other readings at the end than at the "
            "beginning: a drift, or a load that stays"
        )
    else:
        sensor += _of_channels(source)
        if measured is not None and not measured.stays:
            sensor += _of_touches(data, measured, found, noisier, is_counts=is_counts)
            # Much noise makes loads of its own.
            detections += _undetected(data, measured, found) if noisier < _MUCH_NOISE else []
    return Unlike(sensor, [*detections, *_of_detections(data["apart_ms"], readout.labels, found)])


def _of_noise(noisier: float, *, is_counts: bool) -> Iterator[str]:
    """Yield that the noise is so many times that of the training, if that is much more."""
    if is_counts and noisier**2 >= _NOISIER:
        # The variance of events by chance is their number.
        yield f"{noisier**2:.2g} times as many events at rest as in the training"
    elif not is_counts and noisier >= _NOISIER:
        yield f"the noise at rest is {noisier:.2g} times as strong as in the training"


def _of_steps(source: Frames, noise: float, reading: float) -> Iterator[str]:
    """Yield that values come in steps, by the noise of the training, or are held."""
    here = np.unique(np.linspace(0, len(source) - 2, _LOOKS).astype(np.int64))
    change = np.abs(source.values[here + 1].astype(np.float64) - source.values[here])
    step = float(np.min(change, initial=np.inf, where=change > 0))
    held = float((change == 0).all(axis=(1, 2)).mean())
    parts = [f"values change in steps of {step:.3g} {source.unit}"] * (step >= max(_STEP * noise, _OF_TOUCH * reading))
    parts += [f"{held:.0%} of frames equal the one before"] * (held >= _HELD)
    if parts and np.isfinite(step):
        yield f"{', and '.join(parts)}; the noise of the training is {noise:.3g} {source.unit}"


def _of_jumps(source: Frames, rest: _Values, noise: float) -> Iterator[str]:
    """Yield how many taxels jump below their rest for a while, although touches only add load."""
    begins, stretches = _stretches(source)
    quiet = np.sqrt(np.quantile(_squares(source), _QUIET, axis=0))
    change = np.abs(np.diff(np.minimum(stretches - rest, 0.0), axis=1)).mean(axis=1)
    jumps = change > _JUMPS * np.maximum(quiet, noise)
    taxels = jumps.sum(axis=0) >= _SPELLS
    if count := int(np.count_nonzero(taxels)):
        at = jumps[:, taxels].any(axis=1)
        first = int(source.t[begins[at][0]]) - beginning_us(source.t)
        yield (
            f"{counted(count, 'taxel')} {'jumps' if count == 1 else 'jump'} below the rest in {at.mean():.0%} of the "
            f"time, for example at {first / 1e6:.1f} s, by more than {_JUMPS:.0f} times the noise: a loose cable, or "
            "interference"
        )


def _of_channels(source: Events | Frames | SpikeTrains) -> Iterator[str]:
    """Yield which channels, each of which counts alone, read more or less at the end by many times their noise."""
    if not isinstance(source, Frames) or source.array._has_neighbours or len(source) < 2 * _FRAMES:
        return
    first, last = _ends(source)
    noise, moved = np.sqrt(np.median(_squares(source), axis=0)), last - first
    for y, x in np.argwhere((noise > 0) & (np.abs(moved) > _ALONE * noise)):
        more = "more" if moved[y, x] > 0 else "less"
        yield (
            f"column {x}, row {y} reads {abs(moved[y, x]):.3g} {source.unit} {more} at the end than at the beginning, "
            f"{abs(moved[y, x]) / noise[y, x]:.0f} times its noise: a drift, or a load that stays"
        )


def _of_touches(
    data: Mapping[str, Any], measured: _Measured, found: Detections, noisier: float, *, is_counts: bool
) -> Iterator[str]:
    """Yield in what touches and taxels differ."""
    shape, strength = tuple(data["shape"]), data["strength"]
    are_touches = measured.are_touches(strength)
    touches = int(np.count_nonzero(are_touches))
    larger = any(size > most for size, most in zip(measured.loaded.shape, shape, strict=True))
    if larger:
        yield "{} x {} taxels, where the training had {} x {}".format(*measured.loaded.shape, *shape)
    if not touches and strength:
        yield f"no load reaches {_TOUCH:g} of the strength of the training's touches (is the unit right?)"
    # Much noise makes loads of its own.
    if noisier >= _MUCH_NOISE or not strength:
        return
    if touches >= _LEAST:
        at_detections = measured.peaks_at(found.t)
        peaks = at_detections if len(at_detections) >= _LEAST else measured.peaks[are_touches]
        ratio = _strength(peaks) / strength
        # Fewer strong ones than in the training are no weaker touches.
        if ratio > _STRONGER or (ratio < _WEAKER and np.quantile(peaks, _STRONGEST) < _WEAKER * strength):
            yield f"touches are {ratio:.2g} times as strong as in the training"
    elif touches and len(measured.rises) >= _LEAST:
        yield f"most loads do not reach {_TOUCH:g} of the strength of the training's touches"
    # Hot pixels are the most loaded ones of counts.
    if touches >= _LEAST and not is_counts and not larger:
        touched = np.frombuffer(data["touched"].encode(), np.uint8).reshape(shape) == ord("1")
        never = int(np.count_nonzero(touched & ~_within(measured.reached, shape)))
        if never >= max(1.0, _FEWER * np.count_nonzero(touched)):
            trained = counted(int(touched.sum()), "taxel")
            yield f"{never} of {trained} that touches of the training loaded {are(never)} never loaded"


def _undetected(data: Mapping[str, Any], measured: _Measured, found: Detections) -> Iterator[str]:
    """Yield how many touches have no detection, if that is a larger share than in the training."""
    are_touches = measured.are_touches(data["strength"])
    touches = int(np.count_nonzero(are_touches))
    missing = touches - int(np.count_nonzero(measured.detected(found.t) & are_touches))
    if touches >= _LEAST and missing / touches >= 1.0 - data["detected"] + _FEWER:
        yield (
            f"{missing} of {counted(touches, 'touch', 'touches')} {'has' if missing == 1 else 'have'} no detection, in "
            f"the training {1.0 - data['detected']:.0%}"
        )


def _of_detections(apart_ms: Mapping[str, float], labels: Sequence[str], found: Detections) -> list[str]:
    """Return which detections follow one another too soon, and of which label there is none."""
    parts = []
    for label, shortest in apart_ms.items():
        t = np.sort(found.t[np.array([each == label for each in found.label], np.bool_)])
        close = int(np.count_nonzero(to_ms(np.diff(t)) < _CLOSE * shortest))
        if close > max(2.0, _MANY * len(t)):
            parts.append(
                f"{close} of {len(t)} detections of {label} follow another within "
                f"{three_digits(_CLOSE * shortest)} ms, half the shortest time between labels of the training"
            )
    counts = {label: sum(each == label for each in found.label) for label in labels}
    if max(counts.values(), default=0) >= _LEAST:
        parts += [f"no {label} is detected" for label, count in counts.items() if not count and label in apart_ms]
    return parts


def _within(mask: NDArray[np.bool_], shape: Sequence[int]) -> NDArray[np.bool_]:
    """Return a mask padded at its far edges to a shape that is as large at least."""
    return np.pad(mask, [(0, most - size) for size, most in zip(mask.shape, shape, strict=True)])


def _measured(given: Example) -> _Measured | None:
    """Return what is measured in an example; None of spike trains, and without frames or a rest."""
    try:
        (example,) = check_examples([given])
    except ProblemError:
        return None
    source, tare = example.source, example.tare
    if isinstance(source, SpikeTrains) or tare is None or not len(source):  # type: ignore[arg-type]
        return None
    assert isinstance(source, Events | Frames)
    quantity, threshold = ("peak", PEAK) if lacks_neighbours([example]) else ("area", TOUCH)
    floor = floor_of([example])
    loads = Loads([example], [clock_of(given)], floor, reporting(None), sorted({quantity, _SUM}))
    begins, ends = (loads.off(edge, 0).t for edge in loads.edges(quantity, threshold, 1.0, 1))
    begin, end = _touches(begins, ends, int(source.t[-1]))
    stays = bool((end - begin).max(initial=0) > max(_STAYS * (source.t[-1] - source.t[0]), _STAYS_US))
    above, sums = _core.touched_above(floor), loads.changes(_SUM, 0)
    rises = _rises(source, above, sums, begin, end)
    begin, end, rises = begin[rises > 0.0], end[rises > 0.0], rises[rises > 0.0]
    values = tare.off(_touched(source, begin, end)).values
    share = (values >= above).mean(axis=0) if len(values) else np.zeros(source.array.shape)
    most = np.fmax.reduce(values, axis=(1, 2), initial=0.0)
    peaks = largest(*sums, begin, end)
    return _Measured(_noise(source), peaks, rises, begin, end, share >= _LOADED, share > 0.0, _usual(most), stays=stays)


def _rises(
    source: Events | Frames, above: float, sums: _Changes, begin: NDArray[np.int64], end: NDArray[np.int64]
) -> _Values:
    """Return how much more the taxels of each load read at its peak than just before it; 0 of one within the noise.

    So neither the noise of a load that stays nor that of a taxel beside it makes touches.
    """
    t, values = sums
    held, rises = np.append(0.0, values), largest(t, values, begin, end)
    moments = np.linspace(begin - _AROUND_US, end + _AROUND_US, _SAMPLES)
    apart = np.abs(np.diff(held[np.searchsorted(t, moments, side="right")], axis=0))
    noise = np.median(apart, axis=0) / _NORMAL_APART
    if isinstance(source, Frames):
        # A sum leaves out a loaded taxel that is alone: one that stays adds to it only with the noise of another.
        edges = np.searchsorted(source.t, [begin, end])
        for k, (first, last) in enumerate(edges.T.tolist()):
            some = slice(first, max(last, first + 1), 1 + (last - first) // _SAMPLES)
            more = source.values[some] - source.values[max(first - 1, 0)]
            rises[k] = min(rises[k], np.nansum(np.where(more >= above, more, 0.0), axis=(1, 2)).max())
    return np.where(rises > TIMES_NOISE * noise, rises, 0.0)


def _touches(
    begins: NDArray[np.int64], ends: NDArray[np.int64], last: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the begin and the end of each touch; one that has not ended lasts until the recording does."""
    return begins, np.append(ends, last)[: len(begins)] if len(ends) < len(begins) else ends[: len(begins)]


def _touched(source: Events | Frames, begin: NDArray[np.int64], end: NDArray[np.int64]) -> Frames:
    """Return some frames of touches."""
    if isinstance(source, Events):
        lasts = int(source.t[-1] - source.t[0])
        source = Frames.from_events(source, max(1, lasts // _LOOKS), int(source.t[0]))
    during = np.searchsorted(begin, source.t, side="right") > np.searchsorted(end, source.t, side="right")
    inside = np.flatnonzero(during)
    chosen = inside[:: max(1, len(inside) // _LOOKS)]
    return Frames(source.values[chosen], source.t[chosen], unit=source.unit, array=source.array)


def _moved(source: Events | Frames | SpikeTrains, noise: float, reading: float) -> int:
    """Return how many taxels of frames read more or less at the end, against noise and touches; 0 if few do."""
    if not isinstance(source, Frames) or len(source) < 2 * _FRAMES or noise <= 0.0:
        return 0
    first, last = _ends(source)
    count = int(np.count_nonzero(np.abs(last - first) >= max(_MOVED * noise, _OF_TOUCH * reading)))
    return count if count >= max(1.0, _FEWER * source.array.taxels) else 0


def _ends(source: Frames) -> _Values:
    """Return what each taxel reads at the beginning and at the end; NaN of one without a value there."""
    part = len(source) // _PARTS
    step = 1 + part * _PARTS // _LOOKS
    # Touches that come and go leave the lowest readings as they are.
    ends = np.stack([source.values[:part:step], source.values[-part::step]]).astype(np.float64)
    return np.asarray(np.quantile(ends, 0.1, axis=1))


def _stretches(source: Frames) -> tuple[NDArray[np.int64], _Values]:
    """Return the first frames of some stretches, and the values of their frames."""
    begins = np.linspace(0, len(source) - _FRAMES, _STRETCHES).astype(np.int64)
    return begins, source.values[begins[:, None] + np.arange(_FRAMES)].astype(np.float64)


def _squares(source: Frames) -> _Values:
    """Return the squared noise of each taxel in some stretches."""
    # Of independent noise two neighbours in time differ by twice its variance.
    return np.asarray((np.diff(_stretches(source)[1], axis=1) ** 2).mean(axis=1) / 2.0)


def _noise(source: Events | Frames) -> float:
    """Return the noise of a taxel of frames while nothing touches: that of the quiet stretches; of events 0."""
    if isinstance(source, Events) or len(source) < 2 * _FRAMES:
        return 0.0
    return float(np.sqrt(np.quantile(np.nanmean(_squares(source), axis=(1, 2)), _QUIET)))
