"""The laws of taxel's learners and of its public names hold for the rules: of parameters, nonsense, docstrings."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

import docstrings
import manners
import nonsense
import numpy as np
import parameter_laws as parameters
import pytest
import sound
from interrupts import ctrl_c_after
from sound import PLAIN

import taxel
import taxel_rules
from taxel import SpikeTrains
from taxel._base.parameters import Parameters
from taxel_rules import _rules
from taxel_rules._epochs import Status

ROOT = Path(__file__).parents[1]
PUBLIC = nonsense.public_of([taxel_rules])
RULES = {
    name: getattr(taxel_rules, name) for name in taxel_rules.__all__ if hasattr(getattr(taxel_rules, name), "_kind")
}
KINDS = list(RULES.values())
#: Values for parameters without a default.
GIVEN: dict[str, Any] = {"eta": 0.05, "initial": (0.0, 0.5), "epochs": 50, "updates": "pattern", "tau": 10.0}
GIVEN |= {"tau_s": 5.0, "theta_0": 1.0, "rule": "E", "tau_a": 5.0, "window_ms": 1.0}

#: Objects whose methods are called, and sound values, as in `tests/sound.py`.
OBJECTS = {name: (lambda rule=rule: made(rule)) for name, rule in RULES.items()}
OBJECTS |= {
    "SKIM": lambda: taxel_rules.SKIM(tau=5.0).fit([PLAIN], [[5.0]]),
    "STDP.partial_fit": taxel_rules.STDP,
    "STDP": lambda: taxel_rules.STDP().fit([PLAIN]),
    "Tempotron": lambda: taxel_rules.Tempotron(eta=0.1, epochs=5).fit([PLAIN], [True]),
}
VALUES: dict[str, Callable[[], Any]] = {name: (lambda value=value: value) for name, value in GIVEN.items()}
VALUES |= {
    "pattern": lambda: PLAIN,
    "piece": lambda: PLAIN,
    "weights": lambda: [0.1] * 4,
    "change.label": lambda: True,
    "Tempotron.fit.labels": lambda: [True],
    "Tempotron.score.labels": lambda: [True],
}


def made(rule: Any) -> Any:
    """Return a rule that has learnt."""
    given = {name: GIVEN[name] for name in rule._described()["required"]}
    return rule(**given).fit([PLAIN], [[5.0]])


each_rule = pytest.mark.parametrize("name", RULES)
each_kind = pytest.mark.parametrize("kind", KINDS)


@pytest.fixture(autouse=True)
def _of_rules(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the laws find the rules where they look for what they try."""
    for name, value in OBJECTS.items():
        monkeypatch.setitem(sound.OBJECTS, name, value)
    for name, value in VALUES.items():
        monkeypatch.setitem(sound.VALUES, name, value)
    for name, rule in RULES.items():
        monkeypatch.setitem(manners.LEARNERS, name, rule)
    for given in (manners.GIVEN, parameters.REQUIRED):
        for name, value in GIVEN.items():
            monkeypatch.setitem(given, name, value)


def test_a_rule_has_a_file_in_each_place_and_nothing_is_left_out() -> None:
    files = {file.stem for file in (ROOT / "taxel_rules").glob("*.py") if not file.stem.startswith("_")}
    kinds = {rule._kind for rule in KINDS}
    assert kinds == files - {"readout"}, "taxel_rules/NAME.py with _kind NAME, a line in taxel_rules/__init__.py"
    assert kinds - {"skim", "stdp", "tempotron"} == set(_rules.rule_names()), "a name in src/rules/epoch_learner.rs"
    tests = "".join(file.read_text() for file in (ROOT / "tests").glob("test_*.py") if file.name != "test_laws.py")
    for kind in KINDS:
        assert re.search(rf"\b{kind.__name__}\(", tests), f"a test of {kind.__name__} in rules/tests"
    assert all(issubclass(rule, Parameters) for rule in KINDS)


@each_rule
@pytest.mark.parametrize("law", manners.LAWS)
def test_a_rule_has_the_manners_of_a_learner(law: Any, name: str) -> None:
    law(name)


@each_kind
@pytest.mark.parametrize("law", parameters.OF_A_KIND)
def test_parameters_are_defined_once(law: Any, kind: type[Parameters]) -> None:
    law(kind)


@pytest.mark.parametrize(("kind", "name"), parameters.ranged(KINDS))
@pytest.mark.parametrize("law", parameters.OF_A_RANGE)
def test_ranges_are_those_of_the_table(law: Any, kind: type[Parameters], name: str) -> None:
    law(kind, name)


@pytest.mark.filterwarnings("ignore")
def test_nonsense_in_an_argument_is_one_clear_error() -> None:
    nonsense.check(PUBLIC)


def test_docstrings_are_whole() -> None:
    assert [fault for name, value in PUBLIC.items() for fault in docstrings.faults_of_parameters(name, value)] == []


def test_the_words_of_status_are_those_of_the_readme() -> None:
    section = (ROOT / "README.md").read_text().split("## How a training ended")[1].split("\n## ")[0]
    others = {"status_", "max_seconds", "weights_", "SKIM", "STDP"}
    assert set(re.findall(r"`(\w+)`", section)) - others == set(get_args(Status))


def test_errors_are_taxel_s_own_and_an_interrupt_ends_a_call() -> None:
    """An extension beside `taxel._core` raises the same classes, and hears Ctrl-C."""
    with pytest.raises(taxel.ProblemError) as refused:
        taxel_rules.INST(tau=-1.0)
    assert (refused.value.argument, refused.value.hint) == ("tau", None)
    lists = [np.arange(200_000) * 10.0 + n * 0.0999 for n in range(40)]
    trains = SpikeTrains.from_lists(lists, stop=2e6)
    # Half a second is the goal; a loaded machine needs more.
    with ctrl_c_after(0.05, answered_within=2):
        taxel_rules.STDP().partial_fit(trains)
