"""Local load against NumPy, written from the definition: quantities in units of each taxel's own noise."""

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from taxel import Array, Frames
from taxel.encode import LocalLoad

from . import scenes
from .scenes import rest, some_tare, spikes_of, touch

REPAIRED = "read"
#: Examples for the laws of all encoders (test_laws.py).
EXAMPLES = {
    "local load": LocalLoad(tare=rest(scenes.ARRAY)),
    "local load, of running means": LocalLoad(
        rest="tare", local_ms=(50, 300.5), noise_floor=1.0, least_noise=2.0, period_ms=0.3, tare=rest(scenes.ARRAY)
    ),
    "local load, levels": LocalLoad(
        levels=(0.5, 1.5, 3), release=0.6, local_ms=(20,), least_noise=1.0, tare=rest(scenes.ARRAY)
    ),
}
GRADED = {label: encoder for label, encoder in EXAMPLES.items() if not len(encoder.levels)}


def turned(encoder):
    """The trains as they stand on an array that is turned by half a turn: no quantity depends on the position."""
    return np.arange(encoder.trains(scenes.ARRAY))


def around(values):
    """The sums over 3 x 3 places; outside the array is nothing."""
    wide = np.pad(values, 1)
    rows, columns = values.shape
    return sum(wide[y : y + rows, x : x + columns] for y in range(3) for x in range(3))


def area(u, least):
    """The number of taxels from `least` with such a neighbour."""
    there = u >= least
    return np.count_nonzero(there & (around(there.astype(int)) > 1))


def mean(times, rows, k, start_ms, stop_ms):
    """The mean of the samples of an age from `start_ms` to `stop_ms`; or the latest before; or the first."""
    age = times[k] - times[: k + 1]
    inside = (age >= 1000 * start_ms) & (age < 1000 * stop_ms)
    before = np.flatnonzero(age >= 1000 * start_ms)
    return rows[: k + 1][inside].mean(0) if inside.any() else rows[before[-1] if len(before) else 0]


class Oracle:
    """The quantities of frames, with thresholds as far off as `bound` is from 4: at them rounding decides."""

    def __init__(self, encoder, t, readings, exists, bound):
        self.encoder, self.t, self.tare, self.bound = encoder, t, encoder.tare, bound
        self.known = exists & ~np.isnan(self.tare.rest)
        self.sigma = np.maximum(np.nan_to_num(self.tare.noise), encoder.least_noise)
        self.s = np.where(self.known, np.sqrt(self.sigma**2 + encoder.noise_floor**2 / 4), 0.0)
        self.readings = np.where(exists, readings, 0).astype(np.float64)
        # A taxel that has been 0 since the first frame has no value yet: it is at its rest.
        self.waiting = np.logical_and.accumulate(self.readings == 0, axis=0)

    def of(self, value, times):
        """Area, largest, places and total of values above their baselines."""
        known, s = self.known, self.s
        value = np.where(known, value, 0.0)
        sums = around(np.clip(value, -3 * s, 3 * s)) / np.sqrt(np.where(known, around(s**2), np.inf))
        least = np.maximum(self.encoder.noise_floor + 0.5, times * self.sigma) * self.bound / 4
        large = known & (value >= 5 * self.sigma * self.bound / 4)
        return [
            area(value, np.where(known, least, np.inf)),
            max(0.0, sums.max()),
            np.count_nonzero(sums > self.bound),
            value[large].sum(),
        ]

    def above_rest(self):
        """The values above the rest, and the frames in which a taxel without a value is at its rest."""
        far = np.maximum(self.encoder.noise_floor + 0.5, 5 * self.sigma).astype(np.float32)
        baseline, found = np.where(self.known, self.tare.rest, 0.0), []
        for k, frame in enumerate(self.readings):
            if k > 0 and self.encoder.rest == "tracked":
                tau_us = np.where(np.abs(found[-1]) < far, 1e6, 20e6)
                baseline = baseline - np.expm1(-(self.t[k] - self.t[k - 1]) / tau_us) * found[-1]
            frame[self.waiting[k]] = baseline[self.waiting[k]]
            found.append(np.float32(frame - baseline).astype(float))
        return found

    def above_mean(self, tau_ms):
        """The values above running means, after `above_rest`."""
        baseline, found = self.readings[0], []
        for k, frame in enumerate(self.readings):
            if k > 0:
                baseline = baseline - np.expm1(-(self.t[k] - self.t[k - 1]) / (1e3 * tau_ms)) * found[-1]
            found.append(frame - baseline)
        return found

    def values(self):
        """The quantities of each frame."""
        now = [self.of(u, 3) for u in self.above_rest()]
        for tau in self.encoder.local_ms:
            for k, u in enumerate(self.above_mean(tau)):
                up, down = self.of(u, 4), self.of(-u, 4)
                now[k] = [*now[k], up[0], up[1], down[1], down[0], up[3], down[3]]
        now = np.array(now)
        of_rest = now[:, :4]
        windows = [(now, 0, 3), (now, 2, 10), (of_rest, 0, 10), (of_rest, 0, 50)]
        past = [[mean(self.t, rows, k, *ages) for k in range(len(now))] for rows, *ages in windows]
        return np.concatenate([now, *past, np.ones((len(now), 1))], axis=1)


@settings(max_examples=settings.default.max_examples // 2, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    shape=st.sampled_from([(1, 1), (1, 7), (9, 1), (2, 2), (5, 7), (3, 66)]),
    noise=st.sampled_from([0.0, 0.3, 2.4, 30.0]),
    floor=st.sampled_from([0.0, 3.0]),
    least=st.sampled_from([0.3, 5.0]),
    rest_is=st.sampled_from(["tracked", "tare"]),
    local_ms=st.sampled_from([(), (50.0,), (50, 300), (0.4, 1e6, 7)]),
    missing=st.sampled_from([0.0, 0.3]),
    pause=st.sampled_from([192, 60_000, 3_600_000_000]),
)
def test_quantities_are_those_of_numpy(seed, shape, noise, floor, least, rest_is, local_ms, missing, pause):
    rng = np.random.default_rng(seed)
    array = Array(*shape, exists=rng.random(shape) >= missing)
    assume(array.exists.any())
    n = 80
    tare = some_tare(rng, array, noise, rng.choice([0.0, 0.2]))
    t = 5 + np.cumsum(rng.choice([100, 192, 2500, pause], n, p=[0.2, 0.7, 0.05, 0.05]))
    still = np.where(np.isnan(tare.rest), 50, tare.rest) + rng.choice([0.0, 8.0, -6.0], shape)
    readings = np.rint(rng.normal(still, noise, (n, *shape)))
    for _ in range(3):  # presses and releases, quick and slow, and changes that stay
        first, last = sorted(rng.integers(0, n + 1, 2))
        y, x = (rng.integers(0, size) for size in shape)
        readings[first:last, max(0, y - 1) : y + 2, max(0, x - 1) : x + 2] += rng.choice([-40, 3, 15, 100])
    stuck = rng.random(shape) < 0.1
    readings[n // 2 :, stuck] = rng.choice([0, 150])
    readings[: rng.integers(0, n), rng.random(shape) < 0.2] = 0  # no value yet
    readings = np.where(array.exists, np.clip(readings, 0, None), np.nan if missing else 0)
    encoder = LocalLoad(noise_floor=floor, least_noise=least, rest=rest_is, local_ms=local_ms, tare=tare)
    found = encoder.values(Frames(readings, t, unit="ticks", array=array))
    assert found.shape == (n, len(encoder.quantities)) == (n, 21 + 18 * len(local_ms))
    readings = np.nan_to_num(readings)
    fewest, most = (Oracle(encoder, t, readings, array.exists, bound).values() for bound in (4.0001, 3.9999))
    assert (found >= fewest - 1e-4 * (1 + np.abs(fewest))).all()
    assert (found <= most + 1e-4 * (1 + np.abs(most))).all()


def test_spikes_are_the_logarithm_of_the_quantities():
    events = touch(np.random.default_rng(3), scenes.ARRAY, repaired=0.1)
    for encoder in GRADED.values():
        values, spikes = encoder.values(events), encoder.encode(events)
        times, trains = spikes.to_numpy()
        samples = np.rint((times - spikes.start) / encoder.period_ms).astype(int)
        graded = np.zeros_like(values)
        graded[samples, trains] = spikes.values
        assert np.allclose(graded, np.log1p(values), rtol=1e-6)
        assert len(times) == np.count_nonzero(values)
        assert (values[:, -1] == 1).all()
        assert np.isfinite(values).all()


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    local_ms=st.sampled_from([(), (50.0,), (20, 300)]),
    levels=st.sampled_from([(4.0,), (0.5, 1.0, 3.0), (3.0, 4.0, 5.0, 6.0, 8.0)]),
    release=st.sampled_from([1.0, 0.8, 0.5, 0.01]),
)
def test_levels_are_crossed_where_the_largest_sums_of_numpy_cross_them(seed, local_ms, levels, release):
    rng = np.random.default_rng(seed)
    array = Array(5, 7)
    t = 5 + 192 * np.arange(150)
    readings = np.rint(rng.normal(55, rng.choice([0.0, 0.5, 2.0]), (150, 5, 7)))
    for _ in range(4):
        first, last = sorted(rng.integers(0, 150, 2))
        y, x = rng.integers(0, 5), rng.integers(0, 7)
        readings[first:last, max(0, y - 1) : y + 2, max(0, x - 1) : x + 2] += rng.choice([-40, 3, 6, 15])
    frames = Frames(readings, t, unit="ticks", array=array)
    graded = LocalLoad(local_ms=local_ms, tare=rest(array))
    columns = [k for k, name in enumerate(graded.quantities) if name.startswith("largest") and "mean" not in name]
    expected = []
    for column, values in enumerate(graded.values(frames)[:, columns].T):
        for place, level in enumerate(levels):
            reached, train = values[0] >= level, column * len(levels) + place
            for time, value in zip(t.tolist(), values, strict=True):
                if not reached and value >= level:
                    expected.append((time, train, 1.0))
                elif reached and value < release * level:
                    expected.append((time, len(columns) * len(levels) + train, 1.0))
                else:
                    continue
                reached = not reached
    encoder = LocalLoad(levels=levels, release=release, local_ms=local_ms, tare=rest(array))
    assert spikes_of(encoder.encode(frames)) == sorted(expected)
    assert encoder.trains(array) == 2 * len(columns) * len(levels)
    assert (encoder.kind, graded.kind) == ("unsigned", "graded")
