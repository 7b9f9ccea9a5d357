"""The base of learners of spike times that are fitted to all examples at once: fit."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel.learn._examples import examples
from taxel.learn._learner import SpikeLearner
from taxel.spikes import SpikeTrains
from taxel_rules import _rules


@dataclass(kw_only=True, eq=False, repr=False)
class BatchLearner(SpikeLearner):
    """Learn spike times from all examples at once; the results of the compiled part end in ``_``."""

    _compiled: ClassVar[Any] = _rules

    weights_: NDArray[np.float64] = field(init=False)
    #: Names of further results, which the compiled part reads in `predict`.
    _results: dict[str, Any] = field(init=False)

    def fit(self, patterns: Sequence[SpikeTrains], targets: Sequence[ArrayLike]) -> Self:
        """Learn weights that fire the neuron at the targets and nowhere else.

        Parameters
        ----------
        patterns : sequence of SpikeTrains
            The same trains in each; signed ones split into ON and OFF, graded ones are refused. Of any length: a whole
            recording is a pattern.
        targets : sequence of float sequences, ms
            Target spike times, one list per pattern, ascending; empty for a pattern without spikes.

        Returns
        -------
        BatchLearner
            Itself.

        Raises
        ------
        ProblemError : invalid patterns or targets (names pattern and target)
        KeyboardInterrupt : Ctrl-C, within a fraction of a second
        """
        self.weights_, self._results = _rules.fit_batch(self._kind, self._json(), *examples(patterns, targets))
        for name, value in self._results.items():
            setattr(self, f"{name}_", value)
        return self

    def _fired(
        self, patterns: list[SpikeTrains], instead: Mapping[str, Any] = MappingProxyType({})
    ) -> list[NDArray[np.float64]]:
        """Return the output spikes in each pattern; `instead` replaces learnt attributes by name."""
        weights, learnt = self._fitted(), json.dumps(self._results | dict(instead))
        return [_rules.run_batch(self._kind, self._json(), weights, learnt, pattern._parts()) for pattern in patterns]
