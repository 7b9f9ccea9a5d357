"""A plain rule against a loop over frames, written from its documentation; pieces, frames, files, live, tuning."""

import math
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import taxel
from taxel import Array, Events, Frames, ProblemError, Tare
from taxel.detect import Example, PlainRule, load, run, tune

ARRAY = Array(3, 4)
REST, FLOOR = 2.25, 1.0
HOUR = 3_600_000_000


def tare(array=ARRAY, rest=REST):
    """The taxels' rest, of which one is not known."""
    known = [rest] * (array.rows * array.columns)
    return Tare.take(Frames(np.reshape([known, known], (2, *array.shape)), [0, 1000], array=array))


class LocalLoad:
    """The largest 3 x 3 sum of clipped deviations from a rest that follows each taxel, in units of its noise."""

    def __init__(self):
        self.rest, self.above, self.t, self.waiting = np.full(ARRAY.shape, REST), np.zeros(ARRAY.shape), None, None

    def at(self, t, held):
        # The noise of `tare` is 0, so a taxel's is the least, 0.3; s is that with half the floor.
        s, far = math.hypot(0.3, FLOOR / 2), max(FLOOR + 0.5, 5 * 0.3)
        self.waiting = held == 0 if self.waiting is None else self.waiting & (held == 0)
        passed = 0 if self.t is None else t - self.t
        tau = np.where(np.abs(self.above) < far, 1e6, 20e6)
        self.rest = self.rest - np.expm1(-passed / tau) * self.above
        self.t, self.above = t, np.where(self.waiting, self.rest, held) - self.rest
        around = np.pad([np.clip(self.above, -3 * s, 3 * s), np.full(ARRAY.shape, s**2)], [(0, 0), (1, 1), (1, 1)])
        rows, columns = ARRAY.shape
        sums, noise = sum(around[:, y : y + rows, x : x + columns] for y in range(3) for x in range(3))
        return max(0.0, float((sums / np.sqrt(noise)).max()))


class Count:
    """How many levels above rest the taxels are above, each with memory."""

    def __init__(self, levels):
        on, off = ([np.full(ARRAY.shape, np.float32(REST + part * level)) for level in levels] for part in (1.0, 0.7))
        self.on_at, self.off_at, self.above = np.array(on), np.array(off), np.zeros((len(levels), *ARRAY.shape), bool)

    def at(self, _t, held):
        self.above = np.where(self.above, held >= self.off_at, held >= self.on_at)
        return float(self.above.sum())


def quantity(name, held):
    """The number of loaded taxels beside a loaded one, or the sum of their values above rest."""
    loaded = held >= REST + FLOOR + 0.5
    area, total = 0, 0.0
    for y, x in np.ndindex(held.shape):
        around = loaded[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2]
        if loaded[y, x] and around.sum() > 1:
            area, total = area + 1, total + max(float(held[y, x]) - REST, 0.0)
    return float(area) if name == "area" else float(np.float32(total))


def frame_of(t, period_us, stamp_us):
    """The last frame whose stamp, its start rounded down to whole units, is at or before a time."""
    k = int(Fraction(t + stamp_us) / Fraction(period_us)) + 2
    while math.floor(k * Fraction(period_us) / stamp_us) * stamp_us > t:
        k -= 1
    return k


class ByLoop:
    """Frames with changes, as (number, end, changes), of which each change is (time, area, quantity)."""

    def __init__(self, rule, source, frame_us, version=1, reach_us=0):
        self.frames, name = {}, rule.quantity
        held, follows = np.zeros(ARRAY.shape), {"local_load": LocalLoad(), "count": Count(rule.levels)}.get(name)

        def measured(t, held):
            return t, quantity("area", held), quantity(name, held) if follows is None else follows.at(t, held)

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
            while name == "local_load" and again < following:
                self.frames.setdefault(frame_of(again, period, stamp), []).append(measured(again, held))
                again += max(10_000, (again - now) // 8)
        self.end = lambda k: math.ceil((k + 1) * period)
        self.frame = lambda t: frame_of(t, period, stamp)

    @staticmethod
    def horizon(source, reach_us):
        """Until when a recording is continued."""
        return int(source.t.max()) + 1_000_000 + math.ceil(reach_us)

    def edges(self, threshold, release, frames, which=2, dated_at=None, *, of_largest=False):
        """The onsets and ends: (is end, t, known)."""
        loaded, first, since, before, found, rest, largest = False, None, 0, 0.0, [], 0.0, 0.0
        visited = self.frames if hasattr(self, "starts") else {
            n + more for n in self.frames for more in range(frames + 1)
        }  # fmt: skip

        def passes(value, *, dated=False):
            if of_largest:
                return value < rest + release * (largest - rest) if loaded else value >= rest + threshold
            if dated and dated_at is not None:
                return value < dated_at if loaded else value >= dated_at
            return value < release * threshold if loaded else value >= threshold

        for n in sorted(visited):
            for change in self.frames.get(n, []):
                passed = passes(before, dated=True)
                before = change[which]
                largest, rest = max(largest, before), rest if loaded else min(rest, before)
                if passes(before, dated=True) and not passed:
                    since = change[0]
            if not passes(before):
                first = None
                continue
            first = (n, since) if first is None else first
            if n - first[0] + 1 == frames:
                found.append((loaded, first[1], self.end(n)))
                loaded, first, largest = not loaded, None, before
                rest = rest if loaded else before
        return found

    def kinds(self, threshold, age_us, frame_us):
        """The kind of every touch: (is above, t, known)."""
        found = []
        for is_end, t, _ in self.edges(2.0, 1.0, 1, which=1):
            if is_end:
                continue
            at = t + age_us
            if hasattr(self, "starts"):
                last = max(k for k, start in enumerate(self.starts) if start <= at)
                periods = (at - self.starts[last]) // Fraction(frame_us) + 1
                known = math.ceil(self.starts[last] + periods * Fraction(frame_us))
            else:
                known = self.end(last := self.frame(at))
            value = self.frames[max(k for k in self.frames if k <= last)][-1][2]
            found.append((value >= threshold, t, known))
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


#: Local loads are compared with numbers that no sum reaches exactly, as they are computed in single precision.
LOCAL_LOADS = st.sampled_from([0.531, 1.071, 2.133, 3.317, 4.313])


@st.composite
def rules(draw):
    """A rule of edges: of any quantity, dated at its threshold or below it, or of its largest value."""
    name = draw(st.sampled_from(["area", "total", "local_load", "count"]))
    drawn = LOCAL_LOADS if name == "local_load" else st.sampled_from([1.0, 2.0, 3.0, 3.5, 4.0, 7.25, 9.0])
    threshold, release, how = draw(drawn), draw(st.sampled_from([0.125, 0.5, 0.75, 1.0])), {}
    if name == "count":
        how["levels"] = draw(st.sampled_from([[1.0], [1.75, 2.5], [0.5, 1.0, 2.0, 6.0]]))
    if draw(st.booleans()):
        how["of_largest"] = True
    elif draw(st.booleans()):
        part = draw(st.sampled_from([0.0, 0.3, 0.5, 1.0]))
        how["dated_at"] = release * threshold + part * (threshold - release * threshold)
    frames = draw(st.sampled_from([1, 1, 2, 3, 5, 20]))
    return PlainRule(name, threshold, release, frames, **how, labels=("on", "off"), noise_floor=FLOOR)


kinds = st.builds(
    lambda compared, age: PlainRule(*compared, age_ms=age, labels=("small", "large"), noise_floor=FLOOR),
    st.one_of(
        st.tuples(st.sampled_from(["area", "total"]), st.sampled_from([2.0, 3.0, 4.0, 7.25])),
        st.tuples(st.just("local_load"), LOCAL_LOADS),
    ),
    st.sampled_from([0.0, 0.1, 0.192, 0.5, 1.0, 40.0]),
)
clocks = st.sampled_from([(192.0, 1), (192.0, 2), (48.0, 1), (48.0, 2), (499.84, 1), (1000.0, 2)])


def expected(rule, source, frame_us, version=1):
    reach_us = rule.frames * frame_us + 1000 * (rule.age_ms or 0)
    loop = ByLoop(rule, source, frame_us, version, reach_us)
    if rule.age_ms is not None:
        return loop.kinds(rule.threshold, round(rule.age_ms * 1000), frame_us)
    how = {"dated_at": rule.dated_at, "of_largest": rule.of_largest}
    found = loop.edges(rule.threshold, rule.release, rule.frames, **how)
    if isinstance(source, Frames):
        return found
    # A frame that is not over when the recording ends decides nothing.
    last = loop.end(loop.frame(loop.horizon(source, reach_us)) - 1)
    return [one for one in found if one[2] <= last]


@settings(deadline=None)
@given(events(), st.one_of(rules(), kinds), clocks)
def test_events_give_what_a_loop_over_frames_gives(source, rule, clock):
    frame_us, version = clock
    found = run(rule, source, frame_us=frame_us, wire_version=version, tare=tare())
    assert as_tuples(found, rule) == expected(rule, source, frame_us, version)
    assert (found.t <= found.known).all()
    assert np.isnan(found.slope).all()
    assert not found.repaired.any()


@settings(max_examples=60, deadline=None)
@given(events(), rules(), clocks)
def test_a_curve_has_the_begins_and_ends_that_the_rule_finds(source, rule, clock):
    frame_us, version = clock
    found = run(rule, source, frame_us=frame_us, wire_version=version, tare=tare())
    how = rule.quantity, list(rule.levels), FLOOR
    curve = taxel._core.LoadCurve.of_events(*how, source._parts(), frame_us, version, tare().to_json())
    begins, ends = curve.edges(rule.threshold, rule.release, rule.frames, rule.dated_at, rule.of_largest)
    for label, (t, known, _) in (("on", begins), ("off", ends)):
        assert found[label].t.tolist() == t.tolist()
        assert found[label].known.tolist() == known.tolist()


@settings(max_examples=100, deadline=None)
@given(
    st.lists(st.tuples(st.sampled_from([1, 900, 1000, 1000, 2500, HOUR]),
                       st.lists(st.sampled_from([0.0, 3.0, 3.75, 3.8, 9.0]), min_size=12, max_size=12)),
             min_size=1, max_size=12),
    st.one_of(rules(), kinds),
)  # fmt: skip
def test_each_frame_of_the_input_is_one(steps, rule):
    t = np.cumsum([step for step, _ in steps])
    source = Frames(np.reshape([values for _, values in steps], (-1, 3, 4)), t, array=ARRAY)
    found = run(rule, source, frame_us=1000.0, tare=tare())
    assert as_tuples(found, rule) == expected(rule, source, 1000.0)
    stream = rule.stream(frame_us=1000.0, tare=tare())
    one_by_one = [stream.push(source[k : k + 1]) for k in range(len(source))]
    assert sum(one_by_one[1:], one_by_one[0]) + stream.advance(int(t[-1]) + 10_000_000) == found


@settings(max_examples=100, deadline=None)
@given(events(), st.one_of(rules(), kinds), clocks, st.data())
def test_pieces_give_what_the_whole_gives(source, rule, clock, data):
    frame_us, version = clock
    whole = run(rule, source, frame_us=frame_us, wire_version=version, tare=tare())
    stream = rule.stream(ARRAY, frame_us=frame_us, wire_version=version, tare=tare())
    cuts = sorted(data.draw(st.sets(st.integers(0, len(source)))))
    parts = []
    for start, stop in pairwise([0, *cuts, len(source)]):
        parts.append(stream.push(source[start:stop]))
        if stop < len(source) and stop and data.draw(st.booleans()):
            # Time may be advanced to anywhere before what follows.
            latest, following = int(source.t[:stop].max()), int(source.t[stop:].min())
            if following > latest:
                parts.append(stream.advance(data.draw(st.integers(latest, following))))
    parts.append(stream.advance(int(source.t.max()) + 2_000_000))
    joined = sum(parts[1:], parts[0])
    assert joined[: len(whole)] == whole
    # Long after the end of the events a load that stays may have become the rest.
    assert (joined.known[len(whole) :] > source.t.max() + 1_000_000).all()


def press(ticks=9, start=10_000, stop=20_000, array=ARRAY):
    """Two taxels loaded from one stamp until another."""
    t = [start, start, stop, stop]
    return Events(t, [1, 2, 1, 2], [1] * 4, [True, True, False, False], array=array,
                  intensity=np.array([ticks, ticks, 0, 0]))  # fmt: skip


def test_one_frame_of_two_taxels():
    rule = PlainRule("area", 2, noise_floor=FLOOR)
    found = run(rule, press(), tare=tare())
    assert list(found.label) == ["contact", "lift"]
    assert list(found.t) == [10_000, 20_000]
    # The frames to which these stamps belong begin at 52 x 192 and at 104 x 192.
    assert list(found.known) == [53 * 192, 105 * 192]


def test_a_board_s_stamps_are_known_at_the_end_of_their_frames():
    """With version 1 a stamp is floor(1.92 k) units of 100 us, and its frame k ends at 192 (k + 1) us."""
    for k in (3, 260, 1_000, 5_207):
        stamps = [math.floor(1.92 * n) * 100 for n in (k, k + 50)]
        found = run(PlainRule("area", 2, noise_floor=FLOOR), press(start=stamps[0], stop=stamps[1]), tare=tare())
        assert found.t.tolist() == stamps
        assert found.known.tolist() == [192 * (k + 1), 192 * (k + 51)]


@pytest.mark.parametrize(("threshold", "found"), [(2.0, 2), (math.nextafter(2.0, 3.0), 0)])
def test_a_value_at_the_threshold_counts(threshold, found):
    assert len(run(PlainRule("area", threshold, noise_floor=FLOOR), press(), tare=tare())) == found
    # 9 - 2.25 twice, exact in single precision.
    total = PlainRule("total", threshold * 6.75, noise_floor=FLOOR)
    assert len(run(total, press(), tare=tare())) == found


def test_the_local_load_of_what_stays_fades_while_no_event_comes():
    """Two taxels 6.75 above rest are far from it: it follows with 20 s, and their sum falls below 2 units of noise."""
    found = run(PlainRule("local_load", 2.0, noise_floor=FLOOR), press(stop=120_000_000), tare=tare())
    assert list(found.label) == ["contact", "lift"]
    # 20 s x ln(6.75 / 1.5) until they are near, then fast; computed anew within an eighth of that.
    assert 30_000_000 < found.t[1] - found.t[0] < 35_000_000


def test_single_taxels_that_stick_or_flicker_are_no_local_load():
    t = np.arange(10_000, 1_000_000, 200)
    flicker = Events(t, np.ones(len(t), int), np.ones(len(t), int), t % 400 == 0, array=ARRAY,
                     intensity=np.where(t % 400 == 0, 900, 2))  # fmt: skip
    assert not len(run(PlainRule("local_load", 4.0, noise_floor=FLOOR), flicker, tare=tare()))
    assert len(run(PlainRule("local_load", 0.9, noise_floor=FLOOR), flicker, tare=tare())) > 2


def test_a_label_left_out_is_not_detected():
    assert list(run(PlainRule("area", 2, labels=(None, "off"), noise_floor=FLOOR), press(), tare=tare()).label) == [
        "off"
    ]


@pytest.mark.parametrize(
    ("arguments", "options", "said"),
    [
        (
            ("total", 110.841, 0.5, 2),
            {"labels": (None, "end")},
            "total (N) falls below 55.4 after 111 or more, 2 frames",
        ),
        (("peak", 48, 1.0, 10), {"labels": ("begin", None)}, "peak (units of noise) >= 48, release 1, 10 frames"),
        (("area", 4, 0.5), {}, "area >= 4, release 0.5, 1 frame"),
        (("total", 1674.2, 0.75), {"labels": (None, "end")}, "total (N) falls below 1260 after 1670 or more, 1 frame"),
        (("total", 1_674_231.4), {}, "total (N) >= 1674230, release 1, 1 frame"),
        (
            ("duration", 300, 1.0, 1, "end"),
            {"labels": ("tap", "press")},
            "one rule for both kinds, the duration (ms) of the touch, when it ends: below 300 tap, otherwise press",
        ),
    ],
)
def test_what_it_compares_is_said_with_its_unit(arguments, options, said):
    assert PlainRule(*arguments, **options, unit="N")._compared() == said


def test_what_rests_on_repaired_values_is_marked():
    source = press()
    for marked, expected_ in (([True, False, False, False], [True, False]), ([False] * 3 + [True], [False, True])):
        events = Events(source.t, source.x, source.y, source.p, array=ARRAY, intensity=source.intensity,
                        repaired=np.array(marked))  # fmt: skip
        for frames in (1, 5):
            found = run(PlainRule("area", 2, frames=frames, noise_floor=FLOOR), events, tare=tare())
            assert list(found.repaired) == expected_


def test_zeroed_taxels_change_the_load():
    source = press(stop=50_000)
    stream = PlainRule("area", 2, noise_floor=FLOOR).stream(ARRAY, tare=tare())
    assert len(stream.push(source)) == 1
    assert stream.late == 0
    assert stream.potentials == {}


RULES = [
    PlainRule("area", 2),
    PlainRule("total", 1 / 3, 0.1 + 0.2, 20, labels=("a", None), noise_floor=0.0, tare=tare()),
    PlainRule("area", 12, age_ms=5, labels=("small", "large")),
    PlainRule("local_load", 4.0, 0.5, 20),
    PlainRule("count", 8, 4.5 / 8, levels=[5.0, 10.0], dated_at=6.0),
    PlainRule("range_count", 3, 0.5, levels=[0.1, 0.2]),
    PlainRule("total", 30.0, 0.25, of_largest=True),
]


@pytest.mark.parametrize("rule", RULES, ids=repr)
def test_a_saved_rule_is_the_rule(rule, tmp_path: Path):
    path = rule.save(tmp_path / "rule.json")
    for again in (PlainRule.load(path), load(path), PlainRule.from_json(rule.to_json())):
        assert isinstance(again, PlainRule)
        assert again == rule
        assert again.to_json() == rule.to_json()
        assert (again.quantity, again.threshold, again.release, again.frames, again.age_ms, again.labels) == (
            rule.quantity, rule.threshold, rule.release, rule.frames, rule.age_ms, rule.labels
        )  # fmt: skip
        assert (again.levels, again.dated_at, again.of_largest) == (rule.levels, rule.dated_at, rule.of_largest)
        assert again.tare == rule.tare
        assert again.noise_floor == rule.noise_floor
    with pytest.raises(taxel.FormatError, match=r'rule\.json: readout: format is "taxel plain rule"'):
        taxel.Readout.load(path)
    assert rule != PlainRule("area", 3)


def test_one_loader_reads_both_and_refuses_others(tmp_path: Path):
    readout = taxel.Readout(taxel.encode.LevelCrossing([1.0]), {"a": (taxel.Neuron(), [1.0, 0.0])})
    assert load(readout.save(tmp_path / "readout.json")) == readout
    (tmp_path / "other.json").write_text('{"format": "song", "version": 1}')
    with pytest.raises(taxel.FormatError, match='must be "taxel readout" or "taxel plain rule"'):
        load(tmp_path / "other.json")
    with pytest.raises(taxel.FormatError, match='plain rule: format is "taxel readout"'):
        PlainRule.load(tmp_path / "readout.json")
    (tmp_path / "bytes.json").write_bytes(b"{\xff\xfe")
    with pytest.raises(taxel.FormatError, match="not text"):
        load(tmp_path / "bytes.json")


@pytest.mark.parametrize(
    ("arguments", "options", "text"),
    [
        (("force", 2), {}, "quantity"),
        (("area", 0), {}, "threshold is 0"),
        (("area", math.nan), {}, "threshold"),
        (("area", 2, 0), {}, "release is 0"),
        (("area", 2, 1.5), {}, "release is 1.5"),
        (("area", 2, 1, 0), {}, "frames is 0"),
        (("area", 2, 1, 1, -1), {"labels": ("a", "b")}, "age_ms is -1"),
        (("area", 2, 0.5, 1, 5), {"labels": ("a", "b")}, "release is 0.5 and frames is 1: with age_ms both must be 1"),
        (("area", 2, 1, 5, 5), {"labels": ("a", "b")}, "release is 1 and frames is 5: with age_ms both must be 1"),
        (("area", 2, 1, 1, 5), {}, "labels are missing"),
        (("area", 2), {"labels": (None, None)}, "labels are both left out"),
        (("area", 2), {"labels": ("a", "a")}, "labels are both a"),
        (("area", 2), {"labels": ("a",)}, "labels is"),
        (("area", 2), {"labels": "ab"}, "labels is"),
        (("area", 2), {"noise_floor": -1}, "noise_floor is -1"),
        (("count", 2), {}, "levels"),
        (("area", 2), {"levels": [1.0]}, "levels"),
        (("count", 2), {"levels": [2.0, 1.0]}, "levels"),
        (("count", 2), {"levels": [0.0]}, "levels"),
        (("area", 2, 0.5), {"dated_at": 0.9}, "dated_at"),
        (("area", 2, 0.5), {"dated_at": 2.1}, "dated_at"),
        (("area", 2, 0.5), {"dated_at": 1.5, "of_largest": True}, "dated_at"),
        (("area", 2, 1, 1, 5), {"labels": ("a", "b"), "of_largest": True}, "of_largest"),
    ],
)
def test_nonsense_is_refused_by_name(arguments, options, text):
    with pytest.raises(ProblemError, match=text):
        PlainRule(*arguments, **options)


def test_what_a_rule_cannot_read_is_refused():
    rule = PlainRule("area", 2)
    with pytest.raises(ProblemError, match="plain rule without a tare"):
        run(rule, press())
    with pytest.raises(ProblemError, match=r"must be a taxel\.Recording, .*, for a plain rule"):
        run(rule, taxel.SpikeTrains.from_lists([[1.0]]))
    with pytest.raises(ProblemError, match="tare of 3 x 4"):
        run(rule, press(array=Array(4, 4)), tare=tare())


# Counts by running range


def test_a_count_by_running_range_is_what_a_loop_over_frames_counts():
    """Levels are parts of what each channel read in the last ten seconds, renewed each second; none before."""
    draw, levels = np.random.default_rng(5), [0.1, 0.3, 0.6]
    t = np.cumsum(draw.choice([90_000, 100_000, 100_000, 130_000, 2_500_000], 400, p=[0.2, 0.4, 0.2, 0.19, 0.01]))
    values = np.float32(draw.normal(500 * np.sin(t / 3e5), 60)[:, None] + [0.0, 1000.0]) * np.float32([1.0, 0.2])
    frames = Frames(values[:, None, :], t, array=Array(1, 2))

    def percentile(window, percent):
        ranked, rank = np.sort(window), percent / 100.0 * (len(window) - 1)
        below = float(ranked[int(rank)])
        following = ranked[min(int(rank) + 1, len(ranked) - 1)]
        return below + (float(following) - below) * (rank - int(rank))

    above, renewed, ranges, counts = np.zeros((3, 2), bool), None, None, []
    for k, now in enumerate(t.tolist()):
        due = int(t[0]) + 10_000_000 if renewed is None else renewed + 1_000_000
        if now >= due:
            renewed = due + (now - due) // 1_000_000 * 1_000_000
            since = -1 if ranges is None and renewed == due else renewed - 10_000_000
            window = values[:k][t[:k] >= since]
            if len(window):
                low, high = (np.array([percentile(one, p) for one in window.T]) for p in (10.0, 95.0))
                ranges = low, high - low
        if ranges is not None:
            on, off = (
                np.float32([[a + part * level * span for a, span in zip(*ranges, strict=True)] for level in levels])
                for part in (1.0, 0.7)
            )
            above = np.where(above, values[k] >= off, values[k] >= on)
        counts.append(int(above.sum()))
    assert max(counts) == 6
    changes = [
        (now, count) for now, count, last in zip(t.tolist(), counts, [0, *counts], strict=False) if count != last
    ]
    curve = taxel._core.LoadCurve.of_frames("range_count", levels, 0.0, frames._parts(), None, None)
    assert list(zip(*(column.tolist() for column in curve.changes()), strict=True)) == changes
    # It needs no tare.
    rule = PlainRule("range_count", 4, 2.5 / 4, levels=levels, dated_at=3.0)
    whole, stream = run(rule, frames, frame_us=100_000.0), rule.stream(frame_us=100_000.0)
    pieces = [stream.push(frames[k : k + 7]) for k in range(0, len(t), 7)]
    assert sum(pieces[1:], pieces[0]) + stream.advance(int(t[-1]) + 2_000_000) == whole
    assert len(whole) > 20


# Tuning


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


def test_tuning_finds_a_planted_rule():
    examples = [played(seed) for seed in range(3)]
    rules = tune(examples)
    assert (rules["hit"].quantity, rules["hit"].threshold, rules["hit"].frames) == ("area", 16.0, 1)
    assert repr(rules["hit"]).endswith("onset hit)")
    assert repr(rules["gone"]).endswith("end gone)")
    for example_ in [played(17), *examples]:
        for name, rule in rules.items():
            found = run(rule, example_.source, tare=example_.tare)
            score = taxel.detect.score(found, {name: example_.labels[name]}, 50)
            assert (score.missed, score.false) == (0, 0)


def test_tuning_says_none_where_no_rule_is_better_than_nothing():
    example_ = played(1)
    nowhere = Example(example_.source, {"never": np.array([5_000, 5_100, 5_200])}, example_.tare)
    assert tune([nowhere], window_ms=1.0) == {"never": None}
    assert tune([example_], ["hit", "absent"])["absent"] is None
    trains = taxel.encode.ContactArea(tare=example_.tare).encode(example_.source)
    assert tune([Example(trains, example_.labels)]) == {"gone": None, "hit": None}


def test_tuning_tells_two_kinds_by_area_at_an_age():
    draw = np.random.default_rng(3)
    array, rows, labels = Array(12, 12), [], {"small": [], "large": []}
    for k in range(30):
        start, large = 20_000 + 100_000 * k, bool(draw.integers(2))
        labels["large" if large else "small"].append(start - 200)
        # Both begin with 2 x 2; the large one grows from 2.5 ms on.
        for t, side, value in ((start, 2, 20), (start + 2_500, 5 if large else 3, 20), (start + 20_000, 5, 0)):
            rows.extend((t, 1 + j % side, 1 + j // side, value) for j in range(side * side))
    t, x, y, ticks = zip(*rows, strict=True)
    events = Events(t, x, y, np.array(ticks) > 0, array=array, intensity=np.array(ticks))
    example_ = Example(events, labels, tare(array, 0.0))
    rules = tune([example_])
    assert rules["small"] == rules["large"]
    assert rules["small"].age_ms == 3.0
    assert rules["small"].labels == ("small", "large")
    assert 9 < rules["small"].threshold < 25
    score = taxel.detect.score(run(rules["small"], events, tare=example_.tare), labels, 50)
    assert (score.missed, score.false) == (0, 0)
    # With a third label that is an end, the two are still kinds.
    with_end = labels | {"off": [t + 20_200 for one in labels.values() for t in one]}
    found = tune([Example(events, with_end, example_.tare)])
    assert found["small"] == rules["small"]
    assert found["off"].labels == ("off",)


def test_tuning_frames():
    source, held, values = played(4), np.zeros((12, 12)), []
    stamps = np.unique(source.source.t)
    for t in stamps:
        now = source.source[source.source.t == t]
        held[now.y, now.x] = now.intensity
        values.append(held.copy())
    frames = Frames(values, stamps, array=source.source.array)
    rules = tune([Example(frames, source.labels, source.tare)])
    assert rules["hit"] is not None
    assert rules["hit"].labels == ("hit",)
    for wrong in ({"window_ms": -1.0}, {"noise_floor": -1.0}, {"labels": [3]}):
        with pytest.raises(ProblemError):
            tune([source], **wrong)
    # Events without a rest have no load; frames have counts by running range.
    with pytest.raises(ProblemError, match="tare"):
        tune([source._replace(tare=None)])
