"""Balls dropped on the emulated array, sampled, coded and compared: what figures 4.8 to 4.10 and 5.10 to 5.14 share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import pdist, squareform

from taxel import SceneError
from taxel.array import Array
from taxel.encode import ChangeEvents
from taxel.events import Events
from taxel.frames import Frames
from taxel.simulate import Scene, Silence, play, truth
from taxel.spikes import to_ms
from taxel.wire import FRAME_US, Registers
from taxel_studies.study import Kept

#: The foam of all drops, and how stiff a tennis ball is: what the study foam finds (the rest of the foam is taxel's).
FOAM: dict[str, float] = {"modulus_kpa": 20.0, "damping_s_m": 0.1, "dashpot_ms": 3.0}
TENNIS_N_MM = 25.0
#: The experiment of 5.6.2: two spheres, three heights, three slants, 100 trials each; how trials differ is a guess.
TABLE: dict[str, Any] = {
    "balls_mm": [50.0, 70.0],
    "heights_mm": [100.0, 150.0, 200.0],
    "slants_deg": [0.0, 15.0, 30.0],
    "drops": 100,
    "mass_g": 36.0,
    "mass_by_g": 1.0,
    "height_sd_mm": 2.0,
    "place_sd_mm": 5.0,
    "board": 56,
    "foam": FOAM,
    "stiffness_n_mm": None,
}
#: Those parameters, beside the condition and a seed, that the drops depend on.
_DRAWN = ("drops", "mass_g", "mass_by_g", "height_sd_mm", "place_sd_mm", "board", "foam", "stiffness_n_mm")
#: The experiment of 5.6.2 at a size that takes seconds.
TOY: dict[str, Any] = {"heights_mm": [100.0, 200.0], "slants_deg": [0.0], "drops": 8}
#: The experiment of 4.4.2: a tennis ball from two heights at two slants, 100 trials each; how trials differ is a guess.
TENNIS_TABLE: dict[str, Any] = {
    "balls_mm": [65.0],
    "heights_mm": [400.0, 800.0],
    "slants_deg": [0.0, 30.0],
    "drops": 100,
    "mass_g": 56.0,
    "mass_by_g": 0.0,
    "height_sd_mm": 5.0,
    "place_sd_mm": 5.0,
    "board": 44,
    "foam": FOAM,
    "stiffness_n_mm": TENNIS_N_MM,
}
#: The experiment of 4.4.2 at a size that takes seconds.
TENNIS_TOY: dict[str, Any] = {"drops": 8}
#: Taxels along a side of the region around the impact, and how long it is recorded, ms.
REGION, LENGTH_MS = 16, 50.0
#: Frames in that time.
FRAMES = int(LENGTH_MS / to_ms(FRAME_US))
#: An impact is a frame in which this many taxels rise; a single one may be noise.
ANSWERED = 3
#: A change by more than this is an event, ticks, as in the board's fast presets.
NOISE_FLOOR = 3.0
#: Silence before the first drop, ms: longer than the tare.
_BEFORE_MS = 60.0
#: When a hand catches the ball after the impact, ms, and how fast the hand lifts it, mm/s.
_AFTER_MS, _HAND_MM_S = 15.0, 500.0
#: The ball is released at a random time within this many ms, as nothing synchronises it with the board.
_LEAD_MS = 20.0


class Rig(NamedTuple):
    """The board and ball of an experiment, and the region and time that are recorded."""

    preset: str
    """Preset of the board."""
    region: int
    """Taxels along a side of the region."""
    length_ms: float
    """How long a drop is recorded."""
    around: str
    """The region's middle: of the taxels that answer in the impact's first frame the "mean", or the "first"."""

    @property
    def frame_us(self) -> float:
        """Time from one frame to the next."""
        return Registers.preset(self.preset).frame_us

    @property
    def frames(self) -> int:
        """Number of frames of a drop."""
        return int(self.length_ms / to_ms(self.frame_us))


#: The rig of 5.6.2.
IMPACTS = Rig("5.2 kHz", REGION, LENGTH_MS, "mean")
#: The rig of 4.4.2: figure 4.10 shows 40 ms.
TENNIS = Rig("2 kHz", 17, 40.0, "first")


class Condition(NamedTuple):
    """One of the combinations of contact parameters."""

    ball_mm: float
    """Diameter."""
    height_mm: float
    slant_deg: float


class Drops(NamedTuple):
    """All drops of a condition, as the host holds them."""

    ticks: NDArray[np.uint16]
    """Held readings, shape (drops, 1 + the rig's frames, taxels of the region); the first is that before the impact."""
    events: NDArray[np.int64]
    """How many change events the region gave in that time, by drop."""
    lasted_us: NDArray[np.float64]
    """Time from the first of these events to the last, by drop."""
    contact_events: NDArray[np.int64]
    """How many of them came while the ball touched for the first time."""
    contact_us: NDArray[np.float64]
    """Time from the first of those to the last (5.7)."""
    contact_taxels: NDArray[np.int64]
    """How many taxels of the whole array rose meanwhile."""


def conditions(p: Mapping[str, Any]) -> list[Condition]:
    """Return all combinations."""
    return [Condition(*one) for one in product(p["balls_mm"], p["heights_mm"], p["slants_deg"])]


def shared(p: Mapping[str, Any], rig: Rig = IMPACTS) -> list[tuple[Any, ...]]:
    """List the calls that drop each condition's balls, which studies share."""
    return [_call(p, one, rig) for one in conditions(p)]


def played(p: Mapping[str, Any], condition: Condition, kept: Kept, rig: Rig = IMPACTS) -> Drops:
    """Return a condition's drops, computed once for all studies of a report."""
    drops: Drops = kept.made(*_call(p, condition, rig))
    return drops


def _call(p: Mapping[str, Any], condition: Condition, rig: Rig) -> tuple[Any, ...]:
    return _drop, {name: p[name] for name in _DRAWN}, condition, p["seed"], rig


def _drop(p: Mapping[str, Any], condition: Condition, seed: int, rig: Rig) -> Drops:
    """Drop a ball so many times on one board that does not rest between drops."""
    rng = np.random.default_rng([seed, *(round(1000 * part) for part in condition)])
    acts: list[Silence | Scene] = [Silence(_BEFORE_MS)]
    acts += [_scene(p, condition, rng, rig) for _ in range(p["drops"])]
    impacts = [(one.start_us, one.stop_us) for one in truth(acts, preset=rig.preset)[0] if one.kind == "first"]
    return _around(play(acts, seed=p["board"], preset=rig.preset).events, impacts, rig)


def _scene(p: Mapping[str, Any], condition: Condition, rng: np.random.Generator, rig: Rig) -> Scene:
    height = condition.height_mm + rng.normal(0, p["height_sd_mm"])
    fall_ms = float(np.sqrt(2 * height / 9.81e-3))
    array = Array.thesis()
    x, y = ((n - 1) * array.column_mm / 2 + rng.normal(0, p["place_sd_mm"]) for n in (array.columns, array.rows))
    gives = {} if p["stiffness_n_mm"] is None else {"stiffness_n_mm": p["stiffness_n_mm"]}
    return Scene(
        {
            "foam": dict(p["foam"]),
            "bodies": [
                {
                    "shape": {"sphere": {"radius_mm": condition.ball_mm / 2}},
                    "mass_g": float(p["mass_g"] + rng.uniform(-1, 1) * p["mass_by_g"]),
                    "x_mm": float(x),
                    "y_mm": float(y),
                    "motion": {
                        "dropped": {
                            "height_mm": float(height),
                            "ending": {
                                "left_to_rest": {
                                    "rest_ms": fall_ms + rig.length_ms + _AFTER_MS,
                                    "lift_mm_s": _HAND_MM_S,
                                }
                            },
                        }
                    },
                    **gives,
                }
            ],
            "slant_deg": condition.slant_deg,
            "lead_ms": float(rng.uniform(0, _LEAD_MS)),
        }
    )


def _around(events: Events, impacts: Sequence[tuple[float, float]], rig: Rig) -> Drops:
    """Cut the readings of the region around each impact out of a recording (4.4.2, 5.6.2).

    Raises
    ------
    SceneError : an impact that hardly any taxel answered
    """
    events = events.sorted()
    assert events.intensity is not None  # the board sends them
    columns, rows = events.array.columns, events.array.rows
    # A stamp is its frame's start, cut down to whole 100 us.
    frame = np.ceil(events.t / rig.frame_us).astype(np.int64)
    index = events.array.index(events.x, events.y)
    held = np.zeros(rows * columns, np.uint16)
    ticks = np.zeros((len(impacts), 1 + rig.frames, rig.region**2), np.uint16)
    counts, touched, taxels = np.zeros((3, len(impacts)), np.int64)
    lasted, contact = np.zeros((2, len(impacts)))
    done = 0
    for k, (impact, parted) in enumerate(impacts):
        at = int(impact / rig.frame_us)
        soon = slice(*np.searchsorted(frame, [at, at + rig.frames]))
        rises = np.bincount(frame[soon][events.p[soon]] - at, minlength=rig.frames)
        if rises.max() < ANSWERED:
            raise SceneError(f"drop {k}: no {ANSWERED} taxels answered it in one frame; drop it from higher")
        begin = at + int(np.argmax(rises >= ANSWERED))
        first, end = np.searchsorted(frame, [begin, begin + 1])
        held[index[done:first]] = events.intensity[done:first]
        answered = slice(first, end if rig.around == "mean" else first + 1)
        x0 = _corner(events.x[answered], columns, rig.region)
        y0 = _corner(events.y[answered], rows, rig.region)
        region = (np.arange(y0, y0 + rig.region)[:, None] * columns + np.arange(x0, x0 + rig.region)).ravel()
        ticks[k, 0] = held[region]
        edges = np.searchsorted(frame, np.arange(begin, begin + rig.frames + 1))
        for n in range(rig.frames):
            new = slice(edges[n], edges[n + 1])
            held[index[new]] = events.intensity[new]
            ticks[k, n + 1] = held[region]
        done = int(edges[-1])
        mine = frame[first:done][np.isin(index[first:done], region)]
        counts[k], lasted[k] = len(mine), (mine[-1] - mine[0]) * rig.frame_us
        # The frame in which the ball parts still shows it.
        last = int(parted / rig.frame_us) + 1
        touched[k] = np.searchsorted(mine, last, side="right")
        contact[k] = (mine[touched[k] - 1] - mine[0]) * rig.frame_us
        meanwhile = slice(first, int(np.searchsorted(frame, last, side="right")))
        taxels[k] = len(np.unique(index[meanwhile][events.p[meanwhile]]))
    return Drops(ticks, counts, lasted, touched, contact, taxels)


def _corner(places: NDArray[Any], size: int, region: int) -> int:
    """Return where a region begins whose middle is that of some places, within the array."""
    return int(np.clip(round(float(places.mean()) - (region - 1) / 2), 0, size - region))


def sampled(drops: NDArray[np.uint16], period_ms: float, late_ms: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return the change events of drops that are sampled at a period, (drops, samples, ON and OFF, taxels).

    Parameters
    ----------
    drops : uint16, shape (drops, 1 + frames, taxels)
        As of `Drops`.
    period_ms : float
        A frame or more.
    late_ms : float64, shape (drops,)
        When the first sample comes after the impact's first frame. Sample 0 is the first at which anything fires.
    """
    values = _looked_at(drops, period_ms, late_ms, IMPACTS, LENGTH_MS)
    count = values.shape[1] - 1
    t = np.arange(count + 1, dtype=np.int64) * 1000
    frames = Frames(values.transpose(1, 0, 2).astype(np.float32), t, unit="ticks")
    spikes = ChangeEvents(noise_floor=NOISE_FLOOR).encode(frames)
    assert spikes.values is not None  # change events have signs
    train = np.repeat(np.arange(len(spikes)), np.diff(spikes.offsets))
    taxels = drops.shape[2]
    drop, sample = train // taxels, np.round(spikes.times).astype(np.int64) - 1
    first = np.full(len(drops), count)
    np.minimum.at(first, drop, sample)
    counts = np.zeros((len(drops), count, 2, taxels), np.uint8)
    counts[drop, sample - first[drop], (spikes.values < 0).astype(int), train % taxels] = 1
    return counts


def frames_of(
    drops: NDArray[np.uint16], period_ms: float, late_ms: NDArray[np.float64], rig: Rig, length_ms: float
) -> NDArray[np.float64]:
    """Return each taxel's reading less that before the impact, sampled at a period, (drops, samples, taxels).

    Parameters are those of `sampled`, the drops' rig, and how long they are recorded, ms.
    """
    values = _looked_at(drops, period_ms, late_ms, rig, length_ms).astype(np.float64)
    return values[:, 1:] - values[:, :1]


def _looked_at(
    drops: NDArray[np.uint16], period_ms: float, late_ms: NDArray[np.float64], rig: Rig, length_ms: float
) -> NDArray[np.uint16]:
    """Return the readings before the impact and then at every sample, (drops, 1 + samples, taxels)."""
    step = late_ms[:, None] + period_ms * np.arange(int(length_ms / period_ms + 1e-9))
    frame = np.minimum((step / to_ms(rig.frame_us) + 1e-9).astype(np.int64), rig.frames - 1) + 1
    frame = np.concatenate([np.zeros((len(drops), 1), np.int64), frame], axis=1)
    return np.take_along_axis(drops, frame[:, :, None], axis=1)


def smoothed(region: int, pitch_mm: float, sigma: float) -> NDArray[np.float32]:
    """Return what each taxel of a square region adds to each (5.11), its own train counted twice as printed."""
    x, y = np.meshgrid(np.arange(region), np.arange(region))
    places = np.stack([x.ravel(), y.ravel()], -1) * pitch_mm
    apart = np.sqrt(((places[:, None] - places) ** 2).sum(-1))
    return np.asarray(np.eye(region * region) + np.exp(-apart / sigma), np.float32)


def spatial_grams(
    spikes: NDArray[np.uint8], period_ms: float, tau: float, kernels: Sequence[NDArray[np.float32]], ends: Sequence[int]
) -> list[list[NDArray[np.float64]]]:
    """Return the inner products of all patterns smoothed in time and over taxels (5.8 and 5.11, Euclidean).

    Parameters
    ----------
    spikes : uint8, shape (patterns, samples, layers, taxels)
        Spikes in each sample.
    period_ms : float
    tau : float, ms
    kernels : sequence of float32, shape (taxels, taxels)
        As of `smoothed`: one a sigma.
    ends : sequence of int, ascending
        After so many samples.

    Returns
    -------
    list of list of float64, shape (patterns, patterns)
        By kernel, then by end. The distances of these are `taxel.metrics.van_rossum_spatial` without normalisation of
        the spikes before each end.

    Notes
    -----
    Between samples every smoothed train is one exponential, so the integral is a running sum of the products at the
    samples: (1 - q) of each but the last, q = exp(-2 T / tau), in units of tau / 2. One table of states serves every
    sigma and every end.
    """
    count, _, layers, taxels = spikes.shape
    state = np.zeros((count, layers, taxels), np.float32)
    decay = np.float32(np.exp(-period_ms / tau))
    passed = -np.expm1(-2 * period_ms / tau)
    totals = [np.zeros((count, count)) for _ in kernels]
    grams: list[list[NDArray[np.float64]]] = [[] for _ in kernels]
    for k in range(ends[-1]):
        state *= decay
        state += spikes[:, k]
        for n, kernel in enumerate(kernels):
            smooth = (state.reshape(-1, taxels) @ kernel).reshape(count, -1)
            here = smooth @ smooth.T
            if k + 1 in ends:
                grams[n].append((totals[n] + here) * (tau / 2))
            totals[n] += passed * here
    return grams


def as_printed(
    spikes: NDArray[np.uint8], period_ms: float, tau: float, kernel: NDArray[np.float32]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the distances of all patterns as 5.12 and 5.10 print them: norms summed over trains, all over time too.

    The first is Euclidean over time; the root of 5.10 is of one square, so the second adds up what is apart, ms.
    Parameters are those of `spatial_grams`, with one kernel.
    """
    count, samples, layers, taxels = spikes.shape
    state = np.zeros((count, layers, taxels), np.float32)
    smooth = np.empty((layers * taxels, count, samples), np.float32)
    over_time = np.zeros(count * (count - 1) // 2)
    for k in range(samples):
        state = state * np.float32(np.exp(-period_ms / tau)) + spikes[:, k]
        here = (state.reshape(-1, taxels) @ kernel).reshape(count, -1)
        smooth[:, :, k] = here.T
        # All trains fall alike until the next sample; after the last for good.
        until = -np.expm1(-period_ms / tau) if k + 1 < samples else 1.0
        over_time += tau * until * pdist(here, "cityblock")
    # As in `spatial_grams`: each sample but the last counts until the next one.
    smooth[:, :, :-1] *= np.float32(np.sqrt(-np.expm1(-2 * period_ms / tau)))
    norms = np.asarray(sum(distances_of((one @ one.T).astype(np.float64)) for one in smooth))
    return norms, squareform(over_time)


def distances_of(gram: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the Euclidean distances of trials from their inner products."""
    length = np.diag(gram)
    return np.asarray(np.sqrt(np.maximum(length + length[:, None] - 2 * gram, 0.0)))


def named_by_neighbours(distances: NDArray[np.float64], y: NDArray[np.int64], neighbours: int) -> NDArray[np.int64]:
    """Return the class that each pattern's nearest neighbours vote for; no pattern is its own neighbour."""
    apart = distances.copy()
    np.fill_diagonal(apart, np.inf)
    near = np.argsort(apart, axis=1, kind="stable")[:, :neighbours]
    classes, row = np.unique(y, return_inverse=True)
    return np.asarray(classes[_majority(row[near], len(classes))])


def _majority(near: NDArray[np.int64], classes: int) -> NDArray[np.int64]:
    """Return the most frequent class of each row; on a tie, the class whose members come first."""
    votes = np.zeros((len(near), classes))
    rows = np.repeat(np.arange(len(near)), near.shape[1])
    np.add.at(votes, (rows, near.ravel()), 1.0)
    # One vote outweighs all differences in place.
    tie = np.tile(np.linspace(0, 1, near.shape[1]) / (near.shape[1] + 1), len(near))
    np.add.at(votes, (rows, near.ravel()), -tie / near.shape[1])
    return np.asarray(votes.argmax(1))
