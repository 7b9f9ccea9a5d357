"""A plain rule against a loop over frames, written from its documentation; pieces, frames, files, live, tuning."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plain_rules import ARRAY, FLOOR, as_tuples, clocks, events, expected, in_pieces, kinds, played, rules, tare

import taxel
from taxel import Array, Events, Frames
from taxel.detect import Example, PlainRule, run, score, tune


@settings(deadline=None)
@given(events(), st.one_of(rules(), kinds), clocks)
def test_events_give_what_a_loop_over_frames_gives(source, rule, clock):
    frame_us, version = clock
    found = run(rule, source, frame_us=frame_us, wire_version=version, tare=tare())
    assert as_tuples(found, rule) == expected(rule, source, frame_us, version)
    assert (found.t + round(1000 * rule.constant_ms) <= found.known).all()
    assert np.isnan(found.slope).all()
    assert not found.repaired.any()


@settings(max_examples=2 * settings.default.max_examples, deadline=None)
@given(events(), st.one_of(rules(), kinds), clocks, st.data())
def test_pieces_give_what_the_whole_gives(source, rule, clock, data):
    frame_us, version = clock
    whole = run(rule, source, frame_us=frame_us, wire_version=version, tare=tare())
    stream = rule.stream(ARRAY, frame_us=frame_us, wire_version=version, tare=tare())
    parts = in_pieces(stream, source, data)
    joined = sum(parts[1:], parts[0])
    assert joined[: len(whole)] == whole
    # Long after the end of the events a load that stays may have become the rest.
    assert (joined.known[len(whole) :] > source.t.max() + 1_000_000).all()


def press(ticks=9, start=10_000, stop=20_000, array=ARRAY):
    """Two taxels loaded from one stamp until another."""
    t = [start, start, stop, stop]
    return Events(t, [1, 2, 1, 2], [1] * 4, [True, True, False, False], array=array,
                  intensity=np.array([ticks, ticks, 0, 0]))  # fmt: skip


def test_what_rests_on_repaired_values_is_marked():
    source = press()
    for marked, expected_ in (([True, False, False, False], [True, False]), ([False] * 3 + [True], [False, True])):
        events = Events(source.t, source.x, source.y, source.p, array=ARRAY, intensity=source.intensity,
                        repaired=np.array(marked))  # fmt: skip
        for quiet_ms in (0.0, 1.0):
            found = run(PlainRule("area", 2, quiet_ms=quiet_ms, noise_floor=FLOOR), events, tare=tare())
            assert list(found.repaired) == expected_


# The first state


def test_frames_that_begin_loaded_have_no_onset_and_an_end():
    held = [9.0, 9.0, 0.0, 0.0, 9.0, 9.0]
    frames = Frames([[[v, v]] for v in held], range(0, 60_000, 10_000), array=Array(1, 2))
    rest = tare(Array(1, 2), 0.0)
    for name in ("load", "area", "rise"):
        found = run(PlainRule(name, 1, noise_floor=FLOOR), frames, tare=rest)
        begins = [d.t for d in found if d.label == "contact"]
        assert begins == [40_000]
    assert [d.t for d in run(PlainRule("load", 1, noise_floor=FLOOR), frames, tare=rest)] == [20_000, 40_000]


def test_t_is_when_the_load_passed_its_date_whatever_it_reads_on_the_way_to_the_level():
    frames = Frames([[[v]] for v in (0.0, 6.0, 8.0, 7.0, 12.0, 6.0, 0.0)], range(0, 70_000, 10_000), array=Array(1, 1))
    rule = PlainRule("load", 10, 0.2, date=0.5, labels=("on", None), noise_floor=0.5)
    assert run(rule, frames, tare=tare(Array(1, 1), 0.0)).t.tolist() == [10_000]


# The load by running range


def test_a_load_by_running_range_is_what_a_loop_over_frames_adds():
    """Parts of what each channel read in the last ten seconds, renewed each second; nothing is known before."""
    draw = np.random.default_rng(5)
    t = np.cumsum(draw.choice([90_000, 100_000, 100_000, 130_000, 2_500_000], 400, p=[0.2, 0.4, 0.2, 0.19, 0.01]))
    values = np.float32(draw.normal(500 * np.sin(t / 3e5), 60)[:, None] + [0.0, 1000.0]) * np.float32([1.0, 0.2])
    frames = Frames(values[:, None, :], t, array=Array(1, 2))
    renewed, ranges, loads = None, None, []
    for k, now in enumerate(t.tolist()):
        due = int(t[0]) + 10_000_000 if renewed is None else renewed + 1_000_000
        if now >= due:
            renewed = due + (now - due) // 1_000_000 * 1_000_000
            since = -1 if ranges is None and renewed == due else renewed - 10_000_000
            window = values[:k][t[:k] >= since].astype(np.float64)
            if len(window):
                low, high = np.percentile(window, [10.0, 95.0], axis=0)
                ranges = low, high - low
        loads.append(None if ranges is None else float(np.maximum((values[k] - ranges[0]) / ranges[1], 0.0).sum()))
    [curve] = taxel._core.LoadCurve.of_frames(["range_load"], [], 0.0, frames, None, None)
    pairs = zip(t.tolist(), loads, [None, *loads[:-1]], strict=True)
    times, found = (column.tolist() for column in curve.changes())
    changes = [(now, load) for now, load, last in pairs if load != last]
    assert times == [now for now, _ in changes]
    assert found == pytest.approx([load for _, load in changes], rel=1e-5, abs=1e-5)
    # It needs no tare.
    rule = PlainRule("range_load", 0.8, 0.5, quiet_ms=150.0, date=0.75)
    whole, stream = run(rule, frames, frame_us=100_000.0), rule.stream(frame_us=100_000.0)
    pieces = [stream.push(frames[k : k + 7]) for k in range(0, len(t), 7)]
    assert sum(pieces[1:], pieces[0]) + stream.advance(int(t[-1]) + 2_000_000) == whole
    assert len(whole) > 20


# The shear of three axes


def test_shear_is_what_a_loop_over_frames_adds():
    draw = np.random.default_rng(9)
    t = np.cumsum(draw.choice([9_000, 12_000, 13_000, 150_000], 300, p=[0.3, 0.4, 0.29, 0.01]))
    names = [f"{taxel}_{axis}" for taxel in "abc" for axis in "xyz"]
    array, rest = Array(1, 9, names=names), draw.normal(0.0, 2e4, 9)
    values = np.float32(rest + np.cumsum(draw.normal(0.0, 40.0, (300, 9)), axis=0))
    frames = Frames(values[:, None], t, array=array)
    taken = taxel.Tare.take(Frames(np.float32([[rest], [rest]]), [0, 1000], array=array))
    mean, before, rises, falls = None, None, [], []
    for now, row in zip(t.tolist(), values.astype(np.float64) - taken.rest[0], strict=True):
        shear = np.array([row[0::3].sum(), row[1::3].sum()])
        if before is None:
            smooth, mean = shear, shear
        else:
            mean = mean - math.expm1(-(now - before) / 1e5) * (smooth - mean)
            smooth = smooth - math.expm1(-(now - before) / 2e4) * (shear - smooth)
        before, change = now, math.dist(smooth, mean)
        grows = math.hypot(*smooth) > math.hypot(*mean)
        rises.append(change if grows else 0.0)
        falls.append(0.0 if grows else change)
    curves = taxel._core.LoadCurve.of_frames(["shear_rise", "shear_fall"], [], 0.0, frames, None, taken.to_json())
    for curve, loop in zip(curves, (rises, falls), strict=True):
        times, found = curve.changes()
        held = found[np.searchsorted(times, t, side="right") - 1]
        assert held == pytest.approx(loop, rel=1e-4, abs=0.05)
    # What is touched, z says.
    [load] = taxel._core.LoadCurve.of_frames(["load"], [], 0.0, frames, None, taken.to_json())
    times, found = load.changes()
    above = (values - taken.rest[0])[:, 2::3]
    of_z = np.where(above > 0.5, above, 0.0).sum(axis=1)
    assert found[np.searchsorted(times, t, side="right") - 1] == pytest.approx(of_z, rel=1e-4, abs=0.05)
    with pytest.raises(taxel.ProblemError):
        taxel._core.LoadCurve.of_frames(["shear_rise"], [], 0.0, press_frames(), None, tare().to_json())


def press_frames():
    return Frames(np.zeros((2, *ARRAY.shape)), [0, 1000], array=ARRAY)


def test_the_rest_of_x_and_y_follows_while_z_is_at_rest_alone():
    t, array = 10_000 * np.arange(1000), Array(1, 3, names=["a_x", "a_y", "a_z"])
    values = np.zeros((1000, 1, 3), np.float32)
    values[100:, 0, 0], values[:500, 0, 2] = 5.0, 50.0
    taken = taxel.Tare.take(Frames(np.zeros((2, 1, 3)), [0, 1000], array=array))
    left = taxel._core.follow_rest(Frames(values, t, array=array), taken.to_json(), 10.0, 60.0).reshape(1000, 3)
    assert left[499].tolist() == [5.0, 0.0, 50.0]
    # 63 % in a second, as of any taxel near its rest.
    assert left[600, 0] == pytest.approx(5.0 * math.exp(-1.0), rel=0.02)


# Tuning


def test_tuning_finds_a_planted_rule():
    examples = [played(seed) for seed in range(3)]
    rules = tune(examples)
    # Smaller touches of 9 taxels of 20 ticks are no hit, those of 25 are.
    assert rules["hit"].quantity == "load_without_largest"
    assert 160.0 < rules["hit"].level <= 480.0
    assert rules["hit"].constant_ms == pytest.approx(0.3)
    assert repr(rules["hit"]).startswith("PlainRule(hit: ")
    assert repr(rules["gone"]).startswith("PlainRule(gone: ")
    for example_ in [played(17), *examples]:
        for name, rule in rules.items():
            found = run(rule, example_.source, tare=example_.tare)
            score = taxel.detect.score(found, {name: example_.labels[name]}, 50)
            assert (score.missed, score.false) == (0, 0)


def test_tuning_finds_when_a_touch_leaves_the_place_where_it_began():
    """Touches move over a plate from anywhere, equally large all the time, and leave other places as fast."""

    def walked(seed):
        draw, step, values, lifted = np.random.default_rng(seed), 5_000, np.zeros((2_000, 26, 9), np.float32), []
        for begin in range(100, 1_900, 60):
            row, column, moves, leaves, ends = draw.integers([0, 0, 9, 28, 36], [3, 5, 13, 35, 51])
            for k, (first, last) in enumerate(((0, leaves), (6, moves), (moves, ends), (leaves, ends))):
                values[begin + first : begin + last, row + 6 * k : row + 6 * k + 6, column : column + 4] = 20.0
            lifted.append((begin + leaves) * step)
        frames = Frames(values, step * np.arange(len(values)), array=Array(26, 9))
        return Example(frames, {"lifted": np.array(lifted)}, taxel.Tare.take(frames, stop_us=400_000))

    rule, unseen = tune([walked(3)], window_ms=4.0, noise_floor=FLOOR)["lifted"], walked(4)
    begin_area = PlainRule("begin_area", 12, levels=[10.0], labels=(None, "lifted"), noise_floor=FLOOR)
    for one in (rule, begin_area):
        score = taxel.detect.score(run(one, unseen.source, tare=unseen.tare), unseen.labels, 4)
        assert (score.missed, score.false) == (0, 0)


def test_tuning_finds_what_happens_within_touches():
    def slid(seed):
        """Touches of 2 s, in which load moves from some taxels to others for 200 ms."""
        draw, t = np.random.default_rng(seed), 10_000 * np.arange(4000)
        values, slips = draw.normal(0.0, 1.0, (4000, 1, 6)), []
        for begin in range(100, 3800, 400):
            values[begin : begin + 200] += 60.0
            slip = begin + int(draw.integers(50, 150))
            values[slip : slip + 20, :, :3] += 30.0
            values[slip : slip + 20, :, 3:] -= 30.0
            slips.append(10_000 * slip)
        frames = Frames(values, t, unit="N", array=Array(1, 6))
        ends = np.column_stack([slips, np.add(slips, 200_000)])
        return Example(frames, {"slip": slips}, taxel.Tare.take(frames, stop_us=900_000), spans={"slip": ends})

    rule = tune([slid(1), slid(2)], noise_floor=6.0)["slip"]
    assert rule.quantity == "moved"
    assert rule.touched_ms is not None
    unseen = slid(3)
    found = run(rule, unseen.source, tare=unseen.tare)
    assert score(found, unseen.labels, 20.0, unseen.spans).rank[0] == 0


def test_tuning_says_none_where_no_rule_is_better_than_nothing():
    example_ = played(1)
    nowhere = Example(example_.source, {"never": np.array([5_000, 5_100, 5_200])}, example_.tare)
    assert tune([nowhere], window_ms=1.0) == {"never": None}
    assert tune([example_], ["hit", "absent"])["absent"] is None
    trains = taxel.encode.ContactArea(tare=example_.tare).encode(example_.source)
    assert tune([Example(trains, example_.labels)]) == {"gone": None, "hit": None}


@pytest.mark.parametrize(
    ("arguments", "options"),
    [
        (("area", 2, 0.5, 0, 5), {"labels": ("a", "b")}),
        (("area", 2, 1, 5, 5), {"labels": ("a", "b")}),
        (("area", 2, 1, 0, 5), {"labels": ("a", "b"), "date": 1.0}),
        (("area", 2, 1, 0, 5), {}),
        (("area", 2), {"labels": (None, None)}),
        (("area", 2), {"labels": ("a", "a")}),
        (("count", 2), {}),
        (("area", 2), {"levels": [1.0]}),
        (("count", 2), {"levels": [2.0, 1.0]}),
        (("area", 2, 0.5), {"date": 1.1}),
        (("area", 2, 0.5), {"date": 0.4}),
        (("area", 2), {"quiet_ms": -1.0}),
        (("area", 2), {"constant_ms": 1e6}),
    ],
)
def test_what_does_not_fit_together_is_refused(arguments, options):
    with pytest.raises(taxel.ProblemError):
        PlainRule(*arguments, **options)


@settings(max_examples=20, deadline=None)
@given(events())
def test_curves_that_are_measured_at_once_are_those_measured_alone(source):
    def curves(*quantities):
        return taxel._core.LoadCurve.of_events(list(quantities), [], FLOOR, source, 192.0, 2, tare().to_json())

    names = ["load", "local_rise", "local_fall", "moved"]
    for name, curve in zip(names, curves(*names), strict=True):
        [alone] = curves(name)
        for of_both in zip(curve.edges(1.0, 0.5, 1.0, None), alone.edges(1.0, 0.5, 1.0, None), strict=True):
            assert [column.tolist() for column in of_both[0]] == [column.tolist() for column in of_both[1]]
