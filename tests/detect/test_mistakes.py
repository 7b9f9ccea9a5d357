"""Each situation of labels and detections that do not fit: what is measured first of the mistakes says what it is."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from test_label_times import ARRAY, touched

import taxel
from taxel import Detections, Frames, Tare
from taxel.detect import Example, Outcome, Recipe, score
from taxel.detect.cause import Cause, ordered
from taxel.detect.causes import Mistakes
from taxel.detect.evidence import Evidence
from taxel.detect.examples import causes_text, check_examples
from taxel.detect.fitting import fit_aligned
from taxel.detect.mistakes import behind_gaps, causes_of, unreliable
from taxel.detect.scoring import score_together

Times = dict[str, np.ndarray]


def outcome(frames: Frames, labels: Times, found: Times) -> Outcome:
    """Return what was found in frames, scored against labels."""
    example = Example(frames, labels, Tare.take(frames, stop_us=2_000_000))
    times = np.concatenate(list(found.values()))
    names = np.repeat(list(found), [len(t) for t in found.values()])
    detections = Detections(names.tolist(), times.tolist(), times.tolist())
    return Outcome("a.npz", example, detections, score(detections, labels))


def late(seed: int) -> Outcome:
    frames, truth = touched(seed, 20)
    return outcome(frames, {label: t + 320_000 for label, t in truth.items()}, truth)


def late_in_part(seed: int) -> Outcome:
    frames, truth = touched(seed, 20, hold_s=(0.3, 0.45))
    middle = truth["contact"][10]
    return outcome(frames, {label: t + 210_000 * (t >= middle) for label, t in truth.items()}, truth)


def jumped(seed: int) -> Outcome:
    """Return labels whose clock jumps by 1.5 s beside that of the frames, which are written twice for as long."""
    frames, truth = touched(seed, 24)
    middle = truth["contact"][12]
    return outcome(frames, {label: t - 1_500_000 * (t >= middle) for label, t in truth.items()}, truth)


def of_other_rate(seed: int) -> Outcome:
    """Return labels of two names by frames counted at 49 Hz that were taken at 50 Hz, some of which are not found."""
    frames, truth = touched(seed, 20)
    noise = np.random.default_rng(seed)
    labels = {label: np.rint(t * 50 / 49 + noise.normal(0, 15_000, 20)).astype(int) for label, t in truth.items()}
    return outcome(frames, labels, {label: t[k::3] for k, (label, t) in enumerate(truth.items())})


def of_a_short_trial(seed: int) -> Outcome:
    """Return two touches, labelled in frames of a video that are counted at 100 Hz and were taken at 120."""
    frames, truth = touched(seed, 2, begin_s=2.2)
    return outcome(frames, {label: np.rint(t * 1.2).astype(int) for label, t in truth.items()}, truth)


def nearly_late(seed: int) -> Outcome:
    frames, truth = touched(seed, 20)
    return outcome(frames, {label: t - 60_000 for label, t in truth.items()}, truth)


def felt_late(seed: int) -> Outcome:
    frames, truth = touched(seed, 20)
    return outcome(frames, truth, truth | {"contact": truth["contact"] + 170_000})


def of_late_labels(seed: int) -> Outcome:
    frames, truth = touched(seed, 20)
    return outcome(frames, truth, {label: t + 240_000 for label, t in truth.items()})


def felt_nowhere(seed: int) -> Outcome:
    """Return what is late in frames that do not say which of both is right: their rest is not known."""
    made = late(seed)
    return made._replace(example=made.example._replace(tare=None))


def rising_slowly(seed: int) -> Outcome:
    frames, truth = touched(seed, 20)
    return outcome(frames, {"contact": truth["contact"] - 60_000}, {"contact": truth["contact"]})


def no_releases(seed: int) -> Outcome:
    """Return releases that are told .12 s before the load ends, four of which have no label."""
    frames, truth = touched(seed, 20, hold_s=(0.35, 0.45))
    released = truth["lift"] - 120_000
    labels = np.delete(released, np.random.default_rng(seed).choice(20, 4, replace=False))
    return outcome(frames, {"release": labels}, {"release": released})


def alike(seed: int) -> Outcome:
    frames, truth = touched(seed, 20, hold_s=(0.25, 0.45))
    return outcome(frames, truth, truth | {"lift": np.sort(np.concatenate(list(truth.values())))})


def misplaced(seed: int) -> Outcome:
    frames, truth = touched(seed, 40)
    random, moved = np.random.default_rng(seed), truth["contact"].copy()
    wrong = random.choice(40, 6, replace=False)
    moved[wrong] += np.rint(random.uniform(2e5, 4e5, 6) * random.choice([-1, 1], 6)).astype(int)
    return outcome(frames, {"contact": np.sort(moved)}, {"contact": truth["contact"]})


def gap(seed: int) -> Outcome:
    frames, truth = touched(seed, 20)
    begin = truth["contact"][5] - 100_000
    inside = (frames.t >= begin) & (frames.t < begin + 4_000_000)
    seen = {label: t[(t < begin) | (t >= begin + 4_000_000)] for label, t in truth.items()}
    return outcome(Frames(frames.values[~inside], frames.t[~inside], unit="V", array=ARRAY), truth, seen)


def noisy(seed: int) -> Outcome:
    frames, truth = touched(seed, 12)
    times = np.sort(np.random.default_rng(seed).integers(0, int(frames.t[-1]), 300))
    return outcome(frames, {"contact": truth["contact"]}, {"contact": times})


#: Each situation, with the kind of cause that comes first, what it says, and what helps.
SITUATIONS: dict[str, tuple[Callable[[int], Outcome], str, str, str]] = {
    "late": (
        late,
        "shifted_labels",
        "40 of 40 missed labels have a false detection 320 ms earlier; the detections are where loads begin or end",
        "to move the labels by -320 ms (--shift-ms -320)",
    ),
    "of late labels": (
        of_late_labels,
        "shifted_training",
        "a false detection 240 ms later; the labels are where loads begin or end: the labels of the training were late",
        "to train on labels that are 240 ms earlier (taxel train --shift-ms -240)",
    ),
    "felt nowhere": (
        felt_nowhere,
        "shifted_labels",
        "either these labels are late or the labels of the training",
        "to look where a load begins",
    ),
    "late in part": (
        late_in_part,
        "shifted_labels",
        "have a false detection 210 ms earlier, all from ",
        " s to the end 210 ms",
    ),
    "jumped": (
        jumped,
        "shifted_labels",
        "have a false detection 1500 ms later, all from ",
        " s to the end 1500 ms later",
    ),
    "of another rate": (
        of_other_rate,
        "other_rate",
        "labels runs 1.02 times as fast as the recording's: tried with their times divided by 1.02, 1",
        "to divide the times of the labels by 1.02, as of frames counted at another rate, or, if these are right, a "
        "rate of 196",
    ),
    "a short trial of another rate": (
        of_a_short_trial,
        "other_rate",
        "tried with their times divided by 1.2, 4 of 4 labels have a detection, instead of ",
        "to divide the times of the labels by 1.2",
    ),
    "nearly late": (
        nearly_late,
        "shifted_labels",
        "40 of 40 missed labels have a false detection 60 ms later",
        "--shift-ms 60",
    ),
    "rising slowly": (rising_slowly, "window", "20 of 20 missed labels have a false detection 60 ms", "--window-ms 60"),
    "felt late": (felt_late, "shifted_labels", "170 ms later, while lift fits: contact is felt later there", ""),
    "alike": (alike, "other_name", "20 of 20 false detections of lift are within 100 ms of labels of contact", ""),
    "misplaced": (
        misplaced,
        "unlabelled_loads",
        "6 of 6 false detections are in such touches",
        "to label these",
    ),
    "gap": (gap, "gaps", "missed labels are where the recording has no frames, for example ", ""),
    "no releases": (
        no_releases,
        "unlabelled_loads",
        "4 touches without a label of release are detected, about as strong as labelled ones",
        "to label these touches too",
    ),
}


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("name", SITUATIONS)
def test_what_lies_beside_most_mistakes_is_said_first(name: str, seed: int) -> None:
    make, kind, measured, advice = SITUATIONS[name]
    first, *_ = causes_of([make(seed)], 50.0)
    assert (first.kind, bool(first.advice)) == (kind, bool(advice)), first
    assert measured in first.measured
    assert advice in first.advice


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("sd_ms", [15, 60])
def test_labels_of_the_right_clock_have_no_other_rate(seed: int, sd_ms: float) -> None:
    random = np.random.default_rng(seed)
    frames, truth = touched(seed, [2, 4, 12, 24][seed % 4])
    labels = {
        label: np.sort(t + np.rint(1000 * random.normal(0, sd_ms, len(t))).astype(int)) for label, t in truth.items()
    }
    found = {label: t[random.random(len(t)) < 0.7] for label, t in truth.items()}
    exchanged = {"contact": found["lift"], "lift": found["contact"]}
    for made in (outcome(frames, labels, found), outcome(frames, labels, exchanged)):
        assert all(cause.kind != "other_rate" for cause in causes_of([made], 50.0))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_what_differs_from_the_training_is_the_cause_where_labels_are_not(seed: int) -> None:
    noise = ["the noise at rest is 3 times as strong as in the training"]
    for make in (noisy, nearly_found, felt_late, misplaced_and_missed):
        first, *_ = causes_of([make(seed)], 50.0, [noise])
        assert (first.kind, first.measured) == ("unlike_training", noise[0]), make
    for make, kind in ((late, "shifted_labels"), (gap, "gaps"), (no_releases, "unlabelled_loads")):
        first, *others = causes_of([make(seed)], 50.0, [noise])
        assert first.kind == kind
        assert all(cause.measured and cause.mistakes for cause in others), "all is explained by the first"


def test_of_far_too_many_detections_the_verdict_says_all() -> None:
    made = noisy(1)
    assert made.score is not None
    assert causes_of([made], 50.0) == ()
    assert unreliable("contact", made.score, "labels").startswith("contact: do not rely on this readout: ")
    assert unreliable("contact", made.score, "labels").endswith(", no better than to detect nothing")


@pytest.mark.parametrize(
    ("missed", "false", "bad"), [(0, 0, False), (10, 5, False), (11, 0, True), (0, 19, False), (0, 20, True)]
)
def test_a_score_is_bad_that_misses_most_or_has_as_many_false_as_found(missed: int, false: int, bad: bool) -> None:
    truth = 1_000_000 * np.arange(1, 21)
    t = np.sort(np.concatenate([truth[missed:], 500_000 + 1_000_000 * np.arange(false)]))
    scored = score(Detections(["a"] * len(t), t, t), {"a": truth})
    assert (scored.missed, scored.false) == (missed, false)
    assert bool(unreliable("a", scored, "labels")) == bad


def test_sources_of_one_clock_have_one_cause_and_times_count_as_the_file_does() -> None:
    begin = 100_000_000

    def finger(seed: int, name: str, late_from: int) -> Outcome:
        """Return a finger whose labels are .3 s late from one touch on, in a file whose first time is 100 s."""
        frames, truth = touched(seed, 20, hold_s=(0.3, 0.45))
        since = truth["contact"][late_from]
        found = {label: t + begin for label, t in truth.items()}
        labels = {label: t + begin + 300_000 * (t >= since) for label, t in truth.items()}
        moved = Frames(frames.values, frames.t + begin, unit="V", array=ARRAY)
        made = outcome(frames, truth, truth)
        example = Example(moved, labels, Tare.take(moved, stop_us=begin + 2_000_000), "hand ", f"hand {name}")
        times = np.concatenate(list(found.values()))
        detections = Detections(made.found.label.tolist(), times.tolist(), times.tolist())
        return made._replace(name=f"hand {name}", example=example, found=detections, score=score(detections, labels))

    in_part = finger(1, "thumb", 10)
    first, *_ = causes_of([in_part], 50.0)
    begin_s = in_part.example.labels["contact"][10] / 1e6
    assert begin_s > 100.0
    assert f"all from {np.floor(10 * begin_s) / 10:.1f} s to the end" in first.measured
    hand = [finger(1, "thumb", 0), finger(2, "index", 0)]
    (cause,) = causes_of(hand, 50.0)
    assert (cause.labels, cause.option, cause.mistakes) == (("contact", "lift"), "--shift-ms -300", 160)
    assert len(causes_text([made._replace(causes=(cause,)) for made in hand])) == 1


def split(made: Outcome) -> Times:
    """Return what was detected, by label."""
    return {label: made.found.t[np.array([each == label for each in made.found.label])] for label in made.found.labels}


def nearly_found(seed: int) -> Outcome:
    frames, truth = touched(seed, 20)
    return outcome(frames, truth, {label: t + 60_000 for label, t in truth.items()})


def misplaced_and_missed(seed: int) -> Outcome:
    made = misplaced(seed)
    found = {"contact": made.found.t[::2]}
    return outcome(made.example.source, made.example.labels, found)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_labels_of_all_kinds_show_from_when_on_they_are_late(seed: int) -> None:
    frames, truth = touched(seed, 30, hold_s=(0.3, 0.45))
    t, kinds, late = truth["contact"], np.arange(30) % 3, np.arange(30) >= 15
    labels = {name: t[kinds == k] + 150_000 * late[kinds == k] for k, name in enumerate(("tap", "pinch", "hold"))}
    found = {name: t[kinds == k] for k, name in enumerate(labels)}
    # The first late label is found by a second detection; of one kind too few are detected to tell a distance.
    found["tap"] = np.sort(np.append(found["tap"], labels["tap"][5] - 20_000))
    found["hold"] = np.delete(found["hold"], [2, 7, 9])
    cause, *_ = causes_of([outcome(frames, labels, found)], 50.0)
    begin_s = np.floor((t[15] + 150_000) / 1e5) / 10
    assert (cause.kind, set(cause.labels)) == ("shifted_labels", {"tap", "pinch", "hold"})
    assert cause.advice.startswith(f"to move the labels from {begin_s:.1f} s to the end 150 ms earlier"), cause


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_touches_without_a_label_are_counted_once_whatever_kinds_are_detected(seed: int) -> None:
    frames, truth = touched(seed, 30)
    t, kinds, without = truth["contact"], np.arange(30) % 2, np.isin(np.arange(30), [3, 8, 13, 18])
    labels = {name: t[(kinds == k) & ~without] for k, name in enumerate(("tap", "pinch"))}
    found = {name: np.sort(np.append(t[kinds == k], t[[3, 8]] + 5000)) for k, name in enumerate(labels)}
    cause, *_ = causes_of([outcome(frames, labels, found)], 50.0)
    assert (cause.kind, set(cause.labels), cause.mistakes) == ("unlabelled_loads", {"tap", "pinch"}, 8)
    assert cause.measured.startswith("4 touches without a label of pinch, tap are detected, about as strong as ")


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_detection_at_the_first_frames_behind_a_gap_is_of_the_gap(seed: int) -> None:
    made = gap(seed)
    t = made.example.source.t
    end = int(t[np.argmax(np.diff(t)) + 1])
    found = split(made)
    found["contact"] = np.sort(np.append(found["contact"], [end, end + 40_000]))
    behind = outcome(made.example.source, made.example.labels, found)
    assert split(behind._replace(found=behind.found[behind_gaps(behind.example, behind.found)]))[
        "contact"
    ].tolist() == [
        end,
        end + 40_000,
    ]
    first, *_ = causes_of([behind], 50.0)
    assert "and 2 of 2 false detections are at the first frames behind such a gap" in first.measured


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_of_few_mistakes_nothing_is_said(seed: int) -> None:
    frames, truth = touched(seed, 20)
    right = outcome(frames, truth, truth | {"contact": truth["contact"][1:]})
    assert causes_of([right], 50.0) == ()
    assert right.causes_lines == []


def evidence(frames: Frames, labels: Times) -> Evidence:
    example = Example(frames, labels, Tare.take(frames, stop_us=2_000_000))
    return Evidence([example], check_examples([example]), Recipe.load("touch", labels=list(labels), noise_floor=0.02))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_training_says_from_when_on_labels_are_off(seed: int) -> None:
    made = late_in_part(seed)
    (cause,) = evidence(made.example.source, {"contact": made.example.labels["contact"]}).causes({"contact": 20})
    begin_s = np.floor(made.example.labels["contact"][10] / 1e5) / 10
    assert cause.kind == "shifted_labels"
    said = re.fullmatch(
        rf"10 of 20 labels are (\d+) ms after where the sensor felt the others, all from {begin_s:.1f} s to the end",
        cause.measured,
    )
    assert said, cause.measured
    assert abs(int(said[1]) - 210) <= 5
    assert cause.advice == f"to move the labels from {begin_s:.1f} s to the end {said[1]} ms earlier"


def channels(frames: Frames) -> Frames:
    """Return taxels as channels, whose places are not known."""
    return Frames(frames.values.reshape(len(frames), 1, -1), frames.t, unit="V", array=taxel.Array(1, 36))


@pytest.mark.parametrize("of_grid", [True, False])
@pytest.mark.parametrize("names", [("contact", "lift"), ("tap", "press", "off")])
def test_a_stretch_is_found_over_all_names_on_grids_and_channels(names: tuple[str, ...], of_grid: bool) -> None:
    frames, truth = touched(5, 30, hold_s=(0.3, 0.45))
    first, last = truth["contact"][12] - 20_000, truth["contact"][17] + 20_000
    moved = {label: t - 350_000 * ((t >= first) & (t <= last)) for label, t in truth.items()}
    begins = {name: moved["contact"][k :: len(names) - 1] for k, name in enumerate(names[:-1])}
    labels = begins | {names[-1]: moved["lift"]}
    found = evidence(frames if of_grid else channels(frames), labels).causes(dict.fromkeys(names, 5))
    assert {cause.kind for cause in found} == {"shifted_labels"}
    (advice,) = {cause.advice for cause in found}
    said = re.fullmatch(r"to move the labels from ([\d.]+) to ([\d.]+) s (\d+) ms later", advice)
    assert said, advice
    assert abs(int(said[3]) - 350) <= 10
    # As printed, labels are within it that are off, and no others.
    for label, times in labels.items():
        inside = (times >= 1e6 * float(said[1])) & (times <= 1e6 * float(said[2]))
        right = np.isin(times, truth["lift" if label == names[-1] else "contact"])
        assert not (inside & right).any()
        assert (inside | right).all()


@pytest.mark.parametrize("rise_s", [0.3, 0.4])
@pytest.mark.parametrize("late_ms", [0, -300])
def test_labels_of_what_rises_slowly_are_not_off(rise_s: float, late_ms: int) -> None:
    frames, truth = touched(3, 20)
    random, at = np.random.default_rng(3), np.arange(len(frames)) * 5e-3
    values = random.normal(0, 0.002, frames.values.shape)
    for t in truth["contact"] / 1e6:
        begin_s = t - late_ms / 1e3  # a clock that is early, of touches that rise at once
        shape = np.clip((at - begin_s) / (0.02 if late_ms else rise_s), 0, 1) * (at < begin_s + rise_s + 0.1)
        values[:, 1:3, 1:3] += 0.03 * shape[:, None, None]
    slow = Frames(values, frames.t, unit="V", array=ARRAY)
    found = evidence(slow, {"contact": truth["contact"]})
    kinds = {cause.kind for cause in found.causes({"contact": 20})}
    assert ("shifted_labels" in kinds) == bool(late_ms), kinds
    assert ("contact" in found.felt_apart) == (not late_ms)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_labels_of_touches_too_weak_to_be_felt_are_not_blamed(seed: int) -> None:
    frames, truth = touched(seed, 30)
    weak = np.isin(np.arange(30), np.random.default_rng(seed).choice(30, 12, replace=False))
    values = frames.values.copy()
    for begin, end in zip(truth["contact"][weak], truth["lift"][weak], strict=True):
        here = (frames.t >= begin) & (frames.t < end)
        values[here] *= 0.01
    half = Frames(values, frames.t, unit="V", array=ARRAY)
    strong = {label: times[~weak] for label, times in truth.items()}
    made = outcome(half, truth, strong)
    assert [cause.advice for cause in evidence(half, truth).causes({"contact": 12})] == []
    assert [(cause.kind, cause.advice) for cause in causes_of([made], 50.0)] == [("unfelt_labels", "")]


def test_labels_are_moved_by_the_distance_that_they_agree_on_best() -> None:
    frames, truth = touched(2, 30)
    random = np.random.default_rng(2)
    labels = {label: times + 242_000 for label, times in truth.items()}
    labels["lift"] = labels["lift"] - np.rint(random.uniform(35_000, 75_000, 30)).astype(int)
    found = evidence(frames, labels).causes({"contact": 30, "lift": 30})
    (option,) = {cause.option for cause in found}
    assert abs(found[0].arguments["shift_ms"] + 242) <= 5, option
    moved = {label: times + round(1000 * found[0].arguments["shift_ms"]) for label, times in labels.items()}
    again = evidence(frames, moved).causes({"contact": 1, "lift": 10})
    assert not [cause for cause in again if cause.kind == "shifted_labels"]


@pytest.mark.parametrize("seed", [2, 3])
def test_marks_of_a_hand_around_what_was_felt_need_a_window_and_no_move(seed: int) -> None:
    frames, truth = touched(seed, 60)
    spread = np.rint(np.random.default_rng(seed).normal(0, 55_000, 60)).astype(int)
    [cause] = evidence(frames, {"contact": truth["contact"] + spread}).causes({"contact": 20})
    reach = rf"{cause.arguments['window_ms']:.0f} ms"
    assert cause.option == f"--window-ms {reach.removesuffix(' ms')}"
    assert re.fullmatch(
        rf"\d\d of 60 are within {reach} of what the sensor felt, like keys pressed live", cause.measured
    )


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_labels_of_footfalls_that_overlap_are_not_called_wrong(seed: int) -> None:
    """Steps at two places, each of which begins before the one before has ended: one load for the array."""
    random = np.random.default_rng(seed)
    begins = 3 + np.cumsum(random.uniform(0.4, 0.6, 12)) + 4.0 * (np.arange(12) // 4)
    ends = begins + random.uniform(0.65, 0.75, 12)
    t = np.arange(0, round(1e6 * (ends[-1] + 2)), 5000)
    values = random.normal(0, 0.002, (len(t), 6, 6))
    for k, (begin, end) in enumerate(zip(begins, ends, strict=True)):
        values[(t >= 1e6 * begin) & (t < 1e6 * end), :3, 3 * (k % 2) : 3 * (k % 2) + 3] += random.uniform(0.5, 1.0)
    labels = {"heel strike": np.rint(1e6 * begins).astype(np.int64), "toe off": np.rint(1e6 * ends).astype(np.int64)}
    frames = Frames(values, t, unit="kPa", array=ARRAY)
    (cause,) = evidence(frames, labels).causes({"heel strike": 12, "toe off": 12})[:1]
    assert (cause.kind, "of another recording" in cause.measured) == ("overlapping_loads", False)
    assert "9 of 12 labels of heel strike are at times when another load lasts" in cause.measured


@pytest.mark.parametrize("seed", [1, 2])
def test_touches_in_turn_do_not_overlap_where_the_sensor_recovers_slowly(seed: int) -> None:
    random = np.random.default_rng(seed)
    begins = 3 + np.cumsum(random.uniform(1.5, 2.0, 12)) + 4.0 * (np.arange(12) // 4)
    ends = begins + random.uniform(0.9, 1.1, 12)
    t = np.arange(0, round(1e6 * (ends[-1] + 2)), 5000)
    values = random.normal(0, 0.002, (len(t), *ARRAY.shape))
    for k in range(12):
        values[(t >= 1e6 * begins[k]) & (t < 1e6 * ends[k])] += 1.0
        if (k + 1) % 4:
            values[(t >= 1e6 * ends[k]) & (t < 1e6 * begins[k + 1])] += 0.1
    labels = {"contact": np.rint(1e6 * begins).astype(np.int64), "release": np.rint(1e6 * ends).astype(np.int64)}
    found = evidence(Frames(values, t, unit="V", array=ARRAY), labels)
    assert not found.felt.overlapped("contact").any()
    assert not found.felt.overlapped("release").any()


@pytest.mark.parametrize(("found", "is_cause"), [(0, False), (8, False), (18, True)])
def test_a_source_is_a_cause_only_where_most_is_found_beside_it(found: int, is_cause: bool) -> None:
    frames, truth = touched(1, 20)
    tare, labels = Tare.take(frames, stop_us=2_000_000), {"contact": truth["contact"]}
    examples = [Example(frames, labels, tare, "walk ", f"walk {foot}") for foot in ("left", "right")]
    none = np.zeros(0, np.int64)
    times = [labels["contact"][:found], none]
    detections = [Detections(["contact"] * len(t), t, t) for t in times]
    scores = [score(each, labels) for each in detections]
    together = score_together(detections, [labels, labels], 50.0)
    plan = Recipe.load("touch", labels=["contact"], noise_floor=0.02)
    made = fit_aligned(examples[:1], plan, None)
    mistakes = Mistakes(made, together, together, scores)
    causes = mistakes.causes(Evidence(examples, check_examples(examples), plan))
    assert ("unlabelled_source" in [cause.kind for cause in causes]) == is_cause


def test_a_label_is_named_once_and_what_is_measured_of_nothing_is_no_advice() -> None:
    parts = [Cause("unlabelled_source", ("slip",), 2, f"2 missed in {name}", "a column source") for name in "abc"]
    (cause,) = ordered(parts)
    assert (cause.labels, cause.mistakes, cause.measured) == (
        ("slip",),
        6,
        "2 missed in a; 2 missed in b; 2 missed in c",
    )
    assert str(replace(cause, advice="")) == cause.measured


def test_what_no_trial_has_measured_is_said() -> None:
    for kind, tried in (("overfitting", False), ("unlike_training", False), ("plain_rule", True), ("recipe", True)):
        cause = Cause(kind, ("contact",), 3, "measured", "this")
        assert str(cause) == "what may help is this: measured" + "; this was not tried" * (not tried)
        assert str(replace(cause, advice="")) == "measured"


def test_what_was_measured_of_labels_with_one_advice_stands_behind_each() -> None:
    ends = "; the score is then against the moved labels"
    parts = [Cause("gaps", (label,), n, f"{n} of 9 are missed{ends}", "") for label, n in (("contact", 1), ("lift", 2))]
    (cause,) = ordered([*parts, parts[0]])
    assert (cause.labels, cause.mistakes) == (("contact", "lift"), 3)
    assert cause.measured == f"contact: 1 of 9 are missed; lift: 2 of 9 are missed{ends}"
    (same,) = ordered([replace(parts[0], labels=(label,)) for label in ("contact", "lift")])
    assert (same.labels, same.mistakes, same.measured) == (("contact", "lift"), 2, parts[0].measured)


@pytest.mark.parametrize("distance_ms", [0, 40, 55, 95, 105])
def test_false_detections_beside_labels_are_counted_up_to_twice_the_window(distance_ms: int) -> None:
    found = Detections(["a"] * 2, [1_000_000, 1_000_000 + 1000 * distance_ms], [2_000_000] * 2)
    scored = score(found, {"a": [1_000_000]})
    assert scored.false == 1
    assert (scored.false_near, scored.false_beside) == (int(distance_ms <= 50), int(distance_ms <= 100))


def test_names_of_grasps_and_of_steps_are_ends_of_touches() -> None:
    known = taxel.detect.recipes
    assert known.kinds("touch", ["grasp", "Griff", "release", "slip"]) == ("slip",)
    assert known.kinds("touch", ["IC", "FO"]) == ()
    assert known.kinds("event_counts", ["slip"]) == ()


@pytest.mark.parametrize("seed", [1, 2])
def test_a_single_label_tells_no_cause_of_how_far_detections_are(seed: int) -> None:
    frames, truth = touched(seed, 20)
    several = np.random.default_rng(seed).choice(20, 2, replace=False)
    for count, kinds in ((1, []), (2, ["window"])):
        found = truth["contact"].copy()
        found[several[:count]] += 70_000
        extra = {"contact": found, "lift": np.concatenate([truth["lift"], truth["lift"][:3] + 400_000])}
        causes = causes_of([outcome(frames, truth, extra)], 50.0)
        assert [cause.kind for cause in causes if "contact" in cause.labels] == kinds
