"""The demo's readout, trained anew at toy size."""

import numpy as np
import pytest

from taxel.demo.evaluation import evaluate_acts
from taxel.demo.script import script
from taxel.demo.shipped import described, shipped, trained


@pytest.fixture(scope="module")
def toy():
    return trained(boards=1, scenes=3)


def test_a_toy_training_hears_other_scenes(toy):
    """Trained on three caught balls and three left to rest, it finds first impacts of another seed."""
    judged = evaluate_acts(script(17, 2), toy, seed=17).judged
    for label in ("contact", "lift"):
        assert judged.row("first", label).found == 2
    assert sum(len(times) for times in judged.false.values()) <= 1


def test_contact_listens_to_rises_and_lift_to_falls(toy):
    for readout in (toy, shipped()):
        contact, lift = (readout.neurons[label].weights for label in ("contact", "lift"))
        assert np.argmax(contact) == 0
        assert contact[5:].max() < 0.1 * contact[0]
        assert np.argmax(lift) == 5
        assert lift[:5].max() < 0.1 * lift[5]


def test_the_shipped_readout_is_what_the_recipe_says():
    readout = shipped()
    assert (readout.time, readout.after_spike, readout.run_threshold) == ("grid", "keep", 0.9)
    assert {label: one.delay_ms for label, one in readout.neurons.items()} == {"contact": 0.2, "lift": 0.5}
    assert readout.encoder.tare is None
    assert described(readout).startswith("contact: rise to 2 ")


def test_a_toy_training_nearly_gives_the_shipped_weights(toy):
    for label, train_of in (("contact", 0), ("lift", 5)):
        mine, theirs = (readout.neurons[label].weights[train_of] for readout in (toy, shipped()))
        assert mine == pytest.approx(theirs, rel=0.2)
