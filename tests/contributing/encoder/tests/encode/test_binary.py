"""The encoder of CONTRIBUTING: whether values have reached a level."""

from taxel.encode import Binary

from .scenes import frames_of

REPAIRED = "read"
EXAMPLES = {"binary": Binary(level=20.0)}


def trains_of(encoder, taxels, of):
    """The numbers of the trains of some taxels."""
    return taxels


def test_spikes_come_where_the_level_is_reached_and_where_the_value_falls_below():
    spikes = Binary(level=20.0).encode(frames_of([0, 100, 200, 300], [[5.0], [20.0], [40.0], [19.0]]))
    assert spikes.times.tolist() == [0.1, 0.3]
    assert spikes.values.tolist() == [1.0, -1.0]
