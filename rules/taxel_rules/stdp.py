"""STDP: a neuron that finds a pattern which repeats in its inputs, without labels or targets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import instance
from taxel._base.errors import refused
from taxel._base.parameters import defaults
from taxel.learn._learner import SpikeLearner, patterns_of
from taxel.spikes import SpikeTrains
from taxel_rules import _rules

_DEFAULT = defaults("stdp", _rules)


@dataclass(kw_only=True, eq=False, repr=False)
class STDP(SpikeLearner):
    """Learn weights from 0 to 1 by spike-timing-dependent plasticity, until the neuron fires at a repeating pattern.

    It learns without labels: the existence, times and length of a pattern are not inputs.

    Parameters
    ----------
    threshold : float, above 0
        T, in weights. The default suits some 2000 inputs of 64 spikes/s; with too few input spikes the neuron never
        fires, and then it does not learn.
    tau_m, tau_s : float, ms, above 0
        Time constants of membrane and synapses; `tau_s` below `tau_m`.
    k1, k2 : float, 0 or more
        Height of a spike and depth of its afterpotential, in thresholds.
    a_plus, a_minus : float, from 0 to 1
        Largest increase and largest decrease of a weight by one pair of spikes.
    tau_plus, tau_minus : float, ms, above 0
        Time constants of the increase and of the decrease with the distance of the spikes.
    initial : float, from 0 to 1
        Initial value of all weights.

    Attributes
    ----------
    weights_ : float array, shape (trains,)
    spikes_ : float array, ms
        Output spikes in the last piece.

    Raises
    ------
    ProblemError : an invalid parameter

    Notes
    -----
    Masquelier, Guyonneau and Thorpe (2008), PLoS ONE 3:e1377, whose parameters are the defaults. The potential s after
    the last output spike, and u after each input since then, is::

        p = T (k1 exp(-s/tau_m) - k2 (exp(-s/tau_m) - exp(-s/tau_s))) + sum w K (exp(-u/tau_m) - exp(-u/tau_s))

    with K such that the peak of an input is its weight. The neuron fires when p reaches T, which is computed between
    inputs too. A spike changes the weight of each input that last spiked d before it by ``a_plus exp(-d/tau_plus)``,
    and of each input whose next spike is d after it by ``-a_minus exp(-d/tau_minus)``. Only nearest spikes are paired;
    Hathway and Goodman (2018), ReScience 4(1):6, found that other pairings do not learn. The authors' window of 7 tau
    is omitted.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> noise = SpikeTrains.from_lists(np.sort(rng.uniform(0, 1000, (100, 64))), stop=1000.0)
    >>> stdp = STDP(threshold=25.0).partial_fit(noise)
    >>> len(stdp.spikes_) > 0, bool(stdp.weights_.min() < 0.475 < stdp.weights_.max())
    (True, True)
    """

    _kind = "stdp"
    _compiled: ClassVar[Any] = _rules

    threshold: float = _DEFAULT.threshold
    tau_m: float = _DEFAULT.tau_m
    tau_s: float = _DEFAULT.tau_s
    k1: float = _DEFAULT.k1
    k2: float = _DEFAULT.k2
    a_plus: float = _DEFAULT.a_plus
    a_minus: float = _DEFAULT.a_minus
    tau_plus: float = _DEFAULT.tau_plus
    tau_minus: float = _DEFAULT.tau_minus
    initial: float = _DEFAULT.initial

    weights_: NDArray[np.float64] = field(init=False)
    spikes_: NDArray[np.float64] = field(init=False)

    _neuron: _rules.STDP = field(init=False)

    def fit(self, patterns: Sequence[SpikeTrains], targets: object = None) -> Self:  # noqa: ARG002  scikit-learn's call
        """Reset the weights, and learn from several patterns, each from the resting state.

        Parameters
        ----------
        patterns : sequence of SpikeTrains
            The same trains in all.
        targets : object, optional
            Not used; pipelines of scikit-learn pass it.

        Returns
        -------
        STDP
            Itself.

        Raises
        ------
        ProblemError : no patterns, or an invalid one (names it)
        KeyboardInterrupt : Ctrl-C, within a fraction of a second; the weights learnt until then stay
        """
        trains = patterns_of(patterns)
        if not trains:
            raise refused("patterns", ": none, must be one or more")
        self._neuron = _rules.STDP(self._json(), len(trains[0]))
        for train in trains:
            self._neuron.rest()
            self._learn(train)
        return self

    def partial_fit(self, piece: SpikeTrains) -> Self:
        """Learn from the next piece of a stream, which continues the last piece.

        Parameters
        ----------
        piece : SpikeTrains
            The same trains as before; it begins at the last one's end or later.

        Returns
        -------
        STDP
            Itself.

        Raises
        ------
        ProblemError : another number of trains, or a piece that begins before the last one's end; nothing then changes
        KeyboardInterrupt : Ctrl-C, within a fraction of a second

        Examples
        --------
        >>> stdp = STDP(threshold=0.9)
        >>> for start in (0.0, 100.0):
        ...     piece = SpikeTrains.from_lists([[start + 10.0], [start + 10.0]], start=start, stop=start + 100.0)
        ...     stdp = stdp.partial_fit(piece)
        >>> stdp.spikes_.round(2), stdp.weights_.round(3)
        (array([112.71]), array([0.526, 0.526]))
        """
        instance("piece", piece, SpikeTrains)
        if not hasattr(self, "_neuron"):
            self._neuron = _rules.STDP(self._json(), len(piece))
            if hasattr(self, "weights_"):
                self._neuron.set_weights(self._fitted())
        return self._learn(piece)

    def _fired(self, patterns: list[SpikeTrains]) -> list[NDArray[np.float64]]:
        # With the present weights, each pattern from the resting state.
        weights, fired = self._fitted(), []
        for pattern in patterns:
            neuron = _rules.STDP(self._json(), len(weights))
            neuron.set_weights(weights)
            fired.append(neuron.push(pattern, False))
        return fired

    def _learn(self, piece: SpikeTrains) -> Self:
        try:
            self.spikes_ = self._neuron.push(piece, True)
        finally:
            self.weights_ = self._neuron.weights
        return self

    def __getstate__(self) -> dict[str, Any]:
        # A copy continues with the weights, from the resting state.
        return {name: value for name, value in vars(self).items() if name != "_neuron"}
