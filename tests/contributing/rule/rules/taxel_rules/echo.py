"""Echo: a neuron that fires with the one input train that most often spikes shortly before a target."""

from __future__ import annotations

from dataclasses import dataclass

from taxel._base.parameters import defaults
from taxel_rules import _rules
from taxel_rules._batch import BatchLearner

_DEFAULT = defaults("echo", _rules)


@dataclass(kw_only=True, eq=False, repr=False)
class Echo(BatchLearner):
    """Fire with the input train that most often spikes shortly before a target.

    Parameters
    ----------
    within_ms : float, ms, above 0
        Longest time from a spike to the target.
    """

    _kind = "echo"

    within_ms: float = _DEFAULT.within_ms
