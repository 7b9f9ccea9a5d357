"""A press that is held for long stays above a rest that is tracked."""

import numpy as np
import pytest

from taxel import Frames
from taxel.recording.analysis.rest import frames_above, of_frames, ticks_by_unit


@pytest.mark.parametrize("seconds", [60, 600])
def test_a_press_that_is_held_stays_and_drift_of_an_hour_is_followed(seconds: int) -> None:
    random, hz = np.random.default_rng(4), 20
    n = (60 + seconds) * hz
    values = 500 + random.normal(0, 2, (n, 6, 6)) + np.linspace(0, 200 * seconds / 3600, n)[:, None, None]
    values[30 * hz : (30 + seconds) * hz, 2:4, 2:4] += 200
    frames = Frames(values.astype(np.float32), np.arange(n) * (1_000_000 // hz), unit="counts")
    rest = of_frames(frames)
    [(_, above)] = frames_above(rest, [(frames.t, frames.values.reshape(n, 36))], 6, ticks_by_unit(frames))
    total = above.sum(axis=1)
    assert total[(30 + seconds) * hz - 5] > 0.8 * 800
    assert total[: 30 * hz].max() < 100
    assert total[(31 + seconds) * hz :].max() < 150
