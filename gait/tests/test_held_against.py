"""The rule against contacts and foot-offs of published recordings, as ``python -m taxel_gait.against`` prints it."""

import pytest
from walking import published

from taxel_gait.against import EVENTS, Tally, found_by, labelled_in
from taxel_gait.stances import DEFINITIONS

#: What a trial of the rule measured before it was written here: found %, false a minute and foot, % within 10 ms.
GOALS = {
    ("insole_gaitpdb", "insole", "contact"): (99.9, 0.26, 98.6),
    ("insole_gaitpdb", "insole", "foot-off"): (99.6, 0.45, 96.7),
    ("insole_gaitndd", "channel", "contact"): (99.4, 0.24, 96.9),
    ("insole_gaitndd", "channel", "foot-off"): (98.2, 0.87, 85.8),
    ("insole_moticon", "moticon", "contact"): (100.0, 0.0, 100.0),
}


@pytest.mark.parametrize(("name", "definition", "event"), GOALS)
def test_the_rule_finds_what_others_found(name, definition, event):
    feet = list(labelled_in(published(name)))
    tally = Tally.summed(Tally.of(found_by(one, DEFINITIONS[definition])[event], one, event) for one in feet)
    found = len(tally.errors_ms)
    measured = 100 * found / tally.events, tally.false / tally.minutes, 100 * tally.close / found
    for ours, goal, sign in zip(measured, GOALS[name, definition, event], (1, -1, 1), strict=True):
        assert sign * (ours - goal) >= -0.2
    assert {*EVENTS} == {"contact", "foot-off"}
