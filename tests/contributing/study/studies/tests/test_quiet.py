"""The study of quiet neurons: a neuron without weights stays silent."""

from taxel_studies import quiet


def test_without_weight_nothing_fires():
    assert quiet.realise({"inputs": 100, "weight": 0.0}, seed=1) == 0
