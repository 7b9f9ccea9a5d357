"""A detection that may rest on values which states repaired is marked, the others are not: from pieces as the whole."""

import numpy as np
import pytest
from discs import ARRAY, FRAME_US, plain, tare, touches

import taxel
from taxel.encode import ChangeEvents, ContactArea


def lossy(seed: int, share: float) -> taxel.Events:
    """Touches some of whose events were told 1 ms later by states."""
    events, _ = touches(seed)
    gone = np.random.default_rng(seed).random(len(events)) < share
    t = np.where(gone, events.t + 1000, events.t)
    order = np.argsort(t, kind="stable")
    return taxel.Events(
        t[order],
        events.x[order],
        events.y[order],
        events.p[order],
        array=ARRAY,
        intensity=events.intensity[order],
        repaired=gone[order],
    )


def said(readout, events):
    return taxel.detect.run(readout, events, frame_us=FRAME_US, tare=tare())


def test_what_rests_on_repaired_values_is_marked_and_nothing_else():
    readout = plain(ContactArea(levels=(2, 4, 8)), ARRAY)
    events = lossy(3, 0.0)
    assert not said(readout, events).repaired.any()
    assert len(said(readout, events)) > 3
    # Marks every event before the middle as decoded from states.
    middle = int(events.t[len(events) // 2])
    marked = taxel.Events(
        events.t, events.x, events.y, events.p, array=ARRAY, intensity=events.intensity, repaired=events.t < middle
    )
    found = said(readout, marked)
    assert np.array_equal(found.t, said(readout, events).t), "values count as any others"
    crossed = found.t
    memory_us = 8000 * 3.0
    assert found.repaired[crossed < middle].all()
    assert not found.repaired[crossed > middle + memory_us + FRAME_US].any()


def test_an_encoder_of_changes_says_nothing_that_rests_on_repaired_values():
    found = said(plain(ChangeEvents(), ARRAY), lossy(3, 0.3))
    assert len(found)
    assert not found.repaired.any()


def test_marks_stay_in_tables(tmp_path):
    found = taxel.Detections(["a", "b"], [1, 2], [3, 4], [0.5, 0.25], repaired=[True, False])
    assert taxel.Detections.from_csv(found.to_csv(tmp_path / "a.csv")) == found
    assert (found[::-1] + found).repaired.tolist() == [True, True, False, False]
    assert found.to_numpy()["repaired"].tolist() == [True, False]
    assert [d.repaired for d in found] == [True, False]
    none = taxel.Detections(["a"], [1], [3])
    assert "repaired" not in none._csv()
    with pytest.raises(taxel.ProblemError, match="repaired"):
        taxel.Detections(["a"], [1], [3], repaired=[True, False])
