"""The rule of CONTRIBUTING: an echo."""

from taxel import SpikeTrains
from taxel_rules import Echo


def test_the_neuron_fires_with_the_train_that_precedes_the_targets():
    patterns = [SpikeTrains.from_lists([[5.0, 90.0], [40.0], [70.0]], stop=100.0)]
    echo = Echo().fit(patterns, [[50.0]])
    assert echo.weights_.tolist() == [0.0, 1.0, 0.0]
    assert echo.predict(patterns)[0].tolist() == [40.0]
