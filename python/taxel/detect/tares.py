"""Whether a tare fits: whether it holds a touch, and whether taxels read above it at rest or drift away from it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from taxel import _core
from taxel._core import ProblemError
from taxel.detect.examples import Example
from taxel.detect.floors import floor_of
from taxel.encode import Encoder
from taxel.events import Events
from taxel.formats.event_camera import are_counts
from taxel.frames import Frames
from taxel.recorded import recorded
from taxel.spikes import SpikeTrains
from taxel.tare import Tare

#: The number of loaded taxels of the smallest touch.
TOUCH = 2.0
#: This share of a tare, at its beginning, holds no touch.
_EARLY = 0.25
#: These shares of a tare are looked at for a touch, to say how much of it is quiet.
_SHARES = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, _EARLY)
#: A taxel varies more than its noise at the beginning from so many times that on, and this part of the noise floor.
_TIMES_NOISE, _OF_FLOOR = 3.0, 6.0
#: How long before a label the sensor is looked at, us: as long as a tare ends before the first label.
_BEFORE_US = 20_000
#: What may be the rest, until a moment without a touch, lasts so long, us, and so many frames.
_STRETCH_US, _STRETCH_FRAMES = 500_000, 8
#: How many labels at either end of a recording are looked at.
_LABELS = 4
#: Into so many parts a recording is divided to see a drift, at so many frames of each.
_PARTS, _LOOKS = 8, 40
#: Without frames for so long a sensor may have begun anew, us.
_GAP_US = 1_000_000
#: A load in a tare is at least that share of the most that its taxel reads.
_OF_MOST = 0.05
#: A touched taxel reads so many times its drift.
_TIMES = 4


def held_by_tare(examples: Sequence[Example]) -> int:
    """Return how many taxels vary far more in the tare of an example than at its beginning, as a touch is in it.

    If there are several examples, it is the largest number. A tare of another recording says nothing: 0.

    Parameters
    ----------
    examples : sequence of Example, checked
    """
    return max((_held(example, 1.0) for example in examples), default=0)


def quiet_s(examples: Sequence[Example]) -> float | None:
    """Return how many seconds at the beginning of each recording hold no touch, of its tare; None if not known.

    Parameters
    ----------
    examples : sequence of Example, checked
    """
    least = []
    for example in examples:
        tare, source = example.tare, example.source
        if early_part(example) is None or tare is None or tare.start_us > int(source.t[0]):  # type: ignore[union-attr]
            return None
        share = next(share for share in _SHARES if _held(example, share) < TOUCH)
        least.append(share * (tare.stop_us - tare.start_us) / 1e6)
    seconds = min(least, default=0.0)
    digits = 10 ** (2 - int(np.floor(np.log10(seconds)))) if seconds > 0 else 1
    return float(np.floor(seconds * digits) / digits) if seconds > 0 else None


def _held(example: Example, share: float) -> int:
    """Return how many taxels vary far more in that share of a tare than at its beginning."""
    early, late = early_part(example), early_part(example, share)
    if early is None or late is None:
        return 0
    floor = floor_of([example._replace(tare=early)])
    noise, more = early.noise, floor / _OF_FLOOR
    source = example.source
    if isinstance(source, Frames) and are_counts(source.unit):
        # Few events show neither their noise nor that one more is chance.
        first, last = (len(source.between(tare.start_us, tare.stop_us)) for tare in (early, late))
        noise = np.maximum(noise, (np.nanmean(early.rest) + 1.0 / (first * noise.size)) ** 0.5)
        more = max(more, last**-0.5)
    return int(np.count_nonzero(late.noise > _TIMES_NOISE * noise + more))


def early_part(example: Example, share: float = _EARLY) -> Tare | None:
    """Return the beginning of an example's tare; None if the tare is of another recording."""
    tare, source = example.tare, example.source
    if tare is None or isinstance(source, SpikeTrains):
        return None
    try:
        tare_again = Tare.take(source, start_us=tare.start_us, stop_us=tare.stop_us)
        early = tare.start_us + round(share * (tare.stop_us - tare.start_us))
        return (
            Tare.take(source, start_us=tare.start_us, stop_us=early)
            if np.array_equal(tare_again.rest, tare.rest, equal_nan=True)
            else None
        )
    except ProblemError:
        return None


class Loaded(NamedTuple):
    """How many taxels read above the tare of an example while nothing touches it, and from when to when, us."""

    taxels: int
    example: int = 0
    start_us: int = 0
    stop_us: int = 0


def loaded_at_rest(examples: Sequence[Example], encoder: Encoder) -> Loaded:
    """Return how many taxels read above the tare of their example while nothing touches it; 0 without a tare.

    A taxel counts that does so 20 ms before each of the first four labels, or of the last four: at one of four such
    moments at least a touch is yet to begin, and noise is elsewhere each time. So it is a tare that does not fit from
    the beginning, or one that the readings drifted away from, or a load that stays. If there are several examples, it
    is the largest number. The time ends at the moment with the least load.
    """
    return max((_loaded(k, example, encoder) for k, example in enumerate(examples)), default=Loaded(0))


def _loaded(k: int, example: Example, encoder: Encoder) -> Loaded:
    floors = [part.noise_floor for part in encoder._each() if hasattr(part, "noise_floor")]
    source = recorded(example.source)
    times = np.sort(np.concatenate([*example.labels.values(), np.empty(0, np.int64)])).astype(np.int64) - _BEFORE_US
    if example.tare is None or not floors or isinstance(source, SpikeTrains) or not len(times):
        return Loaded(0)
    above = _core.touched_above(max(map(float, floors)))
    found = []
    for ends in (times[:_LABELS], times[-_LABELS:]):
        values = np.array([example.tare.off(_at(source, int(t))).values for t in ends])
        stop_us = int(ends[np.nansum(values, axis=(1, 2, 3)).argmin()])
        before = max(0, int(np.searchsorted(source.t, stop_us)) - _STRETCH_FRAMES)
        start_us = min(stop_us - _STRETCH_US, int(source.t[before]))
        found.append(Loaded(int(np.count_nonzero(values.min(axis=0) >= above)), k, start_us, stop_us))
    return max(found, key=lambda each: each.taxels)


def _at(source: Events | Frames, t_us: int) -> Frames:
    """Return the frame at a time."""
    if isinstance(source, Events):
        return Frames.from_events(source, 1, t_us, t_us + 1)
    index = max(0, int(np.searchsorted(source.t, t_us, side="right")) - 1)
    return source[index : index + 1]


def count_loaded(source: Events | Frames, tare: Tare, noise_floor: float) -> int:
    """Return how many taxels a tare from the beginning of frames holds a load of, which goes at once later.

    A taxel counts that reads less than that later by more than the noise floor, and by a twentieth of the most that it
    reads above that, in nine of ten frames of the recording; half of it goes between one eighth and the next.

    Parameters
    ----------
    source : Events or Frames
    tare : Tare
    noise_floor : float, in the sensor's unit
    """
    if isinstance(source, Events) or tare.start_us > source.t[0] + _GAP_US:
        return 0
    frames = source.between(tare.stop_us, np.inf)
    frames = frames[:: max(1, len(frames) // (_PARTS * _LOOKS))]
    looks = len(frames) // _PARTS
    if looks < _LOOKS // 4:
        return 0
    values = frames.values[: _PARTS * looks].astype(np.float64)
    least = np.quantile(values.reshape(_PARTS, looks, *source.array.shape), 0.1, axis=1)
    fallen = tare.rest - least[1:].max(axis=0)
    most = values.max(axis=0) - least[-1]
    at_once = np.diff(least, axis=0, prepend=tare.rest[None]).min(axis=0) <= (least.min(axis=0) - tare.rest) / 2
    count = np.count_nonzero(at_once & (fallen > noise_floor) & (fallen > _OF_MOST * most))
    return int(count) if count >= min(TOUCH, source.array.taxels) else 0


def count_drifted(source: Events | Frames, tare: Tare, noise_floor: float) -> int:
    """Return how many taxels drifted above a tare by more than the noise floor; 0 where it may be a load.

    A taxel counts that reads no more in the first eighth of the recording and more in the last, in nine of ten
    frames, came there little by little, or while no frame came for a second, and reads four times as much while it is
    touched: a load that stays comes at once, or is all that a taxel reads. A quarter of the taxels that were touched
    must do so, and two at least.

    Parameters
    ----------
    source : Events or Frames
    tare : Tare
    noise_floor : float, in the sensor's unit
    """
    after = source.t[source.t >= tare.stop_us]
    if not len(after):
        return 0
    if isinstance(source, Events):
        source = Frames.from_events(source, max(1, int(after[-1] - after[0]) // (_PARTS * _LOOKS)), int(after[0]))
    frames = source.between(tare.stop_us, np.inf)
    gap_stamps = frames.t[1:][np.diff(frames.t) >= max(_GAP_US, 3 * np.median(np.diff(frames.t)))]
    frames = frames[:: max(1, len(frames) // (_PARTS * _LOOKS))]
    looks = len(frames) // _PARTS
    if looks < _LOOKS // 4:
        return 0
    gaps = np.searchsorted(frames.t, gap_stamps)
    values = tare.off(frames).values[: _PARTS * looks]
    above, most = _core.touched_above(noise_floor), values.max(axis=0)
    least = np.quantile(values.reshape(_PARTS, looks, *most.shape), 0.1, axis=1)
    steps = np.diff(least, axis=0)
    # What a taxel reads otherwise after a gap, as of a sensor that began anew, is no load that came.
    for gap in gaps // looks:
        steps[max(0, gap - 1) : gap + 1] = 0
    slowly = steps.max(axis=0) <= least[-1] / 2
    count = np.count_nonzero((least[0] < above) & (least[-1] >= above) & slowly & (most >= _TIMES * least[-1]))
    return int(count) if count >= max(TOUCH, np.count_nonzero(most >= _TIMES * above) / _TIMES) else 0
