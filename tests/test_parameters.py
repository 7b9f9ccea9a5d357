"""Parameters are defined once, in the compiled part; every class with parameters follows scikit-learn's conventions."""

import numpy as np
import parameter_laws as laws
import pytest

import taxel


def test_every_class_with_parameters_is_found():
    """Every public class with parameters has the same base class."""
    named = {kind.__name__ for kind in laws.KINDS}
    assert {"Neuron", "RunningRange", *Encoders} <= named


Encoders = {kind.__name__ for kind in taxel.encode.Encoder._by_name.values()}


@pytest.mark.parametrize("law", laws.OF_A_KIND)
@pytest.mark.parametrize("kind", laws.KINDS)
def test_parameters_are_defined_once(law, kind):
    law(kind)


@pytest.mark.parametrize("law", laws.OF_A_RANGE)
@pytest.mark.parametrize(("kind", "name"), laws.ranged())
def test_ranges_are_those_of_the_table(law, kind, name):
    law(kind, name)


def test_a_group_that_two_share_is_never_changed():
    held = taxel.encode.RunningRange(window_s=3.0)
    one, two = (taxel.encode.LevelCrossing([0.5], running_range=held) for _ in "ab")
    one.set_params(running_range__window_s=5.0)
    assert (one.running_range.window_s, two.running_range.window_s, held.window_s) == (5.0, 3.0, 3.0)
    assert two.running_range is held


def test_a_representation_shows_what_differs_from_the_default():
    assert repr(taxel.Neuron()) == "Neuron()"
    assert repr(taxel.Neuron(tau=15)) == "Neuron()"
    assert repr(taxel.Neuron(tau=10.0, time="grid")) == "Neuron(tau=10.0, time='grid')"
    assert repr(taxel.encode.ContactArea(levels=[2, 4, 8, 16, 32])) == "ContactArea()"
    assert repr(taxel.encode.ContactArea(levels=np.array([2, 4]))) == "ContactArea(levels=array([2, 4]))"
