"""The encoders once more, plainly from their equations: one channel, one sample at a time, slow.

Each takes times in whole us and values of shape (samples, channels), and gives spikes as (t us, train, value).
"""

import numpy as np
from scipy import ndimage, signal

TICK_SHIFT = 0.5
#: Two sums of a potential, as a share of the range, or of a time in ms differ by rounding by no more.
ROUNDING = 1e-9


def change_events(t, values, noise_floor=3.0, bits=1, previous="last_sent", rounding="truncate"):
    """Equation 5.7 on float32 samples."""
    values, floor, most = np.asarray(values, np.float32), np.float32(noise_floor), 2**bits - 1
    spikes = []
    for channel in range(values.shape[1]):
        last = values[0, channel]
        for at, value in zip(t[1:], values[1:, channel], strict=True):
            u = np.float32(value - last)
            if rounding == "truncate":
                units = int(np.trunc(u / floor)) if abs(u) > floor else 0
            else:
                units = int(np.floor(u / floor))
            if units:
                spikes.append((at, channel, max(-most, min(most, units))))
            if units or previous == "last_sample":
                last = value
    return sorted(spikes)


def level_crossing(t, values, levels, end, release=lambda level: level, hold=0, tonic=None, tonic_level=None):
    """Crossings with release, hold and tonic spikes up to `end`; hold and tonic in us."""
    values = np.asarray(values, np.float32)
    channels, spikes = values.shape[1], []
    for channel in range(channels):
        for k, level in enumerate(levels):
            states = []  # (since, above)
            above = bool(values[0, channel] >= np.float32(level))
            states.append((t[0], above))
            for at, value in zip(t[1:], values[1:, channel], strict=True):
                now = bool(value >= np.float32(release(level) if above else level))
                if now != above:
                    states.append((at, now))
                    above = now
            said, told = states[0][1], [(t[0], states[0][1])]
            untils = [since for since, _ in states[2:]] + [end + 1] if len(states) > 1 else []
            for (since, state), until in zip(states[1:], untils, strict=True):
                if state != said and until - since >= hold and since + hold <= end:
                    said = state
                    told.append((since + hold, state))
                    spikes.append((since + hold, channel * len(levels) + k, 1 if state else -1))
            if tonic is not None and level == (levels[0] if tonic_level is None else tonic_level):
                for (since, state), until in zip(told, [s[0] for s in told[1:]] + [end + 1], strict=True):
                    if state:
                        train = channels * len(levels) + channel
                        spikes += [(at, train, 1) for at in range(since, until, tonic)]
    return sorted(spikes)


def running_range(t, values, low, high, window, renew):
    """Low and high at each sample by percentiles of the past window (us); NaN until the first is full."""
    t, ranges = np.asarray(t), []
    for at in t:
        j = (at - t[0] - window) // renew
        if j < 0:
            ranges.append(np.full((2, values.shape[1]), np.nan))
            continue
        end = t[0] + window + j * renew
        past = values[(t >= end - window) & (t < end)].astype(np.float64)
        ranges.append(np.percentile(past, [low, high], axis=0) if len(past) else ranges[-1])
    return np.array(ranges)


def izhikevich(inputs, a, gain, dt=0.1, start="settled"):
    """Steps in which one neuron spikes; `inputs` is 0 or 1 a step. Forward Euler, both equations from the old state."""
    b, c, d = 0.25, -65.0, 6.0
    v = (-(5 - b) - ((5 - b) * (5 - b) - 4 * 0.04 * 140) ** 0.5) / (2 * 0.04)
    u = b * v
    if start == "settled":
        for _ in range(1_000_000):
            old = v, u
            v, u = _step(v, u, a, b, gain * inputs[0], dt)
            if v >= 30:
                v, u = c, u + d
            elif (v, u) == old:
                break
    fired = []
    for k, on in enumerate(inputs):
        v, u = _step(v, u, a, b, gain * on, dt)
        if v >= 30:
            fired.append(k)
            v, u = c, u + d
    return fired


def _step(v, u, a, b, current, dt):
    return v + dt * (0.04 * v * v + 5.0 * v + 140.0 - u + current), u + dt * a * (b * v - u)


PUBLISHED = {"3.4.3": (0.02, 0.5), "6.5.1": (0.005, 0.6)}


def threshold_izhikevich(t, values, levels, end, published="6.5.1", start="settled"):
    """Hold samples over 0.1 ms steps from the first; spikes at their step's end, up to `end`."""
    values, (a, gain) = np.asarray(values, np.float32), PUBLISHED[published]
    steps = np.arange(t[0], end + 1, 100)
    held = np.searchsorted(t, steps, side="right") - 1
    spikes = []
    for channel in range(values.shape[1]):
        for k, level in enumerate(levels):
            on = (values[held, channel] >= np.float32(level)).astype(float)
            for sign, inputs in ((1, on), (-1, 1 - on)):
                for step in izhikevich(inputs, a, gain, start=start):
                    at = t[0] + 100 * (step + 1)
                    if at <= end:
                        spikes.append((at, channel * len(levels) + k, sign))
    return sorted(spikes)


def fa1(t, values, alpha=0.7, a=20.0, b=0.05, decay="sample", theta_0=None, largest=150.0, period_ms=1.0, bits=1):
    """Equations 5.1 to 5.5, and 5.7."""
    rho = np.maximum(np.asarray(values, np.float64), 0.0) ** alpha  # 5.1
    base = largest**alpha / 1024 if theta_0 is None else theta_0
    fall = b * base if decay == "sample" else b * period_ms * base
    spikes = []
    for channel in range(rho.shape[1]):
        u, theta, s = 0.0, base, 0
        for k in range(1, len(rho)):
            if s:  # 5.5
                theta = theta + period_ms * a * base
            elif theta > base:
                theta = theta - fall
            else:
                theta = base
            u += rho[k, channel] - rho[k - 1, channel]  # 5.2, 5.3
            s = 1 if u > theta else -1 if u < -theta else 0  # 5.4
            if s:
                size = 2**bits - 1 if base == 0 else min(max(int(abs(u) / base), 1), 2**bits - 1)  # 5.7
                spikes.append((t[k], channel, s * size))
                u = 0.0
    return sorted(spikes)


def contact_area(t, frames, rest, floor=3.0, levels=(2, 4, 8, 16, 32), before=None):
    """Rises and falls of the area of a grid or a single taxel; `rest` is NaN where unknown. The first has none."""
    spikes, loaded = [], np.zeros((1, 1), bool)
    for at, frame in zip(t, frames, strict=True):
        above = np.nan_to_num(frame - rest, nan=-np.inf)
        if single := above.size == 1:
            # Its noise is 0: it is loaded from the floor on, until it is below half of that.
            enough = max(floor, 1e-9)
            loaded = above >= np.where(loaded, 0.5 * enough, enough)
        else:
            loaded = above >= floor + TICK_SHIFT
        wide = np.pad(loaded, 1)
        rows, columns = loaded.shape
        beside = sum(
            wide[1 + dy : 1 + dy + rows, 1 + dx : 1 + dx + columns].astype(int)
            for dy in (-1, 0, 1)
            for dx in (-1, 0, 1)
            if (dy, dx) != (0, 0)
        )
        area = int((loaded & (single | (beside > 0))).sum())
        before = area if before is None else before
        for k, level in enumerate(levels):
            if before < level <= area:
                spikes.append((at, k, 1))
            if area < level <= before:
                spikes.append((at, len(levels) + k, 1))
        before = area
    return sorted(spikes)


def counted(frame, rest, floor):
    """Which taxels are loaded and have a loaded neighbour."""
    loaded = np.nan_to_num(frame - rest, nan=-np.inf) >= floor + TICK_SHIFT
    return loaded & (ndimage.convolve(loaded.astype(int), np.ones((3, 3)), mode="constant") > 1)


def moment_levels(levels, **ranges):
    """Each level as (moment, level); moments are area, total, peak, x and y."""
    every = []
    for k, name in enumerate(("area", "total", "peak", "displacement_mm", "displacement_mm")):
        if ranges.get(name) is not None:
            spaced = [float(f"{at:.11e}") for at in np.geomspace(*ranges[name], levels)]
            every += [(k, at) for at in spaced] + [(k, -at) for at in spaced if k > 2]
    return every


def moment_values(frames, rest, floor, pitch):
    """Area, total, peak, and the displacement of the centre in x and in y, of each frame."""
    values, origin = [], None
    for frame in frames.astype(np.float64):
        there = counted(frame, rest, floor)
        if not there.any():
            values.append([0.0] * 5)
            origin = None
            continue
        above = np.where(there, frame - rest, 0.0)
        y, x = ndimage.center_of_mass(above)
        origin = (x, y) if origin is None else origin
        values.append([there.sum(), above.sum(), above.max(), (x - origin[0]) * pitch, (y - origin[1]) * pitch])
    return np.array(values)


def centre_places(frames, rest, floor):
    """Column of the centre from -1 to 1, its square, row and that one's square, of each frame."""
    places = []
    for frame in frames.astype(np.float64):
        above = np.where(counted(frame, rest, floor), frame - rest, 0.0)
        y, x = ndimage.center_of_mass(above) if above.any() else [(n - 1) / 2 for n in above.shape]
        x, y = (2 * x / (above.shape[1] - 1) - 1, 2 * y / (above.shape[0] - 1) - 1)
        places.append([x, x**2, y, y**2])
    return np.array(places)


def sampled_moments(t, values, shown, ages, first, places=None):
    """A spike of each of the moments `shown` at each sample, and one of the largest age (us) that a touch has reached.

    Those of the `places` of the centre, if given, lie between. Trains are numbered from `first`; values are rounded to
    float32.
    """
    spikes, onset = [], None
    places = np.zeros((len(values), 0)) if places is None else places
    for time, sample, place in zip(t, values, places, strict=True):
        onset = None if sample[0] == 0 else time if onset is None else onset
        for n, moment in enumerate(shown):
            value = np.float32(np.sign(sample[moment]) * np.log1p(abs(sample[moment])))
            spikes += [(time, first + n, value)] if value else []
        for n, of in enumerate(place if onset is not None else []):
            spikes += [(time, first + len(shown) + n, np.float32(of))] if np.float32(of) else []
        reached = [] if onset is None else [k for k, age in enumerate(ages) if age <= time - onset]
        spikes += [(time, first + len(shown) + len(place) + reached[-1], np.float32(1))] if reached else []
    return spikes


def moments(t, frames, rest, end, floor, pitch, every, tonic=None):
    """Crossings of the levels in `every`, and tonic spikes (us) up to `end`."""
    spikes, values = [], moment_values(frames, rest, floor, pitch)
    for n, (moment, at) in enumerate(every):
        reached = values[:, moment] >= at if at > 0 else values[:, moment] <= at
        begin = None
        for time, is_, was in zip(t, reached, [reached[0], *reached[:-1]], strict=True):
            if is_ and begin is None:
                begin = time
            if is_ and not was:
                spikes.append((time, n, 1))
            if was and not is_:
                spikes.append((time, len(every) + n, 1))
                spikes += [(s, 2 * len(every) + n, 1) for s in range(begin, time, tonic)] if tonic else []
                begin = None
        if begin is not None and tonic:
            spikes += [(s, 2 * len(every) + n, 1) for s in range(begin, end + 1, tonic)]
    return sorted(spikes)


def afferent(t, values, stages, e, *, settled):
    """Linear filters (numerator, denominator in ms) in turn, and a moving threshold.

    The input of each moves in straight lines between samples, which what comes out of another does not quite.

    A spike is emitted at the first sample at which the potential has come up to the threshold and the refractory time
    is over; it counts from the time between the samples at which a straight line reaches the threshold. Returns the
    spikes (ms) up to the first sample at which rounding decides, and that time; `settled` is the filter's gain at rest.
    """
    x = np.maximum(np.asarray(values, float), 0) / e.range
    step = t[1] - t[0]
    # The filters are linear and at rest for the first value, so only the difference from it is filtered.
    potential = x - x[0]
    for stage in stages:
        potential = signal.lsim(stage, potential, t - t[0])[1]
    potential += settled * x[0]
    raised, wait, spikes = max(potential[0] - e.threshold, 0.0), 0.0, []
    for at, before, now in zip(t[1:], potential, potential[1:], strict=False):
        below, waited = e.threshold + raised - before, wait
        raised, wait = raised * np.exp(-step / e.recovery_ms), max(wait - step, 0.0)
        above = now - e.threshold - raised
        if abs(above) < ROUNDING or 0 < abs(waited - step) < ROUNDING:
            return np.array(spikes), at
        if above >= 0 and waited < step:
            crossed = step * below / (below + above) if below > 0 else 0.0
            since = step - max(crossed, waited)
            raised += e.jump * np.exp(-since / e.recovery_ms)
            wait = max(e.refractory_ms - since, 0.0)
            spikes.append(at)
    return np.array(spikes), np.inf


def slow(encoder, t, x):
    """Spikes of a slowly adapting afferent by the oracle, ms, and how far they are sure."""
    e = encoder
    # (1 + onset) - onset / (1 + s onset_ms) - loss / (1 + s loss_ms), over 1 + s membrane_ms.
    recent, long, membrane = ([tau, 1.0] for tau in (e.onset_ms, e.loss_ms, e.membrane_ms))
    both = np.polymul(recent, long)
    top = (1 + e.onset) * both - e.onset * np.pad(long, (1, 0)) - e.loss * np.pad(recent, (1, 0))
    return afferent(t, x, [(top, both), ([1.0], membrane)], e, settled=1 - e.loss)
