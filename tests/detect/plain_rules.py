"""Plain rules drawn, a loop over frames that finds what they find, written from their documentation, and touches."""

import math
from fractions import Fraction
from itertools import pairwise

import numpy as np
from hypothesis import strategies as st

from taxel import Array, Events, Frames, Tare
from taxel.detect import Example, PlainRule

ARRAY = Array(3, 4)
REST, FLOOR = 2.25, 1.0
HOUR = 3_600_000_000


def tare(array=ARRAY, rest=REST):
    """The taxels' rest, of which one is not known."""
    known = [rest] * (array.rows * array.columns)
    return Tare.take(Frames(np.reshape([known, known], (2, *array.shape)), [0, 1000], array=array))


class Changes:
    """What all taxels gain and lose against running means of 100 ms: the smaller, and the rise and fall of the sum."""

    def __init__(self, name):
        self.name, self.means, self.above, self.t, self.waiting = name, None, np.zeros(ARRAY.shape), None, None

    def at(self, t, held):
        self.waiting = held == 0 if self.waiting is None else self.waiting & (held == 0)
        values = np.where(self.waiting, REST, held)
        self.means = values if self.means is None else self.means
        passed = 0 if self.t is None else t - self.t
        self.means = self.means - math.expm1(-passed / 1e5) * self.above
        self.t, self.above = t, values - self.means
        gains, losses = np.maximum(self.above, 0.0).sum(), np.maximum(-self.above, 0.0).sum()
        return {"moved": min(gains, losses), "rise": max(gains - losses, 0.0), "fall": max(losses - gains, 0.0)}[
            self.name
        ]


class Count:
    """How many levels above rest the taxels are above, each with memory."""

    def __init__(self, levels):
        on, off = ([np.full(ARRAY.shape, np.float32(REST + part * level)) for level in levels] for part in (1.0, 0.7))
        self.on_at, self.off_at, self.above = np.array(on), np.array(off), np.zeros((len(levels), *ARRAY.shape), bool)

    def at(self, _t, held):
        self.above = np.where(self.above, held >= self.off_at, held >= self.on_at)
        return float(self.above.sum())


class BeginArea:
    """How many loaded taxels have been so since a touch began, or since less than a level after it."""

    def __init__(self, levels):
        self.levels, self.began, self.levels_of = levels, None, np.zeros(ARRAY.shape, int)

    def at(self, t, held):
        loaded = beside_loaded(held)
        self.began = None if not loaded.any() else t if self.began is None else self.began
        below = 0 if self.began is None else sum(t - self.began < 1000 * level for level in self.levels)
        self.levels_of = np.where(loaded, np.maximum(self.levels_of, below), 0)
        return float(self.levels_of.sum())


def beside_loaded(held):
    """Which taxels are loaded, beside a loaded one."""
    loaded = held >= REST + FLOOR + 0.5
    around = [loaded[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2].sum() for y, x in np.ndindex(held.shape)]
    return loaded & (np.reshape(around, held.shape) > 1)


def quantity(name, held):
    """The number of loaded taxels beside a loaded one, or the sum of what taxels, each alone, read above rest."""
    if name == "area":
        return float(beside_loaded(held).sum())
    above = np.where(held >= REST + FLOOR + 0.5, held - REST, 0.0)
    return float(np.float32(above.sum() - (above.max() if name == "load_without_largest" else 0.0)))


def frame_of(t, period_us, stamp_us):
    """The last frame whose stamp, its start rounded down to whole units, is at or before a time."""
    k = int(Fraction(t + stamp_us) / Fraction(period_us)) + 2
    while math.floor(k * Fraction(period_us) / stamp_us) * stamp_us > t:
        k -= 1
    return k


class ByLoop:
    """Frames with changes, as (number, end, changes), of which each change is (time, area, quantity)."""

    def __init__(self, rule, source, frame_us, version=1, reach_us=0):
        self.frames, name, self.frame_us = {}, rule.quantity, Fraction(frame_us)
        of_levels = {"count": Count, "begin_area": BeginArea}
        held, follows = np.zeros(ARRAY.shape), Changes(name) if name in CHANGES else None
        follows = of_levels[name](rule.levels) if name in of_levels else follows
        touched_since = None

        def measured(t, held):
            nonlocal touched_since
            area, value = quantity("area", held), quantity(name, held) if follows is None else follows.at(t, held)
            touched_since = None if area < 1 else t if touched_since is None else touched_since
            counts = rule.touched_ms is None or (
                touched_since is not None and t - touched_since >= 1000 * rule.touched_ms
            )
            return t, area, value if counts else 0.0

        if isinstance(source, Frames):
            self.starts = [int(t) for t in source.t]
            for k, (t, frame) in enumerate(zip(self.starts, source.values, strict=True)):
                self.frames[k] = [measured(t, frame)]
            self.end = lambda k: math.ceil(self.starts[k] + Fraction(frame_us))
            return
        period, stamp = Fraction(frame_us), 100 if version == 1 else 1
        now = int(source.t[0])
        for k in range(len(source)):
            now = max(now, int(source.t[k]))
            held[source.y[k], source.x[k]] = source.intensity[k]
            following = self.horizon(source, reach_us) if k + 1 == len(source) else max(now, int(source.t[k + 1]))
            if following == now:
                continue
            self.frames.setdefault(frame_of(now, period, stamp), []).append(measured(now, held))
            # What a rest that follows changes is computed between stamps too.
            again = now + 10_000
            while (name in CHANGES or rule.touched_ms is not None) and again < following:
                self.frames.setdefault(frame_of(again, period, stamp), []).append(measured(again, held))
                again += max(10_000, (again - now) // 8)
        self.end = lambda k: math.ceil((k + 1) * period)
        self.frame = lambda t: frame_of(t, period, stamp)

    @staticmethod
    def horizon(source, reach_us):
        """Until when a recording is continued."""
        return int(source.t.max()) + 1_000_000 + math.ceil(reach_us)

    def held_at(self, at):
        """The frame that holds at a time, and when that is known."""
        if not hasattr(self, "starts"):
            return self.frame(at), self.end(self.frame(at))
        k = max(k for k, start in enumerate(self.starts) if start <= at)
        periods = (at - self.starts[k]) // self.frame_us + 1
        return k, math.ceil(self.starts[k] + periods * self.frame_us)

    def edges(self, level, release, quiet_ms=0.0, date=None, which=2):
        """The onsets and ends: (is end, t, known)."""
        limits = level, release * level
        dated = limits if date is None else (date * level, date * level)
        # The first frame shows whether the sensor is loaded; before events it is not.
        loaded = hasattr(self, "starts") and self.frames[0][-1][which] >= level
        since, before, waits, found = 0, 0.0, None, []

        def passes(value, limits):
            return value < limits[1] if loaded else value >= limits[0]

        for n in [*sorted(self.frames), None]:
            if waits is not None and (n is None or self.held_at(waits[0])[0] < n):
                found.append((loaded, waits[1], self.held_at(waits[0])[1]))
                loaded, waits = not loaded, None
            for change in self.frames.get(n, []):
                passed, before = passes(before, dated), change[which]
                if passes(before, dated) and not passed:
                    since = change[0]
                if not passes(before, limits):
                    waits = None
                elif waits is None:
                    waits = change[0] + round(1000 * quiet_ms) * loaded, since
        return found

    def kinds(self, level, age_us):
        """The kind of every touch: (is above, t, known)."""
        found = []
        for is_end, t, _ in self.edges(1.0, 1.0, which=1):
            if not is_end:
                last, known = self.held_at(t + age_us)
                value = self.frames[max(k for k in self.frames if k <= last)][-1][2]
                found.append((value >= level, t, known))
        return found


def as_tuples(found, rule):
    second = rule._parts["labels"][1]
    return [(label == second, t, known) for label, t, known in zip(found.label, found.t, found.known, strict=True)]


@st.composite
def events(draw):
    """Events at stamps or at any time, some late, with pauses up to an hour; values near the loaded ones."""
    n = draw(st.integers(1, 60))
    steps = draw(st.lists(st.sampled_from([0, 0, 0, 1, 50, 96, 100, 100, 192, 200, 400, 1000, HOUR, -100, -300]),
                          min_size=n, max_size=n))  # fmt: skip
    t = np.maximum(np.cumsum(steps) + 500, 0)
    places = draw(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 2)), min_size=n, max_size=n))
    ticks = draw(st.lists(st.sampled_from([0, 2, 3, 4, 4, 5, 9]), min_size=n, max_size=n))
    x, y = zip(*places, strict=True)
    return Events(t, x, y, [True] * n, array=ARRAY, intensity=np.array(ticks))


CHANGES = ("moved", "rise", "fall")
#: Changes are compared with numbers that no sum reaches exactly, as they are computed in single precision.
UNREACHED = st.sampled_from([0.531, 1.071, 2.133, 3.317, 4.313])


@st.composite
def rules(draw):
    """A rule of edges: of any quantity, dated at its level or below it, with a quiet time and a constant."""
    name = draw(st.sampled_from(["area", "load", "load_without_largest", "count", "begin_area", *CHANGES]))
    drawn = UNREACHED if name in CHANGES else st.sampled_from([1.0, 2.0, 3.0, 3.5, 4.0, 7.25, 9.0])
    level, release, how = draw(drawn), draw(st.sampled_from([0.125, 0.5, 0.75, 1.0])), {}
    if name == "count":
        how["levels"] = draw(st.sampled_from([[1.0], [1.75, 2.5], [0.5, 1.0, 2.0, 6.0]]))
    if name == "begin_area":
        how["levels"] = draw(st.sampled_from([[0.05], [0.192, 0.4], [0.1, 1.0, 20.0]]))
    if draw(st.booleans()):
        how["date"] = release + draw(st.sampled_from([0.0, 0.3, 0.5, 1.0])) * (1.0 - release)
    how["touched_ms"] = draw(st.sampled_from([None, None, 0.0, 0.3, 5.0]))
    quiet_ms, how["constant_ms"] = (
        draw(st.sampled_from([0.0, 0.0, 0.1, 0.192, 1.0, 40.0])),
        draw(st.sampled_from([0.0, 0.3, -2.0])),
    )
    return PlainRule(name, level, release, quiet_ms, **how, labels=("on", "off"), noise_floor=FLOOR)


kinds = st.builds(
    lambda compared, age: PlainRule(*compared, age_ms=age, labels=("small", "large"), noise_floor=FLOOR),
    st.one_of(
        st.tuples(st.sampled_from(["area", "load"]), st.sampled_from([2.0, 3.0, 4.0, 7.25])),
        st.tuples(st.sampled_from(CHANGES), UNREACHED),
    ),
    st.sampled_from([0.0, 0.1, 0.192, 0.5, 1.0, 40.0]),
)
clocks = st.sampled_from([(192.0, 1), (192.0, 2), (48.0, 1), (48.0, 2), (499.84, 1), (1000.0, 2)])


def in_pieces(stream, source, data):
    """What a stream says of pieces, between which time may be advanced to anywhere before what follows."""
    cuts, parts = sorted(data.draw(st.sets(st.integers(0, len(source))))), []
    for start, stop in pairwise([0, *cuts, len(source)]):
        parts.append(stream.push(source[start:stop]))
        if 0 < stop < len(source) and data.draw(st.booleans()):
            latest, following = int(source.t[:stop].max()), int(source.t[stop:].min())
            if following > latest:
                parts.append(stream.advance(data.draw(st.integers(latest, following))))
    return [*parts, stream.advance(int(source.t.max()) + 2_000_000)]


def expected(rule, source, frame_us, version=1):
    reach_us = frame_us + 1000 * (rule.quiet_ms + (rule.age_ms or 0))
    loop = ByLoop(rule, source, frame_us, version, reach_us)
    if rule.age_ms is not None:
        return loop.kinds(rule.level, round(rule.age_ms * 1000))
    found = loop.edges(rule.level, rule.release, rule.quiet_ms, rule.date)
    constant_us = round(1000 * rule.constant_ms)
    if not isinstance(source, Frames):
        # A frame that is not over when the recording ends decides nothing.
        last = loop.end(loop.frame(loop.horizon(source, reach_us)) - 1)
        found = [one for one in found if one[2] <= last]
    return [(is_end, t - constant_us, known) for is_end, t, known in found]


def played(seed, touches=12, gap_us=60_000):
    """Touches of a planted size, with noise on single taxels and smaller touches between; labels 300 us early."""
    draw = np.random.default_rng(seed)
    rows, on, off = [], [], []
    array = Array(12, 12)

    def square(start, stop, side, ticks=20):
        x0, y0 = draw.integers(0, 12 - side, 2)
        for t, value in ((start, ticks), (stop, 0)):
            rows.extend((t, x0 + k % side, y0 + k // side, value) for k in range(side * side))

    for k in range(touches):
        start = 20_000 + k * gap_us + int(draw.integers(0, 50)) * 100
        stop = start + int(draw.integers(50, 200)) * 100
        square(start, stop, 5)
        on.append(start - 300)
        off.append(stop - 300)
        square(stop + 8_000, stop + 9_000, 3)
    rows.sort(key=lambda row: row[0])
    t, x, y, ticks = zip(*rows, strict=True)
    events = Events(t, x, y, np.array(ticks) > 0, array=array, intensity=np.array(ticks))
    return Example(events, {"hit": np.array(on), "gone": np.array(off)}, tare(array, 0.0))
