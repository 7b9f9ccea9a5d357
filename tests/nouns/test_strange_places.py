"""What nouns are asked for in brackets: one error of taxel's, or Python's own for a number out of range."""

import numpy as np
import pytest

import taxel


class Endless:
    """Its representation calls itself."""

    def __repr__(self) -> str:
        return repr(self)


NOUNS = {
    "events": taxel.Events([0, 5], [0, 1], [0, 0], [True, False], array=taxel.Array(1, 2)),
    "frames": taxel.Frames(np.ones((3, 1, 2)), [0, 1, 2]),
    "trains": taxel.SpikeTrains.from_lists([[1.0], []], stop=2.0),
    "detections": taxel.Detections(["a", "b"], [1, 2], [2, 3]),
}
STRANGE = [np.timedelta64(0), np, np.float64, Endless(), [Endless()], -0.0, np.nan, slice(Endless(), None)]
STRANGE += [slice(0.0, None), slice(None, None, 0), slice("a"), {}, object(), 10**30]


@pytest.mark.parametrize("noun", NOUNS)
@pytest.mark.parametrize("asked", STRANGE, ids=lambda asked: type(asked).__name__)
def test_a_place_that_is_none_is_refused_in_one_line(noun, asked):
    with pytest.raises((taxel.ProblemError, IndexError)) as refused:
        NOUNS[noun][asked]
    (_,) = str(refused.value).splitlines()
