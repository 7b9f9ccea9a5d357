"""The worst moments of a report, with the potential around them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib import pyplot as plt

import taxel
from taxel.demo.script import script
from taxel.detect import Example, Outcome, PlainRule, score
from taxel.detections import Detections
from taxel.report.detections import _moments, _potential, write_detections
from taxel.simulate import play, truth


def outcome_of(name: str, found: list[int], labels: list[int]) -> Outcome:
    frames = taxel.Frames(np.zeros((3, 2, 2)), [0, 1_000_000, 2_000_000], unit="counts")
    truth = {"contact": np.array(labels)}
    detections = Detections(["contact"] * len(found), found, found)
    return Outcome(name, Example(frames, truth), detections, score(detections, truth, 50.0))


def test_each_detection_of_a_board_is_a_crossing_that_can_be_seen(tmp_path: Path) -> None:
    acts = script(1, 4)
    taxel.convert(play(acts, seed=1).events, tmp_path / "a.mcap")
    contacts, _ = truth(acts)
    labels = {"contact": [round(c.start_us) for c in contacts], "lift": [round(c.stop_us) for c in contacts]}
    recording = taxel.open(tmp_path / "a.mcap")
    training = taxel.train(recording, [labels], taxel.tasks.TrainOptions(folds=0))
    by_neurons = taxel.tasks.DetectOptions(use="neuron")
    outcomes = taxel.tasks.detect(training.readout, recording, [labels], by_neurons).outcomes
    assert {trained.neuron.after_spike for trained in training.readout.neurons.values()} == {"reset"}
    for label in labels:
        threshold = training.readout.run_threshold * training.readout.neurons[label].neuron.theta_0
        figures = [*_potential(training.readout, label, _moments(outcomes, label))]
        assert figures
        for figure in figures:
            assert figure.axes[0].lines[0].get_ydata().max() >= 0.99 * threshold
            plt.close(figure)


@pytest.mark.parametrize("count", [1, 5])
def test_a_page_shows_warnings_first_and_what_the_command_printed(count: int, tmp_path: Path) -> None:
    outcomes = [outcome_of(f"{k}.npz", [100_000], []) for k in range(count)]
    printed, warnings = ["rest taken: <its first>", "Detections(9)"], ["1.npz: rest: 4 taxels drifted"]
    rule = PlainRule("area", 2, noise_floor=6.0)
    place = write_detections(tmp_path, rule, outcomes, title="t", warnings=warnings, printed=printed)
    page = place.read_text()
    assert page.index('<p class="no">1.npz: rest: 4 taxels drifted</p>') < page.index("<th")
    assert "<pre>rest taken: &lt;its first&gt;\nDetections(9)</pre>" in page
    assert page.count("<td>0</td><td>0</td><td>1</td></tr>") == page.count(' soft">') == count
