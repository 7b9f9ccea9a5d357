"""The worst moments of a report: of each recording, with what the sensor read and the potential around them."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib import pyplot as plt
from tests.detect.test_label_times import touched

import taxel
from taxel.detect import Outcome, Readout, score
from taxel.report.detections import _moments, _potential


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
