"""Names that moved work for one version, with a warning that names the new place."""

import pytest

import taxel


def test_a_label_is_a_note() -> None:
    with pytest.warns(DeprecationWarning, match=r"taxel\.Label is taxel\.Note now"):
        note = taxel.Label("walk", "contact", 400, 5)
    assert note == taxel.Note("contact", 400, 5, "walk")
    for name, value in {"label": "contact", "t_us": 400, "host_ns": 5}.items():
        with pytest.warns(DeprecationWarning, match=f"Label.{name} is Note"):
            assert getattr(note, name) == value
    with pytest.raises(AttributeError, match="colour"):
        _ = note.colour  # type: ignore[attr-defined]


def test_what_live_detects_is_a_detection() -> None:
    with pytest.warns(DeprecationWarning, match=r"taxel\.live\.Said is taxel\.Detection now"):
        assert taxel.live.Said is taxel.Detection


def test_what_a_readout_detected_in_an_example_is_an_outcome() -> None:
    from taxel import report

    events = taxel.Events([0], [0], [0], [True], array=taxel.Array(1, 1))
    with pytest.warns(DeprecationWarning, match=r"Listened is taxel\.detect\.Outcome now"):
        outcome = report.Listened("walk", events, taxel.Detections([], [], []), None, {"contact": [5]})
    assert outcome.example == taxel.detect.Example(events, {"contact": [5]}, None)
