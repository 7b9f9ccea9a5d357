"""The worst moments of a report: of each recording, with what the sensor read and the potential around them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib import pyplot as plt
from touching import touched

import taxel
from taxel.detect import Example, Outcome, PlainRule, Readout, score
from taxel.detections import Detections
from taxel.encode import ContactArea, LocalLoad, Peak
from taxel.report.detections import _moments, _only_input, _potential, _sums, _unclaimed, write_detections


@pytest.fixture(scope="module")
def judged(tmp_path_factory: pytest.TempPathFactory) -> tuple[Readout, list[Outcome]]:
    """Two recordings of touches at 200 Hz, of which two labels each are of nothing."""
    place = tmp_path_factory.mktemp("touches") / "a.npz"
    taxel.convert(touched(1)[0], place)
    training = taxel.train(taxel.open(place), [touched(1)[1]], taxel.tasks.TrainOptions(folds=0))
    (outcome,) = training.outcomes
    truth = {"contact": np.sort(np.r_[outcome.example.labels["contact"], 500_000, 1_500_000])}
    example = outcome.example._replace(labels=truth)
    scored = score(outcome.found["contact"], truth, 50.0)
    return training.readout, [outcome._replace(name=name, example=example, score=scored) for name in ("left", "right")]


def test_equally_bad_moments_are_of_all_recordings(judged) -> None:
    moments = _moments(judged[1], "contact")
    assert [(moment.recording, moment.title) for moment in moments[:2]] == [(0, "missed"), (1, "missed")]
    assert {moment.t for moment in moments} == {500_000, 1_500_000}


def test_what_the_sensor_read_is_drawn_over_the_potential(judged) -> None:
    readout, outcomes = judged
    found = outcomes[0].found["contact"].t
    # Without labels, the first detections.
    unscored = [outcomes[0]._replace(score=None)]
    figure = _potential(readout, unscored, "contact", _moments(unscored, "contact"), None)
    assert figure is not None
    sums, potentials = np.array(figure.axes).reshape(2, -1)
    frames = touched(1)[0]
    assert len(sums) == min(4, len(found))
    for t, above, below in zip(found, sums, potentials, strict=False):
        ms, total = above.lines[0].get_data()
        near = np.abs(frames.t - t) < 1000 * ms.max() + 1
        rest = frames.values[frames.t < 2_000_000].mean(axis=0)
        assert len(ms) >= 25
        assert total == pytest.approx((frames.values[near] - rest).sum(axis=(1, 2)), abs=0.05)
        # Each detection is a crossing that can be seen.
        threshold = readout.run_threshold * readout.neurons["contact"].neuron.theta_0
        assert below.lines[0].get_ydata().max() >= 0.99 * threshold
    assert len(figure.legends) == 1
    assert not any(axis.get_legend() for axis in figure.axes)
    plt.close(figure)


def loads(drift: float = 0.0) -> tuple[taxel.Frames, list[int]]:
    """Thirty seconds of 16 taxels in noise, and when ten loads of 0.5 s begin, us."""
    random = np.random.default_rng(3)
    t = 10_000 * np.arange(3000)
    values = 50 + random.normal(0, 1.0, (3000, 4, 4)) + drift * np.linspace(0, 1, 3000)[:, None, None]
    begins = list(range(200, 2800, 260))
    for k in begins:
        values[k : k + 50, 1:3, 1:3] += 12
    return taxel.Frames(values, t, unit="counts"), [int(t[k]) for k in begins]


@pytest.mark.parametrize("drift", [0.0, 30.0])
def test_loads_without_a_detection_are_found(drift: float) -> None:
    frames, begins = loads(drift)
    at = np.array(begins)
    for missed in ([], [4], [0, 4, 9]):
        kept = np.delete(at, missed)
        outcome = Outcome("a", Example(frames, {}), Detections(["contact"] * len(kept), kept, kept))
        found = _unclaimed(outcome)
        assert sorted(t for t, _ in found) == pytest.approx([begins[k] for k in missed], abs=300_000)
        assert all(what.startswith("a load without a detection: ") for _, what in found)
        # A label claims a load too: it is listed as missed.
        assert not _unclaimed(outcome._replace(example=Example(frames, {"contact": at})))


def test_a_sum_is_drawn_from_begin_to_end() -> None:
    frames, begins = loads()
    outcome = Outcome("a", Example(frames, {}), Detections(["contact"] * 10, begins, begins))
    figure = _sums([outcome], ["contact"])
    assert figure is not None
    curve, detections = figure.axes[0].lines
    assert curve.get_xdata()[[0, -1]] == pytest.approx([0.0, 29.99], abs=0.03)
    assert detections.get_xdata() == pytest.approx(np.array(begins) / 1e6)
    plt.close(figure)


@pytest.mark.parametrize(
    ("encoder", "train", "words"),
    [
        (Peak(levels=[4.0, 8.0], release=0.5), 1, "the peak, in units of noise, rises to 8."),
        (Peak(levels=[4.0, 8.0], release=0.5), 3, "the peak, in units of noise, falls below 4."),
        (ContactArea(levels=[2, 5]), 2, "the number of loaded taxels falls below 2."),
        (
            LocalLoad(local_ms=[50.0], levels=[3.0, 6.0]),
            5,
            "the largest sum over 3 x 3 taxels below running means of 50 ms, in units of noise, rises to 6.",
        ),
    ],
)
def test_a_neuron_with_one_input_is_said_in_words(encoder, train: int, words: str) -> None:
    count = encoder.trains(taxel.Array(4, 4))
    weights = np.zeros(count)
    weights[train] = 0.4
    neuron = taxel.Neuron(tau=1.0)
    readout = Readout(encoder, {"contact": (neuron, weights, 0.1)}, array=taxel.Array(4, 4), unit="counts")
    assert _only_input(readout, "contact") == f"The neuron has one input, and is a threshold: it fires when {words}"
    weights[0] = 0.3
    readout = Readout(encoder, {"contact": (neuron, weights, 0.1)}, array=taxel.Array(4, 4), unit="counts")
    assert _only_input(readout, "contact") == ""


@pytest.mark.parametrize("count", [1, 4, 5])
def test_a_page_shows_warnings_first_and_folds_what_is_of_many_recordings(count: int, tmp_path: Path) -> None:
    frames, begins = loads()
    rule = PlainRule("area", 2, noise_floor=6.0)
    found = Detections(["contact"] * 9, begins[1:], begins[1:])
    outcomes = [Outcome(f"{k}.npz", Example(frames, {}), found) for k in range(count)]
    printed, warnings = ["rest taken: <its first>", "Detections(9)"], ["1.npz: rest: 4 taxels drifted"]
    place = write_detections(tmp_path, rule, outcomes, title="t", warnings=warnings, printed=printed)
    page = place.read_text()
    assert page.index('<p class="no">1.npz: rest: 4 taxels drifted</p>') < page.index("<th")
    assert "<pre>rest taken: &lt;its first&gt;\nDetections(9)</pre>" in page
    assert page.count("a load without a detection") == count
    assert ("More on each recording" in page) == (count > 4)
    assert ("Each label of each recording" in page) == (count > 1)
